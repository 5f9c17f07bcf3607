"""Inverse kinematics of robots with ball joints: every backend reaches what forward kinematics gives."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import dynx
from dynx import trajectory
from dynx.ik.coordinates import FrameCoordinates
from dynx.ik.reach import frame_reach
from dynx.ik.velocity import VelocityTask
from dynx.model import Limits
from dynx.model.limited_positions import limited_positions
from tests.sim.test_ball_joints import arm, each_base

EPS = np.finfo(np.float64).eps
LIMITED = Limits(upper=1.5)


@each_base
@pytest.mark.parametrize("name", ["reference", "compiled", "pinocchio", "mujoco"])
def test_poses_are_reached_within_limits(base: Any, name: str) -> None:
    pytest.importorskip({"pinocchio": "pinocchio", "mujoco": "mujoco"}.get(name, "numpy"))
    model = arm(base, limits=LIMITED)
    with dynx.backend(name, model) as engine:
        for seed in range(5):
            q = model.random(seed)
            target = engine.forward_kinematics(q, "hand")
            found = engine.inverse_kinematics(target, "hand", rng=seed)
            assert found.success
            off = np.abs(engine.forward_kinematics(found.q, "hand") - target)
            assert np.max(off) <= 4e-6
            assert limited_positions(model, found.q)[0] <= LIMITED.upper + 1e-12
            # The tail is on another branch: it stays.
            assert found.q[-1] == 0.0
        position = engine.inverse_kinematics(target[:3, 3], "hand")
        assert position.success
        both = engine.inverse_kinematics(
            {"hand": target, "tail": engine.forward_kinematics(q, "tail")[:3, 3]}, q0=model.random(7)
        )
        assert both.success


def test_a_batch_equals_its_samples() -> None:
    model = arm(limits=LIMITED)
    with dynx.backend("reference", model) as engine:
        targets = engine.forward_kinematics(model.random(0, 3), "hand")
        batch = engine.inverse_kinematics(targets, "hand", model.random(5), rng=1)
        assert batch.success.all()
        assert np.max(np.abs(engine.forward_kinematics(batch.q, "hand") - targets)) <= 4e-6


def test_coordinates_of_ball_joints_count_from_the_current_attitude() -> None:
    model = arm("floating", limits=LIMITED)
    coordinates = FrameCoordinates(model, "hand")
    q = model.random(0)
    assert coordinates.values(q)[:12] == [0.0] * 12
    step = np.concatenate([np.linspace(-0.2, 0.2, 12), [0.3]])
    moved = coordinates.with_values(q, step.tolist())
    v = np.zeros(model.nv)
    v[coordinates.columns] = step
    wanted = model.integrate(q, v)
    elbow = model.position_index("elbow")
    wanted[elbow] = 0.3
    np.testing.assert_allclose(moved, model.clip(wanted), atol=16 * EPS)


def test_the_reach_bounds_random_configurations() -> None:
    model = arm()
    reach = frame_reach(model, "hand", (0.0, 0.0, 0.0))
    with dynx.backend("reference", model) as engine:
        at = engine.forward_kinematics(model.random(0, 2000), "hand")[:, :3, 3]
        distances = np.linalg.norm(at - reach.start, axis=-1)
        # The shoulder is the centre: three links in a row are the most, and random ones come near to it.
        assert 0.9 * reach.most < np.max(distances) <= reach.most * (1 + 8 * EPS)
        far = engine.inverse_kinematics(np.array([9.0, 0.0, 0.0]), "hand")
        assert not far.success
        assert "the chain reaches at most" in str(far.proof)


@each_base
def test_paths_are_continuous(base: Any) -> None:
    model = arm(base, limits=Limits(upper=2.5))
    q0, q1 = model.random(0), model.random(1)
    q = trajectory.quintic(q0, q1, 1.0, model=model)(np.linspace(0.0, 1.0, 80)).q
    with dynx.backend("compiled", model) as engine:
        found = engine.track(engine.forward_kinematics(q, "hand"), "hand", q0)
        assert found, found.message
        steps = np.abs(model.difference(found.q[:-1], found.q[1:]))
        assert np.max(steps[:, 6 * model.floating :]) <= 0.2
        # A target far away needs more than one step: a jump, or poses between.
        ends = engine.track(engine.forward_kinematics(q[[0, -1]], "hand"), "hand", q0, jumps=False)
        assert ends.position_error[0] <= 1e-6


def test_velocities_lead_to_a_pose() -> None:
    pytest.importorskip("daqp")
    model = arm()
    task_gain, q = 5.0, model.random(0)
    posture = q.copy()
    posture[-1] += 0.5
    with dynx.backend("compiled", model) as engine:
        target = engine.forward_kinematics(model.random(1), "hand")
        task = VelocityTask("hand", target=target, gain=task_gain)
        for _ in range(300):
            q = model.integrate(q, 0.02 * engine.velocity_ik(q, task, dt=0.02).v)
        assert np.max(np.abs(engine.forward_kinematics(q, "hand") - target)) <= 1e-6
        # Beside the task the posture moves the tail, which is on another branch.
        v = engine.velocity_ik(q, task, dt=0.02, posture=posture).v
        assert v[-1] > 0.0
