"""Equations with a mass matrix, eliminated from the tips of the tree to its root.

Entries stay zero where two joints are on different branches (Featherstone 2008, section 6.5), so that no
operation is spent on them.
"""

from __future__ import annotations

import numpy as np

from dynx.model import Mechanism
from dynx.rbd.aba import inertia_matrix
from dynx.rbd.kinematics import ancestry
from dynx.rbd.linear import Factors, ldl_factors, solve_ldl
from dynx.spatial.scalar import Array


def has_physical_inertias(mechanism: Mechanism) -> bool:
    """Check whether every moving body's inertia is positive semidefinite; then every mass matrix is too.

    Elimination without pivoting is then as accurate as the matrix allows, with a pivot of zero only where the
    matrix is singular. An indefinite matrix may be regular and have such a pivot.
    """
    root = [mechanism.root] if mechanism.floating else []
    inertias = [*root, *(body.inertia for body in mechanism.bodies)]
    if not inertias:
        return True
    values = np.linalg.eigvalsh(np.stack([inertia_matrix(inertia) for inertia in inertias]))
    return bool(np.all(values[:, 0] >= -8 * np.finfo(np.float64).eps * np.abs(values[:, -1])))


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


def factorize_mass_matrix(mechanism: Mechanism, M: Array) -> Factors:
    """Factorise M into L and D by elimination from the tips to the root."""
    nv, filled = filled_entries(mechanism)
    A = np.zeros((nv, nv), dtype=object)
    for i, j in [*filled, *((i, i) for i in range(nv))]:
        A[i, j] = M[nv - 1 - i, nv - 1 - j]
    return ldl_factors(A, filled)


def solve_with_factors(L: list[dict[int, Array]], D: list[Array], b: Array) -> Array:
    """Solve M x = b for right-hand sides b (..., nv), from the factors of M."""
    return solve_ldl(L, D, b[..., ::-1])[..., ::-1]


def solve_mass_matrix(mechanism: Mechanism, M: Array, B: Array) -> Array:
    """Return X (nv, m) with M X = B: floats by LAPACK, any other scalar by factors."""
    if M.dtype != object and B.dtype != object:
        return np.asarray(np.linalg.solve(M, B))
    return np.asarray(solve_with_factors(*factorize_mass_matrix(mechanism, M), B.T).T)
