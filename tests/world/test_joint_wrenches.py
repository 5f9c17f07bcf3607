"""Wrenches at joints, torques of motors and the balance of momentum in the last step of a world."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

import dynx
from dynx import ExternalForce, Pose
from dynx.backends import backend
from dynx.errors import ArgumentError, UnknownNameError
from dynx.model import Model
from dynx.spatial.scalar import Floats
from dynx.world import PDMotor, PositionMotor, Scene, SceneRobot, World, box, ground
from tests.world.engines import WORLDS
from tests.world.standing import quadruped

RESIDUAL = {"mujoco": 1e-9, "drake": 1e-4, "pybullet": 1e-3}
"""Residual of each engine's equations of motion with contacts, in N and N m, for robots of 12 kg: rounding in
MuJoCo; in Drake 1e-6 of the weight, its solver's relative tolerance; in Bullet what its iterations leave."""

Q0 = (0.0, -1.2, 1.5, -0.3, 0.2, 0.0)


def field() -> tuple[Scene, Model, Model, Floats]:
    """Return a quadruped on the ground and an arm on a tilted mount, and where the legs stand."""
    dog, q = quadruped("a1")
    arm = dynx.load("ur5").with_base_pose(Pose((3.0, 0.0, 0.5), (0.1, 0.2, 0.3)))
    robots = (SceneRobot("dog", dog, q=tuple(q)), SceneRobot("arm", arm, q=Q0))
    return Scene("field", robots=robots, bodies=(ground(),)), dog, arm, q


FORCES = [
    ExternalForce("arm/tool0", (5.0, 3.0, 2.0, 0.1, 0.2, 0.3), 0.0, 1.0, "local", (0.1, 0.0, 0.2)),
    ExternalForce("arm/wrist_1_link", (0.0, 3.0, 0.0, 1.0, 0.0, 0.0), reference="world"),
    ExternalForce("dog/trunk", (5.0, 3.0, 2.0, 0.1, 0.2, 0.3), 0.0205, 1.0),
]


def along_axes(model: Model, wrenches: Floats) -> Floats:
    """Return the moments about the axes of the joints that move, all of them revolute."""
    moving = [(k, np.array(joint.axis)) for k, joint in enumerate(model.joints) if joint.moves]
    return np.array([wrenches[k, 3:] @ axis for k, axis in moving])


@pytest.mark.parametrize("substeps", [1, 3])
@pytest.mark.parametrize("engine", WORLDS)
def test_joints_transmit_what_motors_give_and_the_base_floats(engine: str, substeps: int) -> None:
    """A step in which motors, contacts, and external forces in three references act."""
    scene, dog, arm, q = field()
    motors = {"dog": PDMotor(q[7:], 100.0, 2.0), "arm": PositionMotor(np.full(6, 0.1), kp=200.0, kd=5.0)}
    bar = RESIDUAL[engine]
    with World(scene, engine, substeps=substeps, keep_last_step=True) as world:
        for _ in range(4):
            world.step(10, motors=motors, forces=FORCES)
            np.testing.assert_allclose(world.base_wrench("dog"), np.zeros(6), rtol=0, atol=bar)
            legs = along_axes(dog, world.joint_wrenches("dog"))
            np.testing.assert_allclose(legs, world.torque("dog")[6:], rtol=0, atol=bar)
            np.testing.assert_allclose(
                along_axes(arm, world.joint_wrenches("arm")), world.torque("arm"), rtol=0, atol=bar
            )
        # The feet bear the dog: without contacts its base would have to.
        assert world.contacts("dog")
        lower = world.joint_wrenches("dog", reference="local_world_aligned")
        feet = [k for k, joint in enumerate(dog.joints) if joint.child.endswith("foot")]
        assert -lower[feet, 2].sum() > 0.5 * 9.81 * dog.total_mass


