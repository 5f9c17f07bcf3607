"""Random arms of every family: solutions are right, complete, distinct, and as many as a search finds."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dynx.backends import backend
from dynx.ik import closed_form
from dynx.model import Model
from dynx.spatial.scalar import Floats
from tests.ik.closed_forms.arms import FAMILIES, arm_of, pose_difference, random_arm
from tests.ik.closed_forms.sliding_arms import FAMILIES as SLIDING
from tests.ik.closed_forms.sliding_arms import random_sliding_arm

REACHED = 1e-10
"""Error of a pose [1, m] that a solution has at most, for arms of some metres."""

FOUND = 1e-5
"""Difference [rad or m] up to which a solution is the configuration that the pose was made with."""

SINGULAR = 1e-3
"""Singular value of the Jacobian below which a random configuration is left out of the test of completeness:
there rounding, and deviations of the axes, move solutions by more than `FOUND`, or make them vanish."""

each_family = pytest.mark.parametrize("family", [*FAMILIES, *SLIDING])


def arm_of_family(family: str, rng: np.random.Generator, deviation: float = 0.0) -> Model:
    return (random_arm if family in FAMILIES else random_sliding_arm)(family, rng, deviation)


def difference(model: Model, a: Floats, b: Floats) -> Floats:
    """Return the largest difference (...,) of coordinates (..., nq), of angles modulo full turns."""
    turns = np.array([joint.type == "revolute" for joint in model.coordinate_joints])
    apart = a - b
    return np.asarray(np.abs(apart - 2.0 * np.pi * np.round(apart / (2.0 * np.pi)) * turns).max(axis=-1))


def reachable(model: Model, rng: np.random.Generator, count: int) -> tuple[Floats, Floats]:
    """Return random configurations (n, nq) that are not near a singular one, and their poses."""
    q = np.array([model.random(rng) for _ in range(count)])
    with backend("reference", model) as engine:
        singular_values = np.linalg.svd(engine.jacobian(q, "tool"), compute_uv=False)
        regular = singular_values[:, model.nq - 1] > SINGULAR
        return q[regular], engine.forward_kinematics(q[regular], "tool")


@each_family
@settings(max_examples=8)
@given(seed=st.integers(0, 2**32), deviation=st.sampled_from([0.0, 1e-12, 1e-7]))
def test_all_solutions_of_random_arms(family: str, seed: int, deviation: float) -> None:
    rng = np.random.default_rng(seed)
    model = arm_of_family(family, rng, deviation)
    q, T = reachable(model, rng, 20)
    found = closed_form(model, "tool").solve(T)
    apart = difference(model, found.q, q[:, None])
    assert (apart.min(axis=1, initial=9.0, where=found.success) < FOUND).all()
    with backend("pinocchio", model) as engine:
        reached = engine.forward_kinematics(found.q, "tool")
    assert (pose_difference(reached, T[:, None])[found.success] < REACHED).all()
    assert ((found.q >= model.lower) & (found.q <= model.upper)).all()
    for row, success in zip(found.q, found.success, strict=True):
        q_i = row[success]
        distance = difference(model, q_i[:, None], q_i[None])
        assert (distance[~np.eye(len(q_i), dtype=bool)] > FOUND / 100.0).all()


@pytest.mark.long_cases
@each_family
def test_a_search_from_many_starts_finds_no_other_solution(family: str) -> None:
    rng = np.random.default_rng(7)
    model = arm_of_family(family, rng)
    _, T = reachable(model, rng, 2)
    found = closed_form(model, "tool").solve(T[0])
    starts = np.array([model.random(rng) for _ in range(400)])
    with backend("compiled", model) as engine:
        searched = engine.inverse_kinematics(np.tile(T[0], (400, 1, 1)), "tool", starts, max_restarts=0)
    solutions = searched.q[searched.success]
    apart = difference(model, solutions[:, None], found.q)
    assert (apart.min(axis=1) < 1e-3).all()
    assert set(apart.argmin(axis=1).tolist()) == set(range(len(found.q)))


@pytest.mark.parametrize("family", FAMILIES)
def test_solutions_are_within_limits_or_all_of_them(family: str) -> None:
    rng = np.random.default_rng(3)
    model = random_arm(family, rng, limit=2.0)
    q, T = reachable(model, rng, 60)
    form = closed_form(model, "tool")
    within, everywhere = form.solve(T), form.solve(T, ignore_limits=True)
    inside = ((everywhere.q >= model.lower) & (everywhere.q <= model.upper)).all(axis=-1)
    assert (within.success == (everywhere.success & inside)).all()
    assert within.counts.min() >= 1
    assert everywhere.counts.sum() > within.counts.sum()
    assert (
        difference(model, within.q, q[:, None]).min(axis=1, where=within.success, initial=9.0) < FOUND
    ).all()


@each_family
def test_far_poses_have_no_solution(family: str) -> None:
    rng = np.random.default_rng(11)
    model = arm_of_family(family, rng)
    _, T = reachable(model, rng, 100)
    T[:, :3, 3] *= 1e3 / np.linalg.norm(T[:, :3, 3], axis=-1, keepdims=True)
    found = closed_form(model, "tool").solve(T)
    assert not found
    assert not found.success.any()
    assert np.isfinite(found.q).all()
    assert len(closed_form(model, "tool").solve(T[0]).q) == 0


@pytest.mark.long_cases
@pytest.mark.parametrize("family", FAMILIES)
def test_poses_near_the_edge_of_the_workspace_have_no_wrong_solution(family: str) -> None:
    """Along a line out of the workspace the solutions are right to its very edge, found by bisection."""
    rng = np.random.default_rng(5)
    model = random_arm(family, rng)
    form = closed_form(model, "tool")
    _, T = reachable(model, rng, 5)
    direction = T[0, :3, 3] / np.linalg.norm(T[0, :3, 3])
    near, far = 0.0, 100.0
    with backend("reference", model) as engine:
        for _ in range(60):
            middle = 0.5 * (near + far)
            target = T[0].copy()
            target[:3, 3] += middle * direction
            found = form.solve(target)
            reached = engine.forward_kinematics(found.q, "tool")
            assert (pose_difference(reached, target) < REACHED).all()
            near, far = (middle, far) if found else (near, middle)
    assert far < 100.0


def test_the_stanford_arm_has_eight_solutions() -> None:
    """Lengths of Paul, Robot Manipulators, 1981: axes 1 and 2 meet, a slide, then a spherical wrist."""
    x, y, z = np.eye(3)
    shoulder = np.array([0.0, 0.0, 0.412])
    wrist = shoulder + 0.154 * y
    rng = np.random.default_rng(1)
    axes, points = np.array([z, y, z, z, x, z]), np.array([0.0 * z, shoulder, *[wrist] * 4])
    model = arm_of(axes, points, "RRPRRR", rng, np.pi)
    form = closed_form(model, "tool")
    assert "last three joints meet" in form.family
    q, T = reachable(model, rng, 50)
    found = form.solve(T)
    assert (
        difference(model, found.q, q[:, None]).min(axis=1, initial=9.0, where=found.success) < FOUND
    ).all()
    # The slide may be extended in either direction.
    assert found.counts.max() == 8
    assert (found.counts % 4 == 0).all()


@pytest.mark.parametrize("family", ["PPPRRR", "RRPR parallel", "RRP wrist, meeting", "PRR wrist"])
def test_the_kernel_finds_what_numpy_finds(family: str) -> None:
    rng = np.random.default_rng(13)
    model = random_sliding_arm(family, rng)
    _, T = reachable(model, rng, 50)
    expected = closed_form(model, "tool").solve(T)
    with backend("compiled", model) as engine:
        found = engine.inverse_kinematics(T, "tool", all_solutions=True)
        for _ in range(2):
            alone = engine.inverse_kinematics(T[0], "tool", all_solutions=True)
    assert (found.success == expected.success).all()
    assert difference(model, found.q, expected.q)[found.success].max() < FOUND
    np.testing.assert_array_equal(alone.q, found.q[0][found.success[0]])
