"""Extended precision: NumPy's long double, in which inertias are lumped and turned before they are rounded.

It has 64 bits or more of mantissa where the platform has such a type, and those of float64 elsewhere.
"""

from __future__ import annotations

import numpy as np

from dynx.spatial.scalar import Array

FLOAT64_EPS = float(np.finfo(np.float64).eps)
"""Distance from 1.0 to the next double, 2.2e-16: what extended precision is there to stay below."""


def longdouble(numbers: object) -> Array:
    """The numbers as an array of long doubles."""
    return np.asarray(numbers, dtype=np.longdouble)


def eigen(symmetric: Array) -> tuple[Array, Array]:
    """Eigenvalues (3,) and eigenvectors (3, 3), as columns, of a symmetric matrix, by Jacobi's method.

    Works in the precision of `symmetric`, which LAPACK does not (Golub and Van Loan, Matrix
    Computations, section 8.5).
    """
    A = np.array(symmetric)
    V = np.eye(3, dtype=A.dtype)
    floor = np.finfo(A.dtype).eps ** 2 * np.max(np.abs(A))
    for _ in range(50):
        if max(abs(A[0, 1]), abs(A[0, 2]), abs(A[1, 2])) <= floor:
            break
        for i, j in ((0, 1), (0, 2), (1, 2)):
            if abs(A[i, j]) <= floor:
                continue
            ratio = (A[j, j] - A[i, i]) / (2 * A[i, j])
            tangent = (1 if ratio >= 0 else -1) / (abs(ratio) + np.hypot(ratio, 1))
            cosine = 1 / np.hypot(tangent, 1)
            sine = tangent * cosine
            turn = np.eye(3, dtype=A.dtype)
            turn[i, i] = turn[j, j] = cosine
            turn[i, j], turn[j, i] = sine, -sine
            A = turn.T @ A @ turn
            A[i, j] = A[j, i] = 0
            V = V @ turn
    return np.diagonal(A).copy(), V
