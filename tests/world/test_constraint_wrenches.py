"""Wrenches of constraints and torques of joint limits in the last step, on every engine."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose

import dynx
from dynx import ExternalForce, Pose
from dynx.backends import backend
from dynx.errors import ArgumentError, UnknownNameError
from dynx.model import Model
from dynx.spatial.scalar import Floats
from dynx.world import PDMotor, PointToPoint, PositionMotor, Scene, SceneRobot, Weld, World, box, ground
from dynx.world.scene.robots import LinkFrames
from tests.world.engines import WORLDS
from tests.world.standing import quadruped

pytestmark = pytest.mark.parametrize("engine", [*WORLDS, "dynx"])

RESIDUAL = {"mujoco": 1e-8, "drake": 1e-4, "pybullet": 1e-2, "dynx": 1e-8}
"""Residual of each engine's own equations of motion with contacts and constraints, in N and N m."""

Q0 = (0.3, -1.2, 1.5, -0.3, 0.2, 0.0)
G = 9.81


def arm_with_cup() -> tuple[Scene, Model]:
    """Return an arm with a cup of 2 kg welded to its tool, and a ball of 1 kg that swings on a point."""
    arm = dynx.load("ur5")
    held = Pose.from_matrix(LinkFrames(arm).pose(np.array(Q0), "tool0"))
    bodies = (
        box("cup", (0.1, 0.1, 0.1), mass=2.0, pose=held),
        box("ball", (0.1, 0.1, 0.1), mass=1.0, pose=Pose((3.0, 0.0, 1.0))),
    )
    ties = (
        Weld("arm/tool0", "cup"),
        PointToPoint("ball", "world", (0.3, 0.0, 0.0), (3.3, 0.0, 1.0)),
    )
    robots = (SceneRobot("arm", arm, q=Q0),)
    return Scene("cell", robots=robots, bodies=bodies, constraints=ties, ignored=(("arm", "cup"),)), arm


def engine_forces(world: World) -> list[Floats]:
    """Return the forces (3,) of the weld and of the point of `arm_with_cup` on its first end, as the engine
    reports them; empty for Drake, which does not."""
    inner = world._motion.engine
    if world.engine == "mujoco":
        forces = inner.data.efc_force  # type: ignore[attr-defined]
        return [forces[:3], forces[6:9]]
    if world.engine == "pybullet":
        client = inner.client  # type: ignore[attr-defined]
        states = [
            client.engine.getConstraintState(number, physicsClientId=client.number)
            for number in (
                client.engine.getConstraintUniqueId(k, physicsClientId=client.number) for k in range(2)
            )
        ]
        # Bullet's second end is the world, on which its force acts.
        return [np.array(states[0][:3]), -np.array(states[1][:3])]
    return []


def test_constraints_are_what_the_engine_reports_and_carry_the_weight(engine: str) -> None:
    scene, arm = arm_with_cup()
    with World(scene, engine, keep_last_step=True) as world:
        for n in (1, 40, 300):
            world.step(n, motors={"arm": PositionMotor(Q0, kp=2000.0, kd=200.0)})
            weld, point = world.constraint_wrenches(reference="local_world_aligned")
            for found, reported in zip((weld, point), engine_forces(world), strict=False):
                assert_allclose(found.on_a[:3], reported, rtol=1e-6, atol=1e-6)
        assert (weld.kind, weld.a, weld.b, weld.determined) == ("weld", "arm/tool0", "cup", True)
        assert_allclose(weld.on_b, -weld.on_a, rtol=0, atol=1e-12)
        # At rest but for what the motors let sway.
        assert_allclose(weld.on_a, [0.0, 0.0, -2.0 * G, 0.0, 0.0, 0.0], rtol=0, atol=0.5)
        assert not point.on_a[3:].any()
        # The ball swings on a circle of 0.3 m: the point carries its weight and turns its velocity.
        T, twist = world.state.bodies["ball"]
        lever = np.array([3.3, 0.0, 1.0]) - T[:3, 3]
        pull = 1.0 * (G * lever[2] + twist[:3] @ twist[:3]) / np.linalg.norm(lever)
        along = point.on_a[:3] @ lever / np.linalg.norm(lever)
        assert_allclose(along, pull, rtol=0.1)

        local = world.constraint_wrenches()[0]
        in_world = world.constraint_wrenches(reference="world")[0]
        R = world.state.bodies["cup"].T_world_body[:3, :3]
        assert_allclose(R @ local.on_b[:3], weld.on_b[:3], rtol=0, atol=0.05)
        assert_allclose(in_world.on_b, -in_world.on_a, rtol=0, atol=0.05)

        transmitted = world.joint_wrenches()
        axes = [(k, np.array(joint.axis)) for k, joint in enumerate(arm.joints) if joint.moves]
        along_axes = [transmitted[k, 3:] @ axis for k, axis in axes]
        assert_allclose(along_axes, world.torque(), rtol=0, atol=RESIDUAL[engine])
        foundation = world.base_wrench(reference="local_world_aligned")
        assert_allclose(foundation[2], (arm.total_mass + 2.0) * G, rtol=0.02)


