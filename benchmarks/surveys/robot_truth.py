"""Mass matrices and gravity of a robot's text from other engines: what is true of two texts, without dynx.

Pinocchio reads URDF, MuJoCo MJCF, Drake SDF. Coordinates are the twist of the root link (linear, angular,
in its own axes) if it floats, then the joints by name. Mimics are resolved here, as the specification of
URDF defines them.
"""

from __future__ import annotations

import os
import xml.etree.ElementTree as ET
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
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
    rpy_from_rotation,
)

GRAVITY = 9.81
STATES = 4


@dataclass(frozen=True)
class State:
    """Pose of the root in the world, and positions of joints by name: numbers, or rotations of balls."""

    T_world_root: Matrix
    q: Mapping[str, float | Matrix]


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


def rows_of(first: Sequence[int], widths: Sequence[int]) -> list[int]:
    """Return the rows of joints, from the first row and the number of rows of each."""
    return [i + k for i, width in zip(first, widths, strict=True) for k in range(width)]


def widths_at(state: State, names: Sequence[str]) -> list[int]:
    """Return the number of velocities of joints: three for a ball joint."""
    return [1 if isinstance(state.q[name], float) else 3 for name in names]


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


def _set_positions(model: Any, data: Any, floating: bool, names: Sequence[str], state: State) -> None:
    if floating:
        data.qpos[:3] = state.T_world_root[:3, 3]
        data.qpos[3:7] = quat_wxyz(state.T_world_root[:3, :3])
    for name in names:
        at, value = int(model.jnt_qposadr[model.joint(name).id]), state.q[name]
        if isinstance(value, float):
            data.qpos[at] = value
        else:
            data.qpos[at : at + 4] = quat_wxyz(value)


def _by_mujoco(text: str, floating: bool, names: Sequence[str], states: Sequence[State]) -> list[Quantities]:
    import mujoco

    model: Any = mujoco.MjModel.from_xml_string(text)
    model.dof_armature[:] = 0.0
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONSTRAINT)
    data = mujoco.MjData(model)
    joints = [mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_JOINT, name) for name in names]
    first = [int(model.jnt_dofadr[j]) for j in joints]
    rows = list(range(6 * floating)) + rows_of(first, widths_at(states[0], names))
    found = []
    for state in states:
        P = np.eye(len(rows))
        if floating:
            P[:3, :3] = state.T_world_root[:3, :3]
        _set_positions(model, data, floating, names, state)
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
    widths = widths_at(states[0], names)
    rows = rows_of([j.velocity_start() for j in joints], widths)
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
        column = 6 * floating
        for name, j, width in zip(names, joints, widths, strict=True):
            value, at = state.q[name], j.position_start()
            if isinstance(value, float):
                q[at] = value
            else:  # Drake's angular velocity is in the axes of the joint's parent frame.
                q[at : at + 3] = rpy_from_rotation(value)
                P[column : column + 3, column : column + 3] = value
            column += width
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


def draw_states(rng: np.random.Generator, robot: Robot, floating: bool) -> list[State]:
    """Return random states; where the base is fixed it is at the origin."""
    found = []
    for _ in range(STATES):
        T = pose(rotation_from_rpy(rng.uniform(-2, 2, 3)), rng.uniform(-1, 1, 3)) if floating else np.eye(4)
        q: dict[str, float | Matrix] = {}
        for joint in robot.joints:
            if joint.moves:
                q[joint.name] = float(rng.uniform(-1.5, 1.5))
            elif joint.is_ball:
                q[joint.name] = rotation_from_rpy(rng.uniform(-1.5, 1.5, 3))
        found.append(State(T, q))
    return found


def _reduction(
    robot: Robot, names: Sequence[str], states: list[State], base: int
) -> tuple[list[State], Matrix]:
    """Return states that satisfy the mimics, and d(all coordinates)/d(independent ones)."""
    if any(robot.joint(name).is_ball for name in names):
        # MJCF and SDF state ball joints, and none of these robots has mimics.
        return states, np.eye(base + sum(widths_at(states[0], names)))
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
            own = cast(dict[str, float], state.q)
            own[name] = factor * own[leader] + offset
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


