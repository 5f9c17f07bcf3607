from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from dynx.spatial.scalar import Array, jacobi_eigen, longdouble

EPS = float(np.finfo(np.longdouble).eps)

entries = st.floats(-1.0, 1.0, allow_subnormal=False)


def _size(A: Array) -> float:
    return float(np.max(np.abs(A)))


@given(st.tuples(*[entries] * 6))
def test_eigenvectors_rebuild_the_matrix_and_are_orthonormal(six: tuple[float, ...]) -> None:
    xx, xy, xz, yy, yz, zz = six
    A = longdouble([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    values, vectors = jacobi_eigen(A)
    # Jacobi rounds once per rotation, nine rotations a sweep, some six sweeps.
    bound = 3 * 9 * 6 * EPS
    assert _size(vectors @ np.diag(values) @ vectors.T - A) <= bound * _size(A)
    assert _size(vectors.T @ vectors - np.eye(3)) <= bound
