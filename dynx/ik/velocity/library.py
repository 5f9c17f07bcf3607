"""Quadratic programmes, solved by DAQP (Arnstrom, Bemporad and Axehill, A dual active-set solver for embedded
quadratic programming using recursive LDL' updates, IEEE Trans. Automatic Control 67(8), 2022)."""

from __future__ import annotations

from typing import Any

import numpy as np

from dynx.errors import NotInstalledError
from dynx.spatial.scalar import Floats

_UNLIMITED = 1e30
"""Bound from which on DAQP takes a constraint as absent."""

_EQUALITY = 5
"""Kind of a constraint whose two bounds are one value."""

PRIMAL_TOLERANCE = 1e-11
"""Violation of a constraint that counts as rounding, relative to constraints of norm 1."""

_SOLVED = 1


def solve_programme(
    H: Floats, g: Floats, lower: Floats, upper: Floats, A: Floats, b: Floats, G: Floats, least: Floats
) -> Floats | None:
    """Return the x (n,) that minimises x'Hx / 2 + g'x over lower <= x <= upper, A x = b and G x >= least.

    H (n, n) is positive definite. Returns None if no x satisfies the constraints. Raises NotInstalledError
    without DAQP.
    """
    try:
        import daqp
    except ImportError:
        raise NotInstalledError("velocity_ik needs daqp: pip install 'dynx[qp]'") from None
    # Rows of norm 1 give the tolerance one meaning for all constraints.
    rows, values = np.concatenate([A, G]), np.concatenate([b, least])
    norms = np.linalg.norm(rows, axis=1, keepdims=True)
    norms[norms == 0.0] = 1.0
    rows, values = rows / norms, values / norms[:, 0]
    equal, count = slice(len(upper), len(upper) + len(A)), len(A)
    high = np.concatenate([np.minimum(upper, _UNLIMITED), values[:count], np.full(len(G), _UNLIMITED)])
    low = np.concatenate([np.maximum(lower, -_UNLIMITED), values])
    kinds = np.zeros(len(high), dtype=np.int32)
    kinds[equal] = _EQUALITY
    kinds[: len(upper)][lower == upper] = _EQUALITY
    found: tuple[Floats, float, int, Any] = daqp.solve(
        np.ascontiguousarray(H), np.ascontiguousarray(g), np.ascontiguousarray(rows), high, low, kinds,
        primal_tol=PRIMAL_TOLERANCE,
    )  # fmt: skip
    x, _, outcome, _ = found
    # The bounds hold exactly, not only within the tolerance.
    return np.clip(np.asarray(x), lower, upper) if outcome == _SOLVED else None
