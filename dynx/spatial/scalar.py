"""Elementary functions over arrays of any scalar: float64, 50-digit numbers, traced symbols.

The algorithms of `dynx.rbd` are written once and evaluated on several kinds of number. NumPy's
operators already dispatch on the elements of an object array; its ``sin`` does so only where the
element has a method of that name. The functions here close that gap.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]
"""An array of scalars: float64, or object for every other kind of number."""

Floats = NDArray[np.float64]


def sin(x: Array) -> Array:
    """Sine of each element [rad]."""
    return _elementwise("sin", x)


def cos(x: Array) -> Array:
    """Cosine of each element [rad]."""
    return _elementwise("cos", x)


def sqrt(x: Array) -> Array:
    """Square root of each element."""
    return _elementwise("sqrt", x)


def exp(x: Array) -> Array:
    """Exponential of each element."""
    return _elementwise("exp", x)


def tanh(x: Array) -> Array:
    """Hyperbolic tangent of each element."""
    return _elementwise("tanh", x)


def arctan(x: Array) -> Array:
    """Arctangent of each element [rad], between -pi/2 and pi/2."""
    return _elementwise("arctan", x)


def sign(x: Array) -> Array:
    """-1, 0 or 1 of each element."""
    return _elementwise("sign", x)


def clipped(x: Array, limit: Array) -> Array:
    """Each element cut to -limit and limit (the same number of them, or one); infinite is no limit."""
    x = np.asarray(x)
    if x.dtype != object:
        return np.asarray(np.minimum(np.maximum(x, -limit), limit))

    def one(element: Any, most: Any) -> Any:
        if np.isinf(most):
            return element
        if hasattr(element, "bounded"):
            return element.bounded(most)
        return min(max(element, -most), most)

    return np.asarray(np.frompyfunc(one, 2, 1)(x, limit), dtype=object)


def along(x: Any) -> Array:
    """x[..., None]: a scalar per sample, ready to multiply a vector per sample.

    Arithmetic on 0-d object arrays gives bare scalars, which cannot be indexed.
    """
    return np.asarray(np.asarray(x)[..., None])


def _elementwise(function: str, x: Array) -> Array:
    x = np.asarray(x)
    if x.dtype != object:
        return np.asarray(getattr(np, function)(x))

    def one(element: Any) -> Any:
        method = getattr(element, function, None)
        # To mpmath's numbers `exp` is their exponent.
        if callable(method):
            return method()
        import mpmath

        return getattr(mpmath, {"arctan": "atan"}.get(function, function))(element)

    return np.asarray(np.frompyfunc(one, 1, 1)(x), dtype=object)
