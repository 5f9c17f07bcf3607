"""Kernels with loops inside: Newton's iteration, lanes that end at different times, misuse."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from dynx.errors import TraceError
from dynx.simd.kernel import Kernel
from dynx.simd.repetition import Repetition, load_repetition, trace_repetition
from dynx.spatial.scalar import Array, Floats, less, sqrt

MOST = 60
Numbers = dict[str, Array]


def root_of(x: Array, scale: Array, repeat: Any) -> Numbers:
    """Return the root of x scale by Newton's iteration from 1, and the number of iterations.

    The step uses a value from before the loop, and so does the code after it.
    """
    square = x[0] * scale[0]

    def newton(state: Numbers) -> Numbers:
        y = state["y"][0]
        better = 0.5 * (y + square / y)
        goes_on = less(1e-9 * abs(square), abs(better * better - square))
        return {"y": np.array([better]), "count": state["count"] + 1.0, "goes_on": np.array([goes_on])}

    start = {"y": np.array([1.0 + 0.0 * square]), "count": np.zeros(2), "goes_on": np.ones(1)}
    found = repeat(newton, start, MOST)
    exact = sqrt(np.array([square]))[0]
    return {
        "root": found["y"],
        "count": found["count"][:1],
        "error": np.array([found["y"][0] - exact]),
        "x": x,
    }


def on_numbers(step: Any, state: Numbers, most: int) -> Numbers:
    """Repeat on floats."""
    for _ in range(most):
        if state["goes_on"][0] == 0.0:
            break
        state = step(state)
    return state


@pytest.fixture(scope="module")
def repetition() -> Repetition:
    return trace_repetition(root_of, {"x": (20,), "scale": (1,)})


def run(repetition: Repetition, x: Floats, scale: Floats) -> list[Floats]:
    kernel = load_repetition(repetition)
    found = [np.full((len(x), port.size), np.nan) for port in kernel.outputs]
    kernel([x, scale], found)
    return found


def samples(n: int) -> tuple[Floats, Floats]:
    """Return numbers whose iterations take between one and some thirty steps."""
    rng = np.random.default_rng(n)
    x = rng.uniform(1.0, 2.0, (n, 20))
    x[:, 0] = 10.0 ** rng.uniform(-6.0, 12.0, n)
    x[::5, 0] = 1.0
    return x, np.where(np.arange(n)[:, None] % 5 == 0, 1.0, rng.uniform(0.5, 2.0, (n, 1)))


def test_every_lane_ends_where_numbers_end(repetition: Repetition) -> None:
    x, scale = samples(37)
    root, count, error, same = run(repetition, x, scale)
    for k in range(len(x)):
        wanted = root_of(x[k], scale[k], on_numbers)
        assert count[k, 0] == wanted["count"][0]
        np.testing.assert_allclose(root[k], np.asarray(wanted["root"], dtype=float), rtol=1e-14)
    assert len(set(count[:, 0])) > 5
    assert np.all(np.abs(error[:, 0]) <= 1e-9 * root[:, 0])
    assert np.array_equal(same, x)


def test_results_depend_neither_on_neighbours_nor_on_their_number(repetition: Repetition) -> None:
    x, scale = samples(41)
    whole = run(repetition, x, scale)
    order = np.random.default_rng(0).permutation(len(x))
    mixed = run(repetition, x[order], scale[order])
    for a, b in zip(whole, mixed, strict=True):
        assert np.array_equal(a[order], b)
    for k in range(0, 41, 8):
        for a, b in zip(whole, run(repetition, x[k : k + 1], scale[k : k + 1]), strict=True):
            assert np.array_equal(a[k : k + 1], b)


def test_a_lane_that_never_ends_stops_after_the_largest_number_of_steps(repetition: Repetition) -> None:
    x, scale = samples(16)
    x[3, 0] = np.nan
    clean = run(repetition, *samples(16))
    found = run(repetition, x, scale)
    others = np.arange(16) != 3
    for a, b in zip(found, clean, strict=True):
        assert np.array_equal(a[others], b[others])
    assert np.isnan(found[0][3, 0])


def test_what_a_step_computes_without_the_state_is_computed_before(repetition: Repetition) -> None:
    def function(x: Array, repeat: Any) -> Numbers:
        def step(state: Numbers) -> Numbers:
            return {"y": state["y"] / sqrt(x), "goes_on": state["goes_on"]}

        last: Numbers = repeat(step, {"y": x, "goes_on": np.ones(1)}, 3)
        return {"y": last["y"]}

    found = trace_repetition(function, {"x": (1,)})
    operations = [{node.op for node in part.nodes} - {"input"} for part in found.parts]
    assert operations == [{"sqrt", "div", "constant"}, {"mul", "select"}, set()]
    np.testing.assert_allclose(run_one(found, 4.0), 4.0 / 8.0, rtol=1e-15)


def run_one(repetition: Repetition, x: float) -> Floats:
    kernel = load_repetition(repetition)
    found = np.empty((1, 1))
    kernel([np.full((1, 1), x)], [found])
    return np.asarray(found[0])


def roots_of(x: Array, scale: Array, repeat: Any) -> Numbers:
    """Return the root of x scale and, where it is above 10, its own root, by two loops.

    The second loop and the code after it use values from before the first loop, and of between them.
    """
    first = root_of(x, scale, repeat)
    root, third = first["root"][0], x[0] * scale[0] / 3.0

    def newton(state: Numbers) -> Numbers:
        y = state["y"][0]
        better = 0.5 * (y + root / y)
        goes_on = less(1e-9 * root, abs(better * better - root))
        return {"y": np.array([better]), "goes_on": np.array([goes_on])}

    start = {"y": np.array([1.0 + 0.0 * root]), "goes_on": np.array([less(10.0, root)])}
    last = repeat(newton, start, MOST)["y"][0]
    return {**first, "last": np.array([last, last * third, root + last])}


def test_a_second_loop_begins_where_its_state_says_so() -> None:
    kernel = load_repetition(trace_repetition(roots_of, {"x": (20,), "scale": (1,)}))
    x, scale = samples(37)
    found = [np.full((len(x), port.size), np.nan) for port in kernel.outputs]
    kernel([x, scale], found)
    begun = 0
    for k in range(len(x)):
        wanted = roots_of(x[k], scale[k], on_numbers)
        for port, mine in zip(kernel.outputs, found, strict=True):
            # The error of the first root is a difference of equal numbers.
            expected = np.asarray(wanted[port.name], dtype=float)
            np.testing.assert_allclose(
                mine[k], expected, rtol=1e-13, atol=1e-8 if port.name == "error" else 0
            )
        begun += found[-1][k, 0] != 1.0
    assert 5 < begun < 32


def test_misuse_is_refused() -> None:
    def nested(x: Array, repeat: Any) -> Numbers:
        state = {"goes_on": x}
        return dict(repeat(lambda s: dict(repeat(lambda t: t, s, 2)), state, 2))

    def leaks(x: Array, repeat: Any) -> Numbers:
        seen = []

        def step(state: Numbers) -> Numbers:
            seen.append(state["y"] * 2.0)
            return state

        repeat(step, {"y": x, "goes_on": np.ones(1)}, 2)
        return {"y": seen[0]}

    def never(x: Array, repeat: Any) -> Numbers:
        return {"y": x}

    def endless(x: Array, repeat: Any) -> Numbers:
        return dict(repeat(lambda s: s, {"y": x}, 2))

    for function, message in (
        (nested, "has a loop inside"),
        (leaks, "beside the state"),
        (never, "repeats nothing"),
        (endless, "no entry goes_on"),
    ):
        with pytest.raises(TraceError, match=message):
            trace_repetition(function, {"x": (1,)})


def test_quotients_by_roots_in_a_step_are_correct_to_the_last_places() -> None:
    """Some processors estimate them, and Newton's method ends what the estimate began."""

    def function(x: Array, a: Array, repeat: Any) -> Numbers:
        def step(state: Numbers) -> Numbers:
            return {"x": state["x"], "y": a / sqrt(state["x"]), "goes_on": np.zeros(1)}

        return {"y": repeat(step, {"x": x, "y": a, "goes_on": np.ones(1)}, 1)["y"]}

    kernel = load_repetition(trace_repetition(function, {"x": (1,), "a": (1,)}))
    rng = np.random.default_rng(0)
    x = 10.0 ** rng.uniform(-300.0, 300.0, (4096, 1))
    a, found = rng.uniform(-1.0, 1.0, x.shape), np.empty(x.shape)
    kernel([x, a], [found])
    np.testing.assert_allclose(found, a / np.sqrt(x), rtol=4.0 * np.finfo(float).eps)
    # A root that vanishes divides as the tiny number that is added to it.
    least = np.full((8, 1), 1e-300)
    kernel([least, np.ones((8, 1))], [found[:8]])
    np.testing.assert_allclose(found[:8], 1e150, rtol=1e-15)


def test_turns_are_calls_one_after_another() -> None:
    def function(x: Array, scale: Array, count: Array, repeat: Any) -> Numbers:
        root = root_of(x, scale, repeat)["root"][0]
        # One entry of x stays, the others change places.
        turned = np.array([root + 1e-3 * x[1], x[2], x[1], x[3]])
        return {"x": turned, "count": count + 1.0, "before": x[:1]}

    shapes = {"x": (4,), "scale": (1,), "count": (1,)}
    kernel = load_repetition(trace_repetition(function, shapes, turns=4))
    one = load_repetition(trace_repetition(function, shapes))
    n = 13
    x, count = np.random.default_rng(0).uniform(1.0, 5.0, (n, 4)), np.zeros((n, 1))
    scale = np.full((n, 1), 3.0)

    def call(kernel: Kernel, x: Floats, count: Floats) -> list[Floats]:
        found = [np.full((n, port.size), np.nan) for port in kernel.outputs]
        kernel([x, scale, count], found)
        return found

    after = call(kernel, x, count)
    for _ in range(4):
        x, count, before = call(one, x, count)
    assert np.array_equal(after[0], x)
    assert np.array_equal(after[1], count)
    assert np.array_equal(after[2], before)
    assert (count == 4.0).all()
