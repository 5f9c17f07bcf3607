"""Dry friction in a batch: closed forms, and the same as in one rollout at any step."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import dynx
from dynx.compiled import step
from dynx.control import PD, GravityCompensatedPD
from dynx.errors import ArgumentError
from dynx.model import Model
from dynx.model.loading import load
from dynx.rbd import joint_friction
from dynx.sim import batch, simulate, simulate_batch
from tests.backends.robots import mixed_robot
from tests.oracles.closed_form import MODELS
from tests.sim.batch.batches import assert_same, batch_and_one
from tests.sim.plants.test_dry_friction import MASS, STEPS, F, slider

ARM = MODELS / "six_axis_arm.urdf"


@pytest.fixture(scope="module")
def arm() -> Model:
    return load(ARM)


@pytest.mark.parametrize("dt", STEPS)
def test_blocks_stick_break_loose_and_stop(dt: float) -> None:
    """Each rollout has its own friction and speed; the closed forms are those of one."""
    robot, duration = slider(), 0.2
    friction = np.array([[F], [2.0 * F], [0.0], [F], [1e3]])
    v0 = np.array([[0.123], [-0.3], [0.05], [0.0], [0.7]])
    law = PD(robot, kp=0.0, kd=0.0)
    many = simulate_batch(
        robot, law, robot.neutral(), v0=v0, joint_friction=friction, dt=dt, duration=duration, record_every=1
    )
    deceleration = friction / MASS
    t = many.t[None]
    left = np.maximum(np.abs(v0) - deceleration * t, 0.0)
    np.testing.assert_allclose(np.abs(many.v_record[:, :, 0]), left, atol=1e-12)
    assert np.all(many.v_record[:, :, 0][left == 0.0] == 0.0)
    distance = np.divide(
        0.5 * v0[:, 0] ** 2, deceleration[:, 0], where=deceleration[:, 0] > 0.0, out=np.zeros(5)
    )
    distance[2] = 0.05 * duration
    assert np.all(np.abs(np.abs(many.q[:, 0]) - distance) <= np.abs(v0[:, 0]) * dt + 1e-12)


@pytest.mark.parametrize("dt", STEPS)
def test_loaded_blocks_stick_creep_slide_and_stop(dt: float) -> None:
    """Blocks on a rail along gravity, in a batch and alone, at speeds known in each step."""
    load_, steps = 0.5 * MASS, 100
    robot = slider().with_gravity((load_ / MASS, 0.0, 0.0))
    friction = load_ * np.array([0.0, 0.3, 1.0 - 1e-6, 1.0, 1.0 + 1e-6, 1.5, 0.9, 1.5, 0.2])
    damping = MASS / dt * np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 20.0, 0.05, 0.1])
    v0 = 10.0 * dt * np.array([0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 1.0, -1.0])
    speeds = [[v] for v in v0]
    for _ in range(steps):
        for row, (f, d) in enumerate(zip(friction, damping, strict=True)):
            # At the end of a step M (w - v) / h = load - d w - f sign(w), or w = 0 if that takes less than f.
            free = MASS * speeds[row][-1] / dt + load_
            speeds[row].append(np.sign(free) * max(abs(free) - f, 0.0) / (MASS / dt + d))
    wanted = np.array(speeds)[:, 1:]
    assert np.all(wanted[3:5] == 0.0)
    assert np.all(wanted[[1, 2, 6, 8], -1] > 0.0)
    assert wanted[5, -1] == wanted[7, -1] == 0.0
    np.testing.assert_allclose(wanted[6, -1], 0.1 * load_ / damping[6], rtol=1e-9)
    np.testing.assert_allclose(wanted[1], 0.7 * load_ / MASS * dt * np.arange(1, steps + 1), rtol=1e-9)
    law = PD(robot, kp=0.0, kd=0.0)
    options: dict[str, Any] = {"dt": dt, "duration": steps * dt}
    each: dict[str, Any] = {
        "joint_friction": friction[:, None],
        "joint_damping": damping[:, None],
        "v0": v0[:, None],
    }
    many = simulate_batch(robot, law, robot.neutral(), record_every=1, **each, **options)
    for row in range(len(v0)):
        own = {name: rows[row] for name, rows in each.items()}
        one = simulate(robot, plant="compiled", **own, **options)
        for v in (many.v_record[row, :, 0], one.v[1:, 0]):
            np.testing.assert_allclose(v, wanted[row], rtol=1e-9, atol=1e-13 * dt)
            np.testing.assert_array_equal(v == 0.0, wanted[row] == 0.0)


@pytest.mark.parametrize("dt", STEPS)
def test_smoothed_friction_creeps_at_its_speed(dt: float) -> None:
    load_, slip = 0.5 * F, 1.01 * dt * F / MASS
    robot = slider().with_gravity((load_ / MASS, 0.0, 0.0))
    law, creep = PD(robot, kp=0.0, kd=0.0), slip * np.arctanh(load_ / F)
    options: dict[str, Any] = {"joint_friction": F, "dt": dt, "duration": 100 * dt, "friction_slip": slip}
    assert abs(simulate(robot, plant="compiled", **options).v[-1, 0] / creep - 1.0) < 1e-9
    assert abs(simulate_batch(robot, law, robot.neutral(), **options).v[0, 0] / creep - 1.0) < 1e-9


@pytest.mark.parametrize("dt", [1e-3, 1e-2])
def test_random_motions_are_those_of_one_rollout(arm: Model, dt: float) -> None:
    rng = np.random.default_rng(0)
    law = PD(arm, kp=5.0, kd=0.02)
    q0, v0 = 0.3 * rng.normal(size=(20, 6)), rng.normal(size=(20, 6))
    friction = np.abs(rng.normal(size=(20, 6))) * 10.0 ** rng.uniform(-3, 1, (20, 1))
    options: dict[str, Any] = {"joint_damping": True, "joint_armature": 1e-3, "dt": dt, "duration": 50 * dt}
    many = simulate_batch(
        arm,
        law,
        arm.neutral(),
        q0=q0,
        v0=v0,
        joint_friction=friction,
        record_every=1,
        check_reference=False,
        **options,
    )
    assert 0.05 < np.mean(many.v_record == 0.0) < 0.95
    for row in range(20):
        start: dict[str, Any] = {"q0": q0[row], "v0": v0[row], "joint_friction": friction[row]}
        one = simulate(arm, law, arm.neutral(), plant="compiled", check_reference=False, **start, **options)
        assert_same(many, row, one)
        np.testing.assert_array_equal(many.v_record[row] == 0.0, one.v[1:] == 0.0)


@pytest.mark.parametrize("base", ["fixed", "floating"])
def test_mimic_joints_and_bases(base: str) -> None:
    robot = mixed_robot(base, mimic=True)
    rng = np.random.default_rng(3)
    start: dict[str, Any] = {"q0": robot.random(rng), "v0": 0.3 * rng.uniform(-1.0, 1.0, robot.nv)}
    law = PD(robot, kp=2.0, kd=0.2)
    options: dict[str, Any] = {"duration": 0.1, "check_reference": False, **start}
    many, one = batch_and_one(robot, law, robot.neutral(), joint_friction=10.0, **options)
    assert np.any(one.v == 0.0)
    np.testing.assert_array_equal(many.v_record[0] == 0.0, one.v[1:] == 0.0)


def test_bits_do_not_depend_on_the_neighbours(arm: Model, monkeypatch: pytest.MonkeyPatch) -> None:
    """Steps are repeated for some rollouts, here for many because no mode is corrected in the kernel."""
    monkeypatch.setattr(joint_friction, "CORRECTIONS", 0)
    monkeypatch.setattr(step, "_kernels", {})
    rng = np.random.default_rng(1)
    law = PD(arm, kp=5.0, kd=0.02)
    start: dict[str, Any] = {"q0": 0.3 * rng.normal(size=(37, 6)), "v0": rng.normal(size=(37, 6))}
    options: dict[str, Any] = {"joint_friction": 0.3, "duration": 0.1, "check_reference": False}
    whole = simulate_batch(arm, law, arm.neutral(), **start, **options)
    monkeypatch.setattr(batch, "PART", 5)
    parts = simulate_batch(arm, law, arm.neutral(), **start, **options)
    np.testing.assert_array_equal(parts.v, whole.v)
    rows = rng.permutation(37)
    other: dict[str, Any] = {name: array[rows] for name, array in start.items()}
    shuffled = simulate_batch(arm, law, arm.neutral(), **other, **options)
    np.testing.assert_array_equal(shuffled.v, whole.v[rows])
    one = simulate(arm, law, arm.neutral(), plant="compiled", q0=start["q0"][3], v0=start["v0"][3], **options)
    np.testing.assert_array_equal(whole.v[3], one.v[-1])


def test_friction_as_a_parameter_is_the_same_friction(arm: Model) -> None:
    plant = dynx.parametric(arm, joint_dynamics=True)
    rng = np.random.default_rng(2)
    values = plant.parameters.defaults * rng.uniform(0.5, 1.5, (4, len(plant.parameters.defaults)))
    names = [[f"{joint}.{kind}" for joint in arm.joint_names] for kind in ("damping", "friction", "armature")]
    columns = [[plant.parameters.index(name) for name in each] for each in names]
    law = GravityCompensatedPD(arm, kp=5.0, kd=0.02)
    options: dict[str, Any] = {"q0": np.full(6, 0.4), "v0": np.full(6, 0.3), "duration": 0.1}
    many = simulate_batch(
        arm, law, arm.neutral(), parametric=plant, parameters=values, record_every=1, **options
    )
    for row in range(4):
        damping, friction, armature = (values[row, each] for each in columns)
        one = simulate(
            arm,
            law,
            arm.neutral(),
            plant="compiled",
            joint_damping=damping,
            joint_friction=friction,
            joint_armature=armature,
            **options,
        )
        assert np.any(one.v == 0.0)
        assert_same(many, row, one)


def test_a_slip_speed_below_the_bound_of_any_rollout_is_refused(arm: Model) -> None:
    law = PD(arm, kp=1.0, kd=0.01)
    options: dict[str, Any] = {"friction_slip": 1.0, "duration": 0.01}
    simulate_batch(arm, law, arm.neutral(), joint_friction=np.full((3, 1), 1e-2), **options)
    with pytest.raises(ArgumentError, match="oscillates from step to step"):
        simulate_batch(arm, law, arm.neutral(), joint_friction=np.array([[1e-2], [100.0], [0.0]]), **options)


def test_the_bound_of_the_slip_speed_counts_what_differs_between_rollouts() -> None:
    """It is h f / (M s) with the friction, the armature and the mass of each rollout, at its own start."""
    robot, h, slip = slider(), 1e-2, 0.1
    law = PD(robot, kp=0.0, kd=0.0)
    most = 2.0 * MASS * slip / h
    options: dict[str, Any] = {"dt": h, "friction_slip": slip, "duration": h}
    light = np.array([[0.0], [0.1 * MASS]])

    def batch(**given: Any) -> None:
        simulate_batch(robot, law, robot.neutral(), **{**options, **given})

    batch(joint_friction=np.array([[0.0], [0.99 * most]]))
    with pytest.raises(ArgumentError, match=r"is 2\.02 at rail in rollout 1, and 2 is the largest"):
        batch(joint_friction=np.array([[0.0], [1.01 * most]]))
    batch(joint_friction=1.05 * most, joint_armature=light + 0.1 * MASS)
    with pytest.raises(ArgumentError, match="rail in rollout 0"):
        batch(joint_friction=1.05 * most, joint_armature=light)
    plant = dynx.parametric(robot, links=["block"], joint_dynamics=True)
    values = np.tile(plant.parameters.defaults, (3, 1))
    values[:, plant.parameters.index("rail.friction")] = 0.99 * most
    batch(parametric=plant, parameters=values)
    for name, factor in (("rail.friction", 1.03), ("block.m", 0.98)):
        heavier = values.copy()
        heavier[2, plant.parameters.index(name)] *= factor
        with pytest.raises(ArgumentError, match="rail in rollout 2"):
            batch(parametric=plant, parameters=heavier)
