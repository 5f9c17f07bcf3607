"""A file in URDF or MJCF as MuJoCo loads it.

Quantities are those of the calls that users make, `mj_inverse` and `mj_forward`, with all forces that MuJoCo
adds to rigid bodies. Joint damping, dry friction, violated limits, `<mimic>` (an equality constraint) and
shapes that touch add forces to both; each of `CALLS` removes one kind.

With a fixed base MuJoCo merges the root link, and all links on fixed joints, into their parents
(`fusestatic`, the default for URDF), so these links have no frame.

MJCF is MuJoCo's own format: its bodies and joints without a name are found by their numbers, as
`dynx.model.mjcf` names them.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from dynx.argument_types import checks_types
from dynx.engines.mujoco.library import MAX_DEPTH, mujoco, silence_warnings
from dynx.engines.silence import silence
from dynx.errors import EngineError, UnusableEngineError, nonblank_lines, shown
from dynx.loaded.robot import (
    EngineBase,
    EngineCoordinates,
    LoadedInertial,
    LoadedJoint,
    LoadedModel,
    LoadedRobot,
    called_joints,
    checked_format,
    lacking_joints,
    require_file,
)
from dynx.model import Model
from dynx.model.document_format import Format
from dynx.spatial.scalar import Floats
from dynx.spatial.se3 import homogeneous
from dynx.spatial.so3 import rotation_from_quat

CALLS: Mapping[str, str] = {
    "mujoco.no_damping": "model.dof_damping[:] = 0",
    "mujoco.no_friction": "model.dof_frictionloss[:] = 0",
    "mujoco.no_limits": "model.jnt_limited[:] = 0",
    "mujoco.no_mimic": "model.eq_active0[:] = 0",
    "mujoco.no_armature": "model.dof_armature[:] = 0",
    "mujoco.no_springs": "model.jnt_stiffness[:] = 0",
    "mujoco.no_gravity_compensation": "model.body_gravcomp[:] = 0",
    "mujoco.no_tendons": (
        "model.tendon_stiffness[:] = model.tendon_damping[:] = model.tendon_frictionloss[:] = 0\n"
        "model.tendon_armature[:] = model.tendon_limited[:] = 0"
    ),
    "mujoco.no_actuators": "model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_ACTUATION",
    "mujoco.no_fluid": "model.opt.density = model.opt.viscosity = 0; model.opt.wind[:] = 0",
    "mujoco.exact_inertial_frames": (
        "model.body_sameframe[:] = model.body_simple[:] = model.dof_simplenum[:] = 0"
    ),
    "mujoco.no_contacts": "model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT",
}
"""Remedies at run time: id -> the line of code, which comes after loading and before `mujoco.MjData`."""

FIXED = "model = mujoco.MjModel.from_xml_path(path)"


def load_file(path: Path, model: Model, loading: str, calls: Collection[str]) -> Any:
    """Load the file in MuJoCo by the lines `loading` and apply `calls`; raises EngineError with MuJoCo's
    message if that fails."""
    _refuse_crashes(path, model)
    names: dict[str, Any] = {"mujoco": mujoco, "path": str(path)}
    try:
        with _without_warnings():
            # The lines shown to users are those that are executed.
            exec(loading, names)
            for call, code in CALLS.items():
                if call in calls:
                    exec(code, names)
            _set_joints(names["model"], calls)
    except Exception as error:
        raise EngineError(f"mujoco refuses {path.name}: {_message(error)}") from error
    loaded = names["model"]
    if model.floating:
        bodies = {number: name for name, number in body_numbers(loaded).items()}
        name = bodies[int(loaded.jnt_bodyid[0])] if loaded.njnt else "nothing"
        if name != model.root:
            raise UnusableEngineError(
                f"mujoco lets {shown(name)} float instead of the root {shown(model.root)} of {path.name}"
                + (": MuJoCo mistakes a root named 'world' for the world" if model.root == "world" else "")
            )
    return loaded


def body_numbers(loaded: Any) -> dict[str, int]:
    """Return the numbers of the bodies by name; one without a name is called as dynx calls it."""
    names = ((loaded.body(number).name or f"body_{number}", number) for number in range(1, loaded.nbody))
    return dict(names)


def joint_numbers(loaded: Any) -> dict[str, int]:
    """Return the numbers of the joints by name; one without a name is called as dynx calls it."""
    bodies = {number: name for name, number in body_numbers(loaded).items()}
    numbers = {}
    for joint in range(loaded.njnt):
        body = int(loaded.jnt_bodyid[joint])
        first, count = int(loaded.body_jntadr[body]), int(loaded.body_jntnum[body])
        suffix = "" if count == 1 else f"_{joint - first + 1}"
        numbers[loaded.joint(joint).name or f"{bodies[body]}_joint{suffix}"] = joint
    return numbers


def loading_lines(*, floating: bool, options: str = "") -> str:
    """Return the documented lines that load a URDF with compiler options, and with a floating base, for which
    MuJoCo's reader has no option."""
    free = "spec.worldbody.first_body().add_freejoint()" if floating else ""
    lines = ("spec = mujoco.MjSpec.from_file(path)", options, free, "model = spec.compile()")
    return "\n".join(filter(None, lines)) if floating or options else FIXED


