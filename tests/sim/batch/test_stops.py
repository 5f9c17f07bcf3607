"""Stops at position limits in a batch: each rollout is the one that `simulate` computes alone."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import dynx
from dynx.control import PD
from dynx.model import Model
from dynx.model.loading import load
from dynx.sim import BatchRollouts, Payload, simulate, simulate_batch, step_completion
from dynx.spatial.scalar import Floats
from tests.sim.bars import tutorial_robot

ARM = tutorial_robot()
ROLLOUTS, STEPS = 11, 80


def starts(model: Model) -> tuple[Floats, Floats]:
    """Return states near limits, with velocities towards and away from them."""
    rng = np.random.default_rng(3)
    q0 = model.random(rng, ROLLOUTS)
    base = model.nq - len(model.joint_names)
    joints = q0[:, base:]
    low, high = model.lower[base:], model.upper[base:]
    bounded = np.isfinite(low) & np.isfinite(high)
    near = rng.uniform(0.0, 0.02, joints.shape)
    side = rng.random(joints.shape) < 0.5
    with np.errstate(invalid="ignore"):
        joints[:, bounded] = np.where(side, low + near, high - near)[:, bounded]
    return q0, rng.uniform(-4.0, 4.0, (ROLLOUTS, model.nv))


def both(model: Model, law: PD, goal: Floats, each: dict[str, Any], **options: Any) -> BatchRollouts:
    """Return a batch with stops, after checking its rollouts against `simulate`, one by one."""
    q0, v0 = starts(model)
    options = {"duration": STEPS * 1e-3, "joint_limits": True, "check_reference": False, **options}
    batch = simulate_batch(model, law, goal, q0=q0, v0=v0, record_every=1, **each, **options)
    for k in range(ROLLOUTS):
        own = {name: values[k] for name, values in each.items()}
        alone = simulate(model, law, goal, plant="compiled", q0=q0[k], v0=v0[k], **own, **options)
        np.testing.assert_allclose(batch.q_record[k], alone.q[1:], rtol=0.0, atol=1e-9)
        np.testing.assert_allclose(batch.v_record[k], alone.v[1:], rtol=0.0, atol=1e-7)
        if not model.floating:
            error = np.abs(goal - alone.q[1:])
            np.testing.assert_allclose(batch.max_error[k], error.max(axis=0), atol=1e-9)
            rms = np.sqrt(np.mean(error**2, axis=0))
            np.testing.assert_allclose(batch.rms_error[k], rms, atol=1e-9)
    base = model.nq - len(model.joint_names)
    q = batch.q_record[:, :, base:]
    assert np.all((q >= model.lower[base:]) & (q <= model.upper[base:]))
    assert ((q == model.lower[base:]) | (q == model.upper[base:])).any()
    return batch


@pytest.mark.parametrize(
    "options",
    [{}, {"control_dt": 4e-3, "delay": 3e-3}, {"effort_limits": 20.0}, {"joint_armature": 0.3}],
    ids=["plain", "delay", "effort", "armature"],
)
def test_each_rollout_is_that_of_simulate(options: dict[str, Any]) -> None:
    both(ARM, PD(ARM, kp=50, kd=2), ARM.upper + 0.3, {}, **options)


def test_armature_of_each_rollout_counts_in_the_impact() -> None:
    armature = np.linspace(0.01, 1.0, ROLLOUTS * 6).reshape(ROLLOUTS, 6)
    both(ARM, PD(ARM, kp=50, kd=2), ARM.upper + 0.3, {"joint_armature": armature})


@pytest.mark.parametrize("robot", ["panda", "solo12"])
def test_mimic_joints_and_floating_bases(robot: str) -> None:
    model = load(robot, base="floating" if robot == "solo12" else "fixed")
    both(model, PD(model, kp=5, kd=0.1), model.neutral(), {}, duration=0.03)


def test_parameters_of_the_plant_count_in_the_impact() -> None:
    plant = dynx.parametric(ARM, point_payload="tool0")
    q0, v0 = starts(ARM)
    law, goal = PD(ARM, kp=50, kd=2), ARM.upper + 0.3
    options: dict[str, Any] = {"duration": 0.05, "joint_limits": True, "check_reference": False}
    masses = np.linspace(0.0, 3.0, ROLLOUTS)
    parameters = np.pad(masses[:, None], ((0, 0), (0, 3)))
    batch = simulate_batch(ARM, law, goal, q0=q0, v0=v0, parametric=plant, parameters=parameters, **options)
    for k, mass in enumerate(masses.tolist()):
        payload = Payload("tool0", mass)
        alone = simulate(ARM, law, goal, plant="compiled", q0=q0[k], v0=v0[k], payload=payload, **options)
        np.testing.assert_allclose(batch.q[k], alone.q[-1], rtol=0.0, atol=1e-9)
        np.testing.assert_allclose(batch.v[k], alone.v[-1], rtol=0.0, atol=1e-7)


def test_a_rollout_does_not_depend_on_its_neighbours() -> None:
    q0, v0 = starts(ARM)
    law, goal = PD(ARM, kp=50, kd=2), ARM.upper + 0.3
    options: dict[str, Any] = {"duration": 0.05, "joint_limits": True, "check_reference": False}
    whole = simulate_batch(ARM, law, goal, q0=q0, v0=v0, **options)
    part = simulate_batch(ARM, law, goal, q0=q0[4:6], v0=v0[4:6], **options)
    np.testing.assert_array_equal(whole.q[4:6], part.q)
    np.testing.assert_array_equal(whole.v[4:6], part.v)
    np.testing.assert_array_equal(whole.max_error[4:6], part.max_error)


def test_rollouts_that_begin_beyond_limits_are_those_of_simulate_bit_for_bit() -> None:
    q0, v0 = starts(ARM)
    q0[::2] = ARM.upper + 0.2
    law, goal = PD(ARM, kp=50, kd=2), ARM.upper + 0.3
    options: dict[str, Any] = {"duration": 0.05, "joint_limits": True, "check_reference": False}
    batch = simulate_batch(ARM, law, goal, q0=q0, v0=v0, record_every=1, **options)
    assert (batch.q_record <= np.maximum(ARM.upper, q0)[:, None]).all()
    assert (batch.q_record[::2] == ARM.upper + 0.2).any()
    for k in range(ROLLOUTS):
        alone = simulate(ARM, law, goal, plant="compiled", q0=q0[k], v0=v0[k], **options)
        np.testing.assert_array_equal(batch.q_record[k], alone.q[1:])
        np.testing.assert_array_equal(batch.v_record[k], alone.v[1:])


def test_the_kernel_of_an_impact_is_compiled_when_a_joint_stops(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[object] = []
    monkeypatch.setattr(step_completion, "_impact_kernel", asked.append)
    law, goal = PD(ARM, kp=50, kd=5), 0.5 * (ARM.lower + ARM.upper)
    simulate_batch(ARM, law, goal, rollouts=3, duration=0.05, joint_limits=True)
    simulate(ARM, law, goal, plant="compiled", duration=0.05, joint_limits=True)
    assert not asked


def test_without_a_joint_at_its_limit_stops_change_nothing() -> None:
    law, goal = PD(ARM, kp=50, kd=5), 0.5 * (ARM.lower + ARM.upper)
    runs = [
        simulate_batch(ARM, law, goal, rollouts=3, duration=0.05, joint_limits=limited)
        for limited in (False, True)
    ]
    np.testing.assert_array_equal(runs[0].q, runs[1].q)
    np.testing.assert_array_equal(runs[0].max_error, runs[1].max_error)
