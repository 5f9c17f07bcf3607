"""One damped least-squares step within bounds: Levenberg-Marquardt with an active set.

The step minimises ``|error - J (y - x)|^2 + damping |y - x|^2`` over ``lower <= y <= upper``
(Levenberg 1944; Marquardt 1963). A coordinate that the step would move beyond a bound is fixed at that bound,
its contribution to the error is subtracted, and the step is solved again for the others. Every call starts
with all coordinates free, so a coordinate leaves its bound as soon as that reduces the error.
"""

from __future__ import annotations

from collections.abc import Sequence
from operator import gt

import numpy as np

from dynx.spatial.scalar import Floats

_RELATIVE_RIDGE = 1e-10
"""Extra damping, relative to the largest diagonal entry, for a matrix that rounding made indefinite."""


class BoundedStep:
    """The step for fixed bounds on n coordinates; bounds may be infinite."""

    __slots__ = ("_dposv", "_lower", "_upper")

    def __init__(self, lower: Sequence[float], upper: Sequence[float]) -> None:
        # Imported here because scipy.linalg is slow to import and importing dynx must be fast.
        from scipy.linalg.lapack import dposv

        self._dposv = dposv
        self._lower = lower
        self._upper = upper

    def __call__(self, J: Floats, error: Sequence[float], x: Sequence[float], damping: float) -> list[float]:
        """Return the new coordinates y (n,), from J (m, n), error (m,), x (n,) within bounds, damping > 0."""
        residual = np.array(error)
        displacement = self._displacement(J, residual, damping).tolist()
        y = [a + b for a, b in zip(x, displacement, strict=True)]
        if not any(map(gt, self._lower, y)) and not any(map(gt, y, self._upper)):
            return y
        fixed: dict[int, float] = {}
        while True:
            violated = {
                k: low if value < low else high
                for k, (value, low, high) in enumerate(zip(y, self._lower, self._upper, strict=True))
                if value < low or value > high
            }
            if not violated:
                return y
            fixed |= violated
            columns = list(fixed)
            free = J.copy()
            free[:, columns] = 0.0
            fixed_error = J[:, columns].dot([fixed[k] - x[k] for k in columns])
            displacement = self._displacement(free, residual - fixed_error, damping).tolist()
            y = [fixed.get(k, a + b) for k, (a, b) in enumerate(zip(x, displacement, strict=True))]

    def _displacement(self, J: Floats, error: Floats, damping: float) -> Floats:
        # Solve the smaller of two equivalent systems: J'(J J' + d)^-1 e = (J'J + d)^-1 J'e.
        m, n = J.shape
        if m <= n:
            displacement: Floats = self._solve(J.dot(J.T), error, damping).dot(J)
            return displacement
        return self._solve(J.T.dot(J), error.dot(J), damping)

    def _solve(self, A: Floats, b: Floats, damping: float) -> Floats:
        diagonal = A.reshape(-1)[:: len(A) + 1]
        diagonal += damping
        _, solution, not_definite = self._dposv(A, b)
        if not_definite:
            diagonal += _RELATIVE_RIDGE * float(diagonal.max())
            _, solution, not_definite = self._dposv(A, b)
        found: Floats = np.zeros_like(b) if not_definite else solution
        return found
