"""Coefficients by which an engine's rule for two surfaces gives each contact the geometric mean of theirs.

**Sums** (`pair_terms`): engines that add a term of each surface. Surfaces of one material that touch the same
materials have the same term. Of the equations x_i + x_j = w_ij as many as possible are solved exactly with
terms of at least zero; the others are left to the caller.

**Priorities** (`contact_priorities`): MuJoCo knows no mean. A contact has the coefficients of the geom with
the higher priority, or those of an explicit pair of geoms. Where the mean is the same for all partners of a
geom, the geom gets it, with a priority above its partners, as a robot on a ground does. The contacts that
remain become explicit pairs, which take time in every step.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dynx.spatial.scalar import Floats

CLOSE = 1e-12
"""Relative difference of two terms that counts as none."""


def pair_terms(materials: NDArray[np.intp], wanted: Floats, pairs: NDArray[np.bool_]) -> Floats:
    """Return the term (n,) of each surface, 0 for one without pairs.

    `materials` (n,) numbers the materials, `wanted` (m, m) is the sum for each two of them, NaN where any
    will do; `pairs` (n, n) are the surfaces that may touch.
    """
    if not pairs.any():
        return np.zeros(len(pairs))
    counted = np.isfinite(wanted)
    present = range(len(wanted))
    touched = np.column_stack([pairs[:, materials == k].any(axis=1) for k in present])
    touched &= counted[materials]
    _, first, kind = np.unique(
        np.column_stack([materials, touched]), axis=0, return_index=True, return_inverse=True
    )
    kind = kind.reshape(-1)
    reach = np.stack([pairs[kind == k].any(axis=0) for k in range(len(first))])
    touch = np.column_stack([reach[:, kind == k].any(axis=1) for k in range(len(first))])
    sums = wanted[np.ix_(materials[first], materials[first])]
    return _solve(sums, touch & np.isfinite(sums))[kind]


def _solve(sums: Floats, touch: NDArray[np.bool_]) -> Floats:
    """Return one term for each kind of surface, in the order of how many of its equations are decided."""
    own = touch.diagonal()
    terms = np.where(own, 0.5 * sums.diagonal(), np.nan)
    terms[~touch.any(axis=1)] = 0.0
    while np.isnan(terms).any():
        open_ = np.isnan(terms)
        decided = np.where(open_, (touch & ~open_).sum(axis=1), -1)
        k = int(np.argmax(decided))
        if decided[k] == 0:
            # Nothing is decided here: half of the least sum leaves every partner a term above zero.
            k = int(np.argmax(np.where(open_, touch.sum(axis=1), -1)))
            terms[k] = 0.5 * sums[k, touch[k]].min()
            continue
        partners = touch[k] & ~open_
        terms[k] = _most_frequent(sums[k, partners] - terms[partners], sums[k, partners])
    return terms


def _most_frequent(candidates: Floats, scale: Floats) -> float:
    """Return the candidate, at least zero, that agrees with most of the others; 0 if there is none."""
    valid = candidates >= -CLOSE * scale
    if not valid.any():
        return 0.0
    agree = abs(np.subtract.outer(candidates, candidates)) <= CLOSE * scale
    return max(0.0, float(candidates[np.argmax(np.where(valid, agree.sum(axis=0), -1))]))


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
