"""Configurations that differ from solutions by full turns of joints whose limits span more than one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray

from dynx.errors import ArgumentError
from dynx.ik.coordinates import FULL_TURN
from dynx.model import Model
from dynx.spatial.scalar import Floats

AT_LIMIT = 1e-12
"""Fraction of a turn by which an angle may exceed a limit, by rounding; it is moved to the limit."""

MAX_CONFIGURATIONS = 1_000_000
"""Most configurations that are listed."""

Integers = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class FullTurns:
    """Angles with two limits, which may take several values that differ by full turns."""

    columns: tuple[int, ...]
    """Indices in q."""
    lower: Floats
    upper: Floats
    """Limits [rad]."""

    @classmethod
    def of(cls, model: Model, columns: Sequence[int]) -> FullTurns:
        """Select the limited angles among the coordinates `columns`. Joints without limits take one value."""
        kinds = [joint.type for joint in model.coordinate_joints]
        chosen = [
            k
            for k in columns
            if kinds[k] != "prismatic" and np.isfinite(model.lower[k]) and np.isfinite(model.upper[k])
        ]
        return cls(tuple(chosen), model.lower[chosen], model.upper[chosen])

    def counts(self, q: Floats) -> Integers:
        """Return the number (...,) of configurations within the limits for each q (..., nq), itself
        included."""
        first, last = self._turns(q)
        return np.asarray(np.prod(np.maximum(last - first + 1, 0), axis=-1))

    def configurations(self, q: Floats) -> Floats:
        """Return all configurations (m, nq) for q (k, nq), those of the first row first.

        Raises ArgumentError for more than `MAX_CONFIGURATIONS`.
        """
        count = int(self.counts(q).sum())
        if count > MAX_CONFIGURATIONS:
            raise ArgumentError(
                f"{count} configurations differ by full turns within the limits; at most "
                f"{MAX_CONFIGURATIONS} are listed"
            )
        found, row = np.empty((count, q.shape[-1])), 0
        for one, first, last in zip(q, *self._turns(q), strict=True):
            for turns in product(*(range(a, b + 1) for a, b in zip(first, last, strict=True))):
                found[row] = one
                moved = one[list(self.columns)] + FULL_TURN * np.array(turns)
                found[row, self.columns] = np.clip(moved, self.lower, self.upper)
                row += 1
        return found

    def _turns(self, q: Floats) -> tuple[Integers, Integers]:
        """Return the least and the greatest number of turns (..., n) that may be added to each angle."""
        angles = q[..., list(self.columns)]
        first = np.ceil((self.lower - angles) / FULL_TURN - AT_LIMIT)
        last = np.floor((self.upper - angles) / FULL_TURN + AT_LIMIT)
        return first.astype(np.int64), last.astype(np.int64)
