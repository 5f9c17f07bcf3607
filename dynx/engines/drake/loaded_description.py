"""Description of a link and of a joint in Drake, and of the messages while loading."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np

from dynx.loaded.description import LoadedInertial, LoadedJoint
from dynx.spatial.scalar import Floats


def describe_link(body: Any, context: Any) -> LoadedInertial:
    """Return the inertia of a body about its centre of mass. Drake stores it about the link's origin.

    Drake's world, which is the body of a link named ``world``, has no mass.
    """
    if body.index() == 0:
        return LoadedInertial(0.0, np.zeros(3), np.zeros((3, 3)))
    held = body.CalcSpatialInertiaInBodyFrame(context)
    mass, center = float(held.get_mass()), np.array(held.get_com())
    unit: Floats = np.array(held.get_unit_inertia().CopyToFullMatrix3())
    central = mass * (unit - (center @ center) * np.eye(3) + np.outer(center, center))
    return LoadedInertial(mass, center, central)


def describe_joint(joint: Any, actuator: Any | None) -> LoadedJoint:
    """Return the description of a joint that moves; effort and armature are those of its actuator, if any."""
    placement = np.array(joint.frame_on_parent().GetFixedPoseInBodyFrame().GetAsMatrix4())
    kind = str(joint.type_name())
    if joint.num_velocities() != 1:
        return LoadedJoint(kind, placement)
    prismatic = kind == "prismatic"
    lower, upper = float(joint.position_lower_limits()[0]), float(joint.position_upper_limits()[0])
    unbounded = not prismatic and bool(np.isinf([lower, upper]).all())
    return LoadedJoint(
        type="continuous" if unbounded else kind,
        placement=placement,
        axis=np.array(joint.translation_axis() if prismatic else joint.revolute_axis()),
        limits=(lower, upper),
        velocity=float(joint.velocity_upper_limits()[0]),
        effort=None if actuator is None else float(actuator.effort_limit()),
        damping=float(joint.default_damping_vector()[0]),
        friction=0.0,
        armature=0.0 if actuator is None else float(actuator.default_reflected_inertia()),
    )


def remarks(log: Iterable[str], path: str, plant: Any) -> tuple[str, ...]:
    """Return Drake's log messages, each once and on one line, and the number of constraints that it made."""
    lines = [" ".join(message.replace(f"{path}:", "line ").split()) for message in log]
    if plant.num_constraints():
        lines.append(f"{plant.num_constraints()} mimic joints are constraints")
    return tuple(dict.fromkeys(lines))
