"""Gravity compensation that a robot description states, as data."""

from __future__ import annotations

from dataclasses import dataclass, field


@dataclass(frozen=True)
class StatedGravityCompensation:
    """Gravity compensation of a link, as a robot description states it. It is data: dynx compensates nothing.

    MuJoCo applies the force ``-factor mass gravity`` at the centre of mass of the link. So a link with the
    factor 1 is weightless, and one with a larger factor rises.
    """

    link: str
    factor: float
    line: int | None = field(default=None, compare=False)
