"""Solution of equations with the mass matrix in a kernel, by the sparsity due to branches of the tree."""

from __future__ import annotations

import numpy as np

from dynx.model import Mechanism
from dynx.rbd.elimination import filled_entries
from dynx.rbd.linear import Factors, ldl_factors, solve_ldl
from dynx.spatial.scalar import Array


def factorize_mass_matrix(mechanism: Mechanism, M: Array) -> Factors:
    """Factorise M into L and D by elimination from the tips to the root.

    Entries stay zero where two joints are on different branches (Featherstone 2008, section 6.5), so that no
    operation is spent on them.
    """
    nv, filled = filled_entries(mechanism)
    A = np.zeros((nv, nv), dtype=object)
    for i, j in [*filled, *((i, i) for i in range(nv))]:
        A[i, j] = M[nv - 1 - i, nv - 1 - j]
    return ldl_factors(A, filled)


def solve_with_factors(L: list[dict[int, Array]], D: list[Array], b: Array) -> Array:
    """Solve M x = b for right-hand sides b (..., nv), from the factors of M."""
    return solve_ldl(L, D, b[..., ::-1])[..., ::-1]
