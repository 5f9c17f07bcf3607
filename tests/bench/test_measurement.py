"""Implementations are checked before they are timed; all that are right are timed."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest

import dynx
from dynx.backends.quantities import QUANTITIES
from dynx.bench import measurement
from dynx.bench.cases import BENCHMARK_QUANTITIES, Batch, BenchmarkCase, draw_batch
from dynx.bench.implementations import PreparedCall
from dynx.bench.measurement import CHECKED_AT_ENDS, LOST_IN_NOISE, TRIAL_SAMPLES, Judge, checked_rows, measure
from dynx.bench.timing import Call, Times
from dynx.errors import SingularMassMatrixError
from dynx.model import Joint, Link, Model
from dynx.model.tree import Base
from dynx.reference.backend import ReferenceBackend
from dynx.spatial.scalar import Floats
from tests.bench.implementations import Failing, Scaled, Silent

MODEL = dynx.load("double_pendulum")
BATCH = draw_batch(MODEL, MODEL.frame_names[-1], 40)
CASE = BenchmarkCase("inverse_dynamics", 40)


def test_right_implementations_are_timed_per_sample() -> None:
    implementation = Scaled("right")
    (found,) = measure(CASE, [implementation], BATCH, 3)
    assert found.problem is None
    assert found.times is not None
    assert len(found.times.seconds) == 3
    assert 0.0 < found.times.median < 1.0 / 40
    assert found.samples == 40
    assert found.error == 0.0


@pytest.mark.parametrize("quantity", BENCHMARK_QUANTITIES)
def test_a_wrong_result_is_reported_and_not_timed(quantity: str) -> None:
    wrong, right = Scaled("wrong", 1.01), Scaled("right")
    found = measure(BenchmarkCase(quantity, 40), [wrong, right], BATCH, 2)
    assert [each.implementation for each in found] == ["wrong", "right"]
    assert found[0].times is None
    assert found[0].problem is not None
    assert found[0].problem.startswith("wrong result, not timed: error ")
    assert wrong.calls == 1
    assert found[1].times is not None


def test_one_wrong_sample_is_enough() -> None:
    (found,) = measure(CASE, [Scaled("nearly", spoilt=39)], BATCH, 2)
    assert found.times is None


def test_an_implementation_that_writes_nothing_does_not_pass_on_earlier_results() -> None:
    found = measure(CASE, [Scaled("right"), Silent("silent")], BATCH, 2)
    assert found[0].times is not None
    assert found[1].times is None
    assert found[1].error == np.inf


def test_a_failing_implementation_is_reported_with_the_error() -> None:
    (found,) = measure(CASE, [Failing("failing")], BATCH, 2)
    assert (found.times, found.error, found.problem) == (None, None, "no such luck")


class Slow(Scaled):
    """An implementation so slow that a whole batch would take long."""

    whole = False

    def prepare(self, case: BenchmarkCase, batch: Batch, out: Floats) -> PreparedCall:
        call = super().prepare(case, batch, out).call

        def slow() -> Floats:
            for _ in range(len(batch) * 200):
                np.sqrt(2.0)
            results: Floats = call()
            return results

        return PreparedCall(slow)


def test_a_slow_implementation_is_timed_at_fewer_samples() -> None:
    batch = draw_batch(MODEL, MODEL.frame_names[-1], 65536)
    found = measure(BenchmarkCase("inverse_dynamics", 65536), [Slow("slow"), Scaled("quick")], batch, 1)
    assert TRIAL_SAMPLES <= found[0].samples < 65536
    assert found[1].samples == 65536


class WithBaseline(Scaled):
    """An implementation with a baseline, whose time is not part of the case."""

    def prepare(self, case: BenchmarkCase, batch: Batch, out: Floats) -> PreparedCall:
        return PreparedCall(super().prepare(case, batch, out).call, lambda: None)


def replace_times(monkeypatch: pytest.MonkeyPatch, *times: Times) -> None:
    """Replace the measured times by these."""

    def interleaved(calls: Sequence[Call], repetitions: int) -> list[Times]:
        assert len(calls) == len(times)
        return list(times)

    monkeypatch.setattr(measurement, "interleaved", interleaved)


def test_a_baseline_is_subtracted(monkeypatch: pytest.MonkeyPatch) -> None:
    plain, with_baseline, baseline = Times((4.0, 4.0)), Times((8.0, 12.0)), Times((2.0, 4.0))
    replace_times(monkeypatch, with_baseline, baseline, plain)
    found = measure(CASE, [WithBaseline("less"), Scaled("wrong", 2.0), Scaled("plain")], BATCH, 2)
    assert found[0].times == Times((6.0 / 40, 8.0 / 40))
    assert found[1].times is None
    assert found[2].times == Times((0.1, 0.1))


def test_a_time_within_the_noise_is_not_reported(monkeypatch: pytest.MonkeyPatch) -> None:
    replace_times(monkeypatch, Times((5e-6,) * 3), Times((6e-6, 5e-6, 1e-6)))
    (found,) = measure(CASE, [WithBaseline("less")], BATCH, 3)
    assert (found.times, found.problem) == (None, LOST_IN_NOISE)
    assert found.error == 0.0


def test_one_sample_has_no_batch_axis() -> None:
    shapes = []

    class Recording(Scaled):
        def prepare(self, case: BenchmarkCase, batch: Batch, out: Floats) -> PreparedCall:
            shapes.append((len(batch), out.shape))
            return super().prepare(case, batch, out)

    (found,) = measure(BenchmarkCase("jacobian", 1), [Recording("asked")], BATCH, 1)
    assert shapes == [(1, (1, 6, MODEL.nv))]
    assert isinstance(found.times, Times)


ROBOTS = ("double_pendulum", "panda")


def judge_and_reference(quantity: str, robot: str, base: Base) -> tuple[Judge, Floats]:
    """Return the judge of some samples, and the reference values."""
    model = dynx.load(robot, base=base)
    batch = draw_batch(model, model.frame_names[-1], 20)
    frame = [batch.frame] if QUANTITIES[quantity].of_frame else []
    right = getattr(ReferenceBackend(model), quantity)(*batch.arguments(quantity), *frame)
    return Judge(batch), right


@pytest.mark.parametrize("base", ["fixed", "floating"])
@pytest.mark.parametrize("robot", ROBOTS)
@pytest.mark.parametrize("quantity", BENCHMARK_QUANTITIES)
def test_right_results_pass_and_small_errors_do_not(quantity: str, robot: str, base: Base) -> None:
    judge, right = judge_and_reference(quantity, robot, base)
    assert judge.check(quantity, right).right
    # An acceleration is judged by the torque it takes, which mostly holds gravity.
    error = 1e-6 if quantity == "forward_dynamics" else 1e-9
    for row in (0, len(right) - 1):
        wrong = right.copy()
        wrong[row] *= 1.0 + error
        check = judge.check(quantity, wrong)
        assert not check.right
        assert check.error > check.tolerance


@pytest.mark.parametrize("quantity", QUANTITIES)
@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_nan_and_infinity_are_wrong(quantity: str, value: float) -> None:
    judge, right = judge_and_reference(quantity, "double_pendulum", "fixed")
    assert judge.check(quantity, right).right
    right[7] = value
    assert judge.check(quantity, right).error == np.inf


def test_a_singular_mass_matrix_is_refused() -> None:
    joint = Joint("joint", "revolute", "base", "tip")
    model = Model.build("massless", [Link("base"), Link("tip")], [joint])
    judge = Judge(draw_batch(model, "tip", 3))
    with pytest.raises(SingularMassMatrixError):
        judge.check("forward_dynamics", np.zeros((3, 1)))


def test_all_rows_of_few_samples_are_checked() -> None:
    assert checked_rows(100) == list(range(100))


def test_of_many_samples_both_ends_and_some_between_are_checked() -> None:
    rows = checked_rows(10**6)
    assert rows == sorted(set(rows))
    assert rows[:CHECKED_AT_ENDS] == list(range(CHECKED_AT_ENDS))
    assert rows[-CHECKED_AT_ENDS:] == list(range(10**6 - CHECKED_AT_ENDS, 10**6))
    # Groups of samples begin at multiples of 8: what is between must not all be at one place in them.
    assert {row % 8 for row in rows[CHECKED_AT_ENDS:-CHECKED_AT_ENDS]} == set(range(8))
