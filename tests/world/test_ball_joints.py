"""Worlds with robots that have ball joints: equal on the engines that take them, refused by the others."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import dynx
from dynx.errors import UnsupportedFeatureError
from dynx.model import JointDynamics, Limits, Model
from dynx.model.limited_positions import limited_positions
from dynx.world import Encoder, Imu, PDMotor, Scene, SceneRobot, VelocityMotor, World, read_scene, write_scene
from tests.sim.test_ball_joints import arm, each_base

EPS = np.finfo(np.float64).eps


def scene_of(model: Model, speed: float = 1.0) -> Scene:
    rng = np.random.default_rng(1)
    robot = SceneRobot("arm", model, q=model.random(0), v=rng.uniform(-speed, speed, model.nv))
    return Scene("arm", robots=(robot,))


@each_base
@pytest.mark.parametrize(
    "dynamics", [JointDynamics(), JointDynamics(0.3, 0.0, 0.02), JointDynamics(0.3, 0.2, 0.02)], ids=str
)
def test_engines_take_the_same_steps(base: Any, dynamics: JointDynamics) -> None:
    """MuJoCo's Euler, dynx's own stepper and `simulate` are the same method."""
    pytest.importorskip("mujoco")
    model = arm(base, dynamics)
    scene = scene_of(model)
    states = {}
    for engine in ("dynx", "mujoco"):
        with World(scene, engine, dt=1e-3) as world:
            world.step(50)
            states[engine] = world.state.robots["arm"]
            assert not [note for note in world.notes if "no mass" in note]
    size = np.max(np.abs(states["dynx"].v))
    assert np.max(np.abs(model.difference(states["dynx"].q, states["mujoco"].q))) <= 1e-12
    assert np.max(np.abs(states["dynx"].v - states["mujoco"].v)) <= 1e-11 * size
    start = scene.robots[0]
    run = dynx.simulate(model, duration=0.05, dt=1e-3, plant="reference", q0=start.q, v0=start.v)
    assert np.max(np.abs(model.difference(run.q[-1], states["dynx"].q))) <= 1e-12


@pytest.mark.parametrize("engine", ["dynx", "mujoco"])
def test_limits_act(engine: str) -> None:
    pytest.importorskip("mujoco")
    model = arm(limits=Limits(upper=0.8))
    with World(scene_of(model, 4.0), engine, dt=1e-3) as world:
        largest = 0.0
        for _ in range(400):
            world.step()
            largest = max(largest, limited_positions(model, world.state.robots["arm"].q)[0])
        # MuJoCo's limit is a stiff spring.
        assert 0.75 < largest <= 0.8 + (1e-12 if engine == "dynx" else 0.02)
    with World(scene_of(model, 4.0), engine, dt=1e-3, joint_limits=False) as world:
        found = []
        for _ in range(40):
            world.step(10)
            found.append(limited_positions(model, world.state.robots["arm"].q)[0])
        # Without limits the shoulder turns further.
        assert max(found) > 0.85


@pytest.mark.parametrize("engine", ["dynx", "mujoco"])
def test_states_are_set_saved_and_restored(engine: str) -> None:
    pytest.importorskip("mujoco")
    model = arm("floating")
    scene = scene_of(model)
    with World(scene, engine, dt=1e-3) as world:
        q, v = model.random(5), np.linspace(-1.0, 1.0, model.nv)
        world.set_state(robots={"arm": (q, v)})
        found = world.state.robots["arm"]
        np.testing.assert_allclose(found.q, q, atol=8 * EPS)
        np.testing.assert_allclose(found.v, v, atol=16 * EPS)
        world.step(5)
        saved = world.save()
        world.step(20)
        wanted = world.state.robots["arm"]
        world.restore(saved)
        world.step(20)
        again = world.state.robots["arm"]
        np.testing.assert_array_equal(again.q, wanted.q)
        np.testing.assert_array_equal(again.v, wanted.v)


@pytest.mark.parametrize("engine", ["dynx", "mujoco"])
def test_torques_hold_the_robot(engine: str) -> None:
    """The torque of inverse dynamics at rest keeps every coordinate at rest."""
    pytest.importorskip("mujoco")
    model = arm()
    q = model.random(2)
    with dynx.backend("reference", model) as bodies:
        tau = bodies.gravity_torque(q)
    scene = Scene("arm", robots=(SceneRobot("arm", model, q=q),))
    with World(scene, engine, dt=1e-3) as world:
        world.step(20, torques={"arm": tau})
        assert np.max(np.abs(model.difference(q, world.state.robots["arm"].q))) <= 1e-10


@pytest.mark.parametrize("engine", ["dynx", "mujoco"])
def test_motors_act_on_other_joints(engine: str) -> None:
    """The law of a motor reads the position of its joint, which is not at the index of its velocity."""
    pytest.importorskip("mujoco")
    model = arm("floating", gravity=(0.0, 0.0, 0.0))
    scene = Scene("arm", robots=(SceneRobot("arm", model),), gravity=(0.0, 0.0, 0.0))
    motor = PDMotor(target=[0.4, -0.3], kp=50.0, kd=10.0, joints=["elbow", "tail"])
    with World(scene, engine, dt=1e-3) as world:
        world.step(3000, motors={"arm": motor})
        q = world.state.robots["arm"].q
        reached = [q[model.position_index(name)] for name in ("elbow", "tail")]
        np.testing.assert_allclose(reached, [0.4, -0.3], atol=1e-3)
        for everything in (VelocityMotor(0.0, 1.0), VelocityMotor(0.0, 1.0, joints=["wrist"])):
            with pytest.raises(UnsupportedFeatureError, match=r"'(shoulder|wrist)' of arm is a ball joint"):
                world.step(motors={"arm": everything})


@pytest.mark.parametrize("engine", ["dynx", "mujoco"])
def test_a_rod_on_a_ball_joint_falls_on_the_ground(engine: str, tmp_path: Path) -> None:
    pytest.importorskip("mujoco")
    path = tmp_path / "scene.xml"
    path.write_text(
        """<mujoco><worldbody><geom type="plane" size="0 0 1"/>
        <body name="rod" pos="0 0 0.3"><joint name="pivot" type="ball"/>
        <geom type="capsule" fromto="0 0 0.1 0.8 0 0.1" size="0.05" mass="1"/></body></worldbody></mujoco>"""
    )
    with World(read_scene(path), engine, dt=1e-3) as world:
        world.step(2000)
        (name,) = [robot.name for robot in world.scene.robots]
        assert world.contacts()
        assert np.max(np.abs(world.state.robots[name].v)) < 0.1
        # The lowest point of the rod is on the ground.
        model, state = world.scene.robots[0].model, world.state.robots[name]
        with dynx.backend("reference", model) as bodies:
            tip = bodies.forward_kinematics(state.q, "rod") @ [0.8, 0.0, 0.1, 1.0]
        assert tip[2] == pytest.approx(0.05, abs=2e-3)


def test_other_engines_refuse_by_name() -> None:
    for engine, module in (("pybullet", "pybullet"), ("drake", "pydrake")):
        pytest.importorskip(module)
        with pytest.raises(UnsupportedFeatureError, match=f"'shoulder' .* a world on '{engine}'"):
            World(scene_of(arm()), engine, dt=1e-3)


def test_sensors() -> None:
    model = arm()
    scene = scene_of(model)
    with pytest.raises(UnsupportedFeatureError, match="'shoulder', a ball joint of arm"):
        Scene("arm", robots=scene.robots, sensors=(Encoder("angle", "shoulder"),))
    sensors = Imu("imu", "hand"), Encoder("angle", "tail")
    with World(Scene("arm", robots=scene.robots, sensors=sensors), "dynx", dt=1e-3) as world:
        world.step(3)
        readings, state = world.read_sensors(), world.state.robots["arm"]
        with dynx.backend("reference", model) as bodies:
            omega = bodies.frame_velocity(state.q, state.v, "hand", reference="local")[3:]
        np.testing.assert_allclose(readings["imu"].values[3:6], omega, atol=1e-2)
        tail = state.q[model.position_index("tail")], state.v[model.coordinate_index("tail")]
        np.testing.assert_allclose(readings["angle"].values, tail, atol=1e-2)


def test_scenes_are_written_and_read(tmp_path: Path) -> None:
    model = arm("floating", JointDynamics(0.1, 0.2, 0.3), Limits(upper=2.0))
    scene = scene_of(model)
    for name in ("scene.json", "scene.toml"):
        write_scene(scene, tmp_path / name)
        again = read_scene(tmp_path / name)
        assert again.robots[0].model == model
        assert again.robots[0].q == scene.robots[0].q


def test_mjcf_of_a_scene_is_read(tmp_path: Path) -> None:
    mujoco = pytest.importorskip("mujoco")
    path = tmp_path / "scene.xml"
    path.write_text(
        """<mujoco><worldbody>
        <body name="upper"><joint name="shoulder" type="ball" damping="0.1"/>
        <inertial mass="1" pos="0 0 -0.3" diaginertia="0.1 0.1 0.02"/>
        <body name="lower" pos="0 0 -0.5"><joint name="elbow" axis="0 1 0"/>
        <inertial mass="1" pos="0 0 -0.2" diaginertia="0.05 0.05 0.01"/></body></body>
        </worldbody><keyframe><key name="home" qpos="0.5 0.5 0.5 0.5 0.3" qvel="1 2 3 4"/></keyframe>
        </mujoco>"""
    )
    scene = read_scene(path, keyframe="home")
    robot = scene.robots[0]
    assert robot.q == pytest.approx((0.5, 0.5, 0.5, 0.5, 0.3))
    assert robot.v == (1.0, 2.0, 3.0, 4.0)
    engine = mujoco.MjModel.from_xml_path(str(path))
    data = mujoco.MjData(engine)
    mujoco.mj_resetDataKeyframe(engine, data, 0)
    engine.opt.timestep = 1e-3
    mujoco.mj_step(engine, data, 30)
    with World(scene, "dynx", dt=1e-3) as world:
        world.step(30)
        q = world.state.robots[robot.name].q
    wanted = np.array([*np.roll(data.qpos[:4], -1), data.qpos[4]])
    assert np.max(np.abs(robot.model.difference(q, wanted))) <= 1e-11


def test_an_exported_world_moves_alike() -> None:
    mujoco = pytest.importorskip("mujoco")
    model = arm("floating", JointDynamics(0.1, 0.0, 0.01), Limits(upper=2.0))
    with World(scene_of(model), "mujoco", dt=1e-3) as world:
        engine = mujoco.MjModel.from_xml_string(world.to_mjcf())
        data = mujoco.MjData(engine)
        mujoco.mj_resetDataKeyframe(engine, data, 0)
        mujoco.mj_step(engine, data, 20)
        world.step(20)
        shoulder = model.position_index("shoulder")
        q = world.state.robots["arm"].q
        np.testing.assert_allclose(q[shoulder : shoulder + 4], np.roll(data.qpos[7:11], -1), atol=1e-9)


def test_contacts_and_limits_together_are_refused_by_name(tmp_path: Path) -> None:
    """The impulses of dynx's own engine have no largest angle."""
    path = tmp_path / "scene.xml"
    path.write_text(
        """<mujoco><worldbody><geom type="plane" size="0 0 1"/>
        <body name="rod" pos="0 0 0.3"><joint name="pivot" type="ball" range="0 1"/>
        <geom type="capsule" fromto="0 0 0.1 0.8 0 0.1" size="0.05" mass="1"/></body></worldbody></mujoco>"""
    )
    scene = read_scene(path)
    with pytest.raises(UnsupportedFeatureError, match="ball joint 'pivot'"):
        World(scene, "dynx", dt=1e-3)
    with World(scene, "dynx", dt=1e-3, joint_limits=False) as world:
        world.step(2)
