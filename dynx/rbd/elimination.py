"""Pattern of the factors of a mass matrix, eliminated from the tips of the tree to its root."""

from __future__ import annotations

import numpy as np

from dynx.model import Mechanism
from dynx.rbd.kinematics import ancestry


def filled_entries(mechanism: Mechanism) -> tuple[int, list[tuple[int, int]]]:
    """Return nv, and the positions where L may differ from zero, in the order of elimination."""
    base = 6 if mechanism.floating else 0
    on_branch = np.zeros((mechanism.nv, mechanism.nv), dtype=bool)
    on_branch[:base] = True
    for body in range(len(mechanism.bodies)):
        on_branch[[base + k for k in ancestry(mechanism, body)], base + body] = True
    if mechanism.coupling is not None:
        S = mechanism.coupling.matrix() != 0.0
        on_branch = S.T @ (on_branch | on_branch.T) @ S
    A = (on_branch | on_branch.T)[::-1, ::-1]
    nv = len(A)
    for i in range(nv):
        for j in range(i):
            A[i, j] = A[i, j] or np.any(A[i, :j] & A[j, :j])
    return nv, [(i, j) for i in range(nv) for j in range(i) if A[i, j]]
