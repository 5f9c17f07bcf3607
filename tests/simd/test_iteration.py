"""Iterations: every task has the result it has alone, whatever its lane, its neighbours and the threads."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dynx.errors import CompileError, ShapeError
from dynx.simd.emit import Settings
from dynx.simd.iteration import Iteration, IterationKernel, compile_iteration
from dynx.simd.iteration_status import GIVEN_UP, NO_RESTART, REACHED, RUNNING
from dynx.simd.target import host
from dynx.simd.trace import trace
from dynx.spatial.scalar import Array, Floats, less, select

TOLERANCE = 1e-12
"""Largest relative error of a square."""


def newton(x: Array, memory: Array, square: Array, settings: Array) -> dict[str, Array]:
    """Newton's method for the square root; a start below zero is given up, for the next start."""
    value, (_, _, steps, start) = x[0], memory
    error = abs(value * value - square[0])
    below = less(value, 0.0)
    reached = less(error, settings[0] * square[0]) * (1.0 - below)
    exhausted = less(settings[1], start + 1.5)
    again = below * (1.0 - exhausted)
    status = select(reached, REACHED, select(below * exhausted, GIVEN_UP, RUNNING))
    following = 0.5 * (value + square[0] / value)
    after = [value, reached, steps + (1.0 - reached) * (1.0 - below), start + again]
    restart = select(again, start + 1.0, NO_RESTART)
    return {
        "x": np.array([following], dtype=object),
        "memory": np.array(after, dtype=object),
        "status": status,
        "restart": restart,
    }


SHAPES: dict[str, tuple[int, ...]] = {"x": (1,), "memory": (4,), "square": (1,), "settings": (2,)}
ITERATION = Iteration(trace(newton, SHAPES), ("settings",), 4)
KERNELS = {
    lanes: IterationKernel(compile_iteration(ITERATION, host(), Settings(lanes)))
    for lanes in {1, 2, host().lanes}
}


def roots(squares: Floats, starts: Floats, *, lanes: int = host().lanes, threads: int = 1) -> Floats:
    """Return value, whether it is the root, steps and the number of the start, for each square."""
    n = len(squares)
    result = np.full((n, 4), np.nan)
    first, memory = np.broadcast_to(starts[0], (n, 1)), np.zeros((n, 4))
    settings = np.array([TOLERANCE, float(len(starts))])
    KERNELS[lanes](
        [
            first,
            memory,
            squares[:, None],
        ],
        result,
        settings,
        starts,
        threads=threads,
    )
    return result


@given(
    st.lists(st.floats(0.1, 10.0), min_size=1, max_size=40),
    st.lists(st.floats(-3.0, 3.0).filter(lambda x: abs(x) > 0.1), min_size=1, max_size=4),
)
def test_tasks_have_the_results_that_they_have_alone(values: list[float], first: list[float]) -> None:
    squares, starts = np.array(values), np.array(first)[:, None]
    together = roots(squares, starts)
    usable = [k for k, start in enumerate(first) if start > 0.0]
    if usable:
        np.testing.assert_allclose(together[:, 0], np.sqrt(squares), rtol=1e-10)
        assert (together[:, 1] == 1.0).all()
        assert (together[:, 3] == usable[0]).all()
    else:
        assert not together[:, 1].any()
        assert (together[:, 3] == len(first) - 1).all()
    for k in range(len(squares)):
        np.testing.assert_array_equal(roots(squares[k : k + 1], starts)[0], together[k])
    for lanes in KERNELS:
        np.testing.assert_array_equal(roots(squares, starts, lanes=lanes), together)


def test_results_do_not_depend_on_threads() -> None:
    squares = np.random.default_rng(0).uniform(1e-6, 1e6, 5000)
    starts = np.array([[-1.0], [1.0]])
    np.testing.assert_array_equal(roots(squares, starts, threads=4), roots(squares, starts))


@given(st.lists(st.floats(-3.0, 3.0).filter(lambda x: abs(x) > 0.1), min_size=1, max_size=30))
def test_a_race_ends_with_the_first_start_that_reaches_the_target(first: list[float]) -> None:
    starts = np.array(first)[:, None]
    n = len(starts)
    result = np.full((n, 4), np.nan)
    memory, square = np.zeros((n, 4)), np.full((n, 1), 2.0)
    settings = np.array([TOLERANCE, 0.0])
    for kernel in KERNELS.values():
        race = kernel.bind_race([starts, memory, square], result, settings, starts)
        for _ in range(2):
            completed = race()
            usable = [k for k, start in enumerate(first) if start > 0.0]
            assert completed == (usable[0] + 1 if usable else n)
            expected = np.arange(completed) == (usable[0] if usable else n)
            np.testing.assert_array_equal(result[:completed, 1], expected)


def test_no_tasks() -> None:
    starts = np.ones((1, 1))
    assert roots(np.empty(0), starts).shape == (0, 4)
    empty = [np.empty((0, 1)), np.empty((0, 4)), np.empty((0, 1))]
    for kernel in KERNELS.values():
        race = kernel.bind_race(empty, np.empty((0, 4)), np.array([TOLERANCE, 1.0]), starts)
        assert race() == 0


def test_arrays_that_do_not_fit_are_refused() -> None:
    with pytest.raises(ShapeError, match="square"):
        KERNELS[1](
            [np.ones((2, 1)), np.zeros((2, 4)), np.ones((2, 3))], np.ones((2, 4)), np.ones(2), np.ones((1, 1))
        )


def test_a_step_with_other_ports_is_refused() -> None:
    program = trace(lambda x: {"x": x, "status": x[0]}, {"x": (1,)})
    with pytest.raises(CompileError, match="status"):
        Iteration(program, (), 1)
