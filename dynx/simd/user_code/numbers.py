"""Symbols that functions of NumPy accept: the numbers that a user's own code gets when it is traced.

A `TracedNumber` is a `Symbol` that compares, has powers, and dispatches NumPy's functions to
`dynx.simd.user_code.arrays`. Code of dynx computes on plain symbols, which cost less.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Literal, NoReturn

import numpy as np

from dynx.errors import TraceError
from dynx.simd.expr import Op, Symbol, caller_location

MAX_POWER = 64
"""Largest whole exponent of a power, which is computed by products."""

Comparison = Literal["less", "less_equal", "equal"]


class TracedNumber(Symbol):
    """A symbol in a user's own code."""

    __slots__ = ()
    __array_priority__ = 100.0
    # Set by `dynx.simd.user_code.arrays`, which builds on this module.
    __array_ufunc__: Any
    __array_function__: Any

    def _compared(self, op: Comparison, other: Any, *, swapped: bool = False, inverted: bool = False) -> Any:
        index = self._index(other)
        if index is None:
            return NotImplemented
        pair = (index, self.index) if swapped else (self.index, index)
        found = self.graph.apply(op, *pair)
        if inverted:
            found = self.graph.apply("sub", self.graph.constant(1.0), found)
        return Condition(self.graph, found)

    def __lt__(self, other: Any) -> Any:
        return self._compared("less", other)

    def __le__(self, other: Any) -> Any:
        return self._compared("less_equal", other)

    def __gt__(self, other: Any) -> Any:
        return self._compared("less", other, swapped=True)

    def __ge__(self, other: Any) -> Any:
        return self._compared("less_equal", other, swapped=True)

    def __eq__(self, other: Any) -> Any:
        return self._compared("equal", other)

    def __ne__(self, other: Any) -> Any:
        return self._compared("equal", other, inverted=True)

    __hash__ = Symbol.__hash__

    def __pow__(self, exponent: Any) -> Any:
        return power(self, exponent)

    # Names by which NumPy evaluates functions of the entries of an array of objects.

    def conjugate(self) -> TracedNumber:
        """Return the number itself, which is real."""
        return self

    def _refuse_branch(self, *_: object) -> NoReturn:
        raise TraceError(
            f"{caller_location()} branches on a traced value (if, while, and, or, min, max, sorted): use "
            "np.where, np.minimum, np.maximum or np.clip, on arrays made by np.stack or np.zeros_like rather "
            "than by np.array"
        )

    def _refuse_number(self, *_: object) -> NoReturn:
        raise TraceError(
            f"{caller_location()} needs the number of a traced value (float, functions of math, an entry of "
            "an array of floats): use functions of NumPy, and np.zeros_like(measurement.v) for arrays"
        )

    def _refuse_index(self, *_: object) -> NoReturn:
        raise TraceError(
            f"{caller_location()} needs the whole number of a traced value (int, round, an index): use "
            "np.where, or np.interp for a table"
        )

    __bool__ = _refuse_branch
    __float__ = _refuse_number
    __int__ = __index__ = __round__ = __floor__ = _refuse_index


TracedNumber.kind = TracedNumber


class Condition(TracedNumber):
    """A comparison of traced numbers: 1 where it holds, otherwise 0."""

    __slots__ = ()

    def __and__(self, other: Any) -> Any:
        return logical("and", self, other)

    def __or__(self, other: Any) -> Any:
        return logical("or", self, other)

    def __xor__(self, other: Any) -> Any:
        return logical("xor", self, other)

    __rand__, __ror__, __rxor__ = __and__, __or__, __xor__

    def __invert__(self) -> Condition:
        return Condition(self.graph, self.graph.apply("sub", self.graph.constant(1.0), self.index))


def as_symbol(x: Any) -> Any:
    """Return a traced number as a plain symbol of the same node; anything else unchanged."""
    return Symbol(x.graph, x.index) if isinstance(x, TracedNumber) else x


def as_traced(x: Any) -> Any:
    """Return a symbol as a traced number of the same node; anything else unchanged."""
    return TracedNumber(x.graph, x.index) if isinstance(x, Symbol) and type(x) is Symbol else x


def select(condition: Any, yes: Any, no: Any) -> Any:
    """Return `yes` where the condition is true or not 0, otherwise `no`."""
    if not isinstance(condition, Symbol):
        return yes if condition else no
    return _applied("select", condition, yes, no)


def minimum(a: Any, b: Any) -> Any:
    """Return the smaller number, or NaN if either is NaN."""
    return _extreme("min", np.minimum, a, b)


def maximum(a: Any, b: Any) -> Any:
    """Return the larger number, or NaN if either is NaN."""
    return _extreme("max", np.maximum, a, b)


def logical(name: Literal["and", "or", "xor"], a: Any, b: Any) -> Any:
    """Return the condition that both, either or exactly one of two conditions hold."""
    sides = [as_condition(x) for x in (a, b)]
    if not any(isinstance(x, Symbol) for x in sides):
        one, other = map(bool, sides)
        return {"and": one and other, "or": one or other, "xor": one != other}[name]
    if name == "xor":
        equal = _applied("equal", *sides)
        return ~Condition(equal.graph, equal.index)
    found = _applied("mul" if name == "and" else "max", *sides)
    return Condition(found.graph, found.index)


def as_condition(x: Any) -> Any:
    """Return a number as a condition: whether it is not 0."""
    return x if isinstance(x, Condition) else x != 0.0


def power(base: Any, exponent: Any) -> Any:
    """Return base to the power of a number: a whole number, or its half."""
    if isinstance(exponent, Symbol):
        raise TraceError(f"{caller_location()} has a traced exponent; wanted a number")
    if not isinstance(base, Symbol):
        return base**exponent
    twice = 2.0 * float(exponent)
    if twice != round(twice) or abs(exponent) > MAX_POWER:
        raise TraceError(
            f"{caller_location()} has the exponent {exponent:g}; in traced code it is a whole number or its "
            f"half, of at most {MAX_POWER}"
        )
    whole, root = divmod(abs(round(twice)), 2)
    if whole > 2 or (whole and root) or exponent < -1:
        base.graph.reordered = "power"
    found: Any = base.sqrt() if root else None
    square = base
    while whole:
        if whole & 1:
            found = square if found is None else found * square
        whole >>= 1
        square = square * square
    if found is None:
        return 1.0
    return 1.0 / found if exponent < 0 else found


def _extreme(op: Op, of_numbers: Callable[..., Any], a: Any, b: Any) -> Any:
    if not isinstance(a, Symbol):
        a, b = b, a
    if not isinstance(a, Symbol):
        return of_numbers(a, b)
    # The operation returns its second argument if either is NaN.
    found = _applied(op, b, a)
    return _applied("select", _applied("equal", b, b), found, b) if isinstance(b, Symbol) or b != b else found


def _applied(op: Op, *args: Any) -> TracedNumber:
    """Return the traced number of an operation on numbers, of which one is traced."""
    graph = next(x.graph for x in args if isinstance(x, Symbol))
    indices = [x.index if isinstance(x, Symbol) else graph.constant(float(x)) for x in args]
    return TracedNumber(graph, graph.apply(op, *indices))