@dataclass(frozen=True)
class Correspondence:
    """Coordinates of a robot b from those of a robot a.

    Joints of a are those of b by `names`, reversed where `signs` is -1. A ball joint's rotation in a is that
    in b between the two rotations of `turns`. The root of b has the pose `T_root` in that of a.
    """

    signs: Mapping[str, int] = field(default_factory=dict)
    names: Mapping[str, str] = field(default_factory=dict)
    turns: Mapping[str, tuple[Matrix, Matrix]] = field(default_factory=dict)
    T_root: Matrix = field(default_factory=lambda: np.eye(4))

    def name(self, joint: str) -> str:
        """Return the name in b of a joint of a."""
        return self.names.get(joint, joint)

    def position(self, joint: str, q: float | Matrix) -> float | Matrix:
        """Return the position in b of a joint of a."""
        if isinstance(q, float):
            return self.signs.get(joint, 1) * q
        before, after = self.turns.get(joint, (np.eye(3), np.eye(3)))
        turned: Matrix = before.T @ q @ after.T
        return turned

    def state(self, state: State) -> State:
        """Return a state of a in the coordinates of b."""
        q = {self.name(joint): self.position(joint, value) for joint, value in state.q.items()}
        return State(state.T_world_root @ self.T_root, q)

    def velocities(self, joints: Sequence[str], state: State, floating: bool) -> Matrix:
        """Return d(velocities of b)/d(velocities of a)."""
        base = 6 * floating
        X = np.eye(base + sum(widths_at(state, joints)))
        if base:
            R, p = inverse(self.T_root)[:3, :3], inverse(self.T_root)[:3, 3]
            X[:3, :3] = X[3:6, 3:6] = R
            X[:3, 3:6] = np.array([[0, -p[2], p[1]], [p[2], 0, -p[0]], [-p[1], p[0], 0]]) @ R
        for name, width in zip(joints, widths_at(state, joints), strict=True):
            here = slice(base, base + width)
            if width == 1:
                X[here, here] = self.signs.get(name, 1)
            elif name in self.turns:
                X[here, here] = self.turns[name][1]
            base += width
        return X


def text_difference(
    a: tuple[Robot, str, Format],
    b: tuple[Robot, str, Format],
    floating: bool,
    seed: int,
    by: Correspondence | None = None,
) -> float:
    """Return the relative difference of two texts over random states, each by the engine of its format."""
    (robot_a, text_a, format_a), (robot_b, text_b, format_b) = a, b
    by = by or Correspondence()
    own = [joint.name for joint in robot_a.joints if joint.moves or joint.is_ball]
    theirs = [by.name(name) for name in own]
    states = draw_states(np.random.default_rng(seed), robot_a, floating)
    states, G = _reduction(robot_a, own, states, 6 * floating)
    X = by.velocities(own, states[0], floating) @ G
    first = quantities(text_a, format_a, floating, own, states, robot_a.root)
    second = quantities(text_b, format_b, floating, theirs, [by.state(each) for each in states], robot_b.root)
    return relative_difference(
        [Quantities(G.T @ each.M @ G, G.T @ each.g) for each in first],
        [Quantities(X.T @ each.M @ X, X.T @ each.g) for each in second],
    )


