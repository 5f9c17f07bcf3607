"""Direct calls of Pinocchio agree with the reference, with mimic joints as free joints."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

import dynx
from dynx.backends.registry import installed_backends
from dynx.bench.cases import BENCHMARK_QUANTITIES, BenchmarkCase, draw_batch
from dynx.bench.implementations import backend_implementation
from dynx.bench.measurement import measure
from dynx.bench.pinocchio_implementations import (
    MIN_CALLS,
    PinocchioBatch,
    PinocchioInside,
    PinocchioLoop,
    pinocchio_implementations,
    without_mimics,
)
from dynx.errors import UnknownBackendError
from dynx.model.tree import Base

ROBOTS: tuple[tuple[str, Base], ...] = (
    ("pendulum", "fixed"),
    ("ur5", "floating"),
    ("panda", "fixed"),
    ("panda", "floating"),
)


@pytest.mark.parametrize("count", [1, 5])
@pytest.mark.parametrize(("robot", "base"), ROBOTS)
def test_they_agree_with_the_reference(robot: str, base: Base, count: int) -> None:
    model = dynx.load(robot, base=base)
    batch = draw_batch(model, model.frame_names[-1], count)
    implementations = list(pinocchio_implementations(model, 2))
    for quantity in BENCHMARK_QUANTITIES:
        for found in measure(BenchmarkCase(quantity, count, threads=2), implementations, batch, 1):
            assert found.problem is None
            assert found.error is not None


def test_the_batches_are_for_two_quantities_and_several_samples() -> None:
    implementation = PinocchioBatch(dynx.load("pendulum"), 2)
    done = {
        (quantity, batch)
        for quantity in BENCHMARK_QUANTITIES
        for batch in (1, 2)
        if implementation.supports(BenchmarkCase(quantity, batch))
    }
    assert done == {("inverse_dynamics", 2), ("forward_dynamics", 2)}
    assert implementation.threads == 2


def test_the_batches_write_into_the_given_array() -> None:
    model = dynx.load("panda")
    implementation = PinocchioBatch(model, 1)
    batch = implementation.samples(draw_batch(model, "panda_hand", 50))
    out = np.full((50, implementation.model.nv), np.nan)
    results = implementation.prepare(BenchmarkCase("inverse_dynamics", 50), batch, out).call()
    assert results is out
    assert np.isfinite(out).all()


def test_freed_mimic_joints_have_the_same_state() -> None:
    model = dynx.load("panda")
    free = without_mimics(model)
    assert (model.nv, free.nv) == (8, 9)
    batch = draw_batch(model, "panda_hand", 6)
    own = PinocchioLoop(model).samples(batch)
    with dynx.backend("reference", model) as ours, dynx.backend("reference", free) as theirs:
        for frame in ("panda_hand", "panda_rightfinger"):
            np.testing.assert_array_equal(
                ours.forward_kinematics(batch.q, frame), theirs.forward_kinematics(own.q, frame)
            )
        energy = theirs.kinetic_energy(own.q, own.v)
        np.testing.assert_allclose(energy, ours.kinetic_energy(batch.q, batch.v), rtol=1e-14)
    # The same case: tau v of both.
    np.testing.assert_allclose(
        np.sum(own.tau * own.v, axis=-1), np.sum(batch.tau * batch.v, axis=-1), rtol=1e-12, atol=1e-14
    )


def test_a_robot_without_mimic_joints_is_unchanged() -> None:
    model = dynx.load("ur5")
    assert without_mimics(model) is model
    batch = draw_batch(model, "tool0", 3)
    assert PinocchioLoop(model).samples(batch) is batch


@pytest.mark.parametrize("quantity", BENCHMARK_QUANTITIES)
def test_the_baseline_runs_on_a_model_of_one_joint(quantity: str) -> None:
    model = dynx.load("pendulum")
    implementation = PinocchioInside(model)
    assert not implementation.supports(BenchmarkCase(quantity, MIN_CALLS - 1))
    case = BenchmarkCase(quantity, MIN_CALLS)
    assert implementation.supports(case)
    (found,) = measure(case, [implementation], draw_batch(model, "tip", MIN_CALLS), 2)
    # Of a robot with one joint nothing is left; what is left of others is not for a test to time.
    assert found.error is not None
    ready = implementation.prepare(case, draw_batch(model, "tip", 2), np.zeros((2, *answer_of(quantity))))
    assert len(ready.calls) == 2


def answer_of(quantity: str) -> tuple[int, ...]:
    """Return the shape of the quantity for the pendulum."""
    return {"forward_kinematics": (4, 4), "jacobian": (6, 1), "mass_matrix": (1, 1)}.get(quantity, (1,))


def test_the_engine_is_named_with_its_version() -> None:
    assert PinocchioLoop(dynx.load("pendulum")).version == f"pinocchio {pin.__version__}"


@pytest.mark.parametrize("count", [1, 5])
@pytest.mark.parametrize("name", installed_backends())
@pytest.mark.parametrize("base", ["fixed", "floating"])
def test_every_backend_computes_every_quantity(name: str, base: Base, count: int) -> None:
    model = dynx.load("panda", base=base)
    batch = draw_batch(model, "panda_hand", count)
    implementation = backend_implementation(model, name, 1)
    for quantity in BENCHMARK_QUANTITIES:
        (found,) = measure(BenchmarkCase(quantity, count), [implementation], batch, 1)
        assert found.problem is None
        assert found.times is not None


def test_a_backend_with_threads_gets_them() -> None:
    model = dynx.load("double_pendulum")
    implementation = backend_implementation(model, "compiled", 2)
    assert (implementation.name, implementation.threads, implementation.whole) == ("compiled", 2, True)
    implementation = backend_implementation(model, "reference", 2)
    assert (implementation.name, implementation.threads, implementation.whole) == ("reference", 1, False)


def test_an_unknown_backend_is_refused() -> None:
    with pytest.raises(UnknownBackendError):
        backend_implementation(dynx.load("double_pendulum"), "nosuch", 1)


def test_closing_closes_the_backend() -> None:
    model = dynx.load("double_pendulum")
    implementation = backend_implementation(model, "reference", 1)
    implementation.close()
    (found,) = measure(BenchmarkCase("mass_matrix", 1), [implementation], draw_batch(model, "tip", 1), 1)
    assert found.problem is not None
    assert "was closed" in found.problem
