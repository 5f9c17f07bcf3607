"""Elementary functions over arrays of any scalar type: float64, 50-digit numbers, traced symbols.

The algorithms of `dynx.rbd` are written once and evaluated on several scalar types. NumPy's operators
dispatch on the elements of an object array, but ``np.sin`` does so only if the element has a method of that
name, which 50-digit numbers lack. The functions here work on all of them.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]
"""An array of scalars: dtype float64, or object for every other scalar type."""

Floats = NDArray[np.float64]
"""An array of float64."""


def _elementwise(function: str) -> Callable[[Array], Array]:
    """Make NumPy's function of this name for floats, the element's method or mpmath's function for others."""

    def evaluate_one(element: Any) -> Any:
        method = getattr(element, function, None)
        # `exp` of an mpmath number is an attribute, its exponent.
        if callable(method):
            return method()
        import mpmath  # only the referee needs it; importing dynx must not load it

        return getattr(mpmath, {"arctan": "atan"}.get(function, function))(element)

    of_floats, of_objects = getattr(np, function), np.frompyfunc(evaluate_one, 1, 1)

    def evaluate(x: Array) -> Array:
        x = np.asarray(x)
        if x.dtype != object:
            return np.asarray(of_floats(x))
        return np.asarray(of_objects(x), dtype=object)

    return evaluate


sin = _elementwise("sin")
"""Sine of each element [rad]."""
cos = _elementwise("cos")
"""Cosine of each element [rad]."""
sqrt = _elementwise("sqrt")
"""Square root of each element."""
exp = _elementwise("exp")
"""Exponential of each element."""
tanh = _elementwise("tanh")
"""Hyperbolic tangent of each element."""
arctan = _elementwise("arctan")
"""Arctangent of each element [rad], between -pi/2 and pi/2."""
sign = _elementwise("sign")
"""Sign of each element: -1, 0 or 1."""


def clamp(x: Array, limit: Array | float) -> Array:
    """Clamp each element of x (..., n) to [-limit, limit]; `limit`, (n,) or a scalar, may be infinite."""
    x = np.asarray(x)
    if x.dtype != object:
        return np.asarray(np.minimum(np.maximum(x, -limit), limit))

    def clamp_one(element: Any, bound: Any) -> Any:
        if np.isinf(bound):
            return element
        if hasattr(element, "clamp"):
            return element.clamp(bound)
        return min(max(element, -bound), bound)

    return np.asarray(np.frompyfunc(clamp_one, 2, 1)(x, limit), dtype=object)


def where_less(a: Array | float, b: Array | float, yes: Array | float, no: Array | float) -> Array:
    """Return `yes` where a < b and `no` elsewhere, also where a or b is NaN; the arguments broadcast."""
    numbers: list[Array] = [np.asarray(each) for each in (a, b, yes, no)]
    if all(each.dtype != object for each in numbers):
        return np.where(numbers[0] < numbers[1], numbers[2], numbers[3])
    return np.asarray(_where_less_of_objects(*numbers), dtype=object)


def _where_less_one(a: Any, b: Any, yes: Any, no: Any) -> Any:
    # A traced symbol has methods instead of operators that compare.
    mask = a.less(b) if hasattr(a, "less") else b.more(a) if hasattr(b, "more") else a < b
    return mask.select(yes, no) if hasattr(mask, "select") else yes if mask else no


_where_less_of_objects = np.frompyfunc(_where_less_one, 4, 1)


def less(a: Any, b: Any) -> Any:
    """Return 1 where the number a < b, otherwise 0; a traced symbol for symbols."""
    traced = _traced(a, b)
    return float(a < b) if traced is None else traced("less", a, b)


def less_equal(a: Any, b: Any) -> Any:
    """Return 1 where the number a <= b, otherwise 0; a traced symbol for symbols."""
    traced = _traced(a, b)
    return float(a <= b) if traced is None else traced("less_equal", a, b)


def equal(a: Any, b: Any) -> Any:
    """Return 1 where the number a == b, otherwise 0; a traced symbol for symbols."""
    traced = _traced(a, b)
    return float(a == b) if traced is None else traced("equal", a, b)


def select(condition: Any, yes: Any, no: Any) -> Any:
    """Return `yes` where the number `condition` is not 0, otherwise `no`; a traced symbol for symbols."""
    traced = _traced(condition, yes, no)
    if traced is None:
        return yes if condition != 0.0 else no
    return traced("select", condition, yes, no)


def minimum(a: Any, b: Any) -> Any:
    """Return the smaller of two numbers; b if either is NaN; a traced symbol for symbols."""
    traced = _traced(a, b)
    if traced is None:
        return a if a < b else b
    return traced("min", a, b)


def maximum(a: Any, b: Any) -> Any:
    """Return the larger of two numbers; b if either is NaN; a traced symbol for symbols."""
    traced = _traced(a, b)
    if traced is None:
        return a if a > b else b
    return traced("max", a, b)


def _traced(*numbers: Any) -> Callable[..., Any] | None:
    """Return the function that applies an operation, by name, to the numbers; None without symbols."""
    for number in numbers:
        operation: Callable[..., Any] | None = getattr(number, "traced_operation", None)
        if operation is not None:
            return operation
    return None


def arctan2(y: Array, x: Array) -> Array:
    """Return the angle [rad] of the point (x, y), between -pi and pi; 0 at the origin."""
    y, x = np.asarray(y), np.asarray(x)
    if y.dtype != object and x.dtype != object:
        return np.asarray(np.arctan2(y, x))
    width, height = abs(x), abs(y)
    longer, shorter = where_less(width, height, height, width), where_less(width, height, width, height)
    # The quotient is 0 at the origin.
    angle = arctan(shorter / where_less(0.0, longer, longer, 1.0))
    angle = where_less(width, height, 0.5 * math.pi - angle, angle)
    angle = where_less(x, 0.0, math.pi - angle, angle)
    return where_less(y, 0.0, -angle, angle)


def append_axis(x: Any) -> Array:
    """Return x[..., None]: one scalar per sample, ready to multiply one vector per sample.

    Arithmetic on 0-d object arrays returns bare scalars, which cannot be indexed; hence `np.asarray`.
    """
    return np.asarray(np.asarray(x)[..., None])


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
