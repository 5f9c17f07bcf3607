"""Priorities with which MuJoCo's contacts get the mean coefficients of their two materials.

MuJoCo knows no mean: a contact has the coefficients of the geom with the higher priority, or those of an
explicit pair of geoms. Where the mean is the same for all partners of a geom, the geom gets it, with a
priority above its partners, as a robot on a ground does. The contacts that remain become explicit pairs,
which take time in every step.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray


class Priorities(NamedTuple):
    """The combination (n,) and the priority (n,) of each part, and the pairs that have their own."""

    combination: NDArray[np.intp]
    priority: NDArray[np.intp]
    pairs: tuple[tuple[int, int], ...]


def contact_priorities(
    materials: NDArray[np.intp], combination: NDArray[np.intp], touch: NDArray[np.bool_]
) -> Priorities:
    """Return priorities of parts with the materials (n,) of which those in `touch` (n, n) may touch.

    `combination` (m, m) numbers the coefficients of two materials.
    """
    n = len(materials)
    # How many partners without a priority want each combination of a part.
    wanted = np.zeros((n, int(combination.max(initial=0)) + 1), dtype=np.intp)
    for k in range(len(combination)):
        np.add.at(wanted, (np.arange(n), combination[materials, k]), touch[:, materials == k].sum(axis=1))
    found = combination[materials, materials].copy()
    priority, open_ = np.zeros(n, dtype=np.intp), np.ones(n, dtype=bool)
    pairs: list[tuple[int, int]] = []
    level = 0
    while open_.any():
        # Parts with few partners that want something else come first; those leave fewest pairs.
        others = np.where(open_, wanted.sum(axis=1) - wanted.max(axis=1), n + 1)
        first = int(np.argmin(others))
        value = _most_wanted(wanted[first], found[first])
        chosen = np.array([first])
        if others[first] == 0:
            same = [_most_wanted(wanted[k], found[k]) == value for k in np.flatnonzero(others == 0)]
            chosen = np.flatnonzero(others == 0)[same]
        open_[chosen] = False
        found[chosen], priority[chosen] = value, -level
        level += 1
        for k in chosen.tolist():
            partners = np.flatnonzero(touch[k] & open_)
            each = combination[materials[k], materials[partners]]
            wanted[partners, each] -= 1
            pairs += [(k, j) for j in partners[each != value].tolist()]
    return Priorities(found, priority - priority.min(initial=0), tuple(pairs))


def _most_wanted(counts: NDArray[np.intp], own: int) -> int:
    """Return the combination that most partners want, or its own for a part without partners."""
    return int(np.argmax(counts)) if counts.any() else own


def contact_directions(sliding: float, torsional: float, rolling: float) -> int:
    """Return MuJoCo's number of directions (condim) in which a contact with these coefficients has forces."""
    return 6 if rolling else 4 if torsional else 3 if sliding else 1
