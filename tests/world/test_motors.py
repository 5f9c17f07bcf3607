"""Motors: stiff gains, limits, a quadruped that stands, wheels that roll."""

from __future__ import annotations

import numpy as np
import pytest

import dynx
from dynx import Pose
from dynx.model import Inertial, Joint, Link, Model
from dynx.steppers.layout import RobotLayout
from dynx.world import (
    PDMotor,
    PositionMotor,
    Scene,
    SceneRobot,
    TorqueMotor,
    VelocityMotor,
    World,
    ground,
)
from dynx.world.commands import RobotLoads
from dynx.world.preparation import prepare
from tests.world.engines import FAST_WORLDS, WORLDS
from tests.world.standing import measure


def arm(engine: str) -> World:
    model = dynx.load("six_axis_arm")
    return World(Scene("s", robots=(SceneRobot("arm", model),)), engine, joint_damping=False)


@pytest.mark.parametrize("engine", WORLDS)
def test_a_stiff_position_motor_is_stable(engine: str) -> None:
    target = np.array([0.3, -0.5, 0.8, 0.2, 0.4, -0.3])
    with arm(engine) as world:
        world.run(1.0, motors={"arm": PositionMotor(target, kp=1e6, kd=1e5)})
        assert abs(world.state.robots["arm"].q - target).max() < 1e-3
        assert abs(world.state.robots["arm"].v).max() < 1e-2


@pytest.mark.parametrize("engine", WORLDS)
def test_motors_at_the_end_of_a_step_agree_with_those_at_its_beginning(engine: str) -> None:
    states = []
    for motor in (PDMotor, PositionMotor):
        with World(Scene("s", robots=(SceneRobot("arm", dynx.load("planar_2r")),)), engine) as world:
            world.run(0.5, motors={"arm": motor(0.2, kp=40.0, kd=4.0)})
            states.append(world.state.robots["arm"].q)
    assert abs(states[0] - states[1]).max() < 5e-3


@pytest.mark.parametrize("engine", WORLDS)
def test_a_motor_after_the_state_was_set_acts_as_in_a_new_world(engine: str) -> None:
    motors = {"arm": PositionMotor(0.3, kp=100.0, kd=10.0)}
    rates = []
    for moved in (False, True):
        with arm(engine) as world:
            if moved:
                world.step(20, motors=motors)
            world.set_state(robots={"arm": (np.full(6, 0.1), np.full(6, 0.5))})
            world.step(motors=motors)
            rates.append(world.state.robots["arm"].v)
    assert rates[1] == pytest.approx(rates[0], abs=1e-9)


@pytest.mark.parametrize("engine", WORLDS)
def test_a_motor_gives_at_most_its_force(engine: str) -> None:
    limits = np.array([1.0, 2.0, 3.0, 4.0, 5.0, 6.0])
    with arm(engine) as world:
        world.step(motors={"arm": PositionMotor(100.0, kp=1e6, kd=1.0, max_force=limits)})
        strained = world.state.robots["arm"].v
        world.reset()
        world.step(motors={"arm": TorqueMotor(limits)})
        assert world.state.robots["arm"].v == pytest.approx(strained, abs=1e-12)


@pytest.mark.parametrize("engine", FAST_WORLDS)
@pytest.mark.parametrize(
    ("name", "height"), [("solo12", 0.2309), ("a1", 0.2914), ("laikago", 0.3641), ("anymal_c", 0.5141)]
)
def test_a_quadruped_stands_on_its_feet(engine: str, name: str, height: float) -> None:
    """`height` is that of the base in PyBullet's world after 10 s."""
    found = measure(name, engine, 1.5, 20)
    assert found.forces.mean() == pytest.approx(1.0, abs=0.01)
    assert len(found.touching) == 4
    assert all("foot" in link.lower() for link in found.touching)
    assert found.speed < 0.1
    assert found.heights[-1] == pytest.approx(height, abs=2e-3)


