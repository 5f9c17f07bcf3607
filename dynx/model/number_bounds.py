"""Bound on the numbers of a description, whether a file or a program states them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from dynx.errors import DescriptionError, shown
from dynx.model.elements import Inertial, Joint, Link, Pose
from dynx.model.numbers import MAX_MAGNITUDE

_MOMENTS = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")


def refuse_unbounded_numbers(links: Iterable[Link], joints: Iterable[Joint], source: str) -> None:
    """Raise DescriptionError for a number that is not finite or not below `MAX_MAGNITUDE`.

    Limits may be infinite, and are not part of any product.
    """
    for link in links:
        if link.inertial is not None:
            _require_bounded(f"link {shown(link.name)}", _of_inertial(link.inertial), source, link.line)
    for joint in joints:
        _require_bounded(f"joint {shown(joint.name)}", _of_joint(joint), source, joint.line)


def _of_inertial(inertial: Inertial) -> Iterator[tuple[str, float]]:
    yield "mass", inertial.mass
    yield from ((name, getattr(inertial, name)) for name in _MOMENTS)
    yield from _of_pose("origin of the inertia", inertial.origin)


def _of_joint(joint: Joint) -> Iterator[tuple[str, float]]:
    yield from _of_pose("origin", joint.origin)
    yield from (("axis", value) for value in joint.axis)
    dynamics = joint.dynamics
    yield "damping", dynamics.damping
    yield "friction", dynamics.friction
    yield "armature", dynamics.armature
    if joint.mimic is not None:
        yield "multiplier", joint.mimic.multiplier
        yield "offset", joint.mimic.offset
    if joint.locked_at is not None:
        yield "locked position", joint.locked_at


def _of_pose(name: str, pose: Pose) -> Iterator[tuple[str, float]]:
    yield from ((name, value) for value in (*pose.xyz, *pose.rpy))


def _require_bounded(what: str, numbers: Iterable[tuple[str, float]], source: str, line: int | None) -> None:
    for name, value in numbers:
        # The comparison is false for NaN.
        if not abs(value) < MAX_MAGNITUDE:
            raise DescriptionError(
                f"the {name} of {what} is {value}; wanted a number below {MAX_MAGNITUDE:g} in magnitude, "
                "since products of larger numbers overflow",
                source=source,
                line=line,
            )
