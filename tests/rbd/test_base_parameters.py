"""A mechanism in fewer numbers moves like the one it was made from, in 50 digits."""

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
from dynx.rbd.base_parameters import aligned, reduced, regrouped
from dynx.rbd.placement import Placement
from dynx.spatial.scalar import Array
from dynx.testing.strategies import models, samples
from tests.rbd.exact import CLOSE, distance, exact_mechanism, exactly, fifty_digits, tree_q

Case = tuple[Mechanism, Array, Array, Array]
ROBOTS = ("ur5", "panda", "talos", "solo12", "double_pendulum_continuous")


@pytest.fixture(autouse=True)
def _many_digits() -> Iterator[None]:
    with fifty_digits():
        yield


@st.composite
def cases(draw: st.DrawFn, solvable: bool = False) -> Case:
    """A random mechanism and sample in 50 digits."""
    model = draw(models(max_links=5, solvable=solvable, base="either"))
    q, _, _ = draw(samples(model))
    mechanism = exact_mechanism(model)
    numbers = st.integers(-8, 8).map(lambda n: n / 4)
    v, a = (exactly([draw(numbers) for _ in range(mechanism.nv)]) for _ in range(2))
    return mechanism, tree_q(model, q), v, a


@given(cases(), st.sampled_from([aligned, reduced]))
def test_torque_and_mass_matrix_are_the_same(case: Case, change: type) -> None:
    before, q, v, a = case
    after = change(before)
    assert distance(rnea.inverse_dynamics(after, q, v, a), rnea.inverse_dynamics(before, q, v, a)) < CLOSE
    assert distance(crba.mass_matrix(after, q), crba.mass_matrix(before, q)) < CLOSE


@given(cases(solvable=True), st.sampled_from([aligned, reduced]))
def test_acceleration_is_the_same(case: Case, change: type) -> None:
    before, q, v, tau = case
    wanted = aba.forward_dynamics(before, q, v, tau)
    assert distance(aba.forward_dynamics(change(before), q, v, tau), wanted) < CLOSE


@given(cases(), st.sampled_from([aligned, reduced]))
def test_energy_momentum_and_coriolis_matrix_are_the_same(case: Case, change: type) -> None:
    before, q, v, _ = case
    after = change(before)
    for quantity in (centroidal.kinetic_energy, centroidal.centroidal_momentum, coriolis.coriolis_matrix):
        found = quantity(after, kinematics.body_poses(after, q), v)
        assert distance(found, quantity(before, kinematics.body_poses(before, q), v)) < CLOSE


@given(cases(), st.sampled_from([aligned, reduced]))
def test_frames_and_center_of_mass_stay_where_they_are(case: Case, change: type) -> None:
    before, q, _, _ = case
    after = change(before)
    placements = kinematics.frame_placements(after, q)
    assert distance(placements, kinematics.frame_placements(before, q)) < CLOSE
    for quantity in (centroidal.center_of_mass, centroidal.potential_energy):
        found = quantity(after, kinematics.body_poses(after, q))
        assert distance(found, quantity(before, kinematics.body_poses(before, q))) < CLOSE


@given(cases())
def test_what_a_joint_cannot_tell_is_zero(case: Case) -> None:
    mechanism = reduced(case[0])
    for body in mechanism.bodies:
        mass, h, spread = body.inertia.mass, body.inertia.first_moment, body.inertia.spread
        if body.revolute:
            assert (body.axis == (0, 0, 1)).all()
            assert body.about_z
            assert [mass, h[2], spread[2, 2]] == [0, 0, 0]
        else:
            assert not spread.any()
            assert not body.p.any()
            assert distance(body.R, exactly(np.eye(3))) == 0


@given(cases())
def test_nothing_is_left_to_move_a_second_time(case: Case) -> None:
    once = reduced(case[0])
    for first, second in zip(once.bodies, regrouped(once).bodies, strict=True):
        assert distance(first.inertia.second_moment, second.inertia.second_moment) < CLOSE


@given(cases())
def test_a_turn_about_z_is_the_product_of_matrices(case: Case) -> None:
    mechanism, q, _, _ = case
    A = exactly(np.arange(9).reshape(3, 3) ** 2 - 7)
    for index, body in enumerate(aligned(mechanism).bodies):
        placement = Placement.of(body, kinematics.joint_value(mechanism, q, index))
        R = placement.R
        assert (placement.turn is not None) == body.revolute
        assert distance(placement.similar(A), R @ A @ R.T) < CLOSE
        assert distance(replace(placement, turn=None).symmetric(A + A.T), R @ (A + A.T) @ R.T) < CLOSE
        assert distance(placement.symmetric(A + A.T), R @ (A + A.T) @ R.T) < CLOSE


def test_axes_through_one_point_stay_together() -> None:
    """A shoulder of three hinges whose first two carry nothing: origins must not leave the point."""
    before = dynx.load("human").mechanism
    after = aligned(before)
    together = [k for k, body in enumerate(before.bodies) if body.parent >= 0 and not body.p.any()]
    assert len(together) > 10
    assert all(not after.bodies[k].p.any() for k in together)


@pytest.mark.parametrize("robot", ROBOTS)
def test_real_robots_take_fewer_numbers(robot: str) -> None:
    model = dynx.load(robot)
    before = exact_mechanism(model)
    after = reduced(before)
    assert numbers(after) < numbers(before)
    q = tree_q(model, model.random(np.random.default_rng(3)))
    placements = kinematics.frame_placements(after, q)
    assert distance(placements, kinematics.frame_placements(before, q)) < CLOSE


def numbers(mechanism: Mechanism) -> int:
    """How many of the numbers that make up the bodies are not zero."""
    count = 0
    for body in mechanism.bodies:
        inertia = body.inertia
        count += sum(np.count_nonzero(x) for x in (body.p, inertia.first_moment, inertia.spread))
        count += int(inertia.mass != 0)
    return count


@pytest.mark.parametrize("robot", ["human", "solo12"])
def test_joints_that_give_way_to_nearly_all_inertia_cost_no_digits(robot: str) -> None:
    """No more than one joint's roundings: shoulders of three hinges, and long legs that weigh little."""
    model = dynx.load(robot)
    rng = np.random.default_rng(11)
    q = model.random(rng, 40)
    v, tau = rng.standard_normal((2, 40, model.nv))
    found = aba.forward_dynamics(aligned(model.mechanism), q, v, tau)
    exact = exact_mechanism(model)
    for k in range(len(q)):
        wanted = aba.forward_dynamics(exact, tree_q(model, q[k]), exactly(v[k]), exactly(tau[k]))
        assert distance(exactly(found[k]), wanted) < ROUNDINGS * np.finfo(float).eps
