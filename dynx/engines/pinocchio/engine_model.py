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
from dynx.rbd.regressor import inertia_from_parameters, parameters_from_inertia
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
    nv = model.mechanism.nv
    if nv > MAX_NV:
        raise EngineLimitError(
            f"{model.name} has {nv} degrees of freedom; the backend 'pinocchio' "
            f"takes at most {MAX_NV}, because the engine's memory grows with their cube"
        )
    try:
        return _build(model)
    except DynxError:
        raise
    except Exception as error:
        raise EngineError(f"pinocchio cannot represent {model.name}: {error_message(error)}") from error


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


def joint_parameters_of_links(engine: Any, links: Sequence[int]) -> tuple[list[int], Floats]:
    """Return the map from inertial parameters of links to those of the engine's joints that move them.

    It consists, for each link, of the number of its joint, not counting the universe, and the matrix (10, 10)
    from its parameters in dynx's order to the joint's in the engine's order, zero for links on the universe.
    """
    # Pinocchio lists the upper triangle of the tensor column by column.
    engine_order = [0, 1, 2, 3, 4, 5, 7, 6, 8, 9]
    joints, matrices = [], []
    for link in links:
        frame = engine.frames[link]
        R, p = np.array(frame.placement.rotation), np.array(frame.placement.translation)
        moved = [
            parameters_from_inertia(inertia_from_parameters(unit).transform(R, p)) for unit in np.eye(10)
        ]
        matrix = np.stack(moved, axis=-1)[engine_order]
        joints.append(max(int(frame.parentJoint) - 1, 0))
        matrices.append(0.0 * matrix if frame.parentJoint == WORLD else matrix)
    return joints, np.stack(matrices)


def _placement(pose: Pose) -> Any:
    return pin.SE3(pin.rpy.rpyToMatrix(np.array(pose.rpy)), np.array(pose.xyz))


def _joint_model(joint: Joint) -> Any:
    """Return the engine's joint; for axes along a basis vector the engine has faster code."""
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
    # The constructor refuses a tensor that no body can have; the attributes accept it.
    own = pin.Inertia.Zero()
    own.mass, own.inertia = inertial.mass, inertial.tensor
    placed = (T_carrier_link * _placement(inertial.origin)).act(own)
    present = engine.inertias[carrier]
    if _is_zero(placed):
        return
    if _is_zero(present):
        engine.inertias[carrier] = placed
        return
    _refuse_light_sum(present.mass + placed.mass, link)
    engine.appendBodyToJoint(carrier, placed, pin.SE3.Identity())


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
