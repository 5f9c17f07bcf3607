"""How well a mean is known."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

CONFIDENCE = 0.95


def confidence_interval(values: NDArray[np.float64]) -> tuple[float, float]:
    """Return the interval of Student's t that holds the true mean with the probability `CONFIDENCE`;
    unbounded for one value."""
    from scipy.stats import t  # takes half a second to import

    mean, count = float(values.mean()), len(values)
    if count < 2:
        return -np.inf, np.inf
    reach = float(t.ppf(0.5 + 0.5 * CONFIDENCE, count - 1)) * float(values.std(ddof=1)) / np.sqrt(count)
    return mean - reach, mean + reach


def mean_of_runs(means: Sequence[float]) -> tuple[float, tuple[float, float]]:
    """Return the mean over runs with several seeds, and its 95 % interval: each run counts once."""
    values = np.array(means)
    return float(values.mean()), confidence_interval(values)
