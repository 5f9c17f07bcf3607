"""The mechanism with base parameters has the dynamics of the original, in 50 digits."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import dynx
from dynx.agreement.tolerances import ROUNDINGS
from dynx.model import Mechanism
from dynx.rbd import aba, centroidal, coriolis, crba, kinematics, rnea
from dynx.rbd.base_parameters import align_frames, regroup_inertias
from dynx.rbd.placement import Placement
from dynx.spatial.scalar import Array
from dynx.testing.strategies import models, samples
from tests.rbd.exact import IDENTITY_TOLERANCE, distance, exact_mechanism, exactly, fifty_digits, tree_q

Case = tuple[Mechanism, Array, Array, Array]
ROBOTS = ("ur5", "panda", "talos", "solo12", "double_pendulum_continuous")


@pytest.fixture(autouse=True)
def _fifty_digits() -> Iterator[None]:
    with fifty_digits():
        yield


def to_base_parameters(mechanism: Mechanism) -> Mechanism:
    """Align the frames of a mechanism, then regroup its inertias."""
    return regroup_inertias(align_frames(mechanism))


@st.composite
def cases(draw: st.DrawFn, solvable: bool = False) -> Case:
    """Return a random mechanism and sample in 50 digits."""
    model = draw(models(max_links=5, solvable=solvable, base="either"))
    q, _, _ = draw(samples(model))
    mechanism = exact_mechanism(model)
    numbers = st.integers(-8, 8).map(lambda n: n / 4)
    v, a = (exactly([draw(numbers) for _ in range(mechanism.nv)]) for _ in range(2))
    return mechanism, tree_q(model, q), v, a


@given(cases(), st.sampled_from([align_frames, to_base_parameters]))
def test_torque_and_mass_matrix_are_the_same(case: Case, transform: type) -> None:
    before, q, v, a = case
    after = transform(before)
    assert (
        distance(rnea.inverse_dynamics(after, q, v, a), rnea.inverse_dynamics(before, q, v, a))
        < IDENTITY_TOLERANCE
    )
    assert distance(crba.mass_matrix(after, q), crba.mass_matrix(before, q)) < IDENTITY_TOLERANCE


@given(cases(solvable=True), st.sampled_from([align_frames, to_base_parameters]))
def test_acceleration_is_the_same(case: Case, transform: type) -> None:
    before, q, v, tau = case
    wanted = aba.forward_dynamics(before, q, v, tau)
    assert distance(aba.forward_dynamics(transform(before), q, v, tau), wanted) < IDENTITY_TOLERANCE


@given(cases(), st.sampled_from([align_frames, to_base_parameters]))
def test_energy_momentum_and_coriolis_matrix_are_the_same(case: Case, transform: type) -> None:
    before, q, v, _ = case
    after = transform(before)
    for quantity in (centroidal.kinetic_energy, centroidal.centroidal_momentum, coriolis.coriolis_matrix):
        found = quantity(after, kinematics.body_poses(after, q), v)
        assert distance(found, quantity(before, kinematics.body_poses(before, q), v)) < IDENTITY_TOLERANCE


@given(cases(), st.sampled_from([align_frames, to_base_parameters]))
def test_frames_and_center_of_mass_do_not_move(case: Case, transform: type) -> None:
    before, q, _, _ = case
    after = transform(before)
    placements = kinematics.frame_placements(after, q)
    assert distance(placements, kinematics.frame_placements(before, q)) < IDENTITY_TOLERANCE
    for quantity in (centroidal.center_of_mass, centroidal.potential_energy):
        found = quantity(after, kinematics.body_poses(after, q))
        assert distance(found, quantity(before, kinematics.body_poses(before, q))) < IDENTITY_TOLERANCE


@given(cases())
def test_redundant_parameters_are_zero(case: Case) -> None:
    mechanism = to_base_parameters(case[0])
    for body in mechanism.bodies:
        inertia, sigma = body.inertia, body.inertia.second_moment_matrix
        if body.revolute:
            assert (body.axis == (0, 0, 1)).all()
            assert body.about_z
            assert [inertia.mass, inertia.first_moment[2], sigma[2, 2]] == [0, 0, 0]
        else:
            assert not sigma.any()
            assert not body.p.any()
            assert distance(body.R, exactly(np.eye(3))) == 0


@given(cases())
def test_regrouping_twice_changes_nothing(case: Case) -> None:
    once = to_base_parameters(case[0])
    for first, second in zip(once.bodies, regroup_inertias(once).bodies, strict=True):
        assert (
            distance(first.inertia.rotational_inertia, second.inertia.rotational_inertia) < IDENTITY_TOLERANCE
        )


@given(cases())
def test_rotating_a_tensor_about_z_is_the_product_of_matrices(case: Case) -> None:
    mechanism, q, _, _ = case
    A = exactly(np.arange(9).reshape(3, 3) ** 2 - 7)
    for index, body in enumerate(align_frames(mechanism).bodies):
        placement = Placement.of(body, kinematics.joint_value(mechanism, q, index))
        general = replace(placement, cos_sin=None)
        R = placement.R
        assert (placement.cos_sin is not None) == body.revolute
        assert distance(placement.rotate_tensor(A), R @ A @ R.T) < IDENTITY_TOLERANCE
        assert distance(general.rotate_symmetric(A + A.T), R @ (A + A.T) @ R.T) < IDENTITY_TOLERANCE
        assert distance(placement.rotate_symmetric(A + A.T), R @ (A + A.T) @ R.T) < IDENTITY_TOLERANCE


def test_intersecting_axes_keep_a_common_origin() -> None:
    """Three revolute joints of a shoulder, the first two with massless links, keep a common origin."""
    before = dynx.load("human").mechanism
    after = align_frames(before)
    coincident = [k for k, body in enumerate(before.bodies) if body.parent >= 0 and not body.p.any()]
    assert len(coincident) > 10
    assert all(not after.bodies[k].p.any() for k in coincident)


@pytest.mark.parametrize("robot", ROBOTS)
def test_real_robots_have_fewer_nonzero_numbers(robot: str) -> None:
    model = dynx.load(robot)
    before = exact_mechanism(model)
    after = to_base_parameters(before)
    assert count_nonzero(after) < count_nonzero(before)
    q = tree_q(model, model.random(np.random.default_rng(3)))
    placements = kinematics.frame_placements(after, q)
    assert distance(placements, kinematics.frame_placements(before, q)) < IDENTITY_TOLERANCE


def count_nonzero(mechanism: Mechanism) -> int:
    """Count the non-zero numbers that describe the bodies."""
    count = 0
    for body in mechanism.bodies:
        inertia = body.inertia
        arrays = (inertia.mass, body.p, inertia.first_moment, inertia.second_moment_matrix)
        count += sum(np.count_nonzero(x) for x in arrays)
    return count


@pytest.mark.parametrize("robot", ["human", "solo12"])
def test_joints_that_move_nearly_all_inertia_lose_no_digits(robot: str) -> None:
    """The error stays that of one joint: shoulders of three revolute joints, and long light legs."""
    model = dynx.load(robot)
    rng = np.random.default_rng(11)
    q = model.random(rng, 40)
    v, tau = rng.standard_normal((2, 40, model.nv))
    found = aba.forward_dynamics(align_frames(model.mechanism), q, v, tau)
    exact = exact_mechanism(model)
    for k in range(len(q)):
        wanted = aba.forward_dynamics(exact, tree_q(model, q[k]), exactly(v[k]), exactly(tau[k]))
        assert distance(exactly(found[k]), wanted) < ROUNDINGS * np.finfo(float).eps
