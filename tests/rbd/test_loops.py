"""Loops over bodies: one text on floats, on 50 digits and on symbols, and the order of its steps."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from dynx.model.mechanism import Body, BodyFrame, Mechanism
from dynx.rbd import aba, coriolis, crba, derivatives, regressor, rnea
from dynx.rbd.loops import PythonLoops
from dynx.simd.trace import trace
from dynx.spatial.scalar import Array, Floats
from tests.backends.robots import mixed_robot
from tests.rbd.exact import distance, exact_mechanism, exactly, fifty_digits, tree_q
from tests.simd.interp import interpret

FRAMES = (0, 3, 7)

ALGORITHMS: dict[str, tuple[Callable[..., Any], str]] = {
    "inverse dynamics": (rnea.inverse_dynamics, "qva"),
    "bias torque": (rnea.bias_torque, "qv"),
    "gravity torque": (rnea.gravity_torque, "q"),
    "mass matrix": (crba.mass_matrix, "q"),
    "forward dynamics": (aba.forward_dynamics, "qva"),
    "Coriolis matrix": (coriolis.coriolis_matrix_at, "qv"),
    "derivatives": (derivatives.inverse_dynamics_derivatives, "qva"),
    "regressor": (lambda m, q, v, a: regressor.inertial_regressor_at(m, q, v, a, FRAMES), "qva"),
}


def _evaluated(name: str, mechanism: Mechanism, state: dict[str, Array]) -> tuple[Array, ...]:
    algorithm, arguments = ALGORITHMS[name]
    found = algorithm(mechanism, *(state[argument] for argument in arguments))
    return found if isinstance(found, tuple) else (found,)


@pytest.mark.parametrize("base", ["fixed", "floating"])
@pytest.mark.parametrize("name", ALGORITHMS)
def test_floats_fifty_digits_and_symbols_give_the_same(name: str, base: str) -> None:
    model = mixed_robot(base)
    mechanism, rng = model.mechanism, np.random.default_rng(1)
    q = mechanism.tree_q(model.random(rng))
    state = {"q": q, "v": rng.normal(size=mechanism.nv), "a": rng.normal(size=mechanism.nv)}
    found = _evaluated(name, mechanism, state)
    with fifty_digits():
        exact = {"q": tree_q(model, model.random(np.random.default_rng(1)))}
        exact |= {rate: exactly(state[rate]) for rate in "va"}
        wanted = _evaluated(name, exact_mechanism(model), exact)
        assert all(distance(x, y) < 1e-11 for x, y in zip(found, wanted, strict=True))

    def outputs(**symbols: Array) -> dict[str, Array]:
        return {f"{k}": x for k, x in enumerate(_evaluated(name, mechanism, symbols))}

    program = trace(outputs, {argument: state[argument].shape for argument in ALGORITHMS[name][1]})
    traced = interpret(program, [state[argument][None] for argument in ALGORITHMS[name][1]])
    for k, x in enumerate(found):
        np.testing.assert_allclose(traced[k].reshape(x.shape), x, rtol=0.0, atol=1e-12 * np.abs(x).max())


@pytest.mark.parametrize("base", ["fixed", "floating"])
@pytest.mark.parametrize("batched", ["q", "v", "qva"])
@pytest.mark.parametrize("name", ALGORITHMS)
def test_leading_axes_of_the_arguments_are_broadcast(name: str, batched: str, base: str) -> None:
    model = mixed_robot(base)
    mechanism, rng = model.mechanism, np.random.default_rng(2)
    batch: dict[str, Floats] = {"q": mechanism.tree_q(model.random(rng, (3,)))}
    batch |= {rate: rng.normal(size=(3, mechanism.nv)) for rate in "va"}
    state = {argument: x if argument in batched else x[0] for argument, x in batch.items()}
    if not set(batched) & set(ALGORITHMS[name][1]):
        return
    found = _evaluated(name, mechanism, state)
    for k in range(3):
        one = {argument: x[k] if argument in batched else x for argument, x in state.items()}
        for x, y in zip(found, _evaluated(name, mechanism, one), strict=True):
            np.testing.assert_allclose(x[k], y, rtol=0.0, atol=1e-12 * np.abs(y).max())


@pytest.mark.parametrize("name", ALGORITHMS)
def test_a_mechanism_without_joints_has_results_without_entries(name: str) -> None:
    mechanism = replace(mixed_robot().mechanism, bodies=(), frames=mixed_robot().mechanism.frames[:1])
    empty = np.zeros((4, 0))
    if name == "regressor":
        found = regressor.inertial_regressor_at(mechanism, empty, empty, empty, (0,))
        assert found.shape == (4, 0, 10)
        return
    for x in _evaluated(name, mechanism, {"q": empty, "v": empty, "a": empty}):
        assert x.shape in ((4, 0), (4, 0, 0))


# -- the order of the steps -----------------------------------------------------------------------------
#
# A tree whose bodies are numbered by their axes:  root - 0 - 1 - 2
#                                                           \ 3 - 4


def _numbered_tree(base: str = "fixed") -> PythonLoops:
    like = mixed_robot(base).mechanism
    parents = (-1, 0, 1, 0, 3)
    numbers = [np.full(3, float(k)) for k in range(5)]
    bodies = [replace(like.bodies[0], parent=p, axis=x) for p, x in zip(parents, numbers, strict=True)]
    frames = [BodyFrame(str(body), body, np.eye(3), np.zeros(3)) for body in range(-1, 5)]
    return PythonLoops(replace(like, bodies=tuple(bodies), frames=tuple(frames)))


def _number(body: Body) -> int:
    return int(body.axis[0])


def test_a_state_is_carried_outward_from_parents() -> None:
    loops = _numbered_tree()
    states, results = loops.outward(
        lambda body, path, x, name: (f"{path}{_number(body)}", (float(x), name)),
        "r",
        np.array([10.0, 20.0, 30.0, 40.0, 50.0]),
        "abcde",
    )
    assert states == ["r", "r0", "r01", "r012", "r03", "r034"]
    assert results == [(10.0, "a"), (20.0, "b"), (30.0, "c"), (40.0, "d"), (50.0, "e")]


def test_entries_of_joints_are_the_last_of_an_array() -> None:
    loops = _numbered_tree("floating")
    q, v = np.arange(12.0), np.arange(11.0)
    assert loops.each(lambda body, x, y: (float(x), float(y)), q, v) == [(k + 7.0, k + 6.0) for k in range(5)]
    # A sequence may begin with the value of the root.
    assert loops.each(lambda body, x: x, "r01234") == list("01234")


def test_totals_are_summed_inward() -> None:
    totals, results = _numbered_tree().inward(
        lambda body, total, parent: (parent + total, total[0]), ["r", "0", "1", "2", "3", "4"]
    )
    assert totals[0] == "r0" + "34" + "12"
    assert totals[1:] == ["03412", "12", "2", "34", "4"]
    assert results == ["0", "1", "2", "3", "4"]


@pytest.mark.parametrize("base", ["fixed", "floating"])
def test_subtrees_are_summed_without_the_root_of_a_fixed_base(base: str) -> None:
    totals = _numbered_tree(base).subtrees(
        lambda body, total, parent, name: f"{parent}{total}{name}", ["r", "0", "1", "2", "3", "4"], "abcde"
    )
    assert totals[1:] == ["034ed12cb", "12c", "2", "34e", "4"]
    assert totals[0] == ("r" + totals[1] + "a" if base == "floating" else "r")


@pytest.mark.parametrize("base", ["fixed", "floating"])
def test_responses_are_carried_to_the_root(base: str) -> None:
    """The entry of joint i and ancestor j is 100 i + 10 j, plus 1 in the row of i, plus a path's length."""
    loops = _numbered_tree(base)
    first = loops.mechanism.nv - 5
    matrices = loops.matrices(2, like=np.zeros((2, 3, loops.mechanism.nv)))

    def start(body: Body, name: int) -> tuple[tuple[int, int], tuple[Array, Array]]:
        return (name, 0), (np.array(110.0 * name), np.array(-1.0))

    def pair(body: Body, response: tuple[int, int], below: int, here: int) -> tuple[Any, Any, Any]:
        name, steps = response
        assert loops.mechanism.bodies[below].parent == here == _number(body)
        entry = np.array(100.0 * name + 10.0 * here + 0.1 * (steps + 1))
        return (name, steps + 1), (entry + 1.0, np.array(2.0)), (entry, np.array(3.0))

    def at_base(response: tuple[int, int], below: int, root: str) -> tuple[Any, Any]:
        assert below == 0
        assert root == "root"
        row = 1000.0 * response[0] + np.arange(6.0)
        return (row, row), (list(-row), list(-row))

    names = range(5)
    loops.to_root(
        matrices, start, pair, at_base, own=(names,), below=(names,), here=(names,), at_base=("root",)
    )
    loops.base_block(matrices, lambda mechanism, x: (x * np.eye(6), 2.0 * x * np.eye(6)), 7.0)
    A, B = loops.assembled(matrices)
    assert A.shape == (2, 3, loops.mechanism.nv, loops.mechanism.nv)
    assert np.all(A[0, 0] == A)
    assert np.all(B[0, 0] == B)
    A, B = A[0, 0], B[0, 0]
    joints = A[first:, first:]
    np.testing.assert_allclose(np.diag(joints), [0.0, 110.0, 220.0, 330.0, 440.0])
    np.testing.assert_allclose(joints[[2, 2, 4], [1, 0, 3]], [211.1, 201.2, 431.1])
    np.testing.assert_allclose(joints[[1, 0, 3], [2, 2, 4]], [210.1, 200.2, 430.1])
    assert np.all(joints[np.ix_([1, 2], [3, 4])] == 0.0)
    assert np.all(joints[np.ix_([3, 4], [1, 2])] == 0.0)
    assert np.all(np.diag(B[first:, first:]) == -1.0)
    assert B[first + 2, first] == 2.0
    assert B[first, first + 2] == 3.0
    if base == "floating":
        np.testing.assert_array_equal(A[:6, :6], 7.0 * np.eye(6))
        np.testing.assert_array_equal(B[:6, :6], 14.0 * np.eye(6))
        np.testing.assert_array_equal(A[8, :6], 2000.0 + np.arange(6.0))
        np.testing.assert_array_equal(A[:6, 8], -2000.0 - np.arange(6.0))


