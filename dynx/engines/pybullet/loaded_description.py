"""The model that PyBullet reports after loading, in the frames of the URDF."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from dynx.engines.pybullet.loaded_client import LoadedClient
from dynx.loaded.description import LoadedInertial, LoadedJoint, LoadedModel
from dynx.model import Model
from dynx.spatial.scalar import Floats
from dynx.spatial.se3 import homogeneous
from dynx.spatial.so3 import rotation_from_quat


def describe_model(client: LoadedClient, model: Model, links: Mapping[str, int], base: Floats) -> LoadedModel:
    """Return the description of a loaded robot.

    `links` maps link names to Bullet's numbers; `base` is the pose of the root link at the neutral q.
    """
    # Bullet's frame of a link is the inertial frame.
    com = {k: client.com_frame(k) for k in links.values()}
    joints = {}
    for k, info in enumerate(client.joints):
        if info[2] == client.engine.JOINT_FIXED:
            continue
        name = info[1].decode("utf-8", "surrogateescape")
        joints[name] = _joint(client.engine, info, com[int(info[16])], com[k])
    return LoadedModel(
        engine="pybullet",
        links={name: _inertial(client.dynamics(k)) for name, k in links.items()},
        joints=joints,
        base_frame=base,
        gravity=np.zeros(3),
        missing_links=tuple(link.name for link in model.links if link.name not in links),
        remarks=tuple(client.messages),
    )


def _inertial(info: Any) -> LoadedInertial:
    R = rotation_from_quat(np.array(info[4]))
    return LoadedInertial(float(info[0]), np.array(info[3]), np.asarray(R @ np.diag(info[2]) @ R.T))


def _joint(engine: Any, info: Any, T_parent_com: Floats, T_child_com: Floats) -> LoadedJoint:
    """Describe a joint from `getJointInfo`: entry 13 is the axis in the inertial frame of the child, 14
    the joint's position in the inertial frame of the parent, and 15 the attitude of the latter in the
    former at value 0."""
    position = T_parent_com[:3, :3] @ np.array(info[14]) + T_parent_com[:3, 3]
    R_child_parent = rotation_from_quat(np.array(info[15]))
    R = T_parent_com[:3, :3] @ R_child_parent.T @ T_child_com[:3, :3].T
    lower, upper = float(info[8]), float(info[9])
    # Bullet has no continuous type: limits in the wrong order mean that there are none.
    limited = lower <= upper
    kinds = {engine.JOINT_PRISMATIC: "prismatic", engine.JOINT_REVOLUTE: "revolute"}
    kind = kinds.get(info[2], str(info[2]))
    return LoadedJoint(
        type="continuous" if kind == "revolute" and not limited else kind,
        placement=homogeneous(R, position),
        axis=T_child_com[:3, :3] @ np.array(info[13]),
        limits=(lower, upper) if limited else (-np.inf, np.inf),
        velocity=float(info[11]),
        effort=float(info[10]),
        damping=float(info[6]),
        friction=float(info[7]),
    )
