"""Quantities of large robots as calls of routines, which are compiled once for all robots."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from benchmarks.every_quantity import serial_arm, tree
from dynx.backends import backend
from dynx.backends.evaluation import MIN_SUMMED_COLUMNS, HookEvaluation
from dynx.backends.quantities import QUANTITIES
from dynx.compiled.call import MAX_COPIED_SAMPLES
from dynx.compiled.table_kernels import TABLE_QUANTITIES
from dynx.model import Model
from dynx.model.tree import Base
from dynx.simd.target import host
from dynx.spatial.scalar import Floats
from tests.backends.robots import mixed_robot
from tests.compiled.robots import ROBOTS, made, state
from tests.error_bounds import ErrorBounds, samples_at


@pytest.fixture(autouse=True)
def _only_routines(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("dynx.compiled.kernels.MAX_SECONDS_BESIDE_ROUTINES", -1.0)
    monkeypatch.setattr("dynx.compiled.kernels.MAX_COMPILE_SECONDS", -1.0)


def _arguments(model: Model, quantity: str, size: tuple[int, ...]) -> list[Floats]:
    q, v, a = state(model, size)
    values = {"q": q, "v": v, "a": a, "tau": a}
    return [values[argument] for argument in QUANTITIES[quantity].arguments]


@pytest.mark.parametrize("quantity", sorted(TABLE_QUANTITIES))
@pytest.mark.parametrize("model", [*ROBOTS.values(), tree(30), serial_arm(20)], ids=lambda m: m.name)
def test_routines_give_the_results_of_the_reference(model: Model, quantity: str) -> None:
    q, v, a = state(model, (3,))
    expected = getattr(backend("reference", model), quantity)(*_arguments(model, quantity, (3,)))
    found = getattr(made(model), quantity)(*_arguments(model, quantity, (3,)))
    if quantity == "forward_dynamics":
        quantity, expected = "inverse_dynamics", a
        found = backend("reference", model).inverse_dynamics(q, v, found)
        ErrorBounds(samples_at(model, q, v, a, a)).check(quantity, found, expected)
        return
    ErrorBounds(samples_at(model, q, v, a, a)).check(quantity, found, expected)


@pytest.mark.parametrize("quantity", sorted(TABLE_QUANTITIES))
def test_results_do_not_depend_on_the_other_samples_or_on_threads(quantity: str) -> None:
    """One sample has code of one lane, few are repeated to fill the lanes, many are divided into parts."""
    model = ROBOTS["floating"]
    sizes = (1, 2, 3, host().lanes, host().lanes + 1, MAX_COPIED_SAMPLES + 3)
    arguments = _arguments(model, quantity, (sizes[-1],))
    engine = made(model, threads=3)
    whole = getattr(engine, quantity)(*arguments)
    single = getattr(engine, quantity)(*(x[0] for x in arguments))
    np.testing.assert_array_equal(single, whole[0])
    for size in sizes:
        rows = [np.ascontiguousarray(x[:size]) for x in arguments]
        np.testing.assert_array_equal(getattr(engine, quantity)(*rows), whole[:size])
        strided = [np.asfortranarray(x) for x in rows]
        np.testing.assert_array_equal(getattr(made(model, threads=1), quantity)(*strided), whole[:size])


@pytest.mark.parametrize("robot", ["mimic", "floating mimic"])
@pytest.mark.parametrize("quantity", ["coriolis_matrix", "inertial_regressor", "inverse_dynamics"])
def test_mimic_joints_are_expanded_by_stored_matrices(
    robot: str, quantity: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Making them in each call had taken longer than the routines and than other engines."""
    model = ROBOTS[robot]
    call = getattr(made(model), quantity)
    rows = _arguments(model, quantity, (3,))
    whole = call(*rows)

    def refuse(*_: object) -> None:
        raise AssertionError("the coupling is made into a matrix")

    for name in ("matrix", "affine_map", "expand_q"):
        monkeypatch.setattr(f"dynx.model.mechanism.Coupling.{name}", refuse)
    size = np.abs(whole).max()
    for k in range(3):
        np.testing.assert_allclose(call(*(x[k] for x in rows)), whole[k], rtol=0.0, atol=1e-13 * size)


