"""Engines with an error of known magnitude are found to have that error."""

from __future__ import annotations

import numpy as np
import pytest

from dynx.agreement.tolerances import BAR
from dynx.doctor.examination import (
    ACCELERATION,
    JACOBIAN,
    KINEMATICS,
    MASS,
    QUANTITIES,
    TORQUE,
    max_change,
)
from dynx.errors import EngineError
from dynx.spatial.scalar import Floats
from tests.doctor.faulty_engine import NAME, SECRET, FaultyEngine, examine_case
from tests.rules.documents import case_of, joint, link

ARM = case_of(
    *(link(name, center=(0.1, 0.2, 0.3)) for name in ("base", "upper", "lower")),
    joint("shoulder", "base", "upper", '<origin xyz="0 0.3 1" rpy="1 0.2 0.3"/>'),
    joint("elbow", "upper", "lower", '<origin xyz="0.5 0 0" rpy="0.3 1 0"/>'),
)


class Weak(FaultyEngine):
    """All torques and mass matrices 1 % too large."""

    def mass_matrix(self, q: Floats) -> Floats:
        return np.asarray(1.01 * super().mass_matrix(q))

    def inverse_dynamics(self, q: Floats, v: Floats, a: Floats) -> Floats:
        return 1.01 * super().inverse_dynamics(q, v, a)


class Fast(FaultyEngine):
    """All accelerations 1 % too large."""

    def forward_dynamics(self, q: Floats, v: Floats, tau: Floats) -> Floats:
        return np.asarray(1.01 * super().forward_dynamics(q, v, tau))


class Stop(FaultyEngine):
    """A stop on one side of the first joint."""

    def forward_dynamics(self, q: Floats, v: Floats, tau: Floats) -> Floats:
        a: Floats = super().forward_dynamics(q, v, tau).copy()
        a[0] = max(a[0], 0.0)
        return a


class Lost(FaultyEngine):
    """No dynamics; one link merged into another, one without a pose."""

    def link_poses(self, q: Floats) -> Floats:
        T: Floats = super().link_poses(q).copy()
        T[0], T[2, 0, 3] = np.nan, np.nan
        return T

    def inverse_dynamics(self, q: Floats, v: Floats, a: Floats) -> Floats:
        return np.full(len(v), np.nan)

    def mass_matrix(self, q: Floats) -> Floats:
        raise EngineError("no mass matrix")


def test_reference_values_have_no_error() -> None:
    errors = examine_case(ARM).errors(NAME)
    assert set(errors) == set(QUANTITIES)
    assert max(errors.values()) == 0.0 or max(errors.values()) <= BAR


@pytest.mark.parametrize("mass", [1e-6, 1.0, 1e6])
def test_an_error_is_relative_whatever_the_robot_weighs(mass: float) -> None:
    moments = (0.01 * mass, 0.01 * mass, 0.01 * mass)
    case = case_of(
        link("base"),
        link("arm", mass=mass, moments=moments, center=(0.1, 0.2, 0.3)),
        joint("j", "base", "arm"),
    )
    errors = examine_case(case, Weak).errors(NAME)
    assert errors[TORQUE] == pytest.approx(0.01)
    assert errors[MASS] == pytest.approx(0.01)
    assert errors[KINEMATICS] <= BAR
    assert errors[JACOBIAN] <= BAR


def test_where_the_reference_value_is_zero_the_error_is_1() -> None:
    # A point mass on the axis of the joint.
    case = case_of(
        *('<link name="base"/>', link("wheel", moments=(0.0, 0.0, 0.0)), '<link name="frame"/>'),
        joint("j", "base", "wheel"),
        joint("flange", "wheel", "frame", type="fixed"),
    )
    errors = examine_case(case).errors(NAME)
    assert errors[MASS] == errors[TORQUE] == 1.0
    # The mass matrix is zero, so no torque gives an acceleration.
    assert ACCELERATION not in errors


def test_an_acceleration_is_judged_by_the_torque_that_it_takes() -> None:
    error = examine_case(ARM, Fast, samples=20).error(NAME, ACCELERATION)
    # M a is a part of |M| |a| + |bias| + |tau|, and its excess is 1 %.
    assert 1e-4 < error <= 0.01


def test_a_force_that_acts_on_one_side_alone_shows() -> None:
    assert all(examine_case(ARM, Stop, samples=1).error(NAME, quantity) <= BAR for quantity in (MASS, TORQUE))
    assert examine_case(ARM, Stop, samples=1).error(NAME, ACCELERATION) > BAR


def test_what_is_no_number_is_no_agreement() -> None:
    lost = examine_case(ARM, Lost)
    assert lost.error(NAME, TORQUE) == lost.error(NAME, MASS) == lost.error(NAME, KINEMATICS) == np.inf
    assert lost.max_error(NAME) == np.inf
    assert "no mass matrix" in lost.outputs[NAME].failed[MASS]


def test_a_link_that_is_merged_is_not_compared_and_one_without_place_is() -> None:
    assert set(examine_case(ARM, Lost).outputs[NAME].deviation[KINEMATICS]) == {"upper", "lower"}


def test_a_file_that_is_refused_has_no_errors_and_is_wrong() -> None:
    refusing = examine_case(case_of(link("base"), f"<!-- {SECRET} -->"))
    assert refusing.outputs[NAME].refused == f"robot.urdf is a {SECRET}"
    assert refusing.errors(NAME) == {}
    assert refusing.max_error(NAME) == refusing.error(NAME, TORQUE) == np.inf


def test_fewer_states_are_the_first_of_them() -> None:
    whole, first = examine_case(ARM, Weak, samples=3), examine_case(ARM, Weak, samples=3).first(1)
    assert len(first.reference.states) == 1
    for quantity in QUANTITIES:
        for part, gap in whole.outputs[NAME].deviation[quantity].items():
            np.testing.assert_array_equal(first.outputs[NAME].deviation[quantity][part], gap[:1])


def test_the_largest_change_of_two_deviations() -> None:
    one, two = np.zeros((3, 2)), np.array([[0.0, -2.0], [1.0, 0.0], [0.0, 0.0]])
    assert max_change({"": one}, {"": two}) == max_change({"": two}, {"": one}) == 2.0
    assert max_change({"a": one, "b": two}, {"a": one}) == 0.0
    assert max_change({"": one}, {"": np.zeros((3, 3))}) == np.inf
    assert max_change({"": one}, {"": np.full((3, 2), np.nan)}) == np.inf


def test_a_joint_has_its_own_error() -> None:
    class Elbow(FaultyEngine):
        def inverse_dynamics(self, q: Floats, v: Floats, a: Floats) -> Floats:
            return super().inverse_dynamics(q, v, a) * [1.0, 1.5]

    errors = examine_case(ARM, Elbow).joint_errors(NAME)
    assert errors["elbow"] == pytest.approx(0.5)
    assert errors["shoulder"] <= BAR