def _set_joints(loaded: Any, calls: Collection[str]) -> None:
    """Apply those of `calls` that are made on single joints."""
    joints = joint_numbers(loaded)
    for call, change in _ON_JOINT.items():
        if call not in calls:
            for name in called_joints(calls, call, joints):
                change(loaded, joints[name])


def _free_follower(loaded: Any, joint: int) -> None:
    """Switch off the constraints by which a joint follows another."""
    follows = (loaded.eq_type == mujoco.mjtEq.mjEQ_JOINT) & (loaded.eq_obj1id == joint)
    loaded.eq_active0[follows] = 0


def _dofs(loaded: Any, joint: int) -> slice:
    """Return the velocities of a joint: six of a free joint, three of a ball joint."""
    last = joint + 1 == loaded.njnt
    return slice(int(loaded.jnt_dofadr[joint]), int(loaded.nv if last else loaded.jnt_dofadr[joint + 1]))


def _disable_damping(loaded: Any, joint: int) -> None:
    loaded.dof_damping[_dofs(loaded, joint)] = 0


def _disable_friction(loaded: Any, joint: int) -> None:
    loaded.dof_frictionloss[_dofs(loaded, joint)] = 0


def _disable_armature(loaded: Any, joint: int) -> None:
    loaded.dof_armature[_dofs(loaded, joint)] = 0


def _disable_spring(loaded: Any, joint: int) -> None:
    loaded.jnt_stiffness[joint] = 0


def _disable_limits(loaded: Any, joint: int) -> None:
    loaded.jnt_limited[joint] = 0


_ON_JOINT: Mapping[str, Callable[[Any, int], None]] = {
    "mujoco.no_damping": _disable_damping,
    "mujoco.no_friction": _disable_friction,
    "mujoco.no_limits": _disable_limits,
    "mujoco.no_mimic": _free_follower,
    "mujoco.no_armature": _disable_armature,
    "mujoco.no_springs": _disable_spring,
}
"""The calls of `CALLS` that can be made on one joint, by its number."""


@contextmanager
def _without_warnings() -> Iterator[None]:
    """Keep warnings out of stderr, Python's warnings and the log file in the working directory.

    MuJoCo writes that file unless a program handles the warnings.
    """
    before = mujoco.get_mju_user_warning()
    with silence(), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        mujoco.set_mju_user_warning(_ignore)
        try:
            yield
        finally:
            mujoco.set_mju_user_warning(before)


def _ignore(message: str) -> None:
    """Handle a warning by doing nothing."""


def _refuse_crashes(path: Path, model: Model) -> None:
    require_file(path)
    depth = {model.root: 1}
    for joint in model.joints:
        depth[joint.child] = depth[joint.parent] + 1
    if max(depth.values()) > MAX_DEPTH:
        raise UnusableEngineError(
            f"{path.name} has {max(depth.values())} links in a row; long chains crash mujoco, so dynx loads "
            f"at most {MAX_DEPTH}"
        )


def _message(error: Exception) -> str:
    # Such as "Error: inertia must satisfy A + B >= C" and "Element name 'arm', id 2".
    return "; ".join(nonblank_lines(error)[:2]) or type(error).__name__


