"""Functions of NumPy on traced numbers and arrays, by NumPy's own protocols of dispatch.

A `TracedArray` is an array of objects, some of them traced numbers. Arithmetic is that of the entries; what
NumPy would compute by comparing them, or not at all, is computed here. A function that has no traced form
raises TraceError, which names it. Linear systems are solved by Gaussian
elimination with pivots chosen by selection.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from functools import reduce
from typing import Any

import numpy as np

from dynx.errors import TraceError
from dynx.simd.expr import Symbol, caller_location
from dynx.simd.user_code.numbers import (
    TracedNumber,
    as_condition,
    as_symbol,
    as_traced,
    logical,
    maximum,
    minimum,
    power,
    select,
)
from dynx.spatial.scalar import Array


class TracedArray(np.ndarray[Any, np.dtype[np.object_]]):
    """An array of objects in a user's own code that is traced."""

    def __array_ufunc__(self, ufunc: np.ufunc, method: str, *inputs: Any, **options: Any) -> Any:
        return _evaluate_ufunc(ufunc, method, inputs, options)

    def __array_function__(self, function: Any, types: Any, arguments: Any, options: Any) -> Any:
        return _evaluate_function(function, arguments, options)


def traced_array(values: Any) -> TracedArray:
    """Return an array of symbols and numbers for a user's own code."""
    objects = np.asarray(values, dtype=object)
    entries = np.empty(objects.shape, dtype=object)
    entries.ravel()[:] = [as_traced(entry) for entry in objects.ravel().tolist()]
    return entries.view(TracedArray)


def symbol_array(values: Any) -> Array:
    """Return values of a user's own code as an array of plain symbols and numbers."""
    objects = np.asarray(values, dtype=object)
    entries = np.empty(objects.shape, dtype=object)
    entries.ravel()[:] = [as_symbol(entry) for entry in objects.ravel().tolist()]
    return entries


def is_traced(values: Any) -> bool:
    """Check whether a value is a traced number, or an array that has one."""
    if isinstance(values, TracedArray | TracedNumber):
        return True
    return isinstance(values, np.ndarray) and values.dtype == object and any(map(_is_number, values.flat))


def _is_number(entry: Any) -> bool:
    return isinstance(entry, TracedNumber)


def _evaluate_ufunc(ufunc: np.ufunc, method: str, inputs: Any, options: dict[str, Any]) -> Any:
    name = ufunc.__name__
    plain = [_plain(x) for x in inputs]
    out = options.pop("out", None)
    options = {key: value for key, value in options.items() if not (key == "where" and value is True)}
    if method == "reduce" and name in _REDUCED:
        found = _reduced(_REDUCED[name], plain[0], **options)
    elif method == "__call__" and name in _ELEMENTWISE and not options:
        evaluate, exact = _ELEMENTWISE[name]
        if not exact:
            _note_reordered(f"np.{name}", *plain)
        found = np.frompyfunc(evaluate, len(plain), 1)(*plain)
    else:
        if method != "__call__" or name in ("matmul", "vecdot", "matvec", "vecmat"):
            _note_reordered(f"np.{name}", *plain)
        try:
            found = getattr(ufunc, method)(*plain, **options)
        except TypeError as error:
            raise _untraceable(f"np.{name}") from error
    if out is None:
        return _wrapped(found)
    return _written(found, out[0])


def _written(found: Any, target: Any) -> Any:
    """Write a result into an array of the user's, and return that."""
    if target.dtype != object:
        raise TraceError(
            f"{caller_location()} writes traced values into an array of {target.dtype}: make it by "
            "np.zeros_like(measurement.v)"
        )
    np.asarray(target)[...] = found
    return target


def _evaluate_function(function: Any, arguments: Any, options: Any) -> Any:
    found = _FUNCTIONS.get(function)
    if found is not None:
        return _wrapped(found(*arguments, **options))
    module = getattr(function, "__module__", "numpy")
    if module.startswith("numpy.linalg"):
        raise _untraceable(f"np.linalg.{function.__name__}")
    if function.__name__ in _SUMS:
        _note_reordered(f"np.{function.__name__}", *arguments)
    try:
        return _wrapped(function._implementation(*arguments, **options))
    except TypeError as error:
        raise _untraceable(f"np.{function.__name__}") from error


TracedNumber.__array_ufunc__ = TracedArray.__array_ufunc__
TracedNumber.__array_function__ = TracedArray.__array_function__


def _plain(x: Any) -> Array:
    """Return an operand as an ordinary array of objects, with Python's numbers as entries."""
    array = np.asarray(x)
    return array if array.dtype == object else array.astype(object)


