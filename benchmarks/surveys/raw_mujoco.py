"""MuJoCo alone, run by raw_engine.py. No dynx in here.

Tasks and answers are those of raw_engine.py; the printed code ``load`` and ``calls`` is executed.
Links that MuJoCo merges into their parents have no pose. A free joint has the linear velocity in the axes of
the world and the angular velocity in those of the base.
"""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np


def loaded(task: dict[str, Any]) -> Any:
    names: dict[str, Any] = {"mujoco": mujoco, "path": task["path"]}
    exec("\n".join([task["load"], *task["calls"]]), names)
    return names["model"]


def answer(task: dict[str, Any]) -> list[dict[str, Any]]:
    model = loaded(task)
    model.opt.gravity[:] = task["gravity"]
    data = mujoco.MjData(model)
    base = 6 if task["floating"] else 0
    joints = [mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_JOINT, name) for name in task["joints"]]
    bodies = [mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, name) for name in task["links"]]
    if min(joints, default=0) < 0:
        raise RuntimeError("joints are missing")
    at_q = [int(model.jnt_qposadr[k]) for k in joints]
    at_v = [*range(base), *(int(model.jnt_dofadr[k]) for k in joints)]
    found = []
    for state in task["states"]:
        v, a, R = np.array(state["v"]), np.array(state["a"]), np.eye(3)
        mujoco.mj_resetData(model, data)
        data.qpos[at_q] = state["q"]
        if base:
            x, y, z, qx, qy, qz, qw = state["base"]
            data.qpos[:7] = [x, y, z, qw, qx, qy, qz]
            mujoco.mj_kinematics(model, data)
            R = np.array(data.xmat[model.jnt_bodyid[0]].reshape(3, 3))
            a[:3] += np.cross(v[3:6], v[:3])
            v[:3], a[:3] = R @ v[:3], R @ a[:3]
        data.qvel[at_v], data.qacc[at_v] = v, a
        mujoco.mj_inverse(model, data)
        tau = np.array(data.qfrc_inverse[at_v])
        M = np.zeros((model.nv, model.nv))
        if hasattr(data, "qM"):
            mujoco.mj_fullM(model, M, data.qM)
        else:
            mujoco.mj_fullM(model, data, M)
        M = M[np.ix_(at_v, at_v)]
        if base:
            tau[:3] = R.T @ tau[:3]
            M[:3] = R.T @ M[:3]
            M[:, :3] = M[:, :3] @ R
        poses = []
        for body in bodies:
            T = np.eye(4)
            T[:3, :3], T[:3, 3] = data.xmat[body].reshape(3, 3), data.xpos[body]
            poses.append(T.tolist() if body > 0 else None)
        found.append({"poses": poses, "M": M.tolist(), "tau": tau.tolist()})
    return found
