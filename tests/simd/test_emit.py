"""Emitted code against the interpreter, for every target and number of lanes."""

from __future__ import annotations

import functools
from collections.abc import Sequence

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from llvmlite import binding

from dynx.simd.emit import Settings, emit
from dynx.simd.expr import ARITY, Graph, Op, Simplify
from dynx.simd.program import Port, Program, extract_program
from dynx.simd.simplify import FAST, STRICT
from dynx.simd.target import Processor
from dynx.spatial.scalar import Floats
from tests.simd.interp import Function, interpret
from tests.simd.machine import LANES, TARGETS, X86, Machine, same_bits
from tests.simd.programs import (
    OPERATIONS,
    ORDINARY_CONSTANTS,
    RANDOM,
    doubles,
    ordinary,
    programs,
    simplified,
)
from tests.simd.rounding import agree, bounds

FUNCTIONS: tuple[Op, ...] = ("sin", "cos", "exp", "tanh", "arctan")
TARGET = st.sampled_from(TARGETS)
LANE = st.sampled_from(LANES)
SEGMENT = st.sampled_from((5, 2500))
BATCH = st.integers(0, 17)
"""Number of samples beyond the least, up to two groups and one sample."""
LAYOUTS = ("rows", "padded", "every second", "backwards", "one row")


@functools.cache
def kernel_functions(target: Processor) -> dict[Op, Function]:
    """Elementary functions as the kernels of `target` compute them; `test_trigonometry` and
    `test_elementary` judge these."""
    functions: dict[Op, Function] = {}
    for op in FUNCTIONS:
        graph = Graph()
        result = graph.apply_unsimplified(op, graph.input(0))
        program = extract_program(graph, [Port("x", (1,))], [Port(op, (1,))], [result])
        machine = Machine(program, target, Settings(2, fast=False))

        def function(x: Floats, machine: Machine = machine) -> Floats:
            return np.asarray(machine([np.concatenate([x, x, x[:1]])[:, None]])[0][: len(x), 0])

        functions[op] = function
    return functions


def with_layout(array: Floats, layout: str) -> Floats:
    """Return a view with the numbers of `array` and the memory layout `layout`."""
    n, width = array.shape
    if layout == "padded":
        block = np.full((n, width + 3), np.nan)
        block[:, 1 : width + 1] = array
        return block[:, 1 : width + 1]
    if layout == "every second":
        block = np.full((2 * n, width), np.nan)
        block[::2] = array
        return block[::2]
    if layout == "backwards":
        return np.flip(np.flip(array, 0).copy(), 0)
    if layout == "one row":
        return np.asarray(np.broadcast_to(array[:1], array.shape))
    return array


def draw_inputs(program: Program, rng: np.random.Generator, n: int, *, special: bool) -> list[Floats]:
    numbers = doubles if special else ordinary
    return [with_layout(numbers(rng, (n, port.size)), str(rng.choice(LAYOUTS))) for port in program.inputs]


@given(programs(), TARGET, LANE, BATCH, SEGMENT, st.booleans(), RANDOM)
def test_strict_code_is_the_interpreter_bit_for_bit(
    program: Program,
    target: Processor,
    lanes: int,
    more: int,
    segment: int,
    quick: bool,
    rng: np.random.Generator,
) -> None:
    n = lanes + min(more, 2 * lanes + 1)
    inputs = draw_inputs(program, rng, n, special=True)
    wanted = interpret(program, inputs, kernel_functions(target))
    got = Machine(program, target, Settings(lanes, fast=False, segment=segment, quick=quick))(inputs)
    for port, a, b in zip(program.outputs, got, wanted, strict=True):
        assert same_bits(a, b), port


@given(
    programs(constants=ORDINARY_CONSTANTS),
    st.sampled_from((None, STRICT, FAST)),
    TARGET,
    LANE,
    BATCH,
    SEGMENT,
    st.booleans(),
    RANDOM,
)
def test_fast_code_is_the_interpreter_to_rounding(
    program: Program,
    simplify: Simplify | None,
    target: Processor,
    lanes: int,
    more: int,
    segment: int,
    quick: bool,
    rng: np.random.Generator,
) -> None:
    n = lanes + min(more, 2 * lanes + 1)
    inputs = draw_inputs(program, rng, n, special=False)
    wanted = interpret(program, inputs)
    short = simplified(program, simplify)
    got = Machine(short, target, Settings(lanes, segment=segment, quick=quick))(inputs)
    for port, a, b, one, other in zip(
        program.outputs, got, wanted, bounds(program, inputs), bounds(short, inputs), strict=True
    ):
        assert agree(a, b, one, other), port


def test_fast_code_contracts_and_strict_code_does_not() -> None:
    """a b - c with a b = 1 - 2^-104, c = 1: one rounding gives -2^-104, two give 0."""
    graph = Graph()
    a, b, c = (graph.input(slot) for slot in range(3))
    program = extract_program(
        graph,
        [Port("x", (3,))],
        [Port("y", (1,))],
        [graph.apply_unsimplified("sub", graph.apply_unsimplified("mul", a, b), c)],
    )
    x = np.array([[1.0 + 2.0**-52, 1.0 - 2.0**-52, 1.0]] * 2)
    for target in TARGETS:
        fast, strict = (Machine(program, target, Settings(2, fast=flag))([x])[0] for flag in (True, False))
        assert np.all(strict == 0.0)
        assert np.all(fast == (-(2.0**-104) if target.fma else 0.0))