def _wrapped(found: Any) -> Any:
    """Return arrays of objects as traced arrays, and arrays without an axis as their entry."""
    if isinstance(found, tuple | list):
        return type(found)(_wrapped(each) for each in found)
    if not isinstance(found, np.ndarray) or found.dtype != object:
        return found
    return found.view(TracedArray) if found.ndim else found[()]


def _untraceable(name: str) -> TraceError:
    return TraceError(
        f"{caller_location()} calls {name}, which has no traced form; functions of numbers that have one are "
        f"{', '.join(sorted(_ELEMENTWISE.keys() | _BY_ENTRIES))}, and np.where, np.interp, np.linalg.solve, "
        "inv and norm"
    )


def _note_reordered(name: str, *operands: Any) -> None:
    """Note in the graph that a kernel rounds a function differently from NumPy."""
    for symbol in _symbols(operands):
        symbol.graph.reordered = name
        return


def _symbols(values: Any) -> Iterator[Symbol]:
    """Yield the symbols in operands."""
    if isinstance(values, Symbol):
        yield values
    elif isinstance(values, np.ndarray):
        if values.dtype == object:
            yield from (entry for entry in np.asarray(values).flat if isinstance(entry, Symbol))
    elif isinstance(values, tuple | list):
        for each in values:
            yield from _symbols(each)


# -- functions of entries -----------------------------------------------------------------------------


def _compared(name: str) -> Callable[[Any, Any], Any]:
    def evaluate(a: Any, b: Any) -> Any:
        return getattr(a, name)(b) if isinstance(a, Symbol) else getattr(b, _MIRRORED[name])(a)

    def compare(a: Any, b: Any) -> Any:
        if isinstance(a, Symbol) or isinstance(b, Symbol):
            return evaluate(a, b)
        return getattr(float(a), name)(float(b))

    return compare


_MIRRORED = {
    "__lt__": "__gt__",
    "__le__": "__ge__",
    "__gt__": "__lt__",
    "__ge__": "__le__",
    "__eq__": "__eq__",
    "__ne__": "__ne__",
}


def _of_numbers(name: str, traced: Callable[..., Any]) -> Callable[..., Any]:
    """Return a function of entries: `traced` if one is a symbol, otherwise NumPy's function of that name."""
    of_floats = getattr(np, name)

    def evaluate(*entries: Any) -> Any:
        if any(isinstance(x, Symbol) for x in entries):
            return traced(*entries)
        return of_floats(*entries).item()

    return evaluate


def _hypot(a: Any, b: Any) -> Any:
    return (a * a + b * b).sqrt()


def _arctan2(y: Any, x: Any) -> Any:
    """Return the angle of a point, by the arctangent of the smaller over the larger coordinate."""
    steep = abs(y) > abs(x)
    ratio = select(steep, x, y) / select(steep, y, x)
    flat = as_traced(ratio).arctan()
    quarter = select(y < 0.0, -0.5 * math.pi, 0.5 * math.pi)
    half = select(x < 0.0, select(y < 0.0, -math.pi, math.pi), 0.0)
    at_origin = logical("and", x == 0.0, y == 0.0)
    return select(at_origin, 0.0, select(steep, quarter - flat, half + flat))


def _arcsin(x: Any) -> Any:
    return _arctan2(x, ((1.0 - x) * (1.0 + x)).sqrt())


def _arccos(x: Any) -> Any:
    return _arctan2(((1.0 - x) * (1.0 + x)).sqrt(), x)


def _cosh(x: Any) -> Any:
    return 0.5 * (x.exp() + (-x).exp())


def _sign(x: Any) -> Any:
    return x.sign() if isinstance(x, Symbol) else float(np.sign(x))