WORLD = 0
NAMES = {
    int(mujoco.mjtJoint.mjJNT_HINGE): "revolute",
    int(mujoco.mjtJoint.mjJNT_SLIDE): "prismatic",
    int(mujoco.mjtJoint.mjJNT_BALL): "spherical",
    int(mujoco.mjtJoint.mjJNT_FREE): "floating",
}


def describe_model(loaded: Any, model: Model, gravity: Floats, form: Format = "urdf") -> LoadedModel:
    """Describe a MuJoCo model `loaded` from a file with the names of `model`."""
    here = body_numbers(loaded)
    merged = _merged_links(model, here)
    links = {
        link.name: _inertial(loaded, here[link.name], merged.get(link.name, ()))
        for link in model.links
        if link.name in here
    }
    first = int(model.floating)
    numbered = joint_numbers(loaded).items()
    joints = {name: _joint(loaded, k, model, here) for name, k in numbered if k >= first}
    remarks = []
    if model.root not in here and form == "urdf":
        remarks.append(f"the root link {model.root} is merged into the world")
    if loaded.neq and form == "urdf":
        remarks.append(f"{loaded.neq} equality constraints stand for <mimic>")
    if np.any(loaded.geom_contype[:] * loaded.geom_conaffinity[:]):
        remarks.append(f"{loaded.ngeom} collision shapes can touch each other")
    return LoadedModel(
        engine="mujoco",
        links=links,
        joints=joints,
        # MuJoCo puts the root link at the origin of the world, even if it merges it.
        base_frame=_pose(loaded.body_pos[here[model.root]], loaded.body_quat[here[model.root]])
        if model.root in here and not (form == "mjcf" and model.floating)
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
    child = next((name for name, number in here.items() if number == body), "")
    parents = [joint.parent for joint in model.joints if joint.child == child]
    first = int(loaded.body_jntadr[body])
    if not parents or (first >= 0 and loaded.qpos0[loaded.jnt_qposadr[first]]):
        # MuJoCo holds the pose of the body in the pose of the file, at which the joint may not be at 0.
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


class LoadedMujoco(LoadedRobot):
    """A robot as `mujoco.MjModel.from_xml_path` loads it; see `LoadedRobot`."""

    name: ClassVar[str] = "mujoco"
    takes_ball_joints: ClassVar[bool] = True
    FORMATS: ClassVar[tuple[Format, ...]] = ("urdf", "mjcf")
    CALLS: ClassVar[Mapping[str, str]] = CALLS
    refuses_without: ClassVar[tuple[str, ...]] = ("collision",)

    def __init__(self, path: Path, model: Model, calls: Collection[str] = ()) -> None:
        self._model = model
        self._form = checked_format(type(self), Path(path))
        call = self.load_call(model.floating, model.root, self._form)
        self._loaded = loaded = load_file(Path(path), model, call, calls)
        self._numbers = body_numbers(loaded), joint_numbers(loaded)
        self._gravity: Floats = np.array(loaded.opt.gravity)
        loaded.opt.gravity[:] = model.gravity
        self._bodies = [self._body(link.name) for link in model.links]
        joints = [self._joint(name) for name in model.joint_names]
        base = 6 if model.floating else 0
        # Indices of dynx's coordinates among MuJoCo's; the free joint comes first in both.
        # The quaternion of a ball joint is (w, x, y, z) in MuJoCo.
        ball = int(mujoco.mjtJoint.mjJNT_BALL)
        is_ball = [int(loaded.jnt_type[joint]) == ball for joint in joints]
        self._q = [
            int(loaded.jnt_qposadr[joint]) + k
            for joint, turns in zip(joints, is_ball, strict=True)
            for k in ((1, 2, 3, 0) if turns else (0,))
        ]
        rates = [
            int(loaded.jnt_dofadr[joint]) + k
            for joint, turns in zip(joints, is_ball, strict=True)
            for k in range(3 if turns else 1)
        ]
        self._v = [*range(base), *rates]
        self._data = mujoco.MjData(loaded)

    @classmethod
    def engine_version(cls) -> str:
        """Return the version of MuJoCo."""
        return str(mujoco.__version__)

    @classmethod
    @checks_types
    def load_call(cls, floating: bool, root: str | None = None, form: Format = "urdf") -> str:
        """Return the call: one line for MJCF and for a fixed base, three for a floating one."""
        return loading_lines(floating=floating and form == "urdf")

    def describe(self) -> LoadedModel:
        """Describe MuJoCo's model."""
        return replace(describe_model(self._loaded, self._model, self._gravity, self._form), engine=self.name)

    def link_poses(self, q: Floats) -> Floats:
        """Return T_world_link (n_links, 4, 4); NaN for links that MuJoCo merged into others."""
        self._place(q)
        mujoco.mj_kinematics(self._loaded, self._data)
        T = np.full((len(self._bodies), 4, 4), np.nan)
        for index, body in enumerate(self._bodies):
            if body is not None:
                T[index] = np.eye(4)
                T[index, :3, :3] = self._data.xmat[body].reshape(3, 3)
                T[index, :3, 3] = self._data.xpos[body]
        return T

    @checks_types
    def jacobian(self, q: Floats, link: str) -> Floats:
        """Return the Jacobian (6, nv) of a link frame by `mj_jacBody`."""
        body = self._bodies[self._model.frame_index(link)]
        if body is None:
            return np.full((6, len(self._v)), np.nan)
        self._place(q)
        mujoco.mj_kinematics(self._loaded, self._data)
        mujoco.mj_comPos(self._loaded, self._data)
        J = np.zeros((6, self._loaded.nv))
        mujoco.mj_jacBody(self._loaded, self._data, J[:3], J[3:], body)
        J = J[:, self._v]
        if self._model.floating:
            J[:, :3] = J[:, :3] @ self._base_rotation()
        return J

    def mass_matrix(self, q: Floats) -> Floats:
        """Return the mass matrix (nv, nv) by `mj_fullM`."""
        self._place(q)
        mujoco.mj_forward(self._loaded, self._data)
        M = np.zeros((self._loaded.nv, self._loaded.nv))
        # Since MuJoCo 4.0 the argument is the data, before that its field qM.
        if hasattr(self._data, "qM"):
            mujoco.mj_fullM(self._loaded, M, self._data.qM)
        else:
            mujoco.mj_fullM(self._loaded, self._data, M)
        M = M[np.ix_(self._v, self._v)]
        if self._model.floating:
            R = self._base_rotation()
            M[:3] = R.T @ M[:3]
            M[:, :3] = M[:, :3] @ R
        return M

    def inverse_dynamics(self, q: Floats, v: Floats, a: Floats) -> Floats:
        """Return the torque (nv,) of `mj_inverse`, which subtracts damping and constraint forces."""
        self._place(q, v)
        self._data.qacc[self._v] = a
        if self._model.floating:
            self._data.qacc[:3] = self._base_rotation() @ (a[:3] + np.cross(v[3:6], v[:3]))
        mujoco.mj_inverse(self._loaded, self._data)
        tau = np.array(self._data.qfrc_inverse[self._v])
        if self._model.floating:
            tau[:3] = self._base_rotation().T @ tau[:3]
        return tau

    def forward_dynamics(self, q: Floats, v: Floats, tau: Floats) -> Floats:
        """Return the acceleration (nv,) of `mj_forward` with `tau` in `qfrc_applied`."""
        self._place(q, v)
        self._data.qfrc_applied[self._v] = tau
        if self._model.floating:
            self._data.qfrc_applied[:3] = self._base_rotation() @ tau[:3]
        mujoco.mj_forward(self._loaded, self._data)
        a = np.array(self._data.qacc[self._v])
        if self._model.floating:
            a[:3] = self._base_rotation().T @ a[:3] - np.cross(v[3:6], v[:3])
        return a

    def contacts(self, q: Floats) -> Mapping[tuple[str, str], float]:
        """Pairs of `data.contact`; the world is the root."""
        # Contacts depend on the configuration alone, and are asked for at hundreds of them.
        self._set_positions(q)
        mujoco.mj_kinematics(self._loaded, self._data)
        mujoco.mj_collision(self._loaded, self._data)
        found: dict[tuple[str, str], float] = {}
        # The list of contacts takes 0.1 ms to make, also where it is empty.
        for contact in self._data.contact[: self._data.ncon] if self._data.ncon else ():
            one, other = sorted(map(self._name_of_shape, (contact.geom1, contact.geom2)))
            found[one, other] = max(found.get((one, other), 0.0), -float(contact.dist))
        return found

    def _name_of_shape(self, geom: int) -> str:
        body = int(self._loaded.geom_bodyid[geom])
        link = self._loaded.body(body).name if body > WORLD else self._model.root
        return str(self._loaded.geom(geom).name or link)

    def close(self) -> None:
        """Release MuJoCo's model and data."""
        vars(self).pop("_data", None)
        vars(self).pop("_loaded", None)

    def coordinates(self) -> EngineCoordinates:
        """Return the addresses of the joints in `qpos` and `qvel`."""
        loaded, floating = self._loaded, self._model.floating
        neutral = np.array(loaded.qpos0)
        single = [int(kind) for kind in (mujoco.mjtJoint.mjJNT_HINGE, mujoco.mjtJoint.mjJNT_SLIDE)]
        neutral[loaded.jnt_qposadr[np.isin(loaded.jnt_type, single)]] = 0.0
        if floating:
            neutral[:7] = 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0
        base = EngineBase((0, 1, 2, 4, 5, 6, 3), tuple(range(6)), True, False) if floating else None
        joints_v = self._v[6:] if floating else self._v
        circles = (False,) * len(self._q)
        return EngineCoordinates(neutral, int(loaded.nv), tuple(self._q), tuple(joints_v), circles, base)

    # -- from dynx to MuJoCo ------------------------------------------------------------------

    def _place(self, q: Floats, v: Floats | None = None) -> None:
        """Reset the data to the state after loading, and set the configuration and the velocity."""
        data = self._data
        mujoco.mj_resetData(self._loaded, data)
        silence_warnings(data)
        self._set_positions(q)
        if v is not None:
            data.qvel[self._v] = v
            if self._model.floating:
                mujoco.mj_kinematics(self._loaded, data)
                data.qvel[:3] = self._base_rotation() @ v[:3]

    def _set_positions(self, q: Floats) -> None:
        """Set the configuration; coordinates that the model lacks stay at zero."""
        qpos, base = self._data.qpos, 7 if self._model.floating else 0
        qpos[self._q] = q[base:]
        if base:
            x, y, z, w = q[3:7]
            qpos[:7] = [*q[:3], w, x, y, z]

    def _base_rotation(self) -> Floats:
        """Return R of the base; MuJoCo has the base's linear velocity in world axes."""
        R: Floats = self._data.xmat[self._loaded.jnt_bodyid[0]].reshape(3, 3)
        return R

    def _body(self, link: str) -> int | None:
        """Return MuJoCo's body for a link; the world for a fixed root named ``world``."""
        if not link:
            return None
        # A link named `world` may be MuJoCo's world, which has the number 0.
        number = self._numbers[0].get(link, WORLD if link == "world" else -1)
        is_world = number == WORLD and link == self._model.root and not self._model.floating
        return number if number > WORLD or is_world else None

    def _joint(self, name: str) -> int:
        number = self._numbers[1].get(name, -1)
        kinds = [mujoco.mjtJoint.mjJNT_HINGE, mujoco.mjtJoint.mjJNT_SLIDE]
        if self._model.joint(name).type == "ball":
            kinds = [mujoco.mjtJoint.mjJNT_BALL]
        if number < 0 or self._loaded.jnt_type[number] not in [int(kind) for kind in kinds]:
            instead = "not there" if number < 0 else "of several degrees of freedom"
            raise lacking_joints(self.name, self._model, {name: instead})
        return number


class BalancedMujoco(LoadedMujoco):
    """A robot as MuJoCo loads it with `balanceinertia`, by which it accepts impossible inertias.

    Moments of which one exceeds the sum of the others are replaced by their mean.
    """

    name: ClassVar[str] = "mujoco:balanceinertia"
    FORMATS: ClassVar[tuple[Format, ...]] = ("urdf",)

    @classmethod
    @checks_types
    def load_call(cls, floating: bool, root: str | None = None, form: Format = "urdf") -> str:
        """Return the call: three lines for a fixed base, four for a floating one."""
        return loading_lines(floating=floating, options="spec.compiler.balanceinertia = True")
