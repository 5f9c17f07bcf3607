"""Rounding bound between two computations of one result: counted in operations, not tuned."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

EPS = float(np.finfo(float).eps)


def assert_same_to_rounding(
    actual: ArrayLike, expected: ArrayLike, operations: int, size: float = 1.0
) -> None:
    """Assert equality within `operations` roundings of numbers of magnitude `size`.

    `operations` is the length of the longest chain of float operations that leads to one entry, both sides
    added up. Each operation is off by at most half an EPS of its result, so a bound of EPS per operation
    holds as long as intermediate results do not exceed twice `size`.
    """
    actual, expected = np.asarray(actual), np.asarray(expected)
    assert actual.shape == expected.shape
    bound = operations * EPS * size
    error = float(np.max(np.abs(actual - expected), initial=0.0))
    assert error <= bound, f"off by {error:.3g}, more than {operations} roundings of {size:.3g}: {bound:.3g}"
