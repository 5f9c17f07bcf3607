"""Costs of programs, counted by hand."""

from __future__ import annotations

from math import prod

import numpy as np
import pytest

import dynx
from dynx.backends.quantities import QUANTITIES
from dynx.bench.machine import SINE_COSINE_PAIRS, SINE_COSINE_SINGLES, Cost, cost_of, program_of
from dynx.simd.ir_writer import Writer
from dynx.simd.trace import trace
from dynx.simd.trigonometry import sines_and_cosines
from dynx.spatial.scalar import Array


def test_a_product_and_its_sum_are_two_operations_done_as_one() -> None:
    program = trace(lambda x: x[:1] * x[1:2] + x[2:3], {"x": (3,)})
    assert cost_of(program) == Cost(bytes=8 * 4, operations=2, multiply_adds=1)


def test_a_product_that_two_sums_use_is_done_alone() -> None:
    def function(x: Array) -> Array:
        product = x[0] * x[1]
        return np.array([product + x[2], product - x[2]])

    assert cost_of(trace(function, {"x": (3,)})) == Cost(bytes=8 * 5, operations=3, multiply_adds=3)


def test_a_product_that_is_also_an_output_is_done_alone() -> None:
    def function(x: Array) -> Array:
        product = x[0] * x[1]
        return np.array([product + x[2], product])

    assert cost_of(trace(function, {"x": (3,)})) == Cost(bytes=8 * 5, operations=2, multiply_adds=2)


def test_a_sum_of_two_products_is_paired_with_one_of_them() -> None:
    program = trace(lambda x: x[:1] * x[1:2] + x[2:3] * x[3:4], {"x": (4,)})
    assert cost_of(program) == Cost(bytes=8 * 5, operations=3, multiply_adds=2)


def test_copying_takes_no_operation() -> None:
    assert cost_of(trace(lambda x: x, {"x": (4,)})) == Cost(bytes=64, operations=0, multiply_adds=0)


def test_sine_and_cosine_of_one_angle_cost_once() -> None:
    both = trace(lambda x: np.array([np.sin(x[0]), np.cos(x[0])]), {"x": (1,)})
    assert cost_of(both).multiply_adds == SINE_COSINE_PAIRS + SINE_COSINE_SINGLES
    assert cost_of(both).operations == 2 * SINE_COSINE_PAIRS + SINE_COSINE_SINGLES


def test_the_cost_matches_the_emitted_instructions() -> None:
    write = Writer(4, fma=True)
    sines_and_cosines(write, ["%x"])
    labels = [k for k, line in enumerate(write.lines) if not line.startswith(" ")]
    straight = write.lines[: labels[0]]  # before the branch for large angles
    assert sum("@llvm.fma" in line for line in straight) == SINE_COSINE_PAIRS
    # The sign of the result costs nothing: bit operations set it.
    single = [line for line in straight if any(f" {op} " in line for op in ("fadd", "fsub", "fmul"))]
    assert len(single) == SINE_COSINE_SINGLES


@pytest.mark.parametrize("quantity", QUANTITIES)
@pytest.mark.parametrize("robot", ["double_pendulum", "panda"])
def test_bytes_are_those_of_arguments_and_result(robot: str, quantity: str) -> None:
    model = dynx.load(robot)
    program = program_of(model, quantity, model.frame_names[-1])
    assert program is not None
    sizes = {"q": model.nq, "v": model.nv, "a": model.nv, "tau": model.nv}
    numbers = sum(sizes[name] for name in QUANTITIES[quantity].arguments) + prod(
        QUANTITIES[quantity].shape_of(model)
    )
    assert cost_of(program).bytes == 8 * numbers


def test_a_quantity_that_is_not_compiled_has_no_cost(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("dynx.bench.machine.compiles", lambda mechanism, name: False)
    model = dynx.load("double_pendulum")
    assert program_of(model, "inverse_dynamics", model.frame_names[-1]) is None
