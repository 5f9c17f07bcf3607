"""Rows of constraints under the elimination of a tree from its tips to its root: the Delassus matrix.

With M = L D L' (`dynx.rbd.elimination`) and rows J of constraints, Y = J L^-T has entries only at the joints
that move the bodies of a row, and at their ancestors. So J M^-1 J' takes operations only for pairs of rows
that have an ancestor in common (Featherstone 2008, section 6.5).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from dynx.spatial.scalar import Array

SparseRow = dict[int, Array]
"""Entries of a row by their place in the order of elimination, from the tips to the root."""


class EliminatedRows(NamedTuple):
    """Rows J of constraints, with the tips eliminated: Y = J L^-T for M = L D L'.

    A row has entries only at the joints that move its bodies, and at their ancestors. With Z = Y D^-1 the
    Delassus matrix is J M^-1 J' = Z Y'; a step of whitened rows X = Y D^-1/2 would need square roots.
    """

    Y: list[SparseRow]
    Z: list[SparseRow]

    def product(self, i: int, j: int) -> Array | float:
        """Return entry (i, j) of J M^-1 J'."""
        found: Array | float = 0.0
        for k, entry in self.Z[i].items():
            if k in self.Y[j]:
                found = found + entry * self.Y[j][k]
        return found

    def delassus_matrix(self) -> Array:
        """Return J M^-1 J' (m, m), of which each pair of entries is computed once."""
        m = len(self.Y)
        G = np.zeros((m, m), dtype=object)
        for i in range(m):
            for j in range(i + 1):
                G[i, j] = G[j, i] = self.product(i, j)
        return G


def eliminate_rows(L: list[dict[int, Array]], D: list[Array], rows: Sequence[SparseRow]) -> EliminatedRows:
    """Eliminate the tips from rows of constraints, given the factors of M."""
    Y: list[SparseRow] = []
    for row in rows:
        found: SparseRow = {}
        for i, factors in enumerate(L):
            entry = row.get(i)
            for k, factor in factors.items():
                if k in found:
                    entry = -(factor * found[k]) if entry is None else entry - factor * found[k]
            if entry is not None:
                found[i] = entry
        Y.append(found)
    return EliminatedRows(Y, [{k: entry / D[k] for k, entry in row.items()} for row in Y])


def eliminate_tips(L: list[dict[int, Array]], b: Array) -> list[Array]:
    """Return L^-1 b (nv,) in the order of elimination."""
    found: list[Array] = []
    for i, row in enumerate(L):
        entry = b[len(L) - 1 - i]
        for k, factor in row.items():
            entry = entry - factor * found[k]
        found.append(entry)
    return found


def substitute_back(L: list[dict[int, Array]], x: Sequence[Array]) -> Array:
    """Return L^-T x (nv,) in the order of the coordinates, for x in the order of elimination."""
    found = list(x)
    for i in reversed(range(len(L))):
        for k, factor in L[i].items():
            found[k] = found[k] - factor * found[i]
    return np.array(found[::-1], dtype=object)
