"""A file as Pinocchio loads it, by ``pin.buildModelFromUrdf`` or ``pin.buildModelFromMJCF`` alone.

Quantities are computed in the gravity of the model of dynx; `LoadedModel.gravity` is Pinocchio's own.

Pinocchio has its own order of joints, has two numbers (cos, sin) for a continuous joint, and makes joints
of several degrees of freedom where the file has them. Here its coordinates are converted to those of dynx
by the names of the joints. Of MJCF, Pinocchio joins the joints of one body to a composite joint, whose
members have no names: they are found by their order in the body.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from dynx.argument_types import checks_types
from dynx.engines.pinocchio.engine_model import MAX_NV, WORLD
from dynx.engines.pinocchio.library import pin
from dynx.engines.silence import capture_output
from dynx.errors import EngineError, UnusableEngineError, nonblank_lines
from dynx.loaded.robot import (
    EngineBase,
    EngineCoordinates,
    LoadedInertial,
    LoadedJoint,
    LoadedModel,
    LoadedRobot,
    checked_format,
    lacking_joints,
)
from dynx.model import Model
from dynx.model.document_format import Format
from dynx.spatial.scalar import Floats

CALLS: Mapping[str, str] = {"pinocchio.no_armature": "model.armature[:] = 0"}
"""Remedies at run time: id -> the line of code, which comes after loading."""

_TYPES = {"FreeFlyer": "floating", "Planar": "planar", "Spherical": "spherical"}


_COMPOSITE = "Composite_"


@dataclass(frozen=True)
class _Member:
    """A joint of a composite joint: its kind, and where its numbers stand among those of the model."""

    kind: str
    idx_q: int
    idx_v: int
    nq: int
    nv: int

    def shortname(self) -> str:
        """Return the kind as Pinocchio's joints do."""
        return f"JointModel{self.kind}"


