"""Reader of URDF's ``<joint>``: type, links, origin, axis, limits, dynamics and mimic."""

from __future__ import annotations

import math
import sys

from dynx.errors import nearest, shown
from dynx.model.elements import INFINITY, Joint, JointDynamics, JointType, Limits, Mimic, Vector
from dynx.model.numbers import MAX_MAGNITUDE
from dynx.model.urdf.origins import read_origin
from dynx.model.urdf.values import Reading
from dynx.model.xml.reading import Element

FRAME_TAG = "dynx_frame"
"""Extension written by `write_urdf`: the joint's child is a frame, added to the parent link."""

LOCKED_TAG = "dynx_locked"
"""Extension written by `write_urdf`: the position at which a joint, written as fixed, was locked."""

_TYPES: dict[str, JointType] = {
    "revolute": "revolute",
    "continuous": "continuous",
    "prismatic": "prismatic",
    "fixed": "fixed",
}
_REFUSED = {
    "planar": "two prismatic joints and a continuous one, with massless links between them",
    "floating": "base='floating' where the root moves freely, or three prismatic and three revolute joints",
    "spherical": "three revolute joints, with massless links between them",
    "ball": "three revolute joints, with massless links between them",
}
_READ = frozenset(["origin", "parent", "child", "axis", "limit", "dynamics", "mimic"])
_KNOWN = _READ | {"calibration", "safety_controller", "gazebo", LOCKED_TAG, FRAME_TAG}


def read_joint(element: Element, reading: Reading, floating_is_base: bool = False) -> Joint:
    """Read a joint. With `floating_is_base`, a floating joint stands for ``base=`` and is read as fixed."""
    name = reading.name(element, "name", "a <joint>")
    what = f"joint {shown(name)}"
    reading.ignore_unknown(element, _KNOWN)
    kind = _read_type(element, what, reading, floating_is_base)
    parent, child = (
        reading.name(reading.required(element, role, what), "link", f"<{role}> of {what}")
        for role in ("parent", "child")
    )
    origin = read_origin(element, what, reading)
    locked = element.all(LOCKED_TAG)
    if kind == "fixed" and not locked:
        return Joint(name, kind, parent, child, origin, line=element.line)
    return Joint(
        name,
        kind,
        parent,
        child,
        origin,
        axis=_read_axis(element, what, reading),
        limits=_read_limits(element, kind, what, reading),
        dynamics=_read_dynamics(element, what, reading),
        mimic=None if locked else _read_mimic(element, what, reading),
        locked_at=reading.number(locked[0], "value", what) if locked else None,
        line=element.line,
    )


def _read_type(element: Element, what: str, reading: Reading, floating_is_base: bool) -> JointType:
    kind = element.attributes.get("type")
    if kind is None:
        raise reading.error(element, f"{what} has no type; wanted one of {', '.join(_TYPES)}")
    if kind in _TYPES:
        return _TYPES[kind]
    if kind == "floating" and floating_is_base:
        reading.note(
            element,
            f"{what} is a floating joint below an empty root link: it is read as fixed, "
            "and base='floating' lets the robot move freely",
        )
        return "fixed"
    if kind in _REFUSED:
        raise reading.unsupported(element, f"{what} is {kind}, which is not supported; use {_REFUSED[kind]}")
    raise reading.error(element, f"{what} has the unknown type {shown(kind)}{nearest(kind, _TYPES)}")


def _read_axis(element: Element, what: str, reading: Reading) -> Vector:
    axis = reading.only(element, "axis")
    if axis is None:
        return (1.0, 0.0, 0.0)
    # A direction is scaled, so that any length will do.
    x, y, z = reading.vector(axis, "xyz", what, bound=INFINITY)
    largest = max(abs(x), abs(y), abs(z))
    if largest == 0.0:
        raise reading.error(axis, f"the axis of {what} is zero; wanted a direction")
    norm = math.hypot(x, y, z)
    if abs(norm - 1.0) <= 1e-15:
        return (x, y, z)
    if abs(norm - 1.0) > 1e-12:
        reading.note(axis, f"the axis of {what} has length {norm:.12g}; it was scaled to 1")
    # Scaled in two steps, so that neither a huge nor a tiny axis over- or underflows.
    x, y, z = x / largest, y / largest, z / largest
    norm = math.hypot(x, y, z)
    return (x / norm, y / norm, z / norm)


def _read_limits(element: Element, kind: JointType, what: str, reading: Reading) -> Limits:
    limit = reading.only(element, "limit")
    if limit is None:
        if kind in ("revolute", "prismatic"):
            unit = "rad" if kind == "revolute" else "m"
            or_else = ', or type="continuous"' if kind == "revolute" else ""
            raise reading.error(
                element,
                f"{what} is {kind} and has no <limit>; wanted "
                f'<limit lower="..." upper="..."/> in {unit}{or_else}',
            )
        return Limits()
    most = {}
    for attribute in ("velocity", "effort"):
        most[attribute] = _limit(limit, attribute, what, reading, INFINITY)
        if attribute not in limit.attributes:
            reading.note(limit, f"{what} has no {attribute} limit; it is read as unlimited")
        elif most[attribute] < 0.0:
            reading.note(limit, f"the {attribute} limit of {what} is negative")
    if kind == "continuous":
        if "lower" in limit.attributes or "upper" in limit.attributes:
            reading.note(limit, f"{what} is continuous; its lower and upper limits were ignored")
        return Limits(**most)
    lower, upper = (_limit(limit, end, what, reading, 0.0) for end in ("lower", "upper"))
    if lower == upper and math.isinf(lower):
        raise reading.error(limit, f"both limits of {what} are {lower}, so that it has no position")
    missing = [end for end in ("lower", "upper") if end not in limit.attributes]
    if missing:
        reading.note(limit, f"{what} has no {' and no '.join(missing)} limit; URDF defines it as 0")
    if lower > upper:
        reading.note(limit, f"{what} has lower limit {lower} above upper limit {upper}; they are exchanged")
    return Limits(lower, upper, **most)


def _limit(limit: Element, attribute: str, what: str, reading: Reading, default: float) -> float:
    value = reading.number_or(limit, attribute, what, default, bound=INFINITY)
    if abs(value) < MAX_MAGNITUDE or math.isinf(value):
        return value
    # The largest double is the usual way to write "no limit": every engine can read it, unlike infinity.
    if abs(value) < sys.float_info.max:
        reading.note(limit, f"the {attribute} limit of {what} is {value:g}; it is read as unlimited")
    return math.copysign(INFINITY, value)


def _read_dynamics(element: Element, what: str, reading: Reading) -> JointDynamics:
    dynamics = reading.only(element, "dynamics")
    if dynamics is None:
        return JointDynamics()
    values = {}
    for attribute in ("damping", "friction", "armature"):
        values[attribute] = reading.number_or(dynamics, attribute, what, 0.0)
        if values[attribute] < 0.0:
            reading.note(dynamics, f"the {attribute} of {what} is negative, so the joint gains energy")
    return JointDynamics(**values)


def _read_mimic(element: Element, what: str, reading: Reading) -> Mimic | None:
    mimic = reading.only(element, "mimic")
    if mimic is None:
        return None
    return Mimic(
        reading.name(mimic, "joint", f"<mimic> of {what}"),
        reading.number_or(mimic, "multiplier", what, 1.0),
        reading.number_or(mimic, "offset", what, 0.0),
    )
