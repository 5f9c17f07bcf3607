"""Solutions nearest to a posture by a kernel: local optima, the same alone, no worse than without it."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from dynx.backends import Backend, backend
from dynx.model.loading import load
from dynx.spatial.scalar import Floats
from tests.oracles.closed_form import MODELS

ARM = load(MODELS / "seven_axis_arm.urdf")
FRAME = ARM.frame_names[-1]
COUNT = 30

AT_LIMIT = 2e-5
"""Distance from a limit [rad] below which a joint is at it."""

SLOPE = 1e-3
"""Slope of the objective [rad] along the target's manifold below which it counts as stationary: a hundredth
of the tolerance, 1e-8, lets solutions be off by its square root."""


def slopes(engine: Backend, q: Floats, away: Floats, axes: slice) -> Floats:
    """Return the largest slope (n,) along the null space of the joints that are not at a limit."""
    found = []
    for q_k, away_k in zip(q, away, strict=True):
        free = (q_k - ARM.lower > AT_LIMIT) & (ARM.upper - q_k > AT_LIMIT)
        J = engine.jacobian(q_k, FRAME)[axes][:, free]
        _, s, V_T = np.linalg.svd(J)
        null = V_T[(s > 1e-9).sum() :]
        found.append(np.abs(null @ away_k[free]).max(initial=0.0))
    return np.array(found)


@pytest.mark.parametrize("position_only", [False, True])
def test_the_nearest_solution_is_stationary(position_only: bool) -> None:
    rng = np.random.default_rng(2)
    with backend("compiled", ARM, threads=1) as engine, backend("pinocchio", ARM) as other:
        poses, goal = engine.forward_kinematics(ARM.random(rng, COUNT), FRAME), ARM.random(rng, COUNT)
        targets = poses[:, :3, 3] if position_only else poses
        found = engine.inverse_kinematics(targets, FRAME, nearest=goal)
        middle = engine.inverse_kinematics(targets, FRAME, maximize="limit_distance")
        axes = slice(3) if position_only else slice(6)
        half = 0.5 * (ARM.upper - ARM.lower)
        share = (0.5 * (ARM.upper + ARM.lower) - middle.q) / half**2
        assert found.success.all()
        assert middle.success.all()
        assert slopes(other, found.q, goal - found.q, axes).max() < SLOPE
        assert slopes(other, middle.q, share, axes).max() < SLOPE
        reached = other.forward_kinematics(found.q, FRAME)[:, :3, 3]
        assert np.linalg.norm(reached - poses[:, :3, 3], axis=-1).max() <= 1.001e-6
        alone = engine.inverse_kinematics(targets[4], FRAME, nearest=goal[4])
        np.testing.assert_array_equal(alone.q, found.q[4])


def test_the_kernel_is_no_worse_than_steps_in_python(monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(6)
    with backend("compiled", ARM, threads=1) as engine:
        targets, goal = engine.forward_kinematics(ARM.random(rng, 12), FRAME), ARM.random(rng, 12)

        def distance(**options: Any) -> float:
            q = engine.inverse_kinematics(targets, FRAME, nearest=goal, **options).q
            return float(((q - goal) ** 2).sum(axis=-1).mean())

        by_kernel = distance()
        monkeypatch.setattr("dynx.ik.kernels.nearest_solutions", lambda *_: None)
        assert by_kernel <= distance() * 1.01
