from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dynx.agreement import agree, tolerances
from dynx.agreement.identities import (
    IDENTITIES,
    MAX_REST_FREQUENCY,
    WEIGHTS,
    IdentityCheck,
    check_identities,
    rotate_world,
    time_derivative,
)
from dynx.agreement.magnitudes import EPS, Magnitudes
from dynx.agreement.sampling import draw_samples
from dynx.backends import Backend
from dynx.model import Inertial, Joint, Link, Model, Pose
from dynx.model.tree import Base
from dynx.reference.backend import ReferenceBackend
from dynx.spatial.scalar import Floats
from tests.agreement.robots import BODY, Broken, GravityUpsideDown, TransposedRotation, arm


def identity_checks(backend: Backend) -> dict[str, IdentityCheck]:
    samples = draw_samples(backend.model, 8, 0)
    magnitudes = Magnitudes(samples.take(samples.differentiable(4), 1))
    return {check.identity: check for check in check_identities(backend.name, backend, magnitudes)}


def failed_identities(backend: Backend) -> set[str]:
    return {name for name, check in identity_checks(backend).items() if not check.agree}


@pytest.mark.parametrize("base", ["fixed", "floating"])
def test_the_reference_keeps_every_identity(base: Base) -> None:
    checks = identity_checks(ReferenceBackend(arm(base)))
    assert len(checks) == len(IDENTITIES) + 1
    assert all(check.agree for check in checks.values())


class Lopsided(Broken):
    def _mass_matrix(self, q: Floats) -> Floats:
        M = super()._mass_matrix(q)
        M[..., 0, 1] *= 1.0 + 1e-9
        return M


class Negative(Broken):
    def _mass_matrix(self, q: Floats) -> Floats:
        return -super()._mass_matrix(q)


class StaleRates(Broken):
    def _coriolis_matrix(self, q: Floats, v: Floats) -> Floats:
        return np.array(np.swapaxes(self._derive("coriolis_matrix", q, v), -1, -2))


class SlantedGravity(Broken):
    def _potential_energy(self, q: Floats) -> Floats:
        return self._derive("potential_energy", q) * (1.0 + 1e-9)


class WrongCenter(Broken):
    def _center_of_mass(self, q: Floats) -> Floats:
        return self._derive("center_of_mass", q) * (1.0 + 1e-9)


class WrongMomentum(Broken):
    def _centroidal_momentum(self, q: Floats, v: Floats) -> Floats:
        return self._derive("centroidal_momentum", q, v) * (1.0 + 1e-9)


class TiltedWorld(Broken):
    """Gravity that points down in every model."""

    def _gravity(self) -> None:
        self._mechanism = self.model.with_gravity((0.0, 0.0, -9.81)).mechanism

    def _inverse_dynamics(self, q: Floats, v: Floats, a: Floats) -> Floats:
        self._gravity()
        return super()._inverse_dynamics(q, v, a)


@pytest.mark.parametrize(
    ("defect", "identity"),
    [
        (Lopsided, "mass matrix is symmetric"),
        (Negative, "mass matrix is positive"),
        (Negative, "M a + bias = inverse dynamics"),
        (StaleRates, "C v + gravity = bias"),
        (GravityUpsideDown, "gravity torque = gradient of potential energy"),
        (SlantedGravity, "gravity torque = gradient of potential energy"),
        (SlantedGravity, "power of the torques = d/dt energy"),
        (WrongCenter, "J v = d/dt centre of mass"),
        (WrongMomentum, "linear momentum = mass * velocity of its centre"),
        (TransposedRotation, "J v = d/dt forward kinematics"),
        (TiltedWorld, "turning the world changes nothing"),
    ],
)
def test_a_defect_breaks_its_identity(defect: type[Broken], identity: str) -> None:
    assert identity in failed_identities(defect(arm()))


def test_the_momentum_of_a_floating_base_is_checked_about_its_centre() -> None:
    assert "momentum = base rows of M v" in failed_identities(WrongMomentum(arm("floating")))
    assert identity_checks(ReferenceBackend(arm()))["momentum = base rows of M v"].note


class Shapeless(Broken):
    def _gravity_torque(self, q: Floats) -> Floats:
        return super()._gravity_torque(q)[..., :1].repeat(7, axis=-1)


def test_a_result_of_the_wrong_shape_fails_identities_without_an_exception() -> None:
    joints = [Joint("j", "continuous", "a", "b"), Joint("k", "continuous", "b", "c")]
    model = Model.build("two", [Link("a", BODY), Link("b", BODY), Link("c", BODY)], joints)
    assert "C v + gravity = bias" in failed_identities(Shapeless(model))


