"""Mass matrices and gravity of a robot's text from other engines: what is true of two texts, without dynx.

Pinocchio reads URDF, MuJoCo MJCF, Drake SDF. Coordinates are the twist of the root link (linear, angular,
in its own axes) if it floats, then the joints by name. Mimics are resolved here, as the specification of
URDF defines them.
"""

from __future__ import annotations

import os
import xml.etree.ElementTree as ET
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, cast

import numpy as np

from benchmarks.surveys.robot_texts import (
    Format,
    Matrix,
    Robot,
    inverse,
    lines,
    pose,
    quat_wxyz,
    rotation_from_rpy,
)

GRAVITY = 9.81
STATES = 4


@dataclass(frozen=True)
class State:
    """Pose of the root in the world, and positions of joints by name."""

    T_world_root: Matrix
    q: Mapping[str, float]


@dataclass(frozen=True)
class Quantities:
    """Mass matrix and gravity torque at a state."""

    M: Matrix
    g: Matrix


def cleaned(text: str) -> ET.Element:
    """Return URDF or SDF without shapes and mimics, continuous joints as revolute ones."""
    root = ET.fromstring(text.encode())
    for parent in list(root.iter()):
        for child in list(parent):
            if child.tag in ("visual", "collision", "mimic", "transmission", "gazebo"):
                parent.remove(child)
    for joint in root.iter("joint"):
        if joint.get("type") == "continuous" and root.tag == "robot":
            joint.set("type", "revolute")
        limit = joint.find("limit")
        if joint.get("type") in ("revolute", "prismatic") and root.tag == "robot":
            if limit is None:
                limit = ET.SubElement(joint, "limit")
            for name in ("lower", "upper", "effort", "velocity"):
                limit.set(name, limit.get(name) or "0")
    return root


def _adjoint(R: Matrix) -> Matrix:
    X = np.zeros((6, 6))
    X[:3, :3] = X[3:, 3:] = R
    return X


def _by_pinocchio(
    text: str, floating: bool, names: Sequence[str], states: Sequence[State]
) -> list[Quantities]:
    import pinocchio

    given = ET.tostring(cleaned(text), encoding="unicode")
    free = (pinocchio.JointModelFreeFlyer(),) if floating else ()
    model: Any = cast(Any, pinocchio).buildModelFromXML(given, *free)
    data = model.createData()
    rows = list(range(6 * floating))
    joints = [model.getJointId(name) for name in names]
    rows += [model.idx_vs[j] for j in joints]
    found = []
    for state in states:
        q = pinocchio.neutral(model)
        if floating:
            quat = quat_wxyz(state.T_world_root[:3, :3])
            q[:7] = [*state.T_world_root[:3, 3], *quat[1:], quat[0]]
        for name, j in zip(names, joints, strict=True):
            q[model.idx_qs[j]] = state.q[name]
        M = pinocchio.crba(model, data, q)
        M = np.triu(M) + np.triu(M, 1).T
        g = pinocchio.computeGeneralizedGravity(model, data, q)
        found.append(Quantities(M[np.ix_(rows, rows)], g[rows].copy()))
    return found


def _by_mujoco(text: str, floating: bool, names: Sequence[str], states: Sequence[State]) -> list[Quantities]:
    import mujoco

    model = mujoco.MjModel.from_xml_string(text)
    model.dof_armature[:] = 0.0
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONSTRAINT)
    data = mujoco.MjData(model)
    joints = [mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_JOINT, name) for name in names]
    rows = list(range(6 * floating)) + [int(model.jnt_dofadr[j]) for j in joints]
    found = []
    for state in states:
        P = np.eye(len(rows))
        if floating:
            data.qpos[:3] = state.T_world_root[:3, 3]
            data.qpos[3:7] = quat_wxyz(state.T_world_root[:3, :3])
            P[:3, :3] = state.T_world_root[:3, :3]
        for name, j in zip(names, joints, strict=True):
            data.qpos[model.jnt_qposadr[j]] = state.q[name]
        mujoco.mj_forward(model, data)
        M = np.zeros((model.nv, model.nv))
        mujoco.mj_fullM(model, data, M) if mujoco.__version__ >= "3.4" else mujoco.mj_fullM(model, M, data.qM)
        M = M[np.ix_(rows, rows)]
        found.append(Quantities(P.T @ M @ P, P.T @ data.qfrc_bias[rows]))
    return found


def _by_drake(
    text: str, floating: bool, names: Sequence[str], states: Sequence[State], root: str
) -> list[Quantities]:
    import pydrake.math as math
    import pydrake.multibody.parsing as parsing
    import pydrake.multibody.plant as plants

    plant: Any = plants.MultibodyPlant(0.0)
    given = ET.tostring(cleaned(text), encoding="unicode")
    parser: Any = parsing.Parser(plant)
    parser.AddModelsFromString(given, "sdf")
    plant.Finalize()
    context = plant.CreateDefaultContext()
    joints = [plant.GetJointByName(name) for name in names]
    body = plant.GetBodyByName(root) if floating else None
    rows = [j.velocity_start() for j in joints]
    if body is not None:
        first = body.floating_velocities_start_in_v()
        rows = [*range(first + 3, first + 6), *range(first, first + 3), *rows]
    found = []
    for state in states:
        P = np.eye(len(rows))
        if body is not None:
            given_pose: Any = state.T_world_root
            T = math.RigidTransform(given_pose)
            plant.SetFreeBodyPose(context, body, T)
            P[:6, :6] = _adjoint(state.T_world_root[:3, :3])
        q = plant.GetPositions(context).copy()
        for name, j in zip(names, joints, strict=True):
            q[j.position_start()] = state.q[name]
        plant.SetPositions(context, q)
        M = plant.CalcMassMatrix(context)[np.ix_(rows, rows)]
        g = -plant.CalcGravityGeneralizedForces(context)[rows]
        found.append(Quantities(P.T @ M @ P, P.T @ g))
    return found


