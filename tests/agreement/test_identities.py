from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from dynx.agreement.identities import IDENTITIES, IdentityCheck, check_identities
from dynx.agreement.magnitudes import Magnitudes
from dynx.agreement.sampling import draw_samples
from dynx.backends import Backend
from dynx.model import Inertial, Joint, Link, Model
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
