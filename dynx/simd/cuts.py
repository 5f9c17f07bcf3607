"""A traced step in pieces between the calls of another engine.

A controller and an integrator do about ten operations on small arrays. NumPy needs half a microsecond for
each, together more than the dynamics take. Here the step is traced on symbols. An engine call ends a piece;
its result is an input of the next one. Pieces are compiled without fast-math (no contraction, no reordering),
so that their results are those of NumPy, bit for bit.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from dynx.errors import TraceError
from dynx.simd.cache import load_kernel, program_recipe
from dynx.simd.call_sequence import CallSequence, StridedRows
from dynx.simd.emit import Settings
from dynx.simd.expr import Graph, Symbol
from dynx.simd.kernel import Kernel
from dynx.simd.program import Port, Program, extract_program, scalar_ranges
from dynx.simd.simplify import STRICT
from dynx.simd.target import host
from dynx.spatial.scalar import Array, Floats

Shape = tuple[int, ...]

Nodes = tuple[int, ...]

EngineCall = Callable[..., Floats]
"""Function of arrays that returns one array."""

EXACTLY_ROUNDED = frozenset(
    {"input", "constant", "add", "sub", "mul", "div", "neg", "abs", "sqrt", "min", "max"}
    | {"less", "less_equal", "equal", "select"}
)
"""Operations with the same bits in NumPy and in a kernel: IEEE 754 requires correct rounding of them."""

MAX_CACHED_PIECES = 128
"""Number of kernels of pieces that this process keeps for later steps."""

_made: dict[bytes, Kernel] = {}


class EngineCallFailed(Exception):
    """An engine call of `origin` raised the exception `__cause__` in a step."""

    def __init__(self, step: int, origin: str) -> None:
        super().__init__(f"an engine call of the {origin} failed in step {step}")
        self.step, self.origin = step, origin


class Piece(NamedTuple):
    """A piece of a step, which ends with an engine call."""

    kernel: Kernel
    """Kernel that writes the arguments."""
    call: EngineCall
    origin: str
    """Who makes the call."""
    arguments: tuple[tuple[str, Shape], ...]
    """Arrays that this piece or an earlier one wrote, and their shapes."""
    result: tuple[str, Shape]


@dataclass(frozen=True)
class CutStep:
    """All pieces of a step, compiled."""

    pieces: tuple[Piece, ...]
    last: Kernel
    """Kernel of the last piece, which writes the results of the step."""
    sizes: Mapping[str, int]
    """Sizes of the arguments and results of the engine calls."""
    numbers: Mapping[str, Floats]
    """Constant inputs."""


class BoundCuts:
    """Steps in pieces whose arrays are known, numbered from 0 on."""

    def __init__(
        self, step: CutStep, rows: Mapping[str, StridedRows], outputs: Mapping[str, StridedRows]
    ) -> None:
        """`rows` and `outputs` are those of `CallSequence`."""
        zeros = np.broadcast_to(np.int64(0), rows["q"].rows.shape)
        places = {name: np.zeros((1, size)) for name, size in step.sizes.items()}
        numbers = {name: value[None] for name, value in step.numbers.items()}
        every = {**rows, **{name: StridedRows(x, zeros) for name, x in {**places, **numbers}.items()}}

        def prepare(kernel: Kernel) -> CallSequence:
            return CallSequence([kernel], zeros, every, outputs=outputs)

        self._pieces: list[tuple[Callable[[int], None], range, EngineCall, list[Floats], Any, str]] = []
        self._kept = []
        for piece in step.pieces:
            calls = prepare(piece.kernel)
            self._kept.append(calls)
            arguments = [places[name].reshape(shape) for name, shape in piece.arguments]
            name, shape = piece.result
            found = places[name].reshape(shape)
            # Assigning to a memory view takes a third of the time of assigning to an array.
            memory = found.data if found.ndim == 1 else found
            run = piece.kernel.locked_entry
            self._pieces.append((run, calls.addresses, piece.call, arguments, memory, piece.origin))
        last = prepare(step.last)
        self._kept.append(last)
        self._last, self._addresses = step.last.locked_entry, last.addresses
        self._status: Any = rows["status"].array.reshape(1).data
        self.taken = 0
        """Number of the step at which the last run ended."""

    def run(self, begin: int, end: int) -> tuple[int, float] | None:
        """Take the steps from `begin` to before `end`; return the number of the step that wrote a status
        other than 0, and the status, or None after the last step.

        Raises EngineCallFailed for an exception of the engine.
        """
        pieces, finish, finishing, status = self._pieces, self._last, self._addresses, self._status
        k, _origin = begin, ""
        status[0] = 0.0
        try:
            for k in range(begin, end):
                for run, addresses, call, arguments, result, _origin in pieces:
                    run(addresses[k])
                    if status[0] != 0.0:
                        return k, status[0]
                    result[:] = call(*arguments)
                finish(finishing[k])
                if status[0] != 0.0:
                    return k, status[0]
            k = end
        except Exception as error:
            raise EngineCallFailed(k, _origin) from error
        finally:
            self.taken = k
        return None


class _TracedCall(NamedTuple):
    call: EngineCall
    origin: str
    written: dict[str, Nodes]
    """Arguments that are new in this call, and what else is written before it."""
    arguments: tuple[tuple[str, Shape], ...]
    result: tuple[str, Shape]


class EngineCallTracer:
    """Records the engine calls of a step while it is traced."""

    def __init__(self, inputs: Mapping[str, int]) -> None:
        self._graph = Graph(STRICT)
        self._ports: list[Port] = []
        self._slot = 0
        self._calls: list[_TracedCall] = []
        self._written: dict[Nodes, str] = {}
        self._numbers: dict[str, Floats] = {}
        self.given = {name: self._symbols(name, size) for name, size in inputs.items()}

    def record(
        self,
        call: EngineCall,
        shape: Shape,
        *arguments: Array,
        origin: str,
        before: Mapping[str, Array] | None = None,
    ) -> Array:
        """Record `call(*arguments)`, made by `origin`, and return symbols of `shape` for its result.

        Outputs `before` are written before the call, which is not made where they include a status.
        """
        written = {name: self._indices(array) for name, array in (before or {}).items()}
        named = []
        for argument in arguments:
            nodes = self._indices(argument)
            name = self._written.get(nodes)
            if name is None:
                name = self._written[nodes] = f"argument {len(self._written)}"
                written[name] = nodes
            named.append((name, argument.shape))
        result = f"result {len(self._calls)}"
        self._calls.append(_TracedCall(call, origin, written, tuple(named), (result, shape)))
        return self._symbols(result, int(np.prod(shape))).reshape(shape)

    def number(self, value: Floats) -> Array:
        """Return symbols for numbers (n,) of a controller: controllers with other gains share the pieces."""
        name = f"number {len(self._numbers)}"
        self._numbers[name] = value
        return self._symbols(name, value.size)

    def refuse_inexact_rounding(self) -> None:
        """Raise TraceError if an operation traced so far rounds differently in a kernel and in NumPy."""
        if self._graph.reordered:
            raise TraceError(f"{self._graph.reordered} is not rounded as NumPy rounds it")
        for node in self._graph.nodes:
            if node.op not in EXACTLY_ROUNDED:
                raise TraceError(f"{node.op} is not rounded as NumPy rounds it")

    def compile(self, results: Mapping[str, Array]) -> CutStep:
        """Compile the pieces, the last of which writes `results`."""
        pieces = []
        sizes = {name: len(nodes) for nodes, name in self._written.items()}
        for call, origin, written, arguments, result in self._calls:
            pieces.append(Piece(_kernel(self._program(written)), call, origin, arguments, result))
            sizes[result[0]] = int(np.prod(result[1]))
        last = _kernel(self._program({name: self._indices(array) for name, array in results.items()}))
        return CutStep(tuple(pieces), last, sizes, self._numbers)

    def _symbols(self, name: str, size: int) -> Array:
        symbols = np.empty(size, dtype=object)
        for k in range(size):
            symbols[k] = Symbol(self._graph, self._graph.input(self._slot + k))
        self._slot += size
        self._ports.append(Port(name, (size,)))
        return symbols

    def _indices(self, array: Array) -> Nodes:
        return tuple(
            entry.index if isinstance(entry, Symbol) else self._graph.constant(float(entry))
            for entry in np.asarray(array, dtype=object).ravel().tolist()
        )

    def _program(self, wanted: Mapping[str, Nodes]) -> Program:
        outputs = [Port(name, (len(nodes),)) for name, nodes in wanted.items()]
        results = [node for nodes in wanted.values() for node in nodes]
        return _without_idle_inputs(extract_program(self._graph, self._ports, outputs, results))


def _without_idle_inputs(program: Program) -> Program:
    """Remove the inputs that the program does not read."""
    read = {node.slot for node in program.nodes if node.op == "input"}
    kept: list[Port] = []
    moved: dict[int, int] = {}
    for port, slots in scalar_ranges(program.inputs):
        if not read.isdisjoint(slots):
            moved.update(zip(slots, range(len(moved), len(moved) + port.size), strict=True))
            kept.append(port)
    nodes = [node._replace(slot=moved[node.slot]) if node.op == "input" else node for node in program.nodes]
    return replace(program, nodes=tuple(nodes), inputs=tuple(kept))


def _kernel(program: Program) -> Kernel:
    recipe = program_recipe(program)
    kernel = _made.get(recipe)
    if kernel is None:
        strict = Settings(host().lanes, fast=False)
        kernel = _made[recipe] = load_kernel(recipe, lambda: program, settings=strict)
        for old in list(_made)[:-MAX_CACHED_PIECES]:
            _made.pop(old, None)
    return kernel