_ELEMENTWISE: dict[str, tuple[Callable[..., Any], bool]] = {
    "minimum": (minimum, True),
    "maximum": (maximum, True),
    "clip": (lambda x, low, high: _clipped(x, low, high), True),
    "sign": (_sign, True),
    "less": (_compared("__lt__"), True),
    "less_equal": (_compared("__le__"), True),
    "greater": (_compared("__gt__"), True),
    "greater_equal": (_compared("__ge__"), True),
    "equal": (_compared("__eq__"), True),
    "not_equal": (_compared("__ne__"), True),
    "logical_and": (lambda a, b: logical("and", a, b), True),
    "logical_or": (lambda a, b: logical("or", a, b), True),
    "logical_xor": (lambda a, b: logical("xor", a, b), True),
    "logical_not": (lambda x: ~as_condition(x) if isinstance(x, Symbol) else not x, True),
    "isnan": (_of_numbers("isnan", lambda x: x != x), True),
    "isfinite": (_of_numbers("isfinite", lambda x: abs(x) < math.inf), True),
    "isinf": (_of_numbers("isinf", lambda x: abs(x) == math.inf), True),
    "heaviside": (_of_numbers("heaviside", lambda x, h: select(x == 0.0, h, 1.0 * (x > 0.0))), True),
    "square": (lambda x: x * x, True),
    "reciprocal": (lambda x: 1.0 / x, True),
    "fabs": (abs, True),
    # A power notes by itself whether it is rounded as NumPy rounds it.
    "power": (power, True),
    "float_power": (power, False),
    "hypot": (_of_numbers("hypot", _hypot), False),
    "tan": (_of_numbers("tan", lambda x: x.sin() / x.cos()), False),
    "arctan2": (_of_numbers("arctan2", _arctan2), False),
    "arcsin": (_of_numbers("arcsin", _arcsin), False),
    "arccos": (_of_numbers("arccos", _arccos), False),
    "cosh": (_of_numbers("cosh", _cosh), False),
    "sinh": (_of_numbers("sinh", lambda x: x.tanh() * _cosh(x)), False),
    **{
        name: (_of_numbers(name, lambda x, factor=factor: x * factor), False)
        for name, factor in (
            ("deg2rad", math.pi / 180.0),
            ("radians", math.pi / 180.0),
            ("rad2deg", 180.0 / math.pi),
            ("degrees", 180.0 / math.pi),
        )
    },
    **{
        name: (_of_numbers(name, lambda x, name=name: getattr(x, name)()), True)
        for name in ("sqrt", "sin", "cos", "exp", "tanh", "arctan")
    },
}
"""Functions of entries by the name of NumPy's function, and whether a kernel rounds them as NumPy does.

Sine, cosine, exp, tanh and arctan are operations of the graph, by which their rounding is known.
"""

_BY_ENTRIES = frozenset({"add", "subtract", "multiply", "divide", "negative", "absolute", "matmul"})
"""Functions that NumPy evaluates by the operators of the entries."""

_SUMS = frozenset({"dot", "inner", "vdot", "tensordot", "einsum"})
"""Functions that add floats in an order of their own, besides those that reduce by np.add or np.multiply."""

_REDUCED: dict[str, Callable[[Any, Any], Any]] = {
    "maximum": maximum,
    "minimum": minimum,
    "logical_and": lambda a, b: logical("and", a, b),
    "logical_or": lambda a, b: logical("or", a, b),
}


def _clipped(x: Any, low: Any, high: Any) -> Any:
    """Return x within bounds, which may be None."""
    found = x if low is None else maximum(x, low)
    return found if high is None else minimum(found, high)


def _reduced(
    function: Callable[[Any, Any], Any], array: Array, axis: Any = 0, keepdims: bool = False, **rest: Any
) -> Any:
    rest = {name: value for name, value in rest.items() if value is not None and name != "dtype"}
    if rest.pop("initial", np._NoValue) is not np._NoValue or rest:
        raise TraceError(f"{caller_location()} has a reduction with {', '.join(rest) or 'initial'}")
    axes = range(array.ndim) if axis is None else (axis,) if isinstance(axis, int) else axis
    kept = [k for k in range(array.ndim) if k not in {each % array.ndim for each in axes}]
    shape = [array.shape[k] for k in kept]
    moved = np.transpose(array, [*kept, *(k for k in range(array.ndim) if k not in kept)])
    rows = moved.reshape(*shape, -1)
    entries = np.empty(shape, dtype=object)
    for place in np.ndindex(*shape):
        entries[place] = reduce(function, rows[place].tolist())
    if keepdims:
        return entries.reshape([array.shape[k] if k in kept else 1 for k in range(array.ndim)])
    return entries


# -- functions of arrays ------------------------------------------------------------------------------


def _where(condition: Any, *sides: Any) -> Any:
    if len(sides) != 2:
        raise TraceError(
            f"{caller_location()} calls np.where without values: wanted np.where(condition, x, y)"
        )
    return np.frompyfunc(select, 3, 1)(*(_plain(each) for each in (condition, *sides)))


def _clip(x: Any, a_min: Any = None, a_max: Any = None, **options: Any) -> Any:
    low, high, out = options.pop("min", a_min), options.pop("max", a_max), options.pop("out", None)
    if options:
        raise TraceError(f"{caller_location()} calls np.clip with {', '.join(options)}")
    found = np.frompyfunc(_clipped, 3, 1)(*(_plain(each) for each in (x, low, high)))
    return found if out is None else _written(found, out)


