"""One damped least-squares step inside bounds: Levenberg-Marquardt with an active set.

The step minimises ``|error - J (y - x)|^2 + damping |y - x|^2`` over ``lower <= y <= upper``
(Levenberg 1944; Marquardt 1963). A coordinate that the step would carry over a bound is put on it,
its part of the error is taken away, and the others are solved for again. Every call begins with
all coordinates free, so a coordinate leaves its bound as soon as that helps.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from dynx.spatial.scalar import Floats

_RIDGE = 1e-10
"""Damping, relative to the matrix, with which a system is solved that rounding made indefinite."""


class BoundedStep:
    """The step for fixed bounds on `n` coordinates; infinite bounds are none."""

    __slots__ = ("_dposv", "_lower", "_upper")

    def __init__(self, lower: Sequence[float], upper: Sequence[float]) -> None:
        # Not at the top: importing dynx must be quick, and scipy.linalg is not.
        from scipy.linalg.lapack import dposv

        self._dposv = dposv
        self._lower = lower
        self._upper = upper

    def __call__(self, J: Floats, error: Sequence[float], x: Sequence[float], damping: float) -> list[float]:
        """The new coordinates y (n,), from J (m, n), error (m,), x (n,) within bounds, damping > 0."""
        residual = np.array(error)
        moved = self._displacement(J, residual, damping).tolist()
        y = [a + b for a, b in zip(x, moved, strict=True)]
        held: dict[int, float] = {}
        while True:
            over = {
                k: low if value < low else high
                for k, (value, low, high) in enumerate(zip(y, self._lower, self._upper, strict=True))
                if value < low or value > high
            }
            if not over:
                return y
            held |= over
            columns = list(held)
            free = J.copy()
            free[:, columns] = 0.0
            carried = J[:, columns].dot([held[k] - x[k] for k in columns])
            moved = self._displacement(free, residual - carried, damping).tolist()
            y = [held.get(k, a + b) for k, (a, b) in enumerate(zip(x, moved, strict=True))]

    def _displacement(self, J: Floats, error: Floats, damping: float) -> Floats:
        # The smaller of two equivalent systems: J'(J J' + d)^-1 e = (J'J + d)^-1 J'e.
        m, n = J.shape
        if m <= n:
            return np.asarray(self._solve(J.dot(J.T), error, damping).dot(J))
        return self._solve(J.T.dot(J), error.dot(J), damping)

    def _solve(self, A: Floats, b: Floats, damping: float) -> Floats:
        diagonal = A.reshape(-1)[:: len(A) + 1]
        diagonal += damping
        _, solution, not_definite = self._dposv(A, b)
        if not_definite:
            diagonal += _RIDGE * float(diagonal.max())
            _, solution, not_definite = self._dposv(A, b)
        return np.zeros_like(b) if not_definite else np.asarray(solution)
