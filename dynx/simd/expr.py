"""Expression graph with common subexpressions merged, and the symbols that build it.

A `Graph` is a list of nodes, each an operation on earlier nodes. It is hash-consed: the same operation on the
same arguments is the same node. A `Symbol` refers to a node and overloads arithmetic, so that array code
written for numbers builds the graph when it is run on arrays of symbols.
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
    "less",
    "less_equal",
    "equal",
    "select",
]

_UNARY: Final[tuple[Op, ...]] = ("neg", "abs", "sqrt", "sin", "cos", "exp", "tanh", "arctan")
_BINARY: Final[tuple[Op, ...]] = (
    *("add", "sub", "mul", "div", "min", "max"),
    *("less", "less_equal", "equal"),
)
ARITY: Final[dict[Op, int]] = {
    "input": 0,
    "constant": 0,
    **dict.fromkeys(_BINARY, 2),
    **dict.fromkeys(_UNARY, 1),
    "select": 3,
}
"""Number of arguments of every operation. `Graph` documents their semantics."""

Kind = Op | Literal["zero", "one", "minus one"]
"""Operation of a node; or which constant it is, if it is 0 or -0, 1, or -1. Other constants are of kind
``constant``."""

_KIND_OF_CONSTANT: Final[dict[float, Kind]] = {0.0: "zero", 1.0: "one", -1.0: "minus one"}
CONSTANT_KINDS: Final[tuple[Kind, ...]] = ("constant", *_KIND_OF_CONSTANT.values())

SIGN_SCALE = 2.0**537
"""Factor whose square scales the smallest subnormal number, 2^-1074, to 1."""

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
"""Function that returns an existing or simpler node equal to an operation on nodes, or None."""


def constant_key(value: float) -> object:
    """Return the key that identifies a constant: 0.0 and -0.0 are distinct, all NaN are one."""
    return value if value and value == value else repr(value)


class Graph:
    """List of nodes in which arguments precede the operations on them.

    Operations are those of IEEE 754 in double precision, rounded to nearest; `min` and `max` return the
    second argument if either is NaN (as the processor's instructions do); sin, cos and arctan are in
    radians, and like exp and tanh accurate to 2 units in the last place. `less`, `less_equal` and `equal` are
    1 or 0, which is what they are if either argument is NaN; `select` is its second argument where the first
    is not 0, otherwise its third.
    """

    def __init__(self, simplify: Simplify | None = None) -> None:
        self.nodes: list[Node] = []
        self.kinds: list[Kind] = []
        """Kind of each node."""
        self._known: dict[object, int] = {}
        self._simplify = simplify
        self.reordered = ""
        """Function of NumPy that was traced with sums in another order than NumPy's, if there is one."""

    def __len__(self) -> int:
        return len(self.nodes)

    def input(self, slot: int) -> int:
        """Return the node of input number `slot`."""
        key = "input", slot
        found = self._known.get(key)
        return self._append(key, Node("input", slot=slot), "input") if found is None else found

    def constant(self, value: float) -> int:
        """Return the node of a constant. 0.0 and -0.0 are distinct; all NaN are one."""
        key = constant_key(value)
        found = self._known.get(key)
        if found is not None:
            return found
        value = float(value)
        return self._append(key, Node("constant", value=value), _KIND_OF_CONSTANT.get(value, "constant"))

    def apply(self, op: Op, *args: int) -> int:
        """Return the node of `op` on earlier nodes, simplified by the rules of the graph."""
        if self._simplify is not None:
            found = self._simplify(self, op, args)
            if found is not None:
                return found
        return self.apply_unsimplified(op, *args)

    def apply_unsimplified(self, op: Op, *args: int) -> int:
        """Return the node of `op` on earlier nodes, without simplification."""
        if op in COMMUTATIVE and args[0] > args[1]:
            args = args[::-1]
        key = op, args
        found = self._known.get(key)
        return self._append(key, Node(op, args), op) if found is None else found

    def sign(self, x: int) -> int:
        """Return the sign of x, composed of other operations: -1, 0 or 1 for every double, NaN for NaN.

        x is scaled up and clamped to [-1, 1] twice: a single factor would not lift the smallest subnormal to
        1, and both factors without a clamp in between would overflow. `min` and `max` propagate NaN in
        their second argument. The derivative of this expression is not meaningful near 0.
        """
        for _ in range(2):
            scaled = self.apply("mul", self.constant(SIGN_SCALE), x)
            x = self.apply("max", self.constant(-1.0), self.apply("min", self.constant(1.0), scaled))
        return x

    def _append(self, key: object, node: Node, kind: Kind) -> int:
        """Append a node, which will be known by this key, and return its index."""
        index = self._known[key] = len(self.nodes)
        self.nodes.append(node)
        self.kinds.append(kind)
        return index


def _unary(op: Op) -> Callable[[Any], Symbol]:
    """Make the method of `Symbol` for an operation on one number."""

    def apply(self: Symbol) -> Symbol:
        return self.kind(self.graph, self.graph.apply(op, self.index))

    return apply


def _binary(op: Op, *, reflected: bool = False) -> Callable[[Any, Any], Any]:
    """Make the method of `Symbol` for an operation on two numbers, the first being the symbol.

    If `reflected` the symbol is the second. `min` and `max` return the second number if either is NaN.
    """

    def apply(self: Symbol, other: Any) -> Any:
        graph = self.graph
        index: int | None
        if isinstance(other, Symbol) and other.graph is graph:
            index = other.index
        else:
            index = graph.constant(other) if type(other) is float else self._index(other)
            if index is None:
                return NotImplemented
        found = graph.apply(op, index, self.index) if reflected else graph.apply(op, self.index, index)
        return self.kind(graph, found)

    return apply


_at_least, _at_most = _binary("max", reflected=True), _binary("min", reflected=True)


class Symbol:
    """A number whose value is not known yet: node `index` of `graph`. Arithmetic on it creates nodes.

    Anything that needs the value (a comparison, ``if``, ``float``) raises TraceError with the file and line
    of the calling code.
    """

    __slots__ = ("graph", "index")

    kind: type[Symbol]
    """Class of the results of arithmetic."""

    def __init__(self, graph: Graph, index: int) -> None:
        self.graph = graph
        self.index = index

    __add__, __radd__ = _binary("add"), _binary("add")
    __sub__, __rsub__ = _binary("sub"), _binary("sub", reflected=True)
    __mul__, __rmul__ = _binary("mul"), _binary("mul")
    __truediv__, __rtruediv__ = _binary("div"), _binary("div", reflected=True)
    __neg__, __abs__ = _unary("neg"), _unary("abs")
    # By these names NumPy and `dynx.spatial.scalar` evaluate functions of objects; angles are in radians.
    sqrt, exp, tanh = _unary("sqrt"), _unary("exp"), _unary("tanh")
    sin, cos, arctan = _unary("sin"), _unary("cos"), _unary("arctan")
    minimum, maximum = _binary("min"), _binary("max")

    def __pos__(self) -> Symbol:
        return self

    def sign(self) -> Symbol:
        """Return the sign: -1, 0 or 1."""
        return self.kind(self.graph, self.graph.sign(self.index))

    # `dynx.spatial.scalar` selects by these: the mask is 1 where the symbol is less, or more, than a number.
    less, more = _binary("less"), _binary("less", reflected=True)

    def select(self, yes: Any, no: Any) -> Symbol:
        """Return `yes` where this symbol, a mask, is not 0, and `no` where it is."""
        sides = [self._index(each) for each in (yes, no)]
        if sides[0] is None or sides[1] is None:
            raise TraceError(f"{caller_location()} selects something other than a number")
        return self.kind(self.graph, self.graph.apply("select", self.index, sides[0], sides[1]))

    def traced_operation(self, op: Op, *arguments: Any) -> Symbol:
        """Return `op` of symbols of this graph and numbers (`dynx.spatial.scalar.less`, `select`, ...)."""
        graph = self.graph
        nodes = [
            each.index if isinstance(each, Symbol) else graph.constant(float(each)) for each in arguments
        ]
        return self.kind(graph, graph.apply(op, *nodes))

    def clamp(self, bound: Any) -> Symbol:
        """Clamp to [-bound, bound]; NaN stays NaN."""
        clamped: Symbol = _at_most(_at_least(self, -bound), bound)
        return clamped

    def _index(self, other: Any) -> int | None:
        """Return the node of an operand, a symbol of the same graph or a real number; else None."""
        if isinstance(other, Symbol):
            if other.graph is not self.graph:
                raise TraceError(f"{caller_location()} mixes symbols of two traces")
            return other.index
        if isinstance(other, (float, int)):
            return self.graph.constant(float(other))
        return None

    # Operations that need the value.

    def _refuse(self, *_: object) -> NoReturn:
        raise TraceError(
            f"{caller_location()} needs the value of a symbol; a traced function must not branch on one"
        )

    # A subclass may define some of them.
    _needs_value: Any = _refuse
    __bool__ = __float__ = __int__ = __index__ = __round__ = __floor__ = _needs_value
    __eq__ = __ne__ = __lt__ = __le__ = __gt__ = __ge__ = _needs_value
    __hash__ = _needs_value


Symbol.kind = Symbol


def caller_location() -> str:
    """Return file and line of the innermost calling code outside this package and NumPy."""
    frame: Any = sys._getframe(2)
    while frame is not None and _is_internal(frame.f_globals.get("__name__", "")):
        frame = frame.f_back
    return "code" if frame is None else f"{frame.f_code.co_filename}:{frame.f_lineno}"


def _is_internal(module: str) -> bool:
    return module.partition(".")[0] == "numpy" or module.startswith("dynx.simd.")