@pytest.mark.parametrize("quantity", ["coriolis_matrix", "inverse_dynamics"])
def test_long_batches_with_mimic_joints_are_evaluated_in_blocks(
    quantity: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    model = ROBOTS["floating mimic"]
    rows = _arguments(model, quantity, (7, 5))
    whole = getattr(made(model, threads=1), quantity)(*rows)
    monkeypatch.setattr("dynx.compiled.call.MIN_BLOCK", 4)
    monkeypatch.setattr("dynx.compiled.call.BLOCK_NUMBERS", 0)
    np.testing.assert_array_equal(getattr(made(model, threads=1), quantity)(*rows), whole)


@pytest.mark.parametrize("batch", [(), (3,), (2, 3)])
@pytest.mark.parametrize("columns", [1, MIN_SUMMED_COLUMNS])
@pytest.mark.parametrize("base", ["fixed", "floating"])
def test_rows_and_columns_are_reduced_by_the_coupling(
    base: Base, columns: int, batch: tuple[int, ...]
) -> None:
    mechanism = mixed_robot(base, mimic=True).mechanism
    assert mechanism.coupling is not None
    S = mechanism.coupling.matrix()
    A = np.random.default_rng(0).normal(size=(*batch, len(S), columns))
    evaluation = HookEvaluation(mechanism, vectorized=True)
    np.testing.assert_allclose(evaluation.reduce_rows(A), S.T @ A, rtol=0.0, atol=1e-14)
    A = np.swapaxes(A, -1, -2)
    np.testing.assert_allclose(evaluation.reduce_columns(A), A @ S, rtol=0.0, atol=1e-14)


def test_a_bad_argument_is_named() -> None:
    model = ROBOTS["floating"]
    q, _, _ = state(model, (300,))
    for value, what in ((np.nan, "q"), (1e200, "q")):
        for size in (1, 300):
            bad = q[:size].copy()
            bad[-1, -1] = value
            with pytest.raises(Exception, match=what):
                made(model).mass_matrix(bad[0] if size == 1 else bad)
    mimic = ROBOTS["mimic"]
    with pytest.raises(Exception, match="q"):
        made(mimic).mass_matrix(np.full(mimic.nq, np.nan))
    with pytest.raises(Exception, match="masked"):
        made(mimic).mass_matrix(np.ma.array(mimic.neutral(), mask=True))
    unscaled = q[0] * np.r_[np.ones(3), np.full(4, 1.1), np.ones(model.nq - 7)]
    with pytest.raises(Exception, match="quaternion"):
        made(model).mass_matrix(unscaled)


@pytest.mark.parametrize("n", [101, 300])
def test_nothing_is_compiled_for_a_large_tree(n: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Its matrices had compiled for minutes."""
    model = tree(n)
    engine: Any = made(model)
    small = made(ROBOTS["fixed"])
    for quantity in ("mass_matrix", "inverse_dynamics", "coriolis_matrix", "forward_dynamics"):
        getattr(small, quantity)(*_arguments(ROBOTS["fixed"], quantity, ()))
    monkeypatch.setattr("dynx.simd.cache.compile_image", _refuse)
    monkeypatch.setattr("dynx.simd.call_table.compile_routines", _refuse)
    q, v, a = state(model)
    M = engine.mass_matrix(q)
    np.testing.assert_array_equal(M, M.T)
    tau = engine.inverse_dynamics(q, v, a)
    np.testing.assert_allclose(engine.forward_dynamics(q, v, tau), a, rtol=1e-6, atol=1e-6)
    if n > 101:
        return
    np.testing.assert_allclose(M, backend("reference", model).mass_matrix(q), atol=1e-9 * np.abs(M).max())
    C = engine.coriolis_matrix(q, v)
    np.testing.assert_allclose(
        C @ v, _velocity_torque(model, q, v), atol=1e-9 * np.abs(C).max() * np.abs(v).max()
    )


def _velocity_torque(model: Model, q: Floats, v: Floats) -> Floats:
    reference = backend("reference", model)
    return reference.bias_torque(q, v) - reference.gravity_torque(q)


def _refuse(*_: object) -> None:
    raise AssertionError("nothing is to be compiled")
