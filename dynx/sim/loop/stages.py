"""A step of a closed loop, compiled in stages between the engine calls.

A controller and an integrator do about ten operations on small arrays. NumPy needs half a microsecond for
each, together more than the dynamics take. Here the step is traced on symbols. An engine call ends a stage;
its result is an input of the next one. Stages are compiled without fast-math (no contraction, no reordering),
so that their results are those of NumPy, bit for bit.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from dynx.control.base import Controller, chain_of, gains_of, rebind
from dynx.control.code_content import is_foreign
from dynx.control.dynamics import QUANTITIES, Dynamics, EngineDynamics, Evaluation
from dynx.errors import TraceError
from dynx.simd.cache import load_kernel, program_recipe
from dynx.simd.emit import Settings
from dynx.simd.expr import Graph, Symbol
from dynx.simd.kernel import Kernel
from dynx.simd.program import Port, Program, extract_program, scalar_ranges
from dynx.simd.simplify import STRICT
from dynx.simd.target import host
from dynx.simd.user_code.arrays import is_traced, symbol_array, traced_array
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

MAX_CACHED_STAGES = 128
"""Number of kernels of stages that this process keeps for later simulations."""

_made: dict[bytes, Kernel] = {}


@dataclass(frozen=True)
class Stage:
    """A stage of a step, which ends with an engine call."""

    kernel: Kernel
    """Kernel that writes the arguments and, if guarded, the defect: 0 if they are finite, otherwise NaN."""
    call: EngineCall
    arguments: tuple[tuple[str, Shape], ...]
    """Arrays that this stage or an earlier one wrote, and their shapes."""
    result: tuple[str, Shape]


@dataclass(frozen=True)
class StagedStep:
    """All stages of a step, compiled."""

    stages: tuple[Stage, ...]
    last: Kernel
    """Kernel of the last stage, which writes the results of the step."""
    sizes: Mapping[str, int]
    """Sizes of the arguments and results of the engine calls."""
    numbers: Mapping[str, Floats]
    """Constant inputs."""


class _TracedCall(NamedTuple):
    call: EngineCall
    fresh: dict[str, Nodes]
    """Arguments that are new in this call."""
    arguments: tuple[tuple[str, Shape], ...]
    result: tuple[str, Shape]
    guarded: bool


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

    def record(self, call: EngineCall, shape: Shape, *arguments: Array, guarded: bool = False) -> Array:
        """Record `call(*arguments)` and return symbols of `shape` for its result.

        With `guarded`, the step stops before the call if an argument is not finite.
        """
        fresh: dict[str, Nodes] = {}
        named = []
        for argument in arguments:
            nodes = self._indices(argument)
            name = self._written.get(nodes)
            if name is None:
                name = self._written[nodes] = f"argument {len(self._written)}"
                fresh[name] = nodes
            named.append((name, argument.shape))
        result = f"result {len(self._calls)}"
        self._calls.append(_TracedCall(call, fresh, tuple(named), (result, shape), guarded))
        return self._symbols(result, int(np.prod(shape))).reshape(shape)

    def number(self, value: Floats) -> Array:
        """Return symbols for numbers (n,) of a controller: controllers with other gains share the stages."""
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

    def compile(self, results: Mapping[str, Array]) -> StagedStep:
        """Compile the stages, the last of which writes `results`."""
        stages = []
        sizes = {name: len(nodes) for nodes, name in self._written.items()}
        for call, fresh, arguments, result, guarded in self._calls:
            wanted = dict(fresh)
            if guarded:
                wanted["defect"] = (self._defect([node for nodes in fresh.values() for node in nodes]),)
            kernel = _kernel(self._program(wanted))
            stages.append(Stage(kernel, call, arguments, result))
            sizes[result[0]] = int(np.prod(result[1]))
        last = _kernel(self._program({name: self._indices(array) for name, array in results.items()}))
        return StagedStep(tuple(stages), last, sizes, self._numbers)

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

    def _defect(self, nodes: list[int]) -> int:
        graph = self._graph
        zero = found = graph.constant(0.0)
        for node in nodes:
            found = graph.apply("add", found, graph.apply("mul", node, zero))
        return found

    def _program(self, wanted: Mapping[str, Nodes]) -> Program:
        outputs = [Port(name, (len(nodes),)) for name, nodes in wanted.items()]
        results = [node for nodes in wanted.values() for node in nodes]
        return _without_idle_inputs(extract_program(self._graph, self._ports, outputs, results))


class TracedEngineCalls(Dynamics):
    """Dynamics of a controller that is traced: each evaluation is recorded as an engine call."""

    def __init__(self, tracer: EngineCallTracer, dynamics: Dynamics) -> None:
        if not isinstance(dynamics, EngineDynamics):
            raise TraceError(f"{type(dynamics).__name__} is not evaluated by an engine")
        self._tracer, self._engine = tracer, dynamics
        super().__init__(dynamics.model)

    def evaluation(self, quantity: str) -> Evaluation:
        """Return the callable that records an engine call and returns symbols for its result."""
        nv = self.model.nv
        shape = (nv, nv) if quantity == "mass_matrix" else (nv,)

        def record(*arguments: Array) -> Array:
            if quantity not in QUANTITIES:
                raise TraceError(f"{quantity} of a frame is no engine call of a compiled stage")
            if any(map(is_traced, arguments)):
                return traced_array(record(*map(symbol_array, arguments)))
            return self._tracer.record(self._engine.bound_to_thread(quantity), shape, *arguments)

        return record


def refuse_impure(controller: Controller[Any]) -> None:
    """Raise TraceError for a controller that may do anything besides returning its torque.

    Other effects, such as counting its calls, would happen once during tracing and not in the steps.
    """
    for each in chain_of(controller):
        if not each.is_pure:
            raise TraceError(
                f"the class of {each.name} is not declared with pure=True, so its torque may do more than "
                "compute a torque"
            )


def traced_controller(controller: Controller[Any], tracer: EngineCallTracer) -> Controller[Any]:
    """Return the controller with engine calls for its dynamics, and symbols for its gains."""

    def symbols(each: Controller[Any]) -> dict[str, Array]:
        gains = gains_of(each).items()
        numbers = {name: tracer.number(gain) for name, gain in gains if gain.ndim == 1}
        if is_foreign(type(each)):
            return {name: traced_array(number) for name, number in numbers.items()}
        return numbers

    return rebind(controller, partial(TracedEngineCalls, tracer), symbols)


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
        for old in list(_made)[:-MAX_CACHED_STAGES]:
            _made.pop(old, None)
    return kernel
