"""Pinocchio's own model of a robot, built from the links and joints of a `Model`."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import Any

import numpy as np

from dynx.engines.pinocchio.library import pin
from dynx.errors import DynxError, EngineError, EngineLimitError, nonblank_lines, shown
from dynx.model import Model
from dynx.model.elements import Inertial, Joint, Pose
from dynx.spatial.inertia import inertia_from_parameters, parameters_from_inertia
from dynx.spatial.scalar import Floats

MAX_NV = 200
"""Largest number of tree velocities (mimic joints included); see `dynx.engines.pinocchio.backend`."""

MIN_MERGED_MASS = float(np.finfo(float).eps)
"""Smallest total mass [kg] of several merged bodies, unless it is zero."""

WORLD = 0
"""Pinocchio's joint 0, the universe, which carries a fixed base."""


def error_message(error: BaseException) -> str:
    """Return the engine's message, without the C++ signatures before and after it."""
    _, _, message = str(error).rpartition("message:\n")
    return f"{type(error).__name__}: {(nonblank_lines(message) or ['no message'])[0]}"


@lru_cache(maxsize=16)
def engine_model(model: Model) -> tuple[Any, tuple[int, ...]]:
    """Build Pinocchio's own model of `model`; also return the number of each frame of `model.frame_names`.

    All backends of a model share it and never change it. Its coordinates are those of the tree, mimic joints
    included. Raises EngineLimitError for a model that the engine would represent wrongly or that is too
    large, EngineError where the engine refuses it.
    """
    refuse_large(model)
    try:
        return _build(model)
    except DynxError:
        raise
    except Exception as error:
        raise EngineError(f"pinocchio cannot represent {model.name}: {error_message(error)}") from error


def refuse_large(model: Model) -> None:
    """Raise EngineLimitError for a model with too many degrees of freedom, mimic joints included.

    They are counted in the description: merging the links of a large robot takes a second.
    """
    nv = sum(joint.n_rates for joint in model.joints) + (6 if model.floating else 0)
    if nv > MAX_NV:
        raise EngineLimitError(
            f"{model.name} has {nv} degrees of freedom; the backend 'pinocchio' "
            f"takes at most {MAX_NV}, because the engine's memory grows with their cube"
        )


def _build(model: Model) -> tuple[Any, tuple[int, ...]]:
    engine = pin.Model()
    engine.name = model.name
    engine.gravity.linear = np.array(model.gravity)
    carrier = WORLD
    if model.floating:
        carrier = engine.addJoint(WORLD, pin.JointModelFreeFlyer(), pin.SE3.Identity(), ":base")
    # For each link, the engine's joint that moves it, and its pose in that joint's frame.
    placements = {model.root: (carrier, _placement(model.base_pose))}
    for index, joint in enumerate(model.joints):
        carrier, T_carrier_parent = placements[joint.parent]
        T_carrier_joint = T_carrier_parent * _placement(joint.origin)
        if joint.moves:
            # Frames get numbers as names, so that no name clashes with one of the engine's own.
            name = f"{index}:{joint.name}"
            number = engine.addJoint(carrier, _joint_model(joint), T_carrier_joint, name)
            placements[joint.child] = (number, pin.SE3.Identity())
        else:
            placements[joint.child] = (carrier, T_carrier_joint)
    for link in model.links:
        if link.inertial is not None:
            _add_inertia(engine, *placements[link.name], link.inertial, link.name)
    _refuse_light_groups(engine)
    frame_ids = []
    for index, frame in enumerate(model.frames):
        carrier, T_carrier_link = placements[frame.link]
        T_carrier_frame = T_carrier_link * _placement(frame.placement)
        engine_frame = pin.Frame(f"{index}:{frame.name}", carrier, 0, T_carrier_frame, pin.FrameType.OP_FRAME)
        frame_ids.append(int(engine.addFrame(engine_frame, False)))
    return engine, tuple(frame_ids)


