"""PyBullet's own motors: they move its plant, and let go when a law of torque follows."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from dynx import control
from dynx.backends import installed_backends
from dynx.control import (
    PD,
    BulletPDMotor,
    BulletPositionMotor,
    BulletTorqueMotor,
    BulletVelocityMotor,
    ComputedTorque,
    Measurement,
    MotorLag,
)
from dynx.control.bullet import BulletMotorCommand
from dynx.engines.pybullet.stepper import BulletStepper
from dynx.errors import ArgumentError, ControlError, GainError, UnknownNameError, UnsupportedFeatureError
from dynx.model import Model
from dynx.model.elements import JointDynamics
from dynx.model.loading import load
from dynx.model.tree import Base
from dynx.sim import simulate
from dynx.spatial.scalar import Floats
from dynx.steppers.forces import Forces
from dynx.world import Scene, SceneRobot, World
from dynx.world.preparation import prepare
from tests.backends.robots import mixed_robot
from tests.sim.bars import PLANTS_AGREE, apart, tutorial_motion, tutorial_robot

pytestmark = pytest.mark.skipif("pybullet" not in installed_backends(), reason="PyBullet is not installed")


def stepper_of(robot: Model) -> BulletStepper:
    layout = prepare(
        Scene("one", robots=(SceneRobot("arm", robot),)),
        collisions=False,
        joint_limits=False,
        joint_damping=False,
        joint_friction=False,
        joint_armature=False,
        joint_springs=False,
    )
    return BulletStepper(
        layout, 1e-3, {name: setting.default for name, setting in BulletStepper.settings.items()}
    )


def test_position_and_velocity_motors_follow_a_motion() -> None:
    robot, motion = tutorial_robot(), tutorial_motion()
    position = simulate(robot, BulletPositionMotor(robot), motion, plant="pybullet", dt=2e-3)
    velocity = simulate(robot, BulletVelocityMotor(robot), motion, plant="pybullet", dt=2e-3)
    # Each step ends at the wanted speed, which is that at its beginning: late by one step.
    np.testing.assert_allclose(velocity.v[1:], motion(velocity.t[:-1]).v, atol=1e-2)
    assert np.abs(position.error).max() < 2e-2
    # Positions drift under a law that does not look at them.
    assert np.abs(position.error[-1]).max() < np.abs(velocity.error[-1]).max()


def test_a_motor_tells_the_engine_the_most_that_it_gives() -> None:
    robot, motion = tutorial_robot(), tutorial_motion()
    measurement, setpoint = Measurement(0.0, motion.start.q, motion.start.v), motion.start
    for kind in (BulletPositionMotor, BulletVelocityMotor):
        assert "forces" not in kind(robot).command(measurement, setpoint).lists()
        limits = [10.0, 20.0, 30.0, 4.0, 5.0, np.inf]
        forces = kind(robot, force=limits).command(measurement, setpoint).lists()["forces"]
        assert forces[:5] == limits[:5]
        assert np.isfinite(forces[5])


def test_a_pd_motor_is_the_pd_law() -> None:
    robot, motion = tutorial_robot(), tutorial_motion()
    gains = {"kp": [300.0, 300.0, 200.0, 30.0, 30.0, 10.0], "kd": [30.0, 30.0, 20.0, 3.0, 3.0, 1.0]}
    motor = simulate(robot, BulletPDMotor(robot, **gains), motion, plant="pybullet", duration=0.2)
    law = simulate(robot, PD(robot, **gains), motion, plant="pybullet", duration=0.2)
    assert apart(motor.q, law.q) <= PLANTS_AGREE
    assert apart(motor.tau, law.tau) <= PLANTS_AGREE


def test_a_torque_motor_is_the_law_within() -> None:
    robot, motion = tutorial_robot(), tutorial_motion()
    law = ComputedTorque(robot, kp=400, kd=40)
    motor = simulate(robot, BulletTorqueMotor(law), motion, plant="pybullet", duration=0.2)
    bare = simulate(robot, law, motion, plant="pybullet", duration=0.2)
    np.testing.assert_array_equal(motor.q, bare.q)
    assert apart(motor.tau, bare.tau) <= PLANTS_AGREE


def test_motors_of_the_engine_neither_wrap_a_state_nor_are_wrapped() -> None:
    robot = tutorial_robot()
    lag = MotorLag(PD(robot, kp=1.0, kd=1.0), control_dt=1e-3, time_constant=1e-3)
    with pytest.raises(
        UnsupportedFeatureError, match="PD, with motor lag has a state, and BulletTorqueMotor takes"
    ):
        BulletTorqueMotor(lag)  # type: ignore[arg-type]  # the mistake that is tested
    with pytest.raises(ArgumentError, match="the inner controller is of type Model"):
        BulletTorqueMotor(robot)  # type: ignore[arg-type]  # the mistake that is tested
    wrapped = MotorLag(BulletPositionMotor(robot), control_dt=1e-3)
    with pytest.raises(ControlError, match="plant='pybullet' only, and inside no other controller"):
        simulate(robot, wrapped, np.zeros(6), plant="pybullet", duration=0.01)


def test_a_motor_that_may_not_pull_does_not() -> None:
    robot = tutorial_robot()
    weak = simulate(robot, BulletPositionMotor(robot, force=0.5), np.zeros(6), plant="pybullet", duration=0.2)
    assert np.abs(weak.tau).max() == pytest.approx(0.5, rel=1e-9)
    assert np.abs(weak.error[-1]).max() > 0.1


def test_motors_move_joints_whatever_else_acts() -> None:
    """Friction and pushes reach the plant past the motors, and are not reported as theirs."""
    robot = tutorial_robot()
    free = simulate(robot, BulletVelocityMotor(robot), np.zeros(6), plant="pybullet", duration=0.02)
    damped = simulate(
        robot,
        BulletVelocityMotor(robot),
        np.zeros(6),
        plant="pybullet",
        duration=0.02,
        joint_damping=5.0,
        v0=np.ones(6),
    )
    # The first step stops the arm: the motor gives all that is missing.
    np.testing.assert_allclose(damped.v[1], 0.0, atol=2e-2)
    assert np.abs(damped.tau[0]).max() > 10 * np.abs(free.tau[0]).max()


@pytest.mark.parametrize("mode", ["POSITION_CONTROL", "VELOCITY_CONTROL"])
def test_the_tutorial_s_trap(mode: str) -> None:
    """After a motor was used, torque moves the arm as if there had been none; in the engine it does not."""
    robot = tutorial_robot()
    stepper = stepper_of(robot)
    rest, forces = np.zeros(6), Forces([(0, np.array([3.0, 2.0, 1.0, 0.1, 0.1, 0.1]))])
    command = BulletMotorCommand(mode, positions=[0.0] * 6, velocities=[0.0] * 6)

    def step(forces: Forces) -> Floats:
        stepper.set_robot_state(0, rest, rest)
        stepper.step(1, forces)
        return stepper.robot_state(0).v

    try:
        fresh = step(forces)
        step(Forces(commands={0: command}))
        trapped = step(forces._replace(commands=stepper._commands))
        released = step(forces)
    finally:
        stepper.close()
    assert np.abs(trapped).max() < 0.1 * np.abs(fresh).max()
    assert (released == fresh).all()


def test_what_motors_cannot_be() -> None:
    robot = tutorial_robot()
    with pytest.raises(UnsupportedFeatureError, match="mimic"):
        BulletPositionMotor(mixed_robot(mimic=True))
    with pytest.raises(GainError, match="position_gain"):
        BulletPositionMotor(robot, position_gain=-1.0)
    with pytest.raises(UnsupportedFeatureError, match="armature"):
        simulate(
            robot,
            BulletPositionMotor(robot),
            np.zeros(6),
            plant="pybullet",
            duration=0.01,
            joint_armature=0.1,
        )
    floating = load("solo12", base="floating")
    moved = simulate(
        floating, BulletPositionMotor(floating), floating.neutral(), plant="pybullet", duration=0.02
    )
    assert np.abs(moved.error[:, 6:]).max() < 1e-3
    with pytest.raises(ArgumentError, match="one of POSITION_CONTROL"):
        BulletMotorCommand("MAGIC")


@pytest.mark.parametrize(
    ("given", "known"),
    [
        ("maxVelocity", "max_velocities"),
        ("max_forces", "forces"),
        ("targetPositions", "positions"),
        ("velocityGain", "velocity_gains"),
        ("foo", "known: mode, positions"),
    ],
)
def test_a_mistaken_argument_of_a_command_is_answered(given: str, known: str) -> None:
    with pytest.raises(UnknownNameError, match=rf"no option '{given}'.*{known}"):
        BulletMotorCommand("POSITION_CONTROL", **{given: 1.0})


def test_a_motor_with_a_largest_velocity_reaches_it_in_one_step_and_keeps_it() -> None:
    """PyBullet clamps the velocity at which a step ends; other modes, and the next command, know no clamp."""
    robot = tutorial_robot()
    scene = Scene(robots=(SceneRobot("arm", robot),))
    slow = BulletMotorCommand("POSITION_CONTROL", positions=1.0, position_gains=1.0, max_velocities=0.5)
    with World(scene, "pybullet", collisions=False) as world:
        world.step(motors={"arm": slow})
        np.testing.assert_allclose(world.state.robots["arm"].v, 0.5, atol=1e-2)
        world.step(motors={"arm": BulletMotorCommand("VELOCITY_CONTROL", velocities=[2.0] * 6)})
        np.testing.assert_allclose(world.state.robots["arm"].v, 2.0, atol=1e-2)
    with pytest.raises(ArgumentError, match="for POSITION_CONTROL alone"):
        BulletMotorCommand("VELOCITY_CONTROL", velocities=1.0, max_velocities=0.5)
    with pytest.raises(ArgumentError, match="above 0"):
        BulletMotorCommand("POSITION_CONTROL", max_velocities=0.0).checked(robot)


def test_defaults_of_a_command_are_those_that_the_reference_states() -> None:
    robot = tutorial_robot()
    given = BulletMotorCommand(
        "POSITION_CONTROL", positions=0.0, velocities=0.0, forces=1e5, position_gains=0.1, velocity_gains=1.0
    )
    found: list[Floats] = []
    for command in (given, BulletMotorCommand("POSITION_CONTROL")):
        scene = Scene(robots=(SceneRobot("arm", robot, q=(0.3,) * 6),))
        with World(scene, "pybullet", collisions=False) as world:
            world.step(motors={"arm": command})
            found.append(world.state.robots["arm"].v)
    assert np.array_equal(found[0], found[1])


@pytest.mark.parametrize("name", ["PositionMotor", "VelocityMotor", "PDMotor", "TorqueMotor", "EngineMotor"])
def test_former_names_are_answered_with_those_of_today(name: str) -> None:
    with pytest.raises(ImportError, match=r"dynx\.control\.Bullet"):
        getattr(control, name)
    if name in ("PositionMotor", "VelocityMotor"):
        found = control.controller_from_document(tutorial_robot(), {"controller": name, "force": 5.0})
        assert type(found).__name__ == f"Bullet{name}"


@pytest.mark.parametrize("base", ["fixed", "floating"])
@pytest.mark.parametrize(("n", "substeps"), [(10, 1), (1, 10)])
def test_torque_commands_act_in_every_engine_step_of_a_call(base: Base, n: int, substeps: int) -> None:
    model = load("ur5", base=base)
    forces = [1.0, -2.0, 3.0, 0.1, 0.2, -0.3]
    command = BulletMotorCommand("TORQUE_CONTROL", forces=forces)
    tau = np.concatenate([np.zeros(model.nv - 6), forces])
    scene, found = Scene(robots=(SceneRobot("arm", model),)), []
    for given in ({"motors": {"arm": command}}, {"torques": {"arm": tau}}):
        with World(scene, "pybullet", 1e-2 / n, substeps=substeps, collisions=False) as world:
            world.step(n, **given)
            found.append(world.state.robots["arm"].q)
    np.testing.assert_allclose(found[0], found[1], rtol=0.0, atol=1e-12)


@pytest.mark.parametrize("law", ["armature", "friction"])
def test_worlds_refuse_motors_of_bullet_for_joint_dynamics_that_they_cannot_have(law: str) -> None:
    model = load("ur5")
    joints = tuple(replace(joint, dynamics=JointDynamics(**{law: 0.1})) for joint in model.joints)
    robot = SceneRobot("arm", replace(model, joints=joints))
    command = BulletMotorCommand("VELOCITY_CONTROL", velocities=[0.1] * 6)
    with World(Scene(robots=(robot,)), "pybullet") as world:
        with pytest.raises(UnsupportedFeatureError, match="inside the engine"):
            world.step(motors={"arm": command})
        assert world.time == 0.0
    with World(Scene(robots=(robot,)), "pybullet", **{f"joint_{law}": False}) as world:
        world.step(motors={"arm": command})
