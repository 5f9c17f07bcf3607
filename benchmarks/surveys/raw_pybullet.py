"""PyBullet alone, run by raw_engine.py. No dynx in here.

Tasks and answers are those of raw_engine.py. What it takes to read PyBullet's answers about a
floating base: they are in the root's principal axes about its centre of mass, angular part first; its
attitude is passed as the identity and gravity is turned instead, because the quaternion is misread.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pybullet as p


def rotation(quat: Any) -> Any:
    x, y, z, w = quat
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


def pose(position: Any, quat: Any) -> Any:
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = rotation(quat), position
    return T


def cross(r: Any) -> Any:
    return np.array([[0, -r[2], r[1]], [r[2], 0, -r[0]], [-r[1], r[0], 0]])


def inverse(T: Any) -> Any:
    back = np.eye(4)
    back[:3, :3], back[:3, 3] = T[:3, :3].T, -T[:3, :3].T @ T[:3, 3]
    return back


def answer(task: dict[str, Any]) -> list[dict[str, Any]]:
    # A client for each: PyBullet keeps the tree of its inverse dynamics when a robot is removed.
    client = p.connect(p.DIRECT)
    try:
        return evaluate(task, client)
    finally:
        p.disconnect(client)


def evaluate(task: dict[str, Any], client: int) -> list[dict[str, Any]]:
    body = p.loadURDF(
        task["path"],
        useFixedBase=not task["floating"],
        flags=p.URDF_USE_INERTIA_FROM_FILE,
        physicsClientId=client,
    )
    infos = [p.getJointInfo(body, k, physicsClientId=client) for k in range(p.getNumJoints(body, client))]
    moving = [info for info in infos if info[2] in (p.JOINT_REVOLUTE, p.JOINT_PRISMATIC)]
    order = {info[1].decode(): k for k, info in enumerate(moving)}
    pick = [order[name] for name in task["joints"]]
    index = {info[12].decode(): info[0] for info in infos}
    index[p.getBodyInfo(body, client)[0].decode()] = -1
    if task["floating"] and p.getDynamicsInfo(body, -1, client)[0] == 0:
        raise RuntimeError("the base is static")
    held = p.getDynamicsInfo(body, -1, client)
    T_base_C = pose(held[3], held[4])
    R, c = T_base_C[:3, :3], T_base_C[:3, 3]
    # (angular, linear) of C, in its axes, from (linear, angular) of the base frame.
    X = np.block([[np.zeros((3, 3)), R.T], [R.T, -R.T @ cross(c)]])
    found = []
    for state in task["states"]:
        n = len(moving)
        q, v, a = np.zeros(n), np.zeros(n), np.zeros(n)
        base = 6 if task["floating"] else 0
        q[pick], v[pick], a[pick] = state["q"], state["v"][base:], state["a"][base:]
        for info, value in zip(moving, q, strict=True):
            p.resetJointState(body, info[0], float(value), physicsClientId=client)
        T_world_base = pose(state["base"][:3], state["base"][3:]) if base else np.eye(4)
        gravity = np.array(task["gravity"])
        if base:
            gravity = (T_world_base @ T_base_C)[:3, :3].T @ gravity
        p.setGravity(*map(float, gravity), physicsClientId=client)
        poses = []
        # Bullet's own pose of the base frame: link poses are seen from there.
        at = p.getBasePositionAndOrientation(body, physicsClientId=client)
        T_bullet_base = pose(*at) @ inverse(T_base_C)
        for link in task["links"]:
            if index[link] < 0:
                poses.append(T_world_base.tolist())
                continue
            state_of = p.getLinkState(body, index[link], computeForwardKinematics=1, physicsClientId=client)
            T = pose(state_of[0], state_of[1]) @ inverse(pose(state_of[2], state_of[3]))
            poses.append((T_world_base @ inverse(T_bullet_base) @ T).tolist())
        listed = [list(map(float, each)) for each in (q, v, a)]
        if base:
            v_C, a_C = X @ state["v"][:6], X @ state["a"][:6]
            a_C[3:] += np.cross(v_C[:3], v_C[3:])
            tau = np.array(
                p.calculateInverseDynamics(
                    body,
                    [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, *listed[0]],
                    [*v_C.tolist(), *listed[1]],
                    [*a_C.tolist(), *listed[2]],
                    physicsClientId=client,
                )
            )
            tau[:6] = X.T @ np.concatenate([tau[3:6], tau[:3]])
        else:
            tau = np.array(p.calculateInverseDynamics(body, *listed, physicsClientId=client) if n else [])
        M = np.zeros((0, 0))
        if n + base:
            M = np.array(p.calculateMassMatrix(body, listed[0], physicsClientId=client))
        if base:
            M[:6] = X.T @ M[:6]
            M[:, :6] = M[:, :6] @ X
        rows = [*range(base), *(base + k for k in pick)]
        found.append({"poses": poses, "M": M[np.ix_(rows, rows)].tolist(), "tau": tau[rows].tolist()})
    return found