class LinkRegressor:
    """The map from the engine's regressor of joints to that of links.

    The engine merges the inertia of a link into the joint that moves it. Columns of links whose frame is the
    joint's own only change their order, those of links that no joint moves are zero, and those of other links
    are products of the joint's columns with a matrix.
    """

    def __init__(self, engine: Any, links: Sequence[int]) -> None:
        """`links` are the engine's numbers of the links' frames."""
        unchanged = np.eye(10)[_ENGINE_ORDER]
        of_joints, of_links = 10 * (engine.njoints - 1), 10 * len(links)
        self._shape = engine.nv, of_joints
        # For each entry of the result, the entry of the engine's array that has it, or one that is zero.
        source = np.empty((engine.nv, of_links), dtype=np.intp)
        source[...] = np.arange(engine.nv)[:, None] * of_joints
        zero = self._zero_entry(engine)
        self._fixed: list[slice] = []
        products: list[tuple[slice, slice, Floats]] = []
        for number, link in enumerate(links):
            frame, columns = engine.frames[link], slice(10 * number, 10 * number + 10)
            begin = 10 * (int(frame.parentJoint) - 1)
            if frame.parentJoint == WORLD:
                if zero is None:
                    self._fixed.append(columns)
                else:
                    source[:, columns] = zero
                continue
            source[:, columns] += begin + np.array(_ENGINE_ORDER)
            matrix = _parameters_on_joint(frame.placement)
            if np.array_equal(matrix, unchanged):
                continue
            joint = slice(begin, begin + 10)
            if products and products[-1][0] == joint and products[-1][1].stop == columns.start:
                # Links in a row on one joint share a product.
                _, before, matrices = products.pop()
                columns, matrix = slice(before.start, columns.stop), np.hstack([matrices, matrix])
            products.append((joint, columns, matrix))
        self._source = source
        self._products = products

    @staticmethod
    def _zero_entry(engine: Any) -> int | None:
        """Return the number of an entry of the engine's regressor that is zero at every state: the torque of
        a joint that does not move the body of the first joint."""
        row = int(engine.joints[1].nv)
        return 10 * (engine.njoints - 1) * row if engine.nv > row else None

    def __call__(self, of_joints: Floats) -> Floats:
        """Return the regressor of the links (nv, 10 n_links) for that of the joints (nv, 10 n_joints)."""
        # With one degree of freedom the binding returns a vector.
        result: Floats = of_joints.take(self._source, None, None, "clip")
        if self._products:
            of_joints = of_joints.reshape(self._shape)
            for joint, columns, matrices in self._products:
                result[:, columns] = of_joints[:, joint].dot(matrices)
        for columns in self._fixed:
            result[:, columns] = 0.0
        return result


class LinkForces:
    """The wrench on each link and on all links beyond it, from the engine's recursive Newton-Euler.

    The engine keeps the wrench on the body that each joint moves. A link that is fixed to another has no
    joint of the engine: what moves it and the fixed links behind it is added to the wrenches of the joints
    that they carry.
    """

    def __init__(self, engine: Any, model: Model, links: Sequence[int]) -> None:
        """`links` are the engine's numbers of the links' frames."""
        frames = [engine.frames[link] for link in links]
        self._engine = engine
        self._carriers = [int(frame.parentJoint) for frame in frames]
        self._placements = [frame.placement for frame in frames]
        self._inertias = [
            None
            if link.inertial is None
            else (frame.placement * _placement(link.inertial.origin)).act(_inertia(link.inertial))
            for link, frame in zip(model.links, frames, strict=True)
        ]
        numbers = {link.name: number for number, link in enumerate(model.links)}
        self._children: list[list[int]] = [[] for _ in links]
        for child, joint in enumerate(model.joints, 1):
            self._children[numbers[joint.parent]].append(child)
        moved = {numbers[joint.child] for joint in model.joints if joint.moves}
        self._has_joint = [number in moved for number in range(len(links))]

    def __call__(self, data: Any, links: range) -> Floats:
        """Return the wrenches (n, 6) on some links at the origins of their frames in their axes, after
        `rnea` on `data`."""
        found = np.empty((len(links), 6))
        for row, link in enumerate(links):
            found[row] = self._placements[link].actInv(self._on_carrier(data, link)).vector
        return found

    def _on_carrier(self, data: Any, link: int) -> Any:
        """Return the wrench on a link and all links beyond it, in the frame of the joint that carries it."""
        carrier = self._carriers[link]
        if self._has_joint[link]:
            return data.f[carrier]
        total, pending = pin.Force.Zero(), [link]
        while pending:
            part = pending.pop()
            if self._has_joint[part]:
                joint = self._carriers[part]
                total += data.liMi[joint].act(data.f[joint])
                continue
            inertia = self._inertias[part]
            if inertia is not None:
                total += inertia * data.a_gf[carrier] + inertia.vxiv(data.v[carrier])
            pending += self._children[part]
        return total