@pytest.mark.parametrize("base", ["fixed", "floating"])
def test_responses_of_frames_are_entered_in_the_rows_of_the_joints_that_move_them(base: str) -> None:
    loops = _numbered_tree(base)
    first = loops.mechanism.nv - 5
    frames = (3, 0, 5)
    matrices = loops.matrices(1, like=np.zeros(loops.mechanism.nv), blocks=3, width=2)
    loops.frames_to_root(
        matrices,
        frames,
        lambda frame, own: (frame.name, own),
        lambda body, response, here: (np.array([float(response[0]), here]),),
        lambda response, root: ([np.array([k, root]) for k in range(6)],),
        own=("r01234",),
        here=(np.arange(loops.mechanism.nv) - first,),
        at_base=(9.0,),
    )
    (Y,) = loops.assembled(matrices)
    rows = Y[first:].reshape(5, 3, 2)
    # Frame 3 is fixed to body 2, frame 5 to body 4, and frame 0 to the root.
    np.testing.assert_array_equal(rows[:, 0, 0], [2.0, 2.0, 2.0, 0.0, 0.0])
    np.testing.assert_array_equal(rows[:, 0, 1], [0.0, 1.0, 2.0, 0.0, 0.0])
    np.testing.assert_array_equal(rows[:, 2, 0], [4.0, 0.0, 0.0, 4.0, 4.0])
    assert np.all(rows[:, 1] == 0.0)
    for block in range(3) if base == "floating" else ():
        np.testing.assert_array_equal(Y[:6, 2 * block], np.arange(6.0))
        np.testing.assert_array_equal(Y[:6, 2 * block + 1], np.full(6, 9.0))
