"""Notes on inputs that are valid and hardly meant: degrees for radians, millimetres for metres, gravity that
points up."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np

from dynx.errors import shown
from dynx.model.elements import Joint
from dynx.model.model import Model
from dynx.model.tree import Tree
from dynx.spatial.scalar import Floats

FAR = {"revolute": 0.5 * math.pi, "prismatic": 1.0}
"""Distance beyond a limit [rad or m] from which a position is noted: other simulators allow less."""

_OTHER_UNITS = {"revolute": ("rad", "degrees", math.pi / 180.0), "prismatic": ("m", "mm", 1e-3)}

MAX_JOINTS = 3
"""Largest number of joints that are noted one by one."""


def position_notes(model: Tree, q: Floats, name: str = "q") -> Iterator[str]:
    """Yield a sentence for each joint whose position in q (nq,) is far beyond its limits, with what the
    number would be in the unit that was perhaps meant. `name` is that of the configuration."""
    found = []
    for joint in model.coordinate_joints:
        k = model.position_index(joint.name)
        x, lower, upper = float(q[k]), float(model.lower[k]), float(model.upper[k])
        if joint.type in FAR and not lower - FAR[joint.type] <= x <= upper + FAR[joint.type]:
            meant = in_other_unit(joint, x, lower, upper)
            found.append(
                f"{name}: {shown(joint.name)} is at {x:g} {joint.unit}, far beyond its limits {lower:.4g} to "
                f"{upper:.4g}{meant and f'; {meant}'}"
            )
    yield from found[:MAX_JOINTS]
    if len(found) > MAX_JOINTS:
        yield f"{name}: {len(found) - MAX_JOINTS} more are far beyond their limits"


def target_notes(model: Model, robot: str, kp: Floats, target: Floats) -> Iterator[str]:
    """Yield a sentence for each target (n,) of the motors of a robot that is far beyond the limits of its
    joint; `kp` (n,) is the stiffness of the motors, zero where a joint has no target."""
    q, driven = model.neutral(), np.flatnonzero(kp)
    places = np.array(model.mechanism.places[6 * model.floating :], dtype=np.intp)
    if model.ball_joints:
        q[places[driven]] = target[driven]
    else:
        q[len(q) - len(target) + driven] = target[driven]
    yield from position_notes(model, q, f"the target of the motors of {shown(robot)}")


def in_other_unit(joint: Joint, x: float, lower: float, upper: float) -> str:
    """Return what a position far beyond the limits is in the unit that was perhaps meant; empty where that
    is beyond them, too."""
    if joint.type not in FAR or lower - FAR[joint.type] <= x <= upper + FAR[joint.type]:
        return ""
    unit, other, factor = _OTHER_UNITS[joint.type]
    return f"{x:g} {other} are {factor * x:.5g} {unit}" if lower <= factor * x <= upper else ""


def gravity_notes(gravity: Sequence[float]) -> Iterator[str]:
    """Yield a sentence if gravity (3,) [m/s^2] points up."""
    if gravity[2] > 0.0:
        numbers = ", ".join(f"{each:g}" for each in gravity)
        yield (
            f"gravity ({numbers}) points up, along z of the world; it is the acceleration of a body that "
            "falls, (0, 0, -9.81) by default"
        )


def rotation_notes(rpy: Sequence[float], name: str) -> Iterator[str]:
    """Yield a sentence if roll, pitch or yaw [rad] of what is called `name` is beyond a full turn, as angles
    in degrees are."""
    largest = max(rpy, key=abs)
    if abs(largest) > 2.0 * math.pi:
        yield (
            f"rpy of {name} holds {largest:g} rad, more than a full turn; {largest:g} degrees are "
            f"{math.radians(largest):.5g} rad"
        )