def test_the_base_of_a_walking_robot_floats_with_what_is_tied_to_it(engine: str) -> None:
    """Base wrench + contacts + constraints + weight = rate of momentum, in a moving robot with pushes."""
    dog, q = quadruped("a1")
    frames = LinkFrames(dog)
    trunk = frames.pose(q, "trunk")
    above = trunk @ Pose((0.0, 0.0, 0.2)).matrix
    bodies = (
        ground(),
        box("load", (0.1, 0.1, 0.1), mass=1.0, pose=Pose.from_matrix(above)),
        box("bell", (0.05, 0.05, 0.05), mass=0.5, pose=Pose((0.6, 0.0, q[2]))),
    )
    ties = (Weld("dog/trunk", "load"), PointToPoint("dog/trunk", "bell", (0.4, 0.0, 0.0), (-0.2, 0.0, 0.0)))
    ignored = (("dog", "load"), ("dog", "bell"))
    robots = (SceneRobot("dog", dog, q=tuple(q)),)
    scene = Scene("yard", robots=robots, bodies=bodies, constraints=ties, ignored=ignored)
    push = ExternalForce("dog/trunk", (5.0, 3.0, 2.0, 0.1, 0.2, 0.3))
    # A joint between free bodies that Drake and Bullet solve iteratively.
    bar = max(RESIDUAL[engine], 1e-4)
    with World(scene, engine, keep_last_step=True) as world:
        for _ in range(3):
            world.step(15, motors={"dog": PDMotor(q[7:], 100.0, 2.0)}, forces=[push])
            assert all(each.determined for each in world.constraint_wrenches())
            assert_allclose(world.base_wrench("dog"), np.zeros(6), rtol=0, atol=bar)
            transmitted = world.joint_wrenches("dog")
            axes = [(k, np.array(joint.axis)) for k, joint in enumerate(dog.joints) if joint.moves]
            found = [transmitted[k, 3:] @ axis for k, axis in axes]
            assert_allclose(found, world.torque("dog")[6:], rtol=0, atol=bar)
        assert np.abs(world.constraint_wrenches()[0].on_a).max() > 5.0


LEG = """<robot name="leg"><link name="base"/>
{links}
<joint name="hip" type="revolute"><parent link="base"/><child link="thigh"/><axis xyz="0 1 0"/>
<dynamics damping="0.3"/><limit lower="-0.2" upper="0.4" effort="99" velocity="99"/></joint>
<joint name="knee" type="revolute"><parent link="thigh"/><child link="shank"/><axis xyz="0 1 0"/>
<origin xyz="0 0 -0.5"/>{knee}<limit lower="-2" upper="2" effort="99" velocity="99"/></joint></robot>"""
LINK = """<link name="{name}"><inertial><origin xyz="0 0 -0.25"/><mass value="1.5"/>
<inertia ixx="0.03" iyy="0.03" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link>"""


def leg(knee: str = "") -> Model:
    """Return a leg of two links of 1.5 kg with damping, a limit at the hip, and this element of its knee."""
    links = "".join(LINK.format(name=name) for name in ("thigh", "shank"))
    return dynx.load(LEG.format(links=links, knee=knee))


