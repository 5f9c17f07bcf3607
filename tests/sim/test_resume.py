"""A rollout taken up again at any step goes on as if it had never stopped, to the last bit."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dynx.backends import installed_backends
from dynx.control import PD, PID, BulletPDMotor, BulletPositionMotor, BulletVelocityMotor, ComputedTorque
from dynx.control.base import Controller
from dynx.errors import ArgumentError
from dynx.model import Model
from dynx.model.loading import load
from dynx.sim import Noise, Rollout, Scenario, Simulation, simulate
from dynx.world import Imu, SensorErrors
from tests.sim.bars import tutorial_motion, tutorial_robot

needs_bullet = pytest.mark.skipif("pybullet" not in installed_backends(), reason="PyBullet is not installed")
ARM = tutorial_robot()
STEPS = 40
LAWS: dict[str, Controller[Any]] = {
    "pid": PID(ARM, kp=300, ki=2000, kd=30, control_dt=3e-3),
    "computed torque": ComputedTorque(ARM, kp=400, kd=40),
    "position motor": BulletPositionMotor(ARM),
    "velocity motor": BulletVelocityMotor(ARM),
    "pd motor": BulletPDMotor(ARM, kp=300.0, kd=30.0),
}
OPTIONS: dict[str, Any] = {
    "duration": STEPS * 1e-3,
    "control_dt": 3e-3,
    "delay": 2e-3,
    "noise": Noise(1e-4, 1e-3, seed=5),
}


def the_same(one: Rollout, other: Rollout) -> None:
    for name in ("t", "q", "v", "a", "tau", "saturated"):
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name), err_msg=name)


def run(law: str, plant: str, **more: Any) -> Rollout:
    return simulate(ARM, LAWS[law], tutorial_motion(), plant=plant, **OPTIONS, **more)


@pytest.mark.parametrize("law", ["pid", "computed torque"])
@pytest.mark.parametrize("integrator", ["semi_implicit", "rk4", "adaptive"])
@settings(max_examples=6)
@given(step=st.integers(0, STEPS))
def test_on_a_plant_of_dynx(law: str, integrator: str, step: int) -> None:
    whole = run(law, "pinocchio", integrator=integrator, effort_limits=True)
    part = whole.first(min(step + 3, STEPS))
    again = run(law, "pinocchio", integrator=integrator, effort_limits=True, resume=part, step=step)
    the_same(again, whole)


@needs_bullet
@pytest.mark.parametrize("law", LAWS)
def test_on_bullet_s_plant(law: str) -> None:
    whole = run(law, "pybullet")
    for step in (0, 1, 17, STEPS - 1, STEPS):
        the_same(run(law, "pybullet", resume=whole.first(step)), whole)


@pytest.mark.parametrize("plant", [pytest.param("pybullet", marks=needs_bullet), "pinocchio"])
def test_with_a_floating_base(plant: str) -> None:
    robot = load("solo12", base="floating")
    law = PD(robot, kp=2.0, kd=0.05)
    start: Any = {"v0": np.linspace(-1.0, 1.0, robot.nv), "plant": plant, "duration": 0.03}
    whole = simulate(robot, law, robot.neutral(), **start)
    for step in (1, 13, 29):
        the_same(simulate(robot, law, robot.neutral(), resume=whole.first(step), **start), whole)


def test_from_a_file(tmp_path: Path) -> None:
    whole = run("pid", "pinocchio")
    whole.first(25).save(tmp_path / "part.npz")
    the_same(run("pid", "pinocchio", resume=Rollout.load(tmp_path / "part.npz")), whole)


def test_a_record_of_something_else_is_refused() -> None:
    whole = run("computed torque", "pinocchio")
    other: Model = load("ur5").with_gravity([0.0, 0.0, -1.0])
    cases: list[dict[str, Any]] = [
        {"dt": 5e-4},
        {"plant": "compiled"},
        {"mass_scale": 1.1},
        {"joint_damping": 1.0},
        {"noise": Noise(1e-4, 1e-3, seed=6)},
        {"joint_limits": False},
        {"step": STEPS + 1},
    ]
    for change in cases:
        options = {**OPTIONS, "plant": "pinocchio", "resume": whole, **change}
        with pytest.raises(ArgumentError, match="resume"):
            simulate(ARM, LAWS["computed torque"], tutorial_motion(), **options)
    with pytest.raises(ArgumentError, match="not of"):
        simulate(other, LAWS["computed torque"], tutorial_motion(), resume=whole, **OPTIONS)
    with pytest.raises(ArgumentError, match="resume"):
        simulate(ARM, LAWS["computed torque"], tutorial_motion(), step=3)


def test_with_other_sensors(tmp_path: Path) -> None:
    """On which no step depends: those of the scenario are read along the whole record."""
    frame = ARM.links[-1].name
    imu = Imu("imu", frame, rate=300.0, gyroscope=SensorErrors(noise=0.1, random_walk=1.0))
    whole = run("pid", "pinocchio", sensors=[imu])
    path = tmp_path / "half.npz"
    run("pid", "pinocchio", sensors=[Imu("other", frame)]).first(STEPS // 2).save(path)
    again = run("pid", "pinocchio", sensors=[imu], resume=Rollout.load(path))
    the_same(again, whole)
    assert list(again.sensors) == ["imu"]
    np.testing.assert_array_equal(again.sensors["imu"].values, whole.sensors["imu"].values)
    scenarios = whole.scenario, run("pid", "pinocchio").scenario
    assert all(isinstance(each, Scenario) for each in scenarios)
    simulation, other = (Simulation(each) for each in scenarios if isinstance(each, Scenario))
    simulation.step(STEPS // 2)
    other.restore(simulation.save())
    assert other.rollout.departures == ()
    simulation.close()
    other.close()