def quantities(
    text: str, to: Format, floating: bool, names: Sequence[str], states: Sequence[State], root: str
) -> list[Quantities]:
    """Return mass matrix and gravity at the states; the engine's own exception if it refuses the text."""
    if to == "urdf":
        return _by_pinocchio(text, floating, names, states)
    if to == "mjcf":
        return _by_mujoco(text, floating, names, states)
    return _by_drake(text, floating, names, states, root)


def draw_states(rng: np.random.Generator, names: Sequence[str], floating: bool) -> list[State]:
    """Return random states; where the base is fixed it is at the origin."""
    found = []
    for _ in range(STATES):
        T = pose(rotation_from_rpy(rng.uniform(-2, 2, 3)), rng.uniform(-1, 1, 3)) if floating else np.eye(4)
        found.append(State(T, dict(zip(names, rng.uniform(-1.5, 1.5, len(names)), strict=True))))
    return found


def _reduction(
    robot: Robot, names: Sequence[str], states: list[State], base: int
) -> tuple[list[State], Matrix]:
    """Return states that satisfy the mimics, and d(all coordinates)/d(independent ones)."""
    G = np.eye(base + len(names))
    kept = list(range(base))
    for i, name in enumerate(names):
        joint = robot.joint(name)
        factor, leader, offset = 1.0, name, 0.0
        seen = set()
        while joint.mimic is not None and joint.name not in seen:
            seen.add(joint.name)
            leader, m, o = joint.mimic
            offset += factor * o
            factor *= m
            joint = robot.joint(leader)
        if leader == name or not joint.moves:
            kept.append(base + i)
            continue
        G[base + i, base + i] = 0.0
        G[base + i, base + names.index(leader)] = factor
        for state in states:
            cast(dict[str, float], state.q)[name] = factor * state.q[leader] + offset
    return states, G[:, kept]


def relative_difference(a: Sequence[Quantities], b: Sequence[Quantities]) -> float:
    """Return the largest difference: of M_ij relative to sqrt(M_ii M_jj), of g_i to its largest value."""
    worst = 0.0
    diagonal = np.max([np.diagonal(each.M) for each in a], axis=0)
    total = max(float(np.max(np.abs(each.M))) for each in a)
    scale = np.sqrt(np.maximum(diagonal, 1e-12 * total))
    heavy = np.max([np.abs(each.g) for each in a], axis=0)
    heavy = np.maximum(heavy, GRAVITY * np.sqrt(total) * scale * 1e-3)
    for one, two in zip(a, b, strict=True):
        worst = max(worst, float(np.max(np.abs(one.M - two.M) / np.outer(scale, scale), initial=0.0)))
        worst = max(worst, float(np.max(np.abs(one.g - two.g) / heavy, initial=0.0)))
    return worst


def text_difference(
    a: tuple[Robot, str, Format],
    b: tuple[Robot, str, Format],
    floating: bool,
    seed: int,
    signs: Mapping[str, int] | None = None,
    names: Mapping[str, str] | None = None,
    T_a_b: Matrix | None = None,
) -> float:
    """Return the relative difference of two texts over random states, each by the engine of its format.

    Joints of `a` are those of `b` by `names`, reversed where `signs` is -1; the root of `b` has the pose
    `T_a_b` in that of `a`.
    """
    (robot_a, text_a, format_a), (robot_b, text_b, format_b) = a, b
    own = [joint.name for joint in robot_a.joints if joint.moves]
    theirs = [(names or {}).get(name, name) for name in own]
    s = np.array([(signs or {}).get(name, 1) for name in own], float)
    T = np.eye(4) if T_a_b is None else T_a_b
    base = 6 * floating
    states, G = _reduction(robot_a, own, draw_states(np.random.default_rng(seed), own, floating), base)
    moved = [
        State(each.T_world_root @ T, {n: s[i] * each.q[own[i]] for i, n in enumerate(theirs)})
        for each in states
    ]
    X = np.eye(base + len(own))
    if base:
        R, p = inverse(T)[:3, :3], inverse(T)[:3, 3]
        X[:3, :3] = X[3:6, 3:6] = R
        X[:3, 3:6] = np.array([[0, -p[2], p[1]], [p[2], 0, -p[0]], [-p[1], p[0], 0]]) @ R
    X[base:, base:] = np.diag(s)
    X = X @ G
    first = quantities(text_a, format_a, floating, own, states, robot_a.root)
    second = quantities(text_b, format_b, floating, theirs, moved, robot_b.root)
    return relative_difference(
        [Quantities(G.T @ each.M @ G, G.T @ each.g) for each in first],
        [Quantities(X.T @ each.M @ X, X.T @ each.g) for each in second],
    )


def line_difference(a: Robot, b: Robot) -> float:
    """Return the largest difference of joint lines at position 0, lengths relative to the robot's reach."""
    ours, theirs = lines(a), lines(b)
    reach = max(a.reach, 1e-3)
    worst = 0.0
    for name in ours.keys() & theirs.keys():
        for i in (0, 3):
            worst = max(
                worst, float(np.linalg.norm((ours[name] - theirs[name])[i : i + 3])) / (reach if i else 1.0)
            )
    return worst


def silence_engines() -> None:
    """Keep engines' warnings from standard error for the rest of this process."""
    null = os.open(os.devnull, os.O_WRONLY)
    os.dup2(null, 2)


__all__ = [
    "Quantities",
    "State",
    "draw_states",
    "line_difference",
    "quantities",
    "relative_difference",
    "silence_engines",
    "text_difference",
]