def coupling_difference(
    a: tuple[Robot, str], b: tuple[Robot, str], floating: bool, seed: int, by: Correspondence
) -> tuple[float, str]:
    """Return the largest difference of tendons, constraints, actuators and keyframes, and whose it is.

    MuJoCo measures lengths and constraint errors at random states, relative to 1 + their size, and the
    positions of keyframes.
    """
    import mujoco

    (robot_a, text_a), (_, text_b) = a, b
    own = [joint.name for joint in robot_a.joints if joint.moves or joint.is_ball]
    states = draw_states(np.random.default_rng(seed), robot_a, floating)
    # Lengths and errors need no inertias, so that those which no body can have do no harm.
    texts = [text.replace("<compiler ", '<compiler balanceinertia="true" ') for text in (text_a, text_b)]
    models: Any = [mujoco.MjModel.from_xml_string(text) for text in texts]
    for model in models:
        model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONTACT)
    worst = (0.0, "")
    for state in states:
        first = _couplings(models[0], floating, own, state)
        second = _couplings(models[1], floating, [by.name(name) for name in own], by.state(state))
        if first.keys() != second.keys():
            return 1.0, f"only one has {sorted(first.keys() ^ second.keys())[:3]}"
        for name, value in first.items():
            size = float(np.max(np.abs(value - second[name]) / (1.0 + np.abs(value)), initial=0.0))
            worst = max(worst, (size, name))
    keys: list[dict[str, State]] = []
    for model, names in zip(models, (own, [by.name(name) for name in own]), strict=True):
        keys.append({model.key(i).name: _key_state(model, i, floating, names) for i in range(model.nkey)})
    if keys[0].keys() != keys[1].keys():
        return 1.0, "keyframes of other names"
    for name, state in keys[0].items():
        wanted, got = by.state(state), keys[1][name]
        if floating:
            worst = max(worst, (float(np.max(np.abs(wanted.T_world_root - got.T_world_root))), name))
        for joint, position in wanted.q.items():
            worst = max(worst, (float(np.max(np.abs(position - got.q[joint]))), f"{name} {joint}"))
    return worst


def _couplings(model: Any, floating: bool, names: Sequence[str], state: State) -> dict[str, Matrix]:
    """Return lengths and parameters of tendons and actuators, and sizes of constraint errors, by name."""
    import mujoco

    data: Any = mujoco.MjData(model)
    _set_positions(model, data, floating, names, state)
    data.eq_active[:] = 1
    mujoco.mj_forward(model, data)
    found = {}
    for i in range(model.ntendon):
        spring = model.tendon_stiffness[i] * (data.ten_length[i] - model.tendon_lengthspring[i, 0])
        values = [data.ten_length[i], spring, *model.tendon_range[i], model.tendon_damping[i]]
        found[f"tendon {model.tendon(i).name}"] = np.array([*values, model.tendon_frictionloss[i]])
    for i in range(model.nu):
        values = [data.actuator_length[i], *model.actuator_gainprm[i, :3], *model.actuator_biasprm[i, :3]]
        values += [*model.actuator_ctrlrange[i], *model.actuator_forcerange[i]]
        found[f"actuator {model.actuator(i).name}"] = np.array(values)
    equality = int(mujoco.mjtConstraint.mjCNSTR_EQUALITY)
    for i in range(model.neq):
        rows = (data.efc_type == equality) & (data.efc_id == i)
        errors = data.efc_pos[rows]
        parts = [float(np.linalg.norm(errors[k : k + 3])) for k in range(0, len(errors), 3)]
        found[f"equality {model.equality(i).name}"] = np.array(
            [*parts, model.eq_active0[i], *model.eq_solref[i]]
        )
    return found


def _key_state(model: Any, key: int, floating: bool, names: Sequence[str]) -> State:
    q: dict[str, float | Matrix] = {}
    T = np.eye(4)
    values = model.key_qpos[key]
    if floating:
        T = pose(rotation_from_quat(values[3:7]), values[:3])
    for name in names:
        at = int(model.jnt_qposadr[model.joint(name).id])
        is_ball = model.jnt_type[model.joint(name).id] == 1
        q[name] = rotation_from_quat(values[at : at + 4]) if is_ball else float(values[at])
    return State(T, q)


def rotation_from_quat(wxyz: Matrix) -> Matrix:
    """Return the rotation of a quaternion of any length, scalar first."""
    w, x, y, z = wxyz / np.linalg.norm(wxyz)
    K = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    R: Matrix = np.eye(3) + 2.0 * (w * K + K @ K)
    return R


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
    "Correspondence",
    "Quantities",
    "State",
    "coupling_difference",
    "draw_states",
    "line_difference",
    "quantities",
    "relative_difference",
    "silence_engines",
    "text_difference",
]
