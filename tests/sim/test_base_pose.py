"""A robot whose fixed base has a pose of its own, simulated like the same robot on a mount."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dynx import ExternalForce
from dynx.backends import installed_backends
from dynx.control import PD, ComputedTorque
from dynx.errors import ArgumentError
from dynx.model import Joint, Link, Model, Pose
from dynx.model.loading import load
from dynx.sim import Payload, Rollout, Scenario, simulate, simulate_batch
from tests.sim.bars import EXACT_ON_DYNX, PLANTS_AGREE, apart, tutorial_robot

MOUNT = Pose((0.4, -1.2, 0.7), (1.1, -0.6, 2.3))
ARM = tutorial_robot().with_base_pose(MOUNT)
MOUNTED = Model.build(
    ARM.name,
    [Link("ground"), *ARM.links],
    [Joint("mount", "fixed", "ground", ARM.root, MOUNT), *ARM.joints],
    gravity=ARM.gravity,
)
START = np.array([0.2, -1.0, 0.8, 0.3, -0.4, 0.5])
OPTIONS: dict[str, Any] = {
    "duration": 0.1,
    "q0": START,
    "payload": Payload(ARM.frame_names[-1], 1.5),
    "pushes": [ExternalForce(ARM.frame_names[-1], (5.0, -3.0, 2.0, 0.1, 0.2, 0.3), 0.02, 0.03)],
}
PLANTS = [name for name in ("compiled", "pinocchio", "pybullet") if name in installed_backends()]


@pytest.mark.parametrize("plant", PLANTS)
def test_a_rollout_is_that_of_the_mounted_robot(plant: str) -> None:
    """A pull of gravity in other axes, a payload and a force in world axes on a controlled arm."""
    one, other = (
        simulate(model, PD(model, kp=200.0, kd=20.0), START, plant=plant, **OPTIONS)
        for model in (ARM, MOUNTED)
    )
    assert apart(one.q, other.q) <= PLANTS_AGREE
    assert apart(one.tau, other.tau) <= PLANTS_AGREE
    plain = tutorial_robot()
    there = simulate(plain, PD(plain, kp=200.0, kd=20.0), START, plant=plant, **OPTIONS)
    assert apart(one.q, there.q) > 1e-4


def test_a_batch_is_like_single_rollouts() -> None:
    controller = ComputedTorque(ARM, kp=400.0, kd=40.0, backend="reference")
    one = simulate(ARM, controller, START, plant="compiled", **OPTIONS)
    many = simulate_batch(ARM, controller, START, rollouts=2, **OPTIONS)
    assert apart(many.q[1], one.q[-1]) < EXACT_ON_DYNX


def test_records_and_scenarios_keep_it(tmp_path: Path) -> None:
    rollout = simulate(ARM, PD(ARM, kp=200.0, kd=20.0), START, plant="compiled", duration=0.01)
    rollout.save(tmp_path / "mounted.npz")
    again = Rollout.load(tmp_path / "mounted.npz")
    assert again.model == ARM
    scenario = rollout.scenario
    assert scenario is not None
    assert Scenario.from_dict(scenario.to_dict()).model == ARM
    np.testing.assert_array_equal(again.energy, rollout.energy)


def test_a_rollout_is_not_resumed_at_another_pose() -> None:
    rollout = simulate(ARM, None, plant="compiled", duration=0.01, q0=START)
    with pytest.raises(ArgumentError, match="it had xyz of base_pose"):
        simulate(load(ARM, base_pose=np.eye(4)), None, plant="compiled", duration=0.02, resume=rollout)
