"""Extended precision (NumPy's long double), in which inertias are merged and rotated before rounding.

Its mantissa has 64 bits or more where the platform has such a type, and the 53 of float64 elsewhere.
"""

from __future__ import annotations

import numpy as np

from dynx.spatial.scalar import Array

FLOAT64_EPS = float(np.finfo(np.float64).eps)
"""Machine epsilon of float64, 2.2e-16: the distance from 1.0 to the next double."""


def longdouble(numbers: object) -> Array:
    """Convert nested numbers to an array of long doubles."""
    return np.asarray(numbers, dtype=np.longdouble)


def jacobi_eigen(symmetric: Array) -> tuple[Array, Array]:
    """Return the eigenvalues (3,) and eigenvectors (3, 3), as columns, of a symmetric matrix.

    Jacobi's method (Golub and Van Loan, Matrix Computations, section 8.5), in the precision of
    `symmetric`; LAPACK works in float64 only.
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
            rotation = np.eye(3, dtype=A.dtype)
            rotation[i, i] = rotation[j, j] = cosine
            rotation[i, j], rotation[j, i] = sine, -sine
            A = rotation.T @ A @ rotation
            A[i, j] = A[j, i] = 0
            V = V @ rotation
    return np.diagonal(A).copy(), V