@pytest.mark.parametrize(
    "knee", ['<dynamics damping="0.2" friction="0.05"/>', '<mimic joint="hip" multiplier="-1.5"/>']
)
def test_a_limit_holds_what_falls_on_it(engine: str, knee: str) -> None:
    """A leg that is driven against the limit of its hip."""
    model = leg(knee)
    scene = Scene("leg", robots=(SceneRobot("leg", model, q=(0.39,) + (0.1,) * (model.nv - 1)),))
    tau = np.array([30.0, 0.0])[: model.nv]
    with World(scene, engine, keep_last_step=True) as world:
        world.step(3, torques={"leg": -tau})
        assert_allclose(world.limit_torque(), 0.0, rtol=0, atol=1e-9)
        world.step(3000, torques={"leg": tau})
        limits = []
        # In Bullet a mimic joint rebounds from its limit by some 0.01 mrad in every few steps.
        for _ in range(120):
            world.step(torques={"leg": tau})
            limits.append(world.limit_torque())
        limit, transmitted = limits[-1], world.joint_wrenches()
        q = world.state.robots["leg"].q
        with backend("reference", model) as reference:
            gravity = reference.gravity_torque(q)
        # The hip rests on its limit; the knee hangs free, or follows the hip.
        assert_allclose(np.mean(limits, axis=0)[0], gravity[0] - 30.0, rtol=0.05)
        assert gravity[0] - 30.0 < -20.0
        assert not limit[1:].any()
        along = transmitted[:, 4]
        if model.nv == 2:
            assert_allclose(along, world.torque() + limit, rtol=0, atol=0.05)
        else:
            # The follower hangs on the gear alone, whose other side presses on the driver.
            assert_allclose(along[0] - 1.5 * along[1], 30.0 + limit[0], rtol=0, atol=0.05)
            assert abs(along[1]) > 0.1
        world.reset()
        world.step(10)
        assert_allclose(world.limit_torque("leg"), 0.0, rtol=0, atol=1e-9)


def test_a_loop_closed_by_a_point_and_one_closed_twice(engine: str) -> None:
    """A leg whose foot is tied to the world carries a part of its weight there, in closed form."""
    model = leg('<dynamics damping="0.2"/>')
    q = (0.2, -0.5)
    foot = (LinkFrames(model).pose(np.array(q), "shank") @ np.array([0.0, 0.0, -0.5, 1.0]))[:3]
    tie = PointToPoint("leg/shank", "world", (0.0, 0.0, -0.5), tuple(foot))
    robots = (SceneRobot("leg", model, q=q),)
    with World(Scene("leg", robots=robots, constraints=(tie,)), engine, keep_last_step=True) as world:
        world.step(1500)
        (found,) = world.constraint_wrenches(reference="local_world_aligned")
        with backend("reference", model) as reference:
            q_now = world.state.robots["leg"].q
            J = reference.jacobian(q_now, "shank", point=(0.0, 0.0, -0.5))[:3]
            wanted = np.linalg.lstsq(J.T, reference.gravity_torque(q_now), rcond=None)[0]
        # Two joints show no force along their axes.
        assert not found.determined
        assert_allclose(found.on_a[:3], wanted, rtol=0, atol=0.02 * np.abs(wanted).max())
    body = (box("plate", (0.2, 0.2, 0.02), mass=1.0, pose=Pose((0.0, 0.0, 1.0))),)
    both = (Weld("world", "plate"), Weld("plate", "world"))
    with World(Scene("plate", bodies=body, constraints=both), engine, keep_last_step=True) as world:
        world.step(200)
        shared = world.constraint_wrenches(reference="local_world_aligned")
        assert [each.determined for each in shared] == [False, False]
        assert_allclose(shared[0].on_b[2] + shared[1].on_a[2], G, rtol=1e-3)


def test_what_a_world_cannot_say(engine: str) -> None:
    scene, _ = arm_with_cup()
    with World(scene, engine) as world:
        world.step()
        for call in (world.constraint_wrenches, world.limit_torque):
            with pytest.raises(ArgumentError, match="keep_last_step=True"):
                call()
    with World(scene, engine, keep_last_step=True) as world:
        with pytest.raises(ArgumentError, match="no step"):
            world.constraint_wrenches()
        world.step()
        with pytest.raises(UnknownNameError, match="local"):
            world.constraint_wrenches(reference="loca")
        with pytest.raises(UnknownNameError, match="arm"):
            world.limit_torque("amr")
