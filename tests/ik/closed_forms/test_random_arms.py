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
from tests.ik.closed_forms.arms import FAMILIES, angle_difference, pose_difference, random_arm

REACHED = 1e-10
"""Error of a pose [1, m] that a solution has at most, for arms of some metres."""

FOUND = 1e-5
"""Difference [rad] up to which a solution is the configuration that the pose was made with."""

SINGULAR = 1e-3
"""Singular value of the Jacobian below which a random configuration is left out of the test of completeness:
there rounding, and deviations of the axes, move solutions by more than `FOUND`, or make them vanish."""


def reachable(model: Model, rng: np.random.Generator, count: int) -> tuple[Floats, Floats]:
    """Return random configurations (n, 6) that are not near a singular one, and their poses."""
    q = np.array([model.random(rng) for _ in range(count)])
    with backend("reference", model) as engine:
        regular = np.linalg.svd(engine.jacobian(q, "tool"), compute_uv=False)[:, -1] > SINGULAR
        return q[regular], engine.forward_kinematics(q[regular], "tool")


@pytest.mark.parametrize("family", FAMILIES)
@settings(max_examples=12)
@given(seed=st.integers(0, 2**32), deviation=st.sampled_from([0.0, 0.0, 1e-12, 1e-7]))
def test_all_solutions_of_random_arms(family: str, seed: int, deviation: float) -> None:
    rng = np.random.default_rng(seed)
    model = random_arm(family, rng, deviation)
    q, T = reachable(model, rng, 20)
    found = closed_form(model, "tool").solve(T)
    assert (angle_difference(found.q, q[:, None]).min(axis=1, initial=9.0, where=found.success) < FOUND).all()
    with backend("pinocchio", model) as engine:
        reached = engine.forward_kinematics(found.q, "tool")
    assert (pose_difference(reached, T[:, None])[found.success] < REACHED).all()
    assert (found.q >= model.lower).all()
    assert (found.q <= model.upper).all()
    for each in zip(found.q, found.success, strict=True):
        q_i = each[0][each[1]]
        distance = angle_difference(q_i[:, None], q_i[None])
        assert (distance[~np.eye(len(q_i), dtype=bool)] > FOUND / 100.0).all()


@pytest.mark.parametrize("family", FAMILIES)
def test_a_search_from_many_starts_finds_no_other_solution(family: str) -> None:
    rng = np.random.default_rng(7)
    model = random_arm(family, rng)
    _, T = reachable(model, rng, 2)
    found = closed_form(model, "tool").solve(T[0])
    with backend("pinocchio", model) as engine:
        starts = [engine.inverse_kinematics(T[0], "tool", rng=k, max_restarts=0) for k in range(300)]
    searched = np.array([each.q for each in starts if each.success])
    nearest = angle_difference(searched[:, None], found.q).argmin(axis=1)
    assert (angle_difference(searched, found.q[nearest]) < 1e-3).all()
    assert set(nearest.tolist()) == set(range(len(found.q)))


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
        angle_difference(within.q, q[:, None]).min(axis=1, where=within.success, initial=9.0) < FOUND
    ).all()


@pytest.mark.parametrize("family", FAMILIES)
def test_far_poses_have_no_solution(family: str) -> None:
    rng = np.random.default_rng(11)
    model = random_arm(family, rng)
    _, T = reachable(model, rng, 100)
    T[:, :3, 3] *= 1e3 / np.linalg.norm(T[:, :3, 3], axis=-1, keepdims=True)
    found = closed_form(model, "tool").solve(T)
    assert not found
    assert not found.success.any()
    assert np.isfinite(found.q).all()
    assert len(closed_form(model, "tool").solve(T[0]).q) == 0


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
