"""Motion without contact: closed forms, and the motion of `dynx.simulate`."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose

import dynx
from dynx import Pose
from dynx.control.open_loop import OpenLoop
from dynx.errors import UnknownNameError
from dynx.model import configuration
from dynx.model.elements import IDENTITY
from dynx.model.geometry import Box, Collision
from dynx.model.tree import Base
from dynx.world import ExternalForce, Scene, SceneBody, SceneRobot, World, box, read_scene
from tests.world.engines import WORLDS

pytestmark = pytest.mark.parametrize("engine", WORLDS)

G = 9.81
DT = 1e-3


def falling(twist: tuple[float, ...], pose: Pose = IDENTITY) -> Scene:
    return Scene("falling", bodies=(box("brick", (0.3, 0.2, 0.1), mass=2.0, twist=twist, pose=pose),))


def test_a_projectile_moves_on_its_parabola(engine: str) -> None:
    start = (3.0, -2.0, 4.0, 0.0, 0.0, 0.0)
    with World(falling(twist=start), engine, DT) as world:
        world.step(500)
        T, twist = world.state.bodies["brick"]
    # Semi-implicit Euler: the sum of the speeds at the ends of the steps.
    t = 0.5
    drop = G * t * (t + DT) / 2
    assert_allclose(T[:3, 3], [3.0 * t, -2.0 * t, 4.0 * t - drop], atol=1e-9)
    assert_allclose(twist, [3.0, -2.0, 4.0 - G * t, 0, 0, 0], atol=1e-9)


def test_spin_about_a_principal_axis_is_constant(engine: str) -> None:
    with World(falling(twist=(0, 0, 0, 0, 0, 2.0)), engine, DT) as world:
        world.step(500)
        T, twist = world.state.bodies["brick"]
    assert_allclose(twist[3:], [0, 0, 2.0], atol=1e-9)
    assert_allclose(T[:2, 0], [np.cos(1.0), np.sin(1.0)], atol=1e-6)


def test_a_body_frame_away_from_the_centre_of_mass_falls_with_it(engine: str) -> None:
    body = SceneBody(
        "hammer",
        (Collision(Box((0.1, 0.1, 0.4))),),
        mass=2.0,
        center_of_mass=(0.1, 0.2, 0.3),
        twist=(0, 0, 0, 0, 0, 3.0),
    )
    scene = Scene("s", bodies=(body,), gravity=(0.0, 0.0, 0.0))
    with World(scene, engine, DT) as world:
        world.step(200)
        T, twist = world.state.bodies["hammer"]
    # Spin about z through the centre of mass is not about a principal axis of the offset frame: the centre
    # of mass keeps the velocity that the frame's twist gives it.
    center = np.array([0.1, 0.2, 0.3])
    velocity = np.cross([0, 0, 3.0], center)
    assert_allclose(T[:3, :3] @ center + T[:3, 3], center + 0.2 * velocity, atol=1e-8)
    assert_allclose(twist[:3] + np.cross(twist[3:], T[:3, :3] @ center), velocity, atol=1e-8)


def test_a_wrench_accelerates_a_body(engine: str) -> None:
    scene = Scene("s", bodies=(box("brick", (0.2, 0.2, 0.2), mass=2.0),), gravity=(0.0, 0.0, 0.0))
    with World(scene, engine, DT) as world:
        world.step(
            100,
            forces=[
                ExternalForce("brick", (2.0, 0, 0, 0, 0, 0)),
                ExternalForce("brick", (0, 4.0, 0, 0, 0, 0)),
            ],
        )
        assert_allclose(world.state.bodies["brick"].twist, [0.1, 0.2, 0, 0, 0, 0], atol=1e-9)
        world.step(100)
        assert_allclose(world.state.bodies["brick"].twist, [0.1, 0.2, 0, 0, 0, 0], atol=1e-9)


def test_a_force_at_a_point_turns_a_body(engine: str) -> None:
    scene = Scene("s", bodies=(box("brick", (0.2, 0.2, 0.2), mass=2.0),), gravity=(0.0, 0.0, 0.0))
    with World(scene, engine, DT) as world:
        world.step(
            forces=[ExternalForce("brick", (3.0, 0, 0, 0, 0, 0), reference="local", point=(0, 0.1, 0))]
        )
        inertia = 2.0 * (0.2**2 + 0.2**2) / 12
        expected = [3.0 / 2.0 * DT, 0, 0, 0, 0, -3.0 * 0.1 / inertia * DT]
        assert_allclose(world.state.bodies["brick"].twist, expected, atol=1e-10)


def test_a_force_at_the_centre_of_mass_turns_nothing(engine: str) -> None:
    center = (0.1, 0.05, -0.02)
    scene = Scene(
        "s", bodies=(box("brick", (0.4, 0.2, 0.2), mass=2.0, center_of_mass=center),), gravity=(0, 0, 0)
    )
    with World(scene, engine, DT) as world:
        world.step(forces=[ExternalForce("brick", (3.0, 1.0, -2.0, 0, 0, 0), point=center)])
        assert_allclose(world.state.bodies["brick"].twist, [1.5e-3, 0.5e-3, -1e-3, 0, 0, 0], atol=1e-12)


def test_the_state_that_is_set_is_the_one_that_is_read(engine: str) -> None:
    model = dynx.load("panda", base="floating")
    rng = np.random.default_rng(3)
    q, v = configuration.random(model, rng), rng.normal(size=model.nv)
    pose, twist = Pose((0.3, 0.2, 0.1), (0.4, -0.5, 0.6)).matrix, rng.normal(size=6)
    brick = box("brick", (0.3, 0.2, 0.1), mass=2.0, center_of_mass=(0.1, 0.0, 0.02))
    with World(Scene("s", robots=(SceneRobot("r", model),), bodies=(brick,)), engine, DT) as world:
        world.set_state(robots={"r": (q, v)}, bodies={"brick": (pose, twist)})
        robot, body = world.state.robots["r"], world.state.bodies["brick"]
    assert_allclose(robot.q, q, atol=1e-12)
    assert_allclose(robot.v, v, atol=1e-12)
    assert_allclose(body.T_world_body, pose, atol=1e-12)
    assert_allclose(body.twist, twist, atol=1e-12)


def test_no_velocity_is_at_rest(engine: str) -> None:
    model = dynx.load("six_axis_arm")
    moving = SceneRobot("r", model, v=(0.5,) * model.nv)
    with World(
        Scene("s", robots=(moving,), bodies=(box("brick", (0.1, 0.1, 0.1), mass=1.0),)), engine, DT
    ) as world:
        world.set_state(
            robots={"r": (model.neutral(), None)}, bodies={"brick": (Pose((0.0, 0.0, 2.0)), None)}
        )
        assert not world.state.robots["r"].v.any()
        assert not world.state.bodies["brick"].twist.any()


@pytest.mark.parametrize("base", ["fixed", "floating"])
@pytest.mark.parametrize("name", ["six_axis_arm", "panda"])
def test_a_wrench_on_a_link_acts_as_its_torque(engine: str, name: str, base: Base) -> None:
    model = dynx.load(name, base=base)
    q = configuration.random(model, 1)
    force, moment, point = np.array([3.0, -2.0, 5.0]), np.array([0.3, 0.1, -0.2]), np.array([0.1, 0, 0.05])
    backend = dynx.backend("reference", model)
    link = model.links[-1].name
    J = backend.jacobian(q, link, point=point)
    with World(Scene("s", robots=(SceneRobot("r", model, q=tuple(q)),)), engine, DT, **FREE) as world:
        world.step(forces=[ExternalForce(f"r/{link}", (*force, *moment), point=point)])
        pushed = world.state.robots["r"]
        world.reset()
        world.step(torques={"r": J.T @ np.concatenate([force, moment])})
        driven = world.state.robots["r"]
    assert_allclose(pushed.v, driven.v, atol=1e-9)


FREE = {"collisions": False, "joint_limits": False, "joint_damping": False}


@pytest.mark.parametrize("base", ["fixed", "floating"])
@pytest.mark.parametrize("name", ["ur5", "panda"])
def test_robots_step_as_simulate_does(engine: str, name: str, base: Base) -> None:
    if engine not in ("pybullet", "mujoco"):
        pytest.skip("the plant of this engine has another scheme")
    model = dynx.load(name, base=base)
    rng = np.random.default_rng(4)
    q, v, tau = configuration.random(model, rng), rng.normal(size=model.nv), rng.normal(size=model.nv)
    controller = OpenLoop(model, np.tile(tau, (50, 1)), control_dt=2 * DT)
    options: dict[str, Any] = {"plant": engine, "duration": 0.1, "dt": 2 * DT, "substeps": 2}
    rollout = dynx.simulate(model, controller, q0=q, v0=v, joint_limits=False, **options)
    scene = Scene("s", robots=(SceneRobot("r", model, q=tuple(q), v=tuple(v)),))
    with World(scene, engine, 2 * DT, substeps=2, collisions=False, joint_limits=False) as world:
        world.step(50, torques={"r": tau})
        state = world.state.robots["r"]
    assert_allclose(state.q, rollout.q[-1], atol=1e-10)
    assert_allclose(state.v, rollout.v[-1], atol=1e-9)


def test_substeps_divide_a_step(engine: str) -> None:
    scene = falling(pose=Pose((0, 0, 1.0)), twist=(1.0, 0, 0, 1.0, 2.0, 3.0))
    with World(scene, engine, DT) as fine, World(scene, engine, 4 * DT, substeps=4) as coarse:
        fine.step(8)
        coarse.step(2)
        assert fine.time == pytest.approx(coarse.time)
        for one, other in zip(fine.state.bodies["brick"], coarse.state.bodies["brick"], strict=True):
            assert (one == other).all()


def test_a_name_without_a_state_is_answered_with_the_nearest(engine: str) -> None:
    with World(read_scene("stack"), engine) as world:
        state = world.state
        assert "box_9" not in state.bodies
        with pytest.raises(UnknownNameError, match=r"no state of 'bx_1'; did you mean 'box_1'"):
            state.bodies["bx_1"]
