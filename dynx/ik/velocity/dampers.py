"""Velocity dampers: bounds on how fast bodies that are near may approach one another.

For a pair of bodies at the distance d, d' >= -gain (d - margin) lets d fall to the margin no faster than
exponentially, and grow back to it where it is below (Faverjon and Tournassoud, A local based approach for
path planning of manipulators with a high number of degrees of freedom, IEEE ICRA 1987; as rows of a quadratic
programme: Kanoun, Lamiraux and Wieber, IEEE Trans. Robotics 27(4), 2011).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from dynx.backends.base import Backend
from dynx.errors import ArgumentError, shown
from dynx.ik.checking import checked_avoidance
from dynx.model.numbers import is_real
from dynx.spatial.scalar import Floats

if TYPE_CHECKING:
    from dynx.distance.avoidance import AvoidanceSource

FREE_SPEED = 1.0
"""Speed of approach [m/s] that the damper of a pair allows where it begins to count."""


@dataclass(frozen=True, eq=False)
class Dampers:
    """Rows J v >= bound, one for each pair that is near."""

    J: Floats
    """Derivatives (m, nv) of the distances."""
    bound: Floats
    """Least rates (m,) of the distances [m/s]; positive for a pair that is closer than its margin."""
    names: tuple[tuple[str, str], ...]
    """Names of the bodies of each pair."""
    note: str = ""
    """What the avoidance leaves out (`Avoidance.note`)."""

    def missed(self, v: Floats, tolerance: float) -> tuple[tuple[str, str], ...]:
        """Return the pairs that approach faster than they may, by more than `tolerance` [m/s]."""
        lack = self.bound - self.J @ v
        return tuple(name for name, x in zip(self.names, lack.tolist(), strict=True) if x > tolerance)

    def active(self, v: Floats, tolerance: float) -> tuple[tuple[str, str], ...]:
        """Return the pairs that approach as fast as they may, or faster."""
        room = self.J @ v - self.bound
        return tuple(name for name, x in zip(self.names, room.tolist(), strict=True) if x <= tolerance)


def dampers(backend: Backend, q: Floats, avoid: AvoidanceSource | None, gain: float, dt: float) -> Dampers:
    """Return the dampers at q (nq,); `gain` [1/s] is at most 1 / dt, so that a step does not pass the margin.

    Raises ArgumentError for `avoid` or `gain`.
    """
    model = backend.model
    avoidance = checked_avoidance(model, avoid)
    if avoidance is None:
        return Dampers(np.zeros((0, model.nv)), np.zeros(0), ())
    if not (is_real(gain) and 0.0 < gain * dt <= 1.0):
        raise ArgumentError(
            f"avoid_gain is {shown(gain)}; wanted a number above 0, at most 1 / dt = {1.0 / dt:.6g} [1/s]"
        )
    near = avoidance.near(backend, q, FREE_SPEED / gain)
    room = np.array([each.separation.lower - each.pair.margin for each in near])
    names = tuple(avoidance.names(each.pair) for each in near)
    return Dampers(avoidance.gradients(backend, q, near), -gain * room, names, avoidance.note)