def _interp(x: Any, xp: Any, fp: Any) -> Any:
    places, values = (np.asarray(each, dtype=np.float64) for each in (xp, fp))
    _note_reordered("np.interp", _plain(x))

    def at(entry: Any) -> Any:
        if not isinstance(entry, Symbol):
            return float(np.interp(entry, places, values))
        found: Any = values[0].item()
        for k in range(len(places) - 1):
            slope = (values[k + 1] - values[k]) / (places[k + 1] - places[k])
            line = values[k].item() + (entry - places[k].item()) * slope.item()
            found = select(entry >= places[k].item(), line, found)
        found = select(entry >= places[-1].item(), values[-1].item(), found)
        return select(entry != entry, entry, found)

    return np.frompyfunc(at, 1, 1)(_plain(x))


def _norm(x: Any, ord: Any = None, axis: Any = None, keepdims: bool = False) -> Any:
    array = _plain(x)
    # The Frobenius norm of a matrix, by default or by name.
    if ord not in ((None, 2) if array.ndim == 1 or isinstance(axis, int) else (None, "fro")):
        raise TraceError(f"{caller_location()} calls np.linalg.norm with ord={ord!r}; wanted the 2-norm")
    _note_reordered("np.linalg.norm", array)
    return np.sqrt(traced_array(np.sum(array * array, axis=axis, keepdims=keepdims)))


def _solve(A: Any, b: Any) -> Any:
    matrix, right = _plain(A), _plain(b)
    _note_reordered("np.linalg.solve", matrix, right)
    return solve(matrix, right)


_FUNCTIONS: dict[Any, Callable[..., Any]] = {
    np.where: _where,
    np.clip: _clip,
    np.interp: _interp,
    np.linalg.norm: _norm,
    np.linalg.solve: _solve,
    np.linalg.inv: lambda A: _solve(A, np.eye(len(A))),
}


MAX_SOLVED_SIZE = 18
"""Largest number of unknowns: a quadruped has 18 coordinates, and 24 take 8 s to compile."""


def solve(matrix: Array, right: Array) -> Array:
    """Return x of matrix (n, n) x = right, (n,) or (n, k).

    The pivot of each column is its largest entry, as in LAPACK. A singular matrix of symbols gives infinities
    or NaN. Raises TraceError for one of numbers, for other shapes and for more than `MAX_SOLVED_SIZE`
    unknowns.
    """
    n = len(matrix)
    if matrix.shape != (n, n) or right.ndim not in (1, 2) or len(right) != n:
        raise TraceError(
            f"{caller_location()} solves a system of shapes {matrix.shape} and {right.shape}; wanted "
            "(n, n) and (n,) or (n, k)"
        )
    if n > MAX_SOLVED_SIZE:
        raise TraceError(
            f"{caller_location()} solves for {n} unknowns; traced code solves for at most {MAX_SOLVED_SIZE}. "
            "forward_dynamics of control.model_dynamics solves with the mass matrix of any robot"
        )
    columns = right.reshape(n, -1)
    rows = [[*row, *side] for row, side in zip(matrix.tolist(), columns.tolist(), strict=True)]
    for k in range(n):
        for i in range(k + 1, n):
            rows[k], rows[i] = _ordered(rows[k], rows[i], k)
        for i in range(k + 1, n):
            factor = _quotient(rows[i][k], rows[k][k])
            pairs = zip(rows[k][k + 1 :], rows[i][k + 1 :], strict=True)
            rows[i][k + 1 :] = [entry - factor * above for above, entry in pairs]
    for k in reversed(range(n)):
        for j in range(n, n + columns.shape[1]):
            total = rows[k][j]
            for i in range(k + 1, n):
                total = total - rows[k][i] * rows[i][j]
            rows[k][j] = _quotient(total, rows[k][k])
    solution = np.empty(columns.shape, dtype=object)
    for k in range(n):
        solution[k] = rows[k][n:]
    return solution.reshape(right.shape)


def _ordered(one: list[Any], other: list[Any], column: int) -> tuple[list[Any], list[Any]]:
    """Return two rows, the one with the larger entry in the column first."""
    exchanged = abs(other[column]) > abs(one[column])
    pairs = list(zip(one, other, strict=True))
    return [select(exchanged, b, a) for a, b in pairs], [select(exchanged, a, b) for a, b in pairs]


def _quotient(a: Any, b: Any) -> Any:
    if not isinstance(b, Symbol) and not b:
        raise TraceError(f"{caller_location()} solves a system with a singular matrix")
    return a / b