class LoadedPinocchio(LoadedRobot):
    """A robot as Pinocchio loads it; see `LoadedRobot`."""

    name: ClassVar[str] = "pinocchio"
    FORMATS: ClassVar[tuple[Format, ...]] = ("urdf", "mjcf")
    CALLS: ClassVar[Mapping[str, str]] = CALLS

    def __init__(self, path: Path, model: Model, calls: Collection[str] = ()) -> None:
        self._form = checked_format(type(self), path)
        self._model = model
        base_joint = [pin.JointModelFreeFlyer()] if model.floating else []
        messages: list[str] = []
        read = "buildModelFromMJCF" if self._form == "mjcf" else "buildModelFromUrdf"
        with self._convert_errors(read):
            with capture_output(messages):
                if self._form == "mjcf":
                    self._engine = pin.buildModelFromMJCF(str(path))
                else:
                    self._engine = pin.buildModelFromUrdf(str(path), *base_joint)
            if "pinocchio.no_armature" in calls:
                self._engine.armature[:] = 0
            if self._engine.nv > MAX_NV:
                raise UnusableEngineError(
                    f"{model.name} has {self._engine.nv} degrees of freedom in pinocchio; at most {MAX_NV} "
                    "are supported, because its workspace grows with their cube"
                )
            self._data = self._engine.createData()
        self._messages = tuple(messages)
        self._default_gravity: Floats = np.array(self._engine.gravity.linear)
        self._engine.gravity.linear = np.array(model.gravity)
        self._neutral: Floats = np.array(pin.neutral(self._engine))
        if model.floating and (self._engine.njoints < 2 or self._engine.joints[1].nv != 6):
            raise UnusableEngineError(f"pinocchio does not let the base of {model.name} float")
        self._composites = self._find_composites()
        self._joints = self._find_joints()
        self._links = {
            frame.name: number
            for number, frame in enumerate(self._engine.frames)
            if frame.type == pin.FrameType.BODY
        }
        base = list(range(6)) if model.floating else []
        # Index in the engine's velocity of each velocity of dynx.
        self._v = np.array(base + [int(joint.idx_v) for joint in self._joints], dtype=np.intp)

    @classmethod
    def engine_version(cls) -> str:
        """Return the version of the library pinocchio, such as ``4.1.0``."""
        return str(pin.__version__)

    @classmethod
    @checks_types
    def load_call(cls, floating: bool, root: str | None = None, form: Format = "urdf") -> str:
        """Return the call: one line; for URDF the joint of a floating base is its second argument. Pinocchio
        finds the root link itself, so `root` has no effect."""
        if form == "mjcf":
            return "model = pinocchio.buildModelFromMJCF(path)"
        base_joint = ", pinocchio.JointModelFreeFlyer()" if floating else ""
        return f"model = pinocchio.buildModelFromUrdf(path{base_joint})"

    # -- quantities ------------------------------------------------------------------------------

    def link_poses(self, q: Floats) -> Floats:
        """Return the poses of the engine's BODY frames."""
        T = np.full((len(self._model.links), 4, 4), np.nan)
        with self._convert_errors("framesForwardKinematics"):
            pin.framesForwardKinematics(self._engine, self._data, self._configuration(q))
            for k, link in enumerate(self._model.links):
                if link.name in self._links:
                    T[k] = self._data.oMf[self._links[link.name]].homogeneous
        return T

    @checks_types
    def jacobian(self, q: Floats, link: str) -> Floats:
        """Return the result of ``computeFrameJacobian`` in LOCAL_WORLD_ALIGNED."""
        if link not in self._links:
            return np.full((6, self._model.nv), np.nan)
        with self._convert_errors("computeFrameJacobian"):
            J = pin.computeFrameJacobian(
                self._engine,
                self._data,
                self._configuration(q),
                self._links[link],
                pin.LOCAL_WORLD_ALIGNED,
            )
        # At one degree of freedom the binding returns a vector.
        return np.asarray(J.reshape(6, self._engine.nv)[:, self._v])

    def mass_matrix(self, q: Floats) -> Floats:
        """Return the mass matrix by ``crba``."""
        with self._convert_errors("crba"):
            M = np.array(pin.crba(self._engine, self._data, self._configuration(q)))
        # Some versions fill the upper triangle only.
        M = np.triu(M) + np.triu(M, 1).T
        return np.asarray(M[np.ix_(self._v, self._v)])

    def inverse_dynamics(self, q: Floats, v: Floats, a: Floats) -> Floats:
        """Return the torque by ``rnea``."""
        with self._convert_errors("rnea"):
            tau = pin.rnea(
                self._engine, self._data, self._configuration(q), self._velocity(v), self._velocity(a)
            )
        return np.asarray(tau[self._v])

    def forward_dynamics(self, q: Floats, v: Floats, tau: Floats) -> Floats:
        """Return the acceleration by ``aba``, or by ``crba`` and ``rnea`` where a joint without a coordinate
        of dynx is held."""
        if len(self._v) < self._engine.nv:
            return self._solved_acceleration(q, v, tau)
        with self._convert_errors("aba"):
            a = pin.aba(
                self._engine, self._data, self._configuration(q), self._velocity(v), self._velocity(tau)
            )
        return np.asarray(a[self._v])

    def close(self) -> None:
        """Do nothing: the interpreter frees all resources."""

    # -- what was loaded ----------------------------------------------------------------------

    def describe(self) -> LoadedModel:
        """Describe the model from frames, joint models and the engine's vectors of limits.

        Pinocchio keeps the inertia of a link on a fixed joint separately, and that of a link on a moving
        joint only merged with the links rigidly connected to it, which `LoadedInertial.merged` names.
        """
        engine = self._engine
        base = self.link_poses(self._model.neutral())[0]
        if self._model.root == "world" and "world" not in self._links:
            # The world of MJCF is Pinocchio's universe.
            base = np.eye(4)
        joints = {
            name: self._describe_joint(number)
            for number, name in enumerate(engine.names)
            if number > (1 if self._model.floating else 0) and name not in self._composites
        }
        for composite in self._composites.values():
            joints |= {name: self._describe_member(member) for name, member in composite}
        return LoadedModel(
            engine=self.name,
            links=dict(self._inertials()),
            joints=joints,
            base_frame=base,
            gravity=self._default_gravity,
            missing_links=tuple(link.name for link in self._model.links if link.name not in self._links),
            remarks=self._messages,
        )

    def _inertials(self) -> Iterator[tuple[str, LoadedInertial]]:
        engine = self._engine
        for name, number in self._links.items():
            frame = engine.frames[number]
            above = engine.frames[frame.parentFrame]
            own, merged = frame.inertia, ()
            # The frame above a link fixed to the world is the universe, which has no inertia of its own.
            if above.type == pin.FrameType.FIXED_JOINT and frame.parentFrame != WORLD:
                own = above.inertia
            elif frame.parentJoint != WORLD:
                # A joint off the origin of its body has a frame of its own.
                own = frame.placement.actInv(engine.inertias[frame.parentJoint])
                merged = tuple(
                    other
                    for other, at in self._links.items()
                    if other != name and engine.frames[at].parentJoint == frame.parentJoint
                )
            yield name, LoadedInertial(float(own.mass), np.array(own.lever), np.array(own.inertia), merged)

    def _describe_joint(self, number: int) -> LoadedJoint:
        engine, joint = self._engine, self._engine.joints[number]
        frame = engine.frames[engine.getFrameId(engine.names[number], pin.FrameType.JOINT)]
        parent = engine.frames[frame.parentFrame]
        placement = (parent.placement.inverse() * engine.jointPlacements[number]).homogeneous
        kind = joint.shortname().removeprefix("JointModel")
        if joint.nv != 1:
            return LoadedJoint(_TYPES.get(kind, kind), np.array(placement))
        prismatic = kind.startswith("P")
        unbounded = not prismatic and joint.nq == 2
        at = joint.idx_v
        state = joint.createData()
        joint.calc(state, self._neutral)
        axis = np.array(state.S).reshape(6)[slice(0, 3) if prismatic else slice(3, 6)]
        limits = (
            float(engine.lowerPositionLimit[joint.idx_q]),
            float(engine.upperPositionLimit[joint.idx_q]),
        )
        return LoadedJoint(
            type="prismatic" if prismatic else "continuous" if unbounded else "revolute",
            placement=np.array(placement),
            axis=axis,
            limits=(-np.inf, np.inf) if unbounded else limits,
            velocity=float(engine.velocityLimit[at]),
            effort=float(engine.effortLimit[at]),
            damping=float(engine.damping[at]),
            friction=float(engine.friction[at]),
            armature=float(engine.armature[at]),
        )

    def _describe_member(self, joint: _Member) -> LoadedJoint:
        """Describe a joint of one body that has several."""
        engine, at = self._engine, joint.idx_v
        return LoadedJoint(
            type="prismatic" if joint.kind.startswith("P") else "revolute",
            limits=(
                float(engine.lowerPositionLimit[joint.idx_q]),
                float(engine.upperPositionLimit[joint.idx_q]),
            ),
            velocity=float(engine.velocityLimit[at]),
            effort=float(engine.effortLimit[at]),
            damping=float(engine.damping[at]),
            friction=float(engine.friction[at]),
            armature=float(engine.armature[at]),
        )

    # -- coordinates --------------------------------------------------------------------------

    def _find_composites(self) -> dict[str, list[tuple[str, _Member]]]:
        """Return the members of each composite joint, by the names that the file gives them.

        A composite is called by the first of the joints of its body, with a prefix.
        """
        model = self._model
        after = {joint.parent: joint for joint in model.joints if joint.moves}
        found: dict[str, list[tuple[str, _Member]]] = {}
        for number, name in enumerate(self._engine.names):
            joint = self._engine.joints[number]
            first = name.removeprefix(_COMPOSITE)
            if first == name or first not in model.joint_names or not joint.shortname().endswith("Composite"):
                continue
            members, q, v = [], int(joint.idx_q), int(joint.idx_v)
            at = model.joint(first)
            for each in joint.extract().joints:
                kind = str(each.shortname()).removeprefix("JointModel")
                members.append((at.name, _Member(kind, q, v, int(each.nq), int(each.nv))))
                q, v = q + int(each.nq), v + int(each.nv)
                following = after.get(at.child)
                if following is None:
                    break
                at = following
            found[name] = members
        return found

    def _find_joints(self) -> list[Any]:
        """Return the engine's joint for each coordinate of dynx."""
        known = {name: self._engine.joints[number] for number, name in enumerate(self._engine.names)}
        known |= dict(member for members in self._composites.values() for member in members)
        names = self._model.joint_names
        wrong = {
            name: known[name].shortname() if name in known else "not there"
            for name in names
            if name not in known or known[name].nv != 1
        }
        if wrong:
            raise lacking_joints(self.name, self._model, wrong)
        return [known[name] for name in names]

    def coordinates(self) -> EngineCoordinates:
        """Return the places of the joints in the engine's q and v; angles without limits are circles."""
        base = EngineBase(tuple(range(7)), tuple(range(6)), False, False) if self._model.floating else None
        return EngineCoordinates(
            self._neutral,
            int(self._engine.nv),
            tuple(int(joint.idx_q) for joint in self._joints),
            tuple(int(joint.idx_v) for joint in self._joints),
            tuple(joint.nq == 2 for joint in self._joints),
            base,
        )

    def _configuration(self, q: Floats) -> Floats:
        x: Floats = self._neutral.copy()
        base = 7 if self._model.floating else 0
        x[:base] = q[:base]
        for joint, value in zip(self._joints, q[base:], strict=True):
            if joint.nq == 1:
                x[joint.idx_q] = value
            else:
                x[joint.idx_q : joint.idx_q + 2] = np.cos(value), np.sin(value)
        return x

    def _velocity(self, v: Floats) -> Floats:
        x: Floats = np.zeros(self._engine.nv)
        x[self._v] = v
        return x

    @contextmanager
    def _convert_errors(self, call: str) -> Iterator[None]:
        """Raise the engine's exceptions as `EngineError` with its messages."""
        try:
            yield
        except EngineError:
            raise
        except Exception as error:
            message = (nonblank_lines(error) or [type(error).__name__])[-1]
            raise EngineError(f"pinocchio failed in {call} for {self._model.name}: {message}") from error
