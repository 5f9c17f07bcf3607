"""A simulation has the damping, dry friction and armature of the description by default, on every plant."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import dynx
from dynx.backends import installed_backends
from dynx.backends.joint_dynamics import JointDynamicsTerms
from dynx.control import PD, MomentumObserver, OpenLoop
from dynx.errors import DynxError, UnknownNameError
from dynx.model import Model
from dynx.sim import Scenario, ScenePlant, simulate, simulate_batch
from dynx.sim.plants.disturbances import Disturbances
from dynx.sim.plants.registry import ENGINES
from dynx.testing.strategies import models
from dynx.world import Scene, SceneRobot
from tests.backends.robots import mixed_robot
from tests.sim.bars import apart
from tests.sim.rigid_bodies import RIGID_BODIES
from tests.world.engines import WORLDS
from tests.world.test_joint_dynamics import PENDULUM, TURNTABLE

SCHEMES = {"pinocchio": ("semi_implicit", "rk4", "adaptive"), "compiled": ("semi_implicit", "rk4")}
PLANTS: dict[str, dict[str, Any]] = {
    f"{name}, {scheme}": {"plant": name, "integrator": scheme}
    for name in installed_backends()
    for scheme in (*SCHEMES.get(name, ("semi_implicit",)), *(["engine"] if name in ENGINES else []))
}
NAMES = ("joint_damping", "joint_friction", "joint_armature")
ALL: dict[str, Any] = dict.fromkeys(NAMES, True)


def in_scene(model: Model, engine: str, q: float = 0.0) -> ScenePlant:
    """Return the plant of a robot that is alone in a scene."""
    robot = SceneRobot("robot", model, q=(q,))
    return ScenePlant(Scene("joint", robots=(robot,), gravity=model.gravity), "robot", engine=engine)


def pendulum_above(lower: float) -> Model:
    """Return a pendulum whose joint stops at a lower limit [rad]."""
    model = dynx.load("pendulum")
    joints = (replace(each, limits=replace(each.limits, lower=lower, upper=np.inf)) for each in model.joints)
    return replace(model, joints=tuple(joints))


def one_joint(text: str, dynamics: str) -> Model:
    """Return a robot of one joint with these joint dynamics."""
    return dynx.load(text.format(dynamics))


def every_plant(model: Model, q: float = 0.0) -> dict[str, dict[str, Any]]:
    """Return the options of all plants of `model`, in scenes of all engines too."""
    scenes = {f"{engine}, scene": {"plant": in_scene(model, engine, q)} for engine in WORLDS}
    return PLANTS | scenes


def test_armature_of_the_description_adds_to_the_inertia() -> None:
    """A torque of 1 N m accelerates 0.1 kg m^2 and 0.9 kg m^2 of armature to 1 rad/s in 1 s."""
    model = one_joint(TURNTABLE, 'armature="0.9"').with_gravity((0.0, 0.0, 0.0))
    law = OpenLoop(model, np.ones((1000, 1)), control_dt=1e-3)
    for name, plant in every_plant(model).items():
        speed = simulate(model, law, duration=1.0, **plant).v[-1, 0]
        assert speed == pytest.approx(1.0, rel=1e-9), name
        speed = simulate(model, law, duration=1.0, joint_armature=False, **plant).v[-1, 0]
        assert speed == pytest.approx(10.0, rel=1e-9), name
    hold = PD(model, kp=0.0, kd=0.0)
    pushed = dynx.ExternalForce("disk", [0.0, 0.0, 0.0, 0.0, 1.0, 0.0])
    batch = simulate_batch(model, hold, [0.0], rollouts=3, duration=1.0, pushes=pushed)
    np.testing.assert_allclose(batch.v, 1.0, rtol=1e-9)


def test_friction_of_the_description_holds_a_pendulum() -> None:
    """Gravity pulls with 8.25 N m at 1 rad, and 9 N m hold it; without them it falls."""
    model = one_joint(PENDULUM, 'friction="9"')
    for name, plant in every_plant(model, 1.0).items():
        # MuJoCo's own friction is soft and creeps; the others hold exactly.
        creep = 1e-4 if name == "mujoco, scene" else 1e-12
        assert simulate(model, q0=[1.0], duration=0.5, **plant).q[-1, 0] == pytest.approx(1.0, abs=creep), (
            name
        )
        falling = simulate(model, q0=[1.0], duration=0.5, joint_friction=False, **plant)
        assert falling.q[-1, 0] < 0.5, name
    batch = simulate_batch(model, PD(model, kp=0.0, kd=0.0), [1.0], rollouts=3, duration=0.5)
    np.testing.assert_array_equal(batch.q, 1.0)


def test_damping_of_the_description_slows_a_joint_down() -> None:
    """I v' = -d v halves the speed in I ln(2) / d; Euler's implicit step is exact to h d / I."""
    model = one_joint(TURNTABLE, 'damping="0.2"')
    duration, h = 0.347, 1e-3
    exact = np.exp(-duration * 0.2 / 0.1)
    for name, plant in every_plant(model).items():
        found = simulate(model, v0=[1.0], dt=h, duration=duration, **plant).v[-1, 0]
        assert found == pytest.approx(exact, rel=2.0 * h * 0.2 / 0.1), name


@given(
    models(max_links=4, solvable=True, mimics=False, joint_types=("revolute", "continuous", "prismatic")),
    st.sampled_from(sorted(PLANTS)),
    st.integers(0, 2**31),
)
def test_the_default_is_what_coefficients_by_hand_are(robot: Model, plant: str, seed: int) -> None:
    """Bit for bit, where no joint follows another."""
    rng, own = np.random.default_rng(seed), JointDynamicsTerms(robot)
    base = 6 if robot.floating else 0
    coefficients = zip(NAMES, (own.damping, own.friction, own.rotors), strict=True)
    by_hand: dict[str, Any] = {name: each[base:] for name, each in coefficients}
    options: dict[str, Any] = {
        "q0": robot.random(rng), "v0": 0.1 * rng.standard_normal(robot.nv), "duration": 5e-3, **PLANTS[plant]
    }  # fmt: skip
    try:
        told = simulate(robot, **by_hand, **options)
    except DynxError as error:
        with pytest.raises(type(error)):
            simulate(robot, **options)
        return
    found = simulate(robot, **options)
    for name in ("q", "v", "a", "tau"):
        np.testing.assert_array_equal(getattr(found, name), getattr(told, name))


@pytest.mark.parametrize("base", ["fixed", "floating"])
def test_the_default_of_joints_that_follow_others_is_that_of_the_description(base: Any) -> None:
    robot = mixed_robot(base, mimic=True)
    rng = np.random.default_rng(5)
    options: dict[str, Any] = {
        "q0": robot.random(rng), "v0": rng.standard_normal(robot.nv), "duration": 0.1, "plant": "compiled"
    }  # fmt: skip
    found, told = simulate(robot, **options), simulate(robot, **ALL, **options)
    np.testing.assert_array_equal(found.v, told.v)
    assert apart(found.v, simulate(robot, **RIGID_BODIES, **options).v) > 1e-2


def test_parameters_of_joint_dynamics_replace_those_of_the_description() -> None:
    """Their defaults are those of the description, which count once."""
    robot = mixed_robot("fixed", mimic=False)
    plant, law = dynx.parametric(robot, joint_dynamics=True), PD(robot, kp=5.0, kd=0.1)
    options: dict[str, Any] = {"q0": robot.neutral() + 0.1, "rollouts": 2, "duration": 0.1}
    options["check_reference"] = False
    varied = simulate_batch(robot, law, robot.neutral(), parametric=plant, **options)
    same = simulate_batch(robot, law, robot.neutral(), **options)
    assert apart(varied.q, same.q) < 1e-9
    assert apart(varied.q, simulate_batch(robot, law, robot.neutral(), **RIGID_BODIES, **options).q) > 1e-4


def test_an_observer_knows_the_joint_dynamics_of_the_description() -> None:
    robot = mixed_robot("fixed", mimic=False)
    joints = ALL | {"joint_friction": False}
    options: dict[str, Any] = {"plant": "compiled", "check_reference": False, "v0": np.ones(robot.nv)}
    law = PD(robot, kp=5.0, kd=0.5)
    rollout = simulate(robot, law, robot.neutral() + 0.1, duration=0.2, joint_friction=False, **options)
    log = rollout.t, rollout.q, rollout.v, rollout.tau
    knows, told = (
        MomentumObserver(robot, time_constant=0.01, **given).residuals(*log)
        for given in ({"joint_friction": False}, joints)
    )
    np.testing.assert_array_equal(knows, told)
    ignores = MomentumObserver(robot, time_constant=0.01, **RIGID_BODIES).residuals(*log)
    assert np.abs(knows).max() < 0.05 * np.abs(ignores).max()


@pytest.mark.parametrize(
    ("former", "present"),
    [
        ("damping", "joint_damping"),
        ("friction", "joint_friction"),
        ("armature", "joint_armature"),
        ("position_limits", "joint_limits"),
    ],
)
def test_former_names_are_answered_with_those_of_today(former: str, present: str) -> None:
    robot: Any = dynx.load("pendulum")
    doors: list[Any] = [
        lambda **given: simulate(robot, duration=0.1, **given),
        lambda **given: simulate_batch(robot, PD(robot, kp=1.0, kd=1.0), [0.0], rollouts=2, **given),
        lambda **given: Scenario(robot, **given),
    ]
    if former != "position_limits":
        doors.append(lambda **given: MomentumObserver(robot, gain=1.0, **given))
        doors.append(lambda **given: Disturbances(robot, **given))
    for door in doors:
        with pytest.raises(UnknownNameError, match=f"no option '{former}'; it is now {present}"):
            door(**{former: True})
    with pytest.raises(AttributeError, match=f"Scenario.{former} is now {present}"):
        getattr(Scenario(robot), former)


@pytest.mark.skipif(not WORLDS, reason="needs an engine with a world")
@pytest.mark.parametrize("stops", [True, False])
def test_one_option_has_the_stops_of_every_plant(stops: bool) -> None:
    """In a scene they are those of the engine; by default there are stops everywhere."""
    model = pendulum_above(0.5)
    for name, plant in every_plant(model, 1.0).items():
        rollout = simulate(model, q0=[1.0], duration=1.0, joint_limits=stops, **plant)
        assert (rollout.q.min() > 0.45) == stops, name
        assert rollout.settings["joint_limits"] is stops
        if stops:
            default = simulate(model, q0=[1.0], duration=1.0, **plant)
            np.testing.assert_array_equal(default.q, rollout.q, err_msg=name)


def test_the_notes_name_joints_that_begin_beyond_their_limits() -> None:
    model = pendulum_above(1.5)
    (joint,) = model.joint_names

    def noted(**given: Any) -> list[str]:
        notes = simulate(model, duration=0.01, **given).notes
        return [each for each in notes if "beyond its limits" in each]

    for name, plant in every_plant(model, 1.0).items():
        (note,) = noted(q0=[1.0], **plant)
        assert f"{joint}' is at 1, beyond its limits 1.5 to inf, at the start, so that it " in note, name
        assert not noted(q0=[1.6], **plant), name
    assert not noted(q0=[1.0], joint_limits=False)
    arm = dynx.load("ur5")
    *first, others = simulate(arm, q0=arm.upper + 0.1, duration=0.01).notes
    assert len(first) == 5
    assert others == "1 more joints are beyond their limits at the start"
