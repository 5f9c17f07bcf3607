"""Expressions: a graph in which every value exists once, and the numbers that build it.

A `Graph` is an arena of nodes, each an operation on earlier nodes. It is hash-consed: the same
operation on the same arguments is the same node, so common subexpressions never exist twice. A
`Symbol` names a node and overloads arithmetic, so that array code written for numbers builds the
graph when it is run on arrays of symbols.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from typing import Any, Final, Literal, NamedTuple, NoReturn

from dynx.errors import TraceError

Op = Literal[
    "input",
    "constant",
    "add",
    "sub",
    "mul",
    "div",
    "neg",
    "abs",
    "sqrt",
    "sin",
    "cos",
    "exp",
    "tanh",
    "arctan",
    "min",
    "max",
]

ARITY: Final[dict[Op, int]] = {
    "input": 0,
    "constant": 0,
    "add": 2,
    "sub": 2,
    "mul": 2,
    "div": 2,
    "neg": 1,
    "abs": 1,
    "sqrt": 1,
    "sin": 1,
    "cos": 1,
    "exp": 1,
    "tanh": 1,
    "arctan": 1,
    "min": 2,
    "max": 2,
}
"""Every operation and how many arguments it takes. `Graph` documents what each one means."""

COMMUTATIVE: Final[frozenset[Op]] = frozenset({"add", "mul"})


class Node(NamedTuple):
    """One operation: its arguments are indices of earlier nodes.

    `slot` numbers an input; `value` is that of a constant.
    """

    op: Op
    args: tuple[int, ...] = ()
    slot: int = -1
    value: float = 0.0


Simplify = Callable[["Graph", Op, tuple[int, ...]], "int | None"]
"""The node that an operation on nodes is equal to, or None where it must be a new one."""


def identity(value: float) -> object:
    """What tells one constant from another: zeros of either sign are two, all NaN are one."""
    return value if value and value == value else repr(value)


class Graph:
    """An arena of nodes in which arguments precede what is made of them.

    Operations are those of IEEE 754 in double precision, rounded to nearest; `min` and `max` give the
    second argument if either is NaN (as the machine's instructions do); sin, cos and arctan are in
    radians, and like exp and tanh within 2 units in the last place.
    """

    def __init__(self, simplify: Simplify | None = None) -> None:
        self.nodes: list[Node] = []
        self._known: dict[object, int] = {}
        self._simplify = simplify

    def __len__(self) -> int:
        return len(self.nodes)

    def input(self, slot: int) -> int:
        """The value of input number `slot`."""
        return self._node(("input", slot), Node("input", slot=slot))

    def constant(self, value: float) -> int:
        """A number. Zeros of either sign are two constants; all NaN are one."""
        return self._node(identity(value), Node("constant", value=float(value)))

    def apply(self, op: Op, *args: int) -> int:
        """The value of `op` on earlier nodes, simplified as far as the graph's rules go."""
        if self._simplify is not None:
            found = self._simplify(self, op, args)
            if found is not None:
                return found
        return self.literal(op, *args)

    def literal(self, op: Op, *args: int) -> int:
        """The same without simplification."""
        if op in COMMUTATIVE and args[0] > args[1]:
            args = args[::-1]
        return self._node((op, args), Node(op, args))

    def _node(self, key: object, node: Node) -> int:
        found = self._known.get(key)
        if found is None:
            found = self._known[key] = len(self.nodes)
            self.nodes.append(node)
        return found


_SIGN_FACTOR = 2.0**537
"""Twice this factor lifts the smallest subnormal, 2^-1074, to 1."""


def sign(graph: Graph, x: int) -> int:
    """The sign of node `x`, made of the operations that there are: -1, 0 or 1 for every double; NaN for NaN.

    x is scaled and clamped to [-1, 1] twice: clamping once between the two factors because one factor
    alone would not reach 1, and both together overflow. `min` and `max` return a NaN if it is their second
    argument. The derivative of this expression near 0 is meaningless.
    """
    for _ in range(2):
        lifted = graph.apply("mul", graph.constant(_SIGN_FACTOR), x)
        x = graph.apply("max", graph.constant(-1.0), graph.apply("min", graph.constant(1.0), lifted))
    return x


class Symbol:
    """A number that is not known yet: node `index` of `graph`. Arithmetic on it makes nodes.

    Anything that asks for its value (a comparison, ``if``, ``float``) raises TraceError with the line
    that asked.
    """

    __slots__ = ("graph", "index")

    def __init__(self, graph: Graph, index: int) -> None:
        self.graph = graph
        self.index = index

    def __add__(self, other: Any) -> Symbol:
        return self._with("add", other)

    def __radd__(self, other: Any) -> Symbol:
        return self._with("add", other)

    def __sub__(self, other: Any) -> Symbol:
        return self._with("sub", other)

    def __rsub__(self, other: Any) -> Symbol:
        return self._from("sub", other)

    def __mul__(self, other: Any) -> Symbol:
        return self._with("mul", other)

    def __rmul__(self, other: Any) -> Symbol:
        return self._with("mul", other)

    def __truediv__(self, other: Any) -> Symbol:
        return self._with("div", other)

    def __rtruediv__(self, other: Any) -> Symbol:
        return self._from("div", other)

    def __neg__(self) -> Symbol:
        return self._alone("neg")

    def __pos__(self) -> Symbol:
        return self

    def __abs__(self) -> Symbol:
        return self._alone("abs")

    def sqrt(self) -> Symbol:
        """Square root."""
        return self._alone("sqrt")

    def sin(self) -> Symbol:
        """Sine [rad]."""
        return self._alone("sin")

    def cos(self) -> Symbol:
        """Cosine [rad]."""
        return self._alone("cos")

    def exp(self) -> Symbol:
        """Exponential."""
        return self._alone("exp")

    def tanh(self) -> Symbol:
        """Hyperbolic tangent."""
        return self._alone("tanh")

    def arctan(self) -> Symbol:
        """Arctangent [rad], between -pi/2 and pi/2."""
        return self._alone("arctan")

    def sign(self) -> Symbol:
        """-1, 0 or 1; see `sign`."""
        return Symbol(self.graph, sign(self.graph, self.index))

    def minimum(self, other: Any) -> Symbol:
        """The smaller one; `other` if either is NaN."""
        return self._with("min", other)

    def maximum(self, other: Any) -> Symbol:
        """The larger one; `other` if either is NaN."""
        return self._with("max", other)

    def clamp(self, most: Any) -> Symbol:
        """This cut to -`most` and `most`; NaN stays NaN."""
        return self._from("max", -most)._from("min", most)

    def _alone(self, op: Op) -> Symbol:
        return Symbol(self.graph, self.graph.apply(op, self.index))

    def _with(self, op: Op, other: Any) -> Symbol:
        index = _index(self.graph, other)
        return (
            NotImplemented if index is None else Symbol(self.graph, self.graph.apply(op, self.index, index))
        )

    def _from(self, op: Op, other: Any) -> Symbol:
        index = _index(self.graph, other)
        return (
            NotImplemented if index is None else Symbol(self.graph, self.graph.apply(op, index, self.index))
        )

    # What would need the value now.

    def _unknown(self, *_: object) -> NoReturn:
        raise TraceError(
            f"{_asking_line()} asks for the value of a symbol; a traced function may not branch on one"
        )

    __bool__ = __float__ = __int__ = __index__ = __round__ = __floor__ = _unknown
    __eq__ = __ne__ = __lt__ = __le__ = __gt__ = __ge__ = _unknown
    __hash__ = _unknown


def _index(graph: Graph, other: Any) -> int | None:
    """The node of an operand: a symbol of the same graph or a real number."""
    if isinstance(other, Symbol):
        if other.graph is not graph:
            raise TraceError(f"{_asking_line()} mixes symbols of two traces")
        return other.index
    if isinstance(other, (float, int)):
        return graph.constant(float(other))
    return None


def _asking_line() -> str:
    """Where the user's code is, which may have asked through a function of NumPy."""
    frame: Any = sys._getframe(2)
    while frame is not None and _passed_through(frame.f_globals.get("__name__", "")):
        frame = frame.f_back
    return "code" if frame is None else f"{frame.f_code.co_filename}:{frame.f_lineno}"


def _passed_through(module: str) -> bool:
    return module in (__name__, "numpy") or module.startswith("numpy.")
