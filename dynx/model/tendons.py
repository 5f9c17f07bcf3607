"""Tendons that a robot description states, as data."""

from __future__ import annotations

from dataclasses import dataclass, field

from dynx.model.elements import INFINITY


@dataclass(frozen=True)
class StatedTendon:
    """Fixed tendon of a robot, as its description states it. It is data: no tendon pulls in dynx.

    `terms` are pairs of a joint and a coefficient. The length of the tendon is the sum of coefficient times
    position of the joint [rad or m], and its velocity follows. The limits `range` are those of the length.
    `spring_length` is a range of lengths without a spring force; it is 0 if `stiffness` is 0. In MuJoCo a
    tendon shorter than this range has the tension ``stiffness (spring_length[0] - length)``, and a longer
    tendon ``stiffness (spring_length[1] - length)``. Damping and dry friction add ``-damping velocity`` and
    `friction` to the tension. The effort of each joint is the coefficient times the tension. `armature` adds
    ``armature coefficient_i coefficient_j`` to the mass matrix. `force_range` bounds the sum of the forces of
    actuators. `name` may be empty.
    """

    name: str
    terms: tuple[tuple[str, float], ...]
    range: tuple[float, float] = (-INFINITY, INFINITY)
    stiffness: float = 0.0
    spring_length: tuple[float, float] = (0.0, 0.0)
    damping: float = 0.0
    friction: float = 0.0
    armature: float = 0.0
    force_range: tuple[float, float] = (-INFINITY, INFINITY)
    line: int | None = field(default=None, compare=False)

    def __post_init__(self) -> None:
        if not self.stiffness:
            object.__setattr__(self, "spring_length", (0.0, 0.0))

    @property
    def joints(self) -> tuple[str, ...]:
        """Names of the joints, in the order of the terms."""
        return tuple(joint for joint, _ in self.terms)