def test_positivity_is_not_checked_where_an_inertia_is_not_physical() -> None:
    model = arm()
    odd = replace(model.links[1], inertial=Inertial(1.0, ixx=-0.1, iyy=0.1, izz=0.1))
    check = identity_checks(ReferenceBackend(replace(model, links=(model.links[0], odd, *model.links[2:]))))
    assert check["mass matrix is positive"].agree
    assert "upper" in (check["mass matrix is positive"].note or "")


def test_the_identities_hold_at_high_speed() -> None:
    samples = draw_samples(arm(), 4, 0)
    fast = replace(samples, v=1e3 * samples.v, a=1e6 * samples.a)
    with ReferenceBackend(arm()) as backend:
        for check in check_identities("reference", backend, Magnitudes(fast)):
            assert check.agree, f"{check.identity}: {check.max_error}"


def test_gravity_rotates_and_keeps_its_magnitude() -> None:
    model, _ = rotate_world(arm())
    assert model.gravity != arm().gravity
    drift = abs(float(np.linalg.norm(model.gravity)) - float(np.linalg.norm(arm().gravity)))
    assert drift <= 8 * np.finfo(float).eps * 9.81


def test_a_fixed_base_gets_a_rotated_pose_and_a_floating_base_is_rotated() -> None:
    model, unchanged = rotate_world(arm())
    assert model.root == arm().root
    R = model.base_pose.matrix[:3, :3]
    np.testing.assert_allclose(R @ arm().gravity, model.gravity, rtol=0, atol=1e-14)
    q = arm().random(0)
    assert np.array_equal(unchanged(q), q)
    floating, rotate_base = rotate_world(arm("floating"))
    assert floating.root == arm().root
    assert not np.array_equal(rotate_base(arm("floating").neutral()), arm("floating").neutral())


def test_a_pose_of_its_own_is_rotated_too() -> None:
    pose = Pose((1.0, 2.0, 3.0), (0.1, 0.2, 0.3))
    rotated = rotate_world(arm().with_base_pose(pose))[0].base_pose.matrix
    R = rotate_world(arm())[0].base_pose.matrix
    np.testing.assert_allclose(rotated, R @ pose.matrix, rtol=0, atol=1e-14)


@given(st.floats(0.0, 50.0), st.floats(-3.0, 3.0), st.floats(0.0, 1.0))
def test_a_band_limited_function_is_differentiated_to_the_stated_error(
    frequency: float, phase: float, share: float
) -> None:
    lower = share * frequency
    rate = time_derivative(
        lambda t: np.sin(frequency * t + phase) + np.cos(lower * t), np.array([frequency, frequency])
    )
    exact = frequency * np.cos(phase)
    assert np.all(np.abs(rate - exact) <= 2.0 * max(frequency, MAX_REST_FREQUENCY) * tolerances.derivative(0))


def test_the_weights_differentiate_polynomials_of_their_order_exactly() -> None:
    for power in (1, 3, 5, 7):
        total = sum(2.0 * weight * k**power for k, weight in WEIGHTS.items())
        assert abs(total - (1.0 if power == 1 else 0.0)) <= EPS * 4**power


def test_the_stated_cancellation_is_that_of_the_weights() -> None:
    assert 2.0 * sum(abs(weight) for weight in WEIGHTS.values()) <= tolerances.CANCELLATION


def test_shapes() -> None:
    rate = time_derivative(lambda t: t[..., None, None] * np.ones((3, 2)), np.array([1.0, 2.0]))
    assert rate.shape == (2, 3, 2)


DISPLACEMENT = 1e-3


class Displaced(Broken):
    """All frames displaced by a millimetre; its solutions are right by its own poses only."""

    def _frame_placements(self, q: Floats) -> Floats:
        T = super()._frame_placements(q)
        T[..., 0, 3] += DISPLACEMENT
        return T

    def _frame_placement(self, q: Floats, frame: int) -> Floats:
        T = super()._frame_placement(q, frame)
        T[..., 0, 3] += DISPLACEMENT
        return T


def test_a_configuration_that_reaches_the_target_by_its_own_poses_only_is_no_solution() -> None:
    model = arm()
    report = agree(model, [ReferenceBackend(model), Displaced(model)], samples=4, referee_samples=0)
    (row,) = [row for row in report.quantities if row.quantity == "inverse_kinematics"]
    assert not row.agree
    assert abs(row.max_abs_error - DISPLACEMENT) < 0.1 * DISPLACEMENT