def all_operations() -> Program:
    """Return a program with every operation once, on two inputs."""
    graph = Graph()
    pair = graph.input(0), graph.input(1)
    results = [graph.apply_unsimplified(op, *(*pair, pair[0])[: ARITY[op]]) for op in OPERATIONS]
    return extract_program(graph, [Port("x", (2,))], [Port("y", (len(results),))], results)


@pytest.mark.parametrize("target", TARGETS, ids=lambda target: target.cpu)
@pytest.mark.parametrize("lanes", LANES)
@pytest.mark.parametrize("fast", [False, True], ids=["strict", "fast"])
@pytest.mark.parametrize("poison", [np.nan, np.inf, -np.inf, 1e300, 2.0**-1074])
def test_lanes_are_independent(target: Processor, lanes: int, fast: bool, poison: float) -> None:
    machine = Machine(all_operations(), target, Settings(lanes, fast=fast))
    x = ordinary(np.random.default_rng(lanes), (lanes, 2))
    (clean,) = machine([x])
    for lane in range(lanes):
        for columns in ([0], [1], [0, 1]):
            dirty = x.copy()
            dirty[lane, columns] = poison
            (got,) = machine([dirty])
            others = np.arange(lanes) != lane
            assert same_bits(got[others], clean[others])
            assert not same_bits(got[lane], clean[lane])


@given(programs(), TARGET, LANE, BATCH, st.sampled_from(("padded", "every second")), RANDOM)
def test_no_memory_outside_the_rows_is_written(
    program: Program, target: Processor, lanes: int, more: int, layout: str, rng: np.random.Generator
) -> None:
    n = lanes + min(more, 2 * lanes + 1)
    inputs = draw_inputs(program, rng, n, special=True)
    machine = Machine(program, target, Settings(lanes, fast=False))
    wanted = machine(inputs)
    mark = -123.456
    blocks = [np.full((2 * n, port.size + 3), mark) for port in program.outputs]
    views = [
        block[:n, 1 : port.size + 1] if layout == "padded" else block[::2, : port.size]
        for block, port in zip(blocks, program.outputs, strict=True)
    ]
    machine.fill(inputs, views, n)
    for block, view, right in zip(blocks, views, wanted, strict=True):
        assert same_bits(view, right)
        view[:] = mark
        assert np.all(block == mark)


def test_results_do_not_depend_on_the_position_in_the_batch() -> None:
    """The last group overlaps the one before; results are the same bits for every batch size, also where two
    groups are evaluated in turn."""
    rng = np.random.default_rng(4)
    x = doubles(rng, (33, 2))
    for target in TARGETS:
        for lanes in LANES:
            one = Machine(all_operations(), target, Settings(lanes))
            several = Machine(all_operations(), target, Settings(lanes, segment=8))
            (whole,) = one([x])
            for n in range(lanes, 33):
                assert same_bits(one([x[:n]])[0], whole[:n])
                assert same_bits(several([x[:n]])[0], whole[:n])


def test_each_segment_is_called_for_two_groups_in_turn() -> None:
    """Segments of code that fits into the cache are called for one group."""
    several = emit(all_operations(), TARGETS[0], Settings(2, segment=8))
    assert several.count("call void @segment1(ptr %arguments, i64 %second, ptr %kept_second)") == 1
    assert "%second" not in emit(all_operations(), TARGETS[0], Settings(2))


def _ports(sizes: Sequence[int], stem: str) -> list[Port]:
    return [Port(f"{stem}{k}", (size,)) for k, size in enumerate(sizes)]


def test_inputs_are_copied_to_outputs_of_every_width() -> None:
    """Loads and stores of every tile shape, with nothing in between."""
    sizes = range(1, 20)
    graph = Graph()
    slots = [graph.input(slot) for slot in range(sum(sizes))]
    program = extract_program(graph, _ports(sizes, "in"), _ports(sizes, "out"), slots)
    rng = np.random.default_rng(5)
    for target in TARGETS:
        for lanes in LANES:
            inputs = [doubles(rng, (2 * lanes + 1, size)) for size in sizes]
            for a, b in zip(Machine(program, target, Settings(lanes))(inputs), inputs, strict=True):
                assert same_bits(a, b)


CROSS = (
    Processor("x86_64-unknown-linux-gnu", "skylake-avx512", "+avx,+avx2,+fma,+avx512f,+avx512vl"),
    Processor("x86_64-unknown-linux-gnu", "x86-64", ""),
)


@pytest.mark.skipif(not X86, reason="LLVM is built for this machine's family")
@pytest.mark.parametrize("target", CROSS, ids=lambda target: target.cpu)
def test_code_for_other_processors_of_the_family(target: Processor) -> None:
    """The code cannot run here, but LLVM accepts it and uses that processor's widest vectors."""
    program = all_operations()
    machine = target.machine()
    module = binding.parse_assembly(emit(program, target, Settings(target.lanes)))
    register = {8: "%zmm", 2: "%xmm"}[target.lanes]
    assert register in machine.emit_assembly(module)


@pytest.mark.parametrize("segment", [10, 2500])
@pytest.mark.parametrize("size", [15, 16, 128, 129])
def test_rows_of_medium_length_are_prefetched(size: int, segment: int) -> None:
    """Shorter rows stall little, and processors prefetch longer ones themselves."""
    graph = Graph()
    nodes = [graph.apply("neg", graph.input(k)) for k in range(size)]
    program = extract_program(graph, [Port("x", (size,))], [Port("y", (size,))], nodes)
    text = emit(program, TARGETS[0], Settings(2, segment=segment))
    lines = 2 * -(-8 * size // 64) if 16 <= size <= 128 else 0
    for hint in ("i32 0, i32 2, i32 1", "i32 1, i32 3, i32 1"):
        assert text.count(f", {hint})") == lines
