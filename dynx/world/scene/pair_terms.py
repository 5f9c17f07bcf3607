"""Terms whose sums over pairs are given: how engines that add coefficients of two surfaces get others.

Surfaces of one material that touch the same materials have the same term. Of the equations x_i + x_j = w_ij
as many as possible are solved exactly with terms of at least zero; the others are left to the caller.
"""

from __future__ import annotations

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