@pytest.mark.parametrize("engine", FAST_WORLDS)
def test_r2d2_drives_on_its_wheels(engine: str) -> None:
    data = pytest.importorskip("pybullet_data")
    model = dynx.load(f"{data.getDataPath()}/r2d2.urdf", base="floating")
    wheels = [name for name in model.joint_names if "wheel" in name]
    others = [name for name in model.joint_names if "wheel" not in name]
    q = np.zeros(model.nq)
    q[6] = 1.0
    with World(Scene("s", robots=(SceneRobot("r2d2", model, q=tuple(q)),)), engine) as world:
        q[2] = -world.aabb("r2d2")[0][2]
    scene = Scene("s", robots=(SceneRobot("r2d2", model, q=tuple(q)),), bodies=(ground(),))
    motors = {"r2d2": [VelocityMotor(5.0, 20.0, joints=wheels), PositionMotor(0.0, 1e3, 1e2, joints=others)]}
    with World(scene, engine, 2e-3) as world:
        world.run(3.0, motors=motors)
        before = world.state.robots["r2d2"].q
        world.run(1.0, motors=motors)
        after = world.state.robots["r2d2"].q
    assert np.linalg.norm(after[:2] - before[:2]) == pytest.approx(5.0 * 0.035, rel=0.01)


def test_a_motor_at_the_end_of_a_step_acts_where_another_joint_moves_no_mass() -> None:
    links = (Link("base"), Link("arm", Inertial(1.0, ixx=0.1, iyy=0.1, izz=0.1)), Link("tip"))
    joints = (
        Joint("shoulder", "revolute", "base", "arm", axis=(0.0, 0.0, 1.0)),
        Joint("wrist", "revolute", "arm", "tip", axis=(0.0, 0.0, 1.0)),
    )
    model = Model("m", links, joints)
    robot = prepare_robot(model)
    loads = RobotLoads(robot, robot, 1e-3, reached=False)
    motors = [PositionMotor(0.5, 100.0, 1.0, joints=["shoulder"])]
    loads.set_motors(motors, loads.changed_law(motors))
    tau = loads.torque(np.zeros(2), np.zeros(2), None, ())
    # kp (q* - q - h v) - kd v at the end of the step, where v = h tau / I.
    assert tau == pytest.approx([50.0 / (1.0 + 1e-3 * (1.0 + 1e-3 * 100.0) / 0.1), 0.0])


def prepare_robot(model: Model) -> RobotLayout:
    off = ("collisions", "joint_limits", "joint_damping", "joint_friction", "joint_armature", "joint_springs")
    return prepare(Scene(robots=(SceneRobot("r", model),)), **dict.fromkeys(off, False)).robots[0]


@pytest.mark.parametrize("engine", WORLDS)
def test_motors_read_the_joints_of_the_state(engine: str) -> None:
    """Mimic joints and a floating base included, and after steps."""
    robots = (
        SceneRobot("arm", dynx.load("panda"), q=tuple(dynx.load("panda").clip(np.zeros(8)))),
        SceneRobot("dog", dynx.load("solo12", base="floating")).at(Pose((3.0, 0.0, 1.0))),
        SceneRobot("hand", dynx.load("panda", base="floating")).at(Pose((-3.0, 0.0, 1.0))),
    )
    with World(Scene("s", robots=robots), engine) as world:
        world.step(5, motors={robot.name: PDMotor(0.1, 1.0, 0.1) for robot in robots})
        for k, robot in enumerate(robots):
            state = world.state.robots[robot.name]
            base = robot.model.floating
            joints = world._motion.engine.joint_state(k)
            np.testing.assert_allclose(joints.q, state.q[7 * base :], rtol=0.0, atol=1e-15)
            np.testing.assert_allclose(joints.v, state.v[6 * base :], rtol=0.0, atol=1e-15)
            assert np.abs(joints.v).max() > 0.0
