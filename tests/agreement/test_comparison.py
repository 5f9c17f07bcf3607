from __future__ import annotations

import mpmath
import numpy as np

from dynx.agreement.compared_quantities import compared_quantities
from dynx.agreement.comparison import BackendResults, compare, judge
from dynx.agreement.magnitudes import Magnitudes
from dynx.agreement.sampling import draw_samples
from dynx.errors import EngineError
from dynx.reference.backend import ReferenceBackend
from dynx.spatial.scalar import Floats
from tests.agreement.robots import Broken, arm

MASS = next(quantity for quantity in compared_quantities() if quantity.name == "mass_matrix")


def test_the_largest_relative_error_and_its_position() -> None:
    verdict = judge(np.array([[1.0, -3.0], [0.5, 0.0]]), np.array([[1.0, 10.0], [0.1, 0.0]]))
    assert verdict.absolute == 3.0
    assert verdict.relative == 5.0
    assert verdict.position == (1, 0)


def test_at_scale_zero_only_an_error_of_zero_is_finite() -> None:
    assert judge(np.zeros(2), np.zeros(2)).relative == 0.0
    assert judge(np.array([1e-300]), np.zeros(1)).relative == np.inf


def test_nan_and_infinity_are_infinite_errors() -> None:
    assert judge(np.array([0.0, np.nan]), np.ones(2)).relative == np.inf
    assert judge(np.array([-np.inf]), np.ones(1)).absolute == np.inf


def test_nothing_to_compare_agrees() -> None:
    assert judge(np.zeros((3, 0)), np.ones((3, 0))).position is None


def test_numbers_of_many_digits_are_subtracted_exactly() -> None:
    error = np.array([mpmath.mpf("1e-40")], dtype=object)
    assert judge(error, np.ones(1)).absolute == 1e-40


def pair(defect: type[Broken]) -> tuple[BackendResults, BackendResults, Magnitudes]:
    samples = draw_samples(arm(), 2, 0)
    one, other = ReferenceBackend(arm()), defect(arm())
    results = BackendResults("reference", one, samples), BackendResults("broken", other, samples)
    return *results, Magnitudes(samples)


class Misshapen(Broken):
    vectorized = False

    def mass_matrix(self, q: object, *, joint_dynamics: bool = False) -> Floats:
        return np.zeros((2, 3, 4))


class Refusing(Broken):
    def _mass_matrix(self, q: Floats) -> Floats:
        raise EngineError("out of order")


def test_another_shape_is_a_difference() -> None:
    row = compare(MASS, *pair(Misshapen))
    assert not row.agree
    assert "(2, 3, 4)" in (row.note or "")


def test_a_refusal_by_one_is_a_difference_that_names_it() -> None:
    row = compare(MASS, *pair(Refusing))
    assert not row.agree
    assert row.note == "broken: EngineError: out of order"
    assert row.worst_sample is None
