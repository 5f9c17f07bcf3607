"""The algorithms of `dynx.rbd` against each other and against derivatives, in 50 digits.

An identity that holds to 1e-24 on random trees of every joint type shows that the formulas are right; the
agreement tests bound their rounding errors in float64.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dynx.model import Mechanism, Model
from dynx.rbd import aba, centroidal, coriolis, crba, jacobians, kinematics, linear, rnea
from dynx.rbd.jacobians import REFERENCES, Reference
from dynx.spatial.scalar import Array
from dynx.testing.strategies import models, samples
from tests.rbd.exact import IDENTITY_TOLERANCE, distance, exact_mechanism, exactly, fifty_digits, rate, tree_q

Case = tuple[Model, Mechanism, Array, Array, Array]


@pytest.fixture(autouse=True)
def _fifty_digits() -> Iterator[None]:
    with fifty_digits():
        yield


@st.composite
def cases(draw: st.DrawFn, solvable: bool = False) -> Case:
    """Draw a model with its 50-digit mechanism and a 50-digit sample in tree coordinates."""
    model = draw(models(max_links=5, solvable=solvable))
    q, _, _ = draw(samples(model))
    mechanism = exact_mechanism(model)
    numbers = st.integers(-8, 8).map(lambda n: n / 4)
    v, a = (exactly([draw(numbers) for _ in range(mechanism.nv)]) for _ in range(2))
    return model, mechanism, tree_q(model, q), v, a


def apply(matrix: Array, vector: Array) -> Array:
    return np.asarray((matrix @ vector[..., None])[..., 0])


def bias(mechanism: Mechanism, q: Array, v: Array) -> Array:
    return rnea.inverse_dynamics(mechanism, q, v, 0 * v)


@given(cases())
def test_inverse_dynamics_is_mass_matrix_times_acceleration_plus_bias(case: Case) -> None:
    _, mechanism, q, v, a = case
    M = crba.mass_matrix(mechanism, q)
    tau = rnea.inverse_dynamics(mechanism, q, v, a)
    assert distance(apply(M, a) + bias(mechanism, q, v), tau) < IDENTITY_TOLERANCE


@given(cases(solvable=True))
def test_forward_dynamics_inverts_inverse_dynamics(case: Case) -> None:
    _, mechanism, q, v, a = case
    tau = rnea.inverse_dynamics(mechanism, q, v, a)
    assert distance(aba.forward_dynamics(mechanism, q, v, tau), a) < IDENTITY_TOLERANCE


@given(cases(solvable=True))
def test_solving_the_mass_matrix_gives_the_same_as_the_articulated_bodies(case: Case) -> None:
    _, mechanism, q, v, tau = case
    M = crba.mass_matrix(mechanism, q)
    a = linear.solve_positive_definite(M, tau - bias(mechanism, q, v))
    assert distance(aba.forward_dynamics(mechanism, q, v, tau), a) < IDENTITY_TOLERANCE


@given(cases())
def test_coriolis_matrix_gives_the_bias_without_gravity(case: Case) -> None:
    _, mechanism, q, v, _ = case
    C = coriolis.coriolis_matrix(mechanism, kinematics.body_poses(mechanism, q), v)
    assert distance(apply(C, v) + bias(mechanism, q, 0 * v), bias(mechanism, q, v)) < IDENTITY_TOLERANCE


@given(cases())
def test_rate_of_the_mass_matrix_minus_twice_coriolis_is_skew(case: Case) -> None:
    _, mechanism, q, v, _ = case
    C = coriolis.coriolis_matrix(mechanism, kinematics.body_poses(mechanism, q), v)
    dM = rate(lambda x: crba.mass_matrix(mechanism, x), mechanism, q, v)
    assert distance(dM, C + C.T) < IDENTITY_TOLERANCE


@given(cases())
def test_gravity_torque_is_the_gradient_of_potential_energy(case: Case) -> None:
    _, mechanism, q, v, _ = case

    def energy(x: Array) -> Array:
        return centroidal.potential_energy(mechanism, kinematics.body_poses(mechanism, x))

    power = np.sum(bias(mechanism, q, 0 * v) * v)
    assert distance(rate(energy, mechanism, q, v), power) < IDENTITY_TOLERANCE


@given(cases())
def test_kinetic_energy_is_half_the_quadratic_form_of_the_mass_matrix(case: Case) -> None:
    _, mechanism, q, v, _ = case
    energy = centroidal.kinetic_energy(mechanism, kinematics.body_poses(mechanism, q), v)
    assert distance(energy, np.sum(v * apply(crba.mass_matrix(mechanism, q), v)) / 2) < IDENTITY_TOLERANCE


@given(cases())
def test_center_of_mass_jacobian_and_momentum_are_its_rate(case: Case) -> None:
    _, mechanism, q, v, _ = case
    poses = kinematics.body_poses(mechanism, q)
    J = centroidal.center_of_mass_jacobian(mechanism, poses)
    if not mechanism.has_mass:
        return

    def center(x: Array) -> Array:
        return centroidal.center_of_mass(mechanism, kinematics.body_poses(mechanism, x))

    velocity = rate(center, mechanism, q, v)
    assert distance(velocity, apply(J, v)) < IDENTITY_TOLERANCE
    momentum = centroidal.centroidal_momentum(mechanism, poses, v)
    mass = sum((body.inertia.mass for body in mechanism.bodies), mechanism.root.mass)
    assert distance(momentum[:3], velocity * mass) < IDENTITY_TOLERANCE


@given(cases(), st.sampled_from(list(REFERENCES.values())))
def test_jacobian_derivative_is_the_rate_of_the_jacobian(case: Case, reference: Reference) -> None:
    _, mechanism, q, v, _ = case
    frame = len(mechanism.frames) - 1

    def jacobian(x: Array) -> Array:
        poses = kinematics.body_poses(mechanism, x)
        return jacobians.frame_jacobian(mechanism, poses, frame, reference)

    poses = kinematics.body_poses(mechanism, q)
    dJ = jacobians.frame_jacobian_derivative(mechanism, poses, v, frame, reference)
    assert distance(rate(jacobian, mechanism, q, v), dJ) < IDENTITY_TOLERANCE


@given(cases())
def test_jacobian_is_the_rate_of_forward_kinematics(case: Case) -> None:
    _, mechanism, q, v, _ = case
    poses = kinematics.body_poses(mechanism, q)
    T = kinematics.frame_placements(mechanism, q)
    dT = rate(lambda x: kinematics.frame_placements(mechanism, x), mechanism, q, v)
    for frame in range(len(mechanism.frames)):
        velocity = apply(jacobians.frame_jacobian(mechanism, poses, frame, "local_world_aligned"), v)
        assert distance(dT[frame, :3, 3], velocity[:3]) < IDENTITY_TOLERANCE
        W = dT[frame, :3, :3] @ T[frame, :3, :3].T
        omega = np.array([W[2, 1], W[0, 2], W[1, 0]])
        assert distance(omega, velocity[3:]) < IDENTITY_TOLERANCE


@given(cases())
def test_power_of_the_torque_is_the_rate_of_the_energy(case: Case) -> None:
    """d/dt (kinetic + potential) = tau . v along q(t) with velocity v(t) = v + a t."""
    _, mechanism, q, v, a = case
    M = crba.mass_matrix(mechanism, q)
    dM = rate(lambda x: crba.mass_matrix(mechanism, x), mechanism, q, v)

    def potential(x: Array) -> Array:
        return centroidal.potential_energy(mechanism, kinematics.body_poses(mechanism, x))

    power = np.sum(rnea.inverse_dynamics(mechanism, q, v, a) * v)
    kinetic_rate = np.sum(v * apply(M, a)) + np.sum(v * apply(dM, v)) / 2
    assert distance(kinetic_rate + rate(potential, mechanism, q, v), power) < IDENTITY_TOLERANCE
