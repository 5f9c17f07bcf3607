"""How far two correctly rounded ways to one result may be apart: counted, not tuned."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

EPS = float(np.finfo(float).eps)


def assert_same_to_rounding(
    actual: ArrayLike, expected: ArrayLike, operations: int, size: float = 1.0
) -> None:
    """Equal within `operations` roundings of numbers of magnitude `size`.

    `operations` is the length of the longest chain of float operations that leads to one entry, of
    both sides together; each is off by at most half an EPS of its result, so EPS apiece is the
    worst case of chains in which intermediate results do not exceed twice `size`.
    """
    actual, expected = np.asarray(actual), np.asarray(expected)
    assert actual.shape == expected.shape
    bound = operations * EPS * size
    worst = float(np.max(np.abs(actual - expected), initial=0.0))
    assert worst <= bound, f"off by {worst:.3g}, more than {operations} roundings of {size:.3g}: {bound:.3g}"
