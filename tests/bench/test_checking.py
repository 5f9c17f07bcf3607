"""Checks of results: right ones pass, wrong ones fail wherever in a batch they are."""

from __future__ import annotations

import numpy as np
import pytest

import dynx
from dynx.backends.quantities import QUANTITIES
from dynx.bench.cases import BENCHMARK_QUANTITIES, draw_batch
from dynx.bench.measurement import CHECKED_AT_ENDS, Judge, checked_rows
from dynx.errors import SingularMassMatrixError
from dynx.model import Joint, Link, Model
from dynx.model.tree import Base
from dynx.reference.backend import ReferenceBackend
from dynx.spatial.scalar import Floats

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