_ENGINE_ORDER = [0, 1, 2, 3, 4, 5, 7, 6, 8, 9]
"""Pinocchio's order of the ten parameters: it lists the upper triangle of the tensor column by column."""


def _parameters_on_joint(placement: Any) -> Floats:
    """Return the matrix (10, 10) from the parameters of a body at `placement`, in dynx's order, to those
    about the joint's origin in the engine's order."""
    R, p = np.array(placement.rotation), np.array(placement.translation)
    moved = [parameters_from_inertia(inertia_from_parameters(unit).transform(R, p)) for unit in np.eye(10)]
    return np.asarray(np.stack(moved, axis=-1)[_ENGINE_ORDER])


def _placement(pose: Pose) -> Any:
    return pin.SE3(pin.rpy.rpyToMatrix(np.array(pose.rpy)), np.array(pose.xyz))


def _joint_model(joint: Joint) -> Any:
    """Return the engine's joint; for axes along a basis vector the engine has faster code."""
    if joint.type == "ball":
        return pin.JointModelSpherical()
    prismatic = joint.type == "prismatic"
    if joint.axis == (1.0, 0.0, 0.0):
        return pin.JointModelPX() if prismatic else pin.JointModelRX()
    if joint.axis == (0.0, 1.0, 0.0):
        return pin.JointModelPY() if prismatic else pin.JointModelRY()
    if joint.axis == (0.0, 0.0, 1.0):
        return pin.JointModelPZ() if prismatic else pin.JointModelRZ()
    axis = np.array(joint.axis)
    return pin.JointModelPrismaticUnaligned(axis) if prismatic else pin.JointModelRevoluteUnaligned(axis)


def _add_inertia(engine: Any, carrier: int, T_carrier_link: Any, inertial: Inertial, link: str) -> None:
    """Add a link's inertia to the joint that moves it."""
    if inertial.mass < 0.0:
        raise EngineLimitError(
            f"link {shown(link)} has mass {inertial.mass}; "
            "the backend 'pinocchio' cannot represent a negative one"
        )
    placed = (T_carrier_link * _placement(inertial.origin)).act(_inertia(inertial))
    present = engine.inertias[carrier]
    if _is_zero(placed):
        return
    if _is_zero(present):
        engine.inertias[carrier] = placed
        return
    _refuse_light_sum(present.mass + placed.mass, link)
    engine.appendBodyToJoint(carrier, placed, pin.SE3.Identity())


def _inertia(inertial: Inertial) -> Any:
    """Return the engine's inertia about the centre of mass."""
    # The constructor refuses a tensor that no body can have; the attributes accept it.
    own = pin.Inertia.Zero()
    own.mass, own.inertia = inertial.mass, inertial.tensor
    return own


def _is_zero(inertia: Any) -> bool:
    return not inertia.mass and not inertia.inertia.any()


def _refuse_light_groups(engine: Any) -> None:
    """Raise EngineLimitError for a joint that moves several bodies of negligible total mass."""
    own = [float(inertia.mass) for inertia in engine.inertias]
    carried = list(own)
    for joint in range(len(own) - 1, WORLD, -1):
        if carried[joint] != own[joint]:
            _refuse_light_sum(carried[joint], engine.names[joint].partition(":")[2])
        carried[engine.parents[joint]] += carried[joint]


def _refuse_light_sum(mass: float, carrier: str) -> None:
    # Where the engine adds two inertias it divides by max(mass, eps): below eps the centre of mass
    # of the sum, and with it the mass matrix, would be silently wrong.
    if 0.0 < mass < MIN_MERGED_MASS:
        raise EngineLimitError(
            f"the bodies merged at {shown(carrier)} have {mass:.3g} kg together; the backend 'pinocchio' "
            f"adds inertias correctly only from {MIN_MERGED_MASS:.2g} kg up, or without any mass"
        )
