"""Description of the links and joints that MuJoCo holds after loading a file."""

from __future__ import annotations

from typing import Any

import numpy as np

from dynx.engines.mujoco.library import mujoco
from dynx.loaded.description import LoadedInertial, LoadedJoint, LoadedModel
from dynx.model import Model
from dynx.spatial.scalar import Floats
from dynx.spatial.se3 import homogeneous
from dynx.spatial.so3 import rotation_from_quat

WORLD = 0
NAMES = {
    int(mujoco.mjtJoint.mjJNT_HINGE): "revolute",
    int(mujoco.mjtJoint.mjJNT_SLIDE): "prismatic",
    int(mujoco.mjtJoint.mjJNT_BALL): "spherical",
    int(mujoco.mjtJoint.mjJNT_FREE): "floating",
}


def describe_model(loaded: Any, model: Model, gravity: Floats) -> LoadedModel:
    """Describe a MuJoCo model `loaded` from a file with the names of `model`."""
    here = {loaded.body(number).name: number for number in range(1, loaded.nbody)}
    merged = _merged_links(model, here)
    links = {
        link.name: _inertial(loaded, here[link.name], merged.get(link.name, ()))
        for link in model.links
        if link.name in here
    }
    first = int(model.floating)
    joints = {loaded.jnt(k).name: _joint(loaded, k, model, here) for k in range(first, loaded.njnt)}
    remarks = []
    if model.root not in here:
        remarks.append(f"the root link {model.root} is merged into the world")
    if loaded.neq:
        remarks.append(f"{loaded.neq} equality constraints stand for <mimic>")
    if np.any(loaded.geom_contype[:] * loaded.geom_conaffinity[:]):
        remarks.append(f"{loaded.ngeom} collision shapes can touch each other")
    return LoadedModel(
        engine="mujoco",
        links=links,
        joints=joints,
        # MuJoCo puts the root link at the origin of the world, even if it merges it.
        base_frame=_pose(loaded.body_pos[here[model.root]], loaded.body_quat[here[model.root]])
        if model.root in here
        else np.eye(4),
        gravity=gravity,
        missing_links=tuple(link.name for link in model.links if link.name not in here),
        remarks=tuple(remarks),
    )


def _merged_links(model: Model, here: dict[str, int]) -> dict[str, tuple[str, ...]]:
    """For each link that MuJoCo kept, the links that it merged into it."""
    carrier = {model.root: model.root}
    found: dict[str, list[str]] = {}
    for joint in model.joints:
        kept = joint.child in here or joint.moves
        carrier[joint.child] = joint.child if kept else carrier[joint.parent]
        if not kept:
            found.setdefault(carrier[joint.child], []).append(joint.child)
    return {name: tuple(members) for name, members in found.items()}


def _inertial(loaded: Any, body: int, merged: tuple[str, ...]) -> LoadedInertial:
    R = _rotation(loaded.body_iquat[body])
    return LoadedInertial(
        mass=float(loaded.body_mass[body]),
        center=np.array(loaded.body_ipos[body]),
        inertia=np.asarray((R * loaded.body_inertia[body]) @ R.T),
        merged=merged,
    )


def _joint(loaded: Any, number: int, model: Model, here: dict[str, int]) -> LoadedJoint:
    kind = int(loaded.jnt_type[number])
    body, dof = int(loaded.jnt_bodyid[number]), int(loaded.jnt_dofadr[number])
    limited = bool(loaded.jnt_limited[number])
    low, high = loaded.jnt_range[number] if limited else (-np.inf, np.inf)
    effort = float(loaded.jnt_actfrcrange[number, 1]) if loaded.jnt_actfrclimited[number] else None
    return LoadedJoint(
        type="continuous" if NAMES[kind] == "revolute" and not limited else NAMES[kind],
        placement=_placement(loaded, body, model, here),
        axis=np.array(loaded.jnt_axis[number]),
        limits=(float(low), float(high)),
        effort=effort,
        damping=float(loaded.dof_damping[dof]),
        friction=float(loaded.dof_frictionloss[dof]),
        armature=float(loaded.dof_armature[dof]),
    )


def _placement(loaded: Any, body: int, model: Model, here: dict[str, int]) -> Floats | None:
    """Return the pose of a body in its parent link; None where MuJoCo has merged that link."""
    child = loaded.body(body).name
    parents = [joint.parent for joint in model.joints if joint.child == child]
    if not parents:
        return None
    parent = int(loaded.body_parentid[body])
    # A root link that became the world keeps its frame.
    kept = here.get(parents[0], WORLD if parents[0] == model.root else None)
    return _pose(loaded.body_pos[body], loaded.body_quat[body]) if kept == parent else None


def _pose(p: Floats, quat_wxyz: Floats) -> Floats:
    return np.asarray(homogeneous(_rotation(quat_wxyz), np.array(p)))


def _rotation(quat_wxyz: Floats) -> Floats:
    w, x, y, z = quat_wxyz
    return np.asarray(rotation_from_quat(np.array([x, y, z, w])))
