"""Pinocchio alone, run by raw_engine.py. No dynx in here."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pinocchio as pin


def configuration(model: Any, task: dict[str, Any], state: dict[str, Any]) -> Any:
    q = pin.neutral(model)
    if task["floating"]:
        q[:7] = state["base"]
    for name, value in zip(task["joints"], state["q"], strict=True):
        joint = model.joints[model.getJointId(name)]
        q[joint.idx_q : joint.idx_q + joint.nq] = (
            [value] if joint.nq == 1 else [math.cos(value), math.sin(value)]
        )
    return q


def answer(task: dict[str, Any]) -> list[dict[str, Any]]:
    free = [pin.JointModelFreeFlyer()] if task["floating"] else []
    model = pin.buildModelFromUrdf(task["path"], *free)
    model.gravity.linear = np.array(task["gravity"])
    data = model.createData()
    columns = list(range(6)) if task["floating"] else []
    columns += [model.joints[model.getJointId(name)].idx_v for name in task["joints"]]
    found = []
    for state in task["states"]:
        q = configuration(model, task, state)
        v, a = np.zeros(model.nv), np.zeros(model.nv)
        v[columns], a[columns] = state["v"], state["a"]
        M = np.triu(pin.crba(model, data, q))
        M = (M + np.triu(M, 1).T)[np.ix_(columns, columns)]
        tau = pin.rnea(model, data, q, v, a)[columns]
        pin.framesForwardKinematics(model, data, q)
        poses = [
            data.oMf[model.getFrameId(link, pin.FrameType.BODY)].homogeneous.tolist()
            for link in task["links"]
        ]
        found.append({"poses": poses, "M": M.tolist(), "tau": tau.tolist()})
    return found
