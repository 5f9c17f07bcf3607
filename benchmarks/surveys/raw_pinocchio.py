"""Pinocchio alone, as a script: ``python raw_pinocchio.py TASKS.json ANSWERS.json``. No dynx in here.

A task is {path, floating, joints, links, gravity, states: [{base, q, v, a}]}: joints and links by name;
q by joint; base is None or [x, y, z, qx, qy, qz, qw]; v and a begin with the linear and angular velocity
of the base in its own axes where it floats. An answer is {poses, M, tau} per state, or {error}.
"""

from __future__ import annotations

import json
import math
import sys
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


def answer_or_error(task: dict[str, Any]) -> Any:
    try:
        return answer(task)
    except Exception as error:
        return {"error": f"{type(error).__name__}: {error}"}


def main() -> None:
    with open(sys.argv[1], encoding="utf-8") as file:
        tasks = json.load(file)
    with open(sys.argv[2], "w", encoding="utf-8") as file:
        json.dump([answer_or_error(task) for task in tasks], file)


if __name__ == "__main__":
    main()