@pytest.mark.parametrize("engine", WORLDS)
def test_the_base_and_all_else_are_the_rate_of_momentum(engine: str) -> None:
    """By differences of the momentum, which no inverse dynamics computes. A box falls on the arm."""
    scene, _, arm, _ = field()
    with backend("reference", arm) as bodies:
        x, y, z = bodies.forward_kinematics(Q0, "forearm_link")[:3, 3].tolist()
    falling = box("brick", (0.2, 0.2, 0.2), mass=2.0, pose=Pose((x, y, z + 0.25)))
    scene = Scene("struck", robots=(scene.robots[1],), bodies=(ground(), falling))
    h, struck = 1e-4, 0
    with World(scene, engine, h, keep_last_step=True) as world, backend("reference", arm) as bodies:
        for _ in range(30):
            holding = bodies.gravity_torque(world.state.robots["arm"].q)
            world.step(100, {"arm": holding}, forces=FORCES[:1])
            before = world.state.robots["arm"]
            world.step(1, {"arm": holding}, forces=FORCES[:1])
            after = world.state.robots["arm"]
            momenta = [bodies.centroidal_momentum(*state)[:3] for state in (before, after)]
            T = bodies.forward_kinematics(before.q, "tool0")
            total = world.base_wrench(reference="world")[:3] + T[:3, :3] @ np.array([5.0, 3.0, 2.0])
            contacts = world.contacts("arm")
            for contact in contacts:
                total = total + (contact.force if contact.a.startswith("arm/") else -contact.force)
            total[2] -= 9.81 * arm.total_mass
            np.testing.assert_allclose(total, (momenta[1] - momenta[0]) / h, rtol=1e-2, atol=1e-2)
            struck += bool(contacts)
    assert struck


@pytest.mark.parametrize("engine", WORLDS)
def test_keeping_the_last_step_changes_no_motion(engine: str) -> None:
    scene, _, _, q = field()
    motors = {"dog": PDMotor(q[7:], 100.0, 2.0)}
    states = []
    for keep in (False, True):
        with World(scene, engine, keep_last_step=keep) as world:
            world.step(5, {"arm": np.full(6, 2.0)})
            world.step(20, motors=motors, forces=FORCES)
            states.append(world.state)
    assert states[0].robots == states[1].robots


def test_joint_dynamics_act_on_the_side_of_the_motor() -> None:
    """Armature and damping of the file take part of a torque; what arrives at the link is less."""
    robot = dynx.load(
        """<robot name="arm"><link name="base"/><link name="bar"><inertial><origin xyz="0.5 0 0"/>
        <mass value="2"/><inertia ixx="0" iyy="0" izz="0" ixy="0" ixz="0" iyz="0"/></inertial></link>
        <joint name="hinge" type="continuous"><parent link="base"/><child link="bar"/><axis xyz="0 0 1"/>
        <dynamics damping="0.4" armature="0.5"/></joint></robot>"""
    )
    with World(Scene("s", robots=(SceneRobot("arm", robot),)), "mujoco", keep_last_step=True) as world:
        world.step(50, {"arm": [3.0]})
        before = world.state.robots["arm"].v
        world.step(1, {"arm": [3.0]})
        after = world.state.robots["arm"].v
        a = (after - before) / 1e-3
        (wrench,) = world.joint_wrenches()
        np.testing.assert_allclose(wrench[5], 2.0 * 0.25 * a[0], rtol=1e-9)
        np.testing.assert_allclose(world.torque(), [3.0])
        np.testing.assert_allclose(3.0 - wrench[5], 0.5 * a[0] + 0.4 * after[0], rtol=1e-9)


def test_what_is_missing_is_named() -> None:
    scene, dog, _, q = field()
    with World(scene, "mujoco") as world:
        world.step()
        for ask in (world.joint_wrenches, world.base_wrench, world.torque):
            with pytest.raises(ArgumentError, match="keep_last_step=True"):
                ask("dog")
    with World(scene, "mujoco", keep_last_step=True) as world:
        with pytest.raises(ArgumentError, match="no step was taken"):
            world.joint_wrenches("dog")
        world.step()
        with pytest.raises(ArgumentError, match="known: dog, arm"):
            world.joint_wrenches()
        with pytest.raises(UnknownNameError, match="no robot 'dg'"):
            world.base_wrench("dg")
        with pytest.raises(UnknownNameError, match="no frame 'tool0'"):
            world.joint_wrenches("dog", frame="tool0")
        assert world.torque("dog").shape == (dog.nv,)
        saved = world.save()
        changes: list[Callable[[], None]] = [
            lambda: world.set_state(robots={"dog": (q, np.zeros(dog.nv))}),
            world.reset,
            lambda: world.restore(saved),
        ]
        for change in changes:
            world.step()
            assert world.base_wrench("dog").shape == (6,)
            change()
            with pytest.raises(ArgumentError, match="no step was taken"):
                world.base_wrench("dog")
