"""Constraints between parts of a scene."""

from __future__ import annotations

from dataclasses import dataclass

from dynx.errors import ArgumentError, shown
from dynx.model import Pose
from dynx.model.elements import ZERO, Vector, checked_pose
from dynx.model.numbers import finite_vector


@dataclass(frozen=True)
class Weld:
    """A rigid connection of `a` and `b`: each a body, ``robot/link`` or ``world``.

    `T_a_b` is the pose of the frame of b in that of a; None keeps their relative pose at the start.
    """

    a: str
    b: str
    T_a_b: Pose | None = None

    def __post_init__(self) -> None:
        _check_ends(self)
        if self.T_a_b is not None:
            object.__setattr__(self, "T_a_b", checked_pose("T_a_b of a weld", self.T_a_b))


@dataclass(frozen=True)
class PointToPoint:
    """A ball joint: `point_a` (3,) [m] of `a` stays at `point_b` of `b`, each in the frame of its end.

    Each end is a body, ``robot/link`` or ``world``.
    """

    a: str
    b: str
    point_a: Vector = ZERO
    point_b: Vector = ZERO

    def __post_init__(self) -> None:
        _check_ends(self)
        for name in ("point_a", "point_b"):
            object.__setattr__(self, name, finite_vector(f"{name} of a constraint", getattr(self, name)))


Constraint = Weld | PointToPoint


def _check_ends(constraint: Constraint) -> None:
    kind = type(constraint).__name__
    for end in (constraint.a, constraint.b):
        if not isinstance(end, str):
            raise ArgumentError(
                f"an end of a {kind} is {shown(end)}; wanted the name of a body or robot/link"
            )
    if constraint.a == constraint.b:
        raise ArgumentError(f"a {kind} connects {shown(constraint.a)} to itself")
