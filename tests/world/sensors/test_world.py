"""Sensors of worlds, on each engine: against the state, the contacts and the wrenches of the steps."""

from __future__ import annotations

import math
import pickle
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import dynx
from dynx import Pose, control
from dynx.backends import backend
from dynx.errors import ArgumentError, UnknownNameError, UnsupportedFeatureError
from dynx.sim.plants.scene_plant import ScenePlant
from dynx.spatial.scalar import Floats
from dynx.world import (
    ContactSensor,
    Encoder,
    ForceTorqueSensor,
    Imu,
    JointTorqueSensor,
    PositionMotor,
    RaySensor,
    Scene,
    SceneRobot,
    SensorErrors,
    World,
    box,
    ground,
    sphere,
)
from dynx.world.scene.documents import scene_document, scene_from_document
from tests.world.engines import WORLDS
from tests.world.standing import quadruped

Q0 = (0.0, -1.2, 1.5, -0.3, 0.2, 0.0)
POSE = Pose((0.02, -0.05, 0.1), (0.3, -0.4, 0.5))
NOISY = SensorErrors(noise=0.1, random_walk=0.5, bias=0.2, cross_axis=0.01, resolution=0.01)

SENSORS = (
    Imu("imu", "dog/trunk", pose=POSE),
    Imu("tool", "arm/tool0", pose=POSE, rate=250.0, delay=0.003, accelerometer=NOISY),
    ForceTorqueSensor("flange", "arm/wrist_3_joint", pose=POSE),
    ForceTorqueSensor("mount", "arm/base_link"),
    JointTorqueSensor("knee", "dog/FR_calf_joint"),
    Encoder("elbow", "arm/elbow_joint", position=SensorErrors(resolution=1e-3), rate=125.0),
    ContactSensor("foot", "dog/FR_foot"),
    ContactSensor("floor", "ground"),
    RaySensor("range", "dog/trunk", pose=Pose((0.0, 0.0, -0.1), (math.pi, 0.0, 0.0))),
)


def field() -> tuple[Scene, Floats]:
    """Return a dog on the ground and an arm beside it with sensors, and where the legs of the dog stand."""
    dog, q = quadruped("a1")
    arm = dynx.load("ur5").with_base_pose(Pose((3.0, 0.0, 0.5), (0.1, 0.2, 0.3)))
    robots = (SceneRobot("dog", dog, q=tuple(q)), SceneRobot("arm", arm, q=Q0))
    return Scene("field", robots=robots, bodies=(ground(),), sensors=SENSORS), q


@pytest.mark.parametrize("engine", WORLDS)
def test_readings_are_of_the_beginning_of_the_last_step(engine: str) -> None:
    scene, q = field()
    motors = {"dog": PositionMotor(q[7:], 100.0, 2.0), "arm": PositionMotor(np.full(6, 0.1), 200.0, 5.0)}
    dog, arm = (robot.model for robot in scene.robots)
    force = dynx.ExternalForce("arm/tool0", [5.0, 3.0, 2.0, 0.1, 0.2, 0.3])
    with World(scene, engine) as world, backend("pinocchio", dog.with_frame("imu", "trunk", POSE)) as bodies:
        assert world.read_sensors() == {}
        world.step(20, motors=motors, forces=[force])
        for _ in range(5):
            before, t = world.state, world.time
            world.step(motors=motors, forces=[force])
            after, found = world.state, world.read_sensors()
            assert {found[name].t for name in ("imu", "flange", "knee", "foot", "range")} == {t}
            # The gyroscope, the encoder and the joints.
            state = before.robots["dog"]
            gyro = bodies.frame_velocity(*state, "imu", reference="local")[3:]
            np.testing.assert_allclose(found["imu"]["angular_velocity"], gyro, rtol=0, atol=1e-12)
            names = [joint.name for joint in arm.joints]
            flange = world.joint_wrenches("arm")[names.index("wrist_3_joint")]
            R, p = POSE.matrix[:3, :3], np.array(POSE.xyz)
            moment = flange[3:] - np.cross(p, flange[:3])
            exact = np.concatenate([R.T @ flange[:3], R.T @ moment])
            np.testing.assert_allclose(found["flange"].values, exact, rtol=0, atol=1e-9)
            np.testing.assert_allclose(found["mount"].values, world.base_wrench("arm"), rtol=0, atol=1e-9)
            k = [joint.name for joint in dog.joints].index("FR_calf_joint")
            axis = np.array(dog.joints[k].axis)
            knee = world.joint_wrenches("dog")[k, 3:] @ axis
            assert abs(found["knee"]["torque"] - knee) < 1e-9
            # The accelerometer, by the velocities of its frame at both ends: to the order of the step.
            v = [bodies.frame_velocity(*each.robots["dog"], "imu")[:3] for each in (before, after)]
            T = bodies.forward_kinematics(state.q, "imu")
            felt = T[:3, :3].T @ ((v[1] - v[0]) / world.dt - np.array(dog.gravity))
            assert np.abs(found["imu"]["acceleration"] - felt).max() < 0.02 * (1.0 + np.abs(felt).max())
            # Contacts and the ray to the ground below the trunk.
            contacts = world.contacts("dog/FR_foot")
            total = sum((c.force if c.a == "dog/FR_foot" else -c.force for c in contacts), np.zeros(3))
            foot = bodies.forward_kinematics(state.q, "FR_foot")[:3, :3]
            np.testing.assert_allclose(foot @ found["foot"]["force"], total, rtol=0, atol=1e-9)
            assert found["floor"]["force"][2] < -0.5 * 9.81 * dog.total_mass
            trunk = bodies.forward_kinematics(state.q, "trunk")
            origin, down = trunk @ [0.0, 0.0, -0.1, 1.0], -trunk[:3, 2]
            assert abs(found["range"]["distance"] - -origin[2] / down[2]) < 1e-9


@pytest.mark.parametrize("engine", WORLDS)
def test_a_world_reads_what_its_record_reads(engine: str) -> None:
    """With noise, at their rates and with delays: a robot that falls, in a world and simulated."""
    dog, q = quadruped("a1")
    sensors = (
        Imu("imu", "dog/trunk", pose=POSE, rate=300.0, delay=0.0045, accelerometer=NOISY, seed=5),
        ForceTorqueSensor("thigh", "dog/FR_thigh_joint", weight=False, torque=NOISY),
        Encoder("knee", "dog/FR_calf_joint", rate=90.0, velocity=SensorErrors(noise_density=0.02)),
        ContactSensor("foot", "dog/FR_foot", force=SensorErrors(saturation=20.0)),
        RaySensor("range", "dog/trunk", pose=Pose(rpy=(math.pi, 0.0, 0.0)), length=0.31),
    )
    robot = SceneRobot("dog", dog, q=tuple(q))
    cube = box("cube", (0.1, 0.1, 0.1), mass=1.0, pose=Pose((0.0, 0.0, 1.0)))
    scene = Scene("fall", robots=(robot,), bodies=(ground(), cube), sensors=sensors)
    rollout = dynx.simulate(dog, None, duration=0.03, plant=ScenePlant(scene, "dog", engine))
    assert set(rollout.sensors) == {each.name for each in sensors}
    assert len(rollout.sensors["imu"]) == 9
    assert rollout.sensors["foot"]["force"].any()
    with World(scene, engine) as world:
        for k in range(1, 31):
            world.step()
            np.testing.assert_array_equal(world.state.robots["dog"].q, rollout.q[k])
            found = world.read_sensors()
            for name, readings in rollout.sensors.items():
                # A sample is known after its step.
                known = readings.t < rollout.t[k] - 1e-9
                ready = np.flatnonzero(known & (readings.available <= rollout.t[k] + 1e-9))
                assert (name in found) == bool(len(ready))
                if len(ready):
                    assert found[name].t == pytest.approx(readings.t[ready[-1]], abs=1e-12)
                    values = readings.values[ready[-1]]
                    np.testing.assert_allclose(found[name].values, values, rtol=1e-9, atol=1e-9)


def test_the_number_of_a_rollout_is_that_of_a_simulation() -> None:
    arm = dynx.load("ur5")
    encoder = Encoder("elbow", "arm/elbow_joint", position=replace(NOISY, cross_axis=0.0))
    scene = Scene("cell", robots=(SceneRobot("arm", arm, q=Q0),), sensors=(encoder,))
    plant = ScenePlant(scene, "arm", "mujoco")
    rollouts = [
        dynx.simulate(arm, None, duration=0.005, plant=plant, noise=dynx.Noise(rollout=k)) for k in (0, 7)
    ]
    with World(scene, "mujoco") as world:
        for number, rollout in zip((0, 7), rollouts, strict=True):
            world.reset()
            world.rollout = number
            world.step(5)
            found = world.read_sensors()["elbow"]
            np.testing.assert_allclose(found.values, rollout.sensors["elbow"].values[-1], rtol=0, atol=1e-12)
            # What was read keeps its number.
            world.rollout = 3
            assert world.read_sensors()["elbow"].values.tolist() == found.values.tolist()
        with pytest.raises(ArgumentError, match="rollout is '-1'; wanted a whole number"):
            world.rollout = -1
    values = [each.sensors["elbow"]["position"] for each in rollouts]
    assert (values[0] != values[1]).any()


def test_a_sensor_without_a_reading_is_named_with_the_reason() -> None:
    with World(field()[0], WORLDS[0]) as world:
        with pytest.raises(ArgumentError) as early:
            world.read_sensors()["imu"]
        assert str(early.value) == (
            "the imu sensor 'imu' has no reading at 0 s; a sample can be read after the step of the engine "
            "in which it is taken; get('imu') is None until then"
        )
        assert world.read_sensors().get("imu") is None
        world.step()
        readings = world.read_sensors()
        assert readings["imu"].t == 0.0
        with pytest.raises(
            ArgumentError, match=r"'tool' has no reading at 0.001 s; .* and its delay of 0.003 s"
        ):
            readings["tool"]
        with pytest.raises(UnknownNameError, match=r"the world has no sensor 'tol'; did you mean 'tool'"):
            readings["tol"]
        assert "tool" not in readings
        assert readings.get("tool") is None
        assert pickle.loads(pickle.dumps(readings)).keys() == readings.keys()
    bare = replace(field()[0], sensors=())
    with World(bare, WORLDS[0]) as world, pytest.raises(UnknownNameError, match="has no sensor 'imu'"):
        world.read_sensors()["imu"]


def test_a_state_that_is_set_has_no_readings_before_the_next_step() -> None:
    scene, _ = field()
    with World(scene, "mujoco") as world:
        world.step(10)
        assert "imu" in world.read_sensors()
        world.set_state(robots={"arm": (Q0, np.zeros(6))})
        assert world.read_sensors() == {}
        world.step()
        world.reset()
        assert world.read_sensors() == {}
    with World(replace(scene, sensors=()), "mujoco") as world:
        world.step()
        assert world.read_sensors() == {}


@pytest.mark.parametrize("engine", WORLDS)
@pytest.mark.parametrize("substeps", [1, 3])
def test_readings_do_not_depend_on_how_many_steps_a_call_takes(engine: str, substeps: int) -> None:
    scene, _ = field()
    found = []
    for n in (1, 5, 20):
        with World(scene, engine, substeps=substeps) as world:
            for _ in range(20 // n):
                world.step(n)
            found.append({k: (each.t, each.values.tobytes()) for k, each in world.read_sensors().items()})
    assert found[0] == found[1] == found[2]
    t, h = found[0]["imu"][0], 1e-3 / substeps
    assert t == 19 * 1e-3 + (substeps - 1) * h


@pytest.mark.long_cases
@pytest.mark.parametrize("engine", WORLDS)
def test_a_saved_world_continues_with_its_readings_bit_for_bit(engine: str, tmp_path: Path) -> None:
    """With a delay over several samples, rates that do not divide that of the steps, and walking biases."""
    scene, q = field()
    slow = (
        Imu("late", "dog/trunk", rate=300.0, delay=0.0214, gyroscope=NOISY),
        ForceTorqueSensor("wrist", "arm/wrist_3_joint", rate=40.0, force=NOISY),
        RaySensor("held", "dog/trunk", rate=35.0, pose=Pose(rpy=(math.pi, 0.0, 0.0))),
    )
    scene = replace(scene, sensors=(*scene.sensors, *slow))
    motors = {"dog": PositionMotor(q[7:], 100.0, 2.0)}

    def readings(world: World) -> list[tuple[str, float, bytes]]:
        return [(name, each.t, each.values.tobytes()) for name, each in world.read_sensors().items()]

    def later(world: World) -> list[list[tuple[str, float, bytes]]]:
        found = []
        for _ in range(30):
            world.step(motors=motors)
            found.append(readings(world))
        return found

    with World(scene, engine) as world:
        world.step(37, motors=motors)
        saved, now = pickle.loads(pickle.dumps(world.save())), readings(world)
        world.write(tmp_path / "mid.world")
        assert {name for name, *_ in now} == {each.name for each in scene.sensors}
        expected = later(world)
        world.restore(saved)
        assert readings(world) == now
        assert later(world) == expected
        # A sensor that the saved world did not have has no reading yet.
        moved = replace(scene, sensors=tuple(replace(each, seed=9) for each in scene.sensors))
        with World(moved, engine) as other:
            other.restore(saved)
            assert other.read_sensors() == {}
    with World.read(tmp_path / "mid.world") as world:
        assert readings(world) == now
        assert later(world) == expected
    # The number of the rollout, of which those that were taken before do not depend, is saved too.
    with World(scene, engine) as world:
        world.rollout = 5
        world.step(37, motors=motors)
        assert readings(world) != now
        saved = world.save()
        world.write(tmp_path / "fifth.world")
        fifth, expected = readings(world), later(world)
        world.rollout = 0
        world.restore(saved)
        assert (world.rollout, readings(world)) == (5, fifth)
        assert later(world) == expected
    with World.read(tmp_path / "fifth.world") as world:
        assert later(world) == expected
    wrong = replace(saved, samples={"imu": np.zeros((2, 5))})
    with World(scene, engine) as world, pytest.raises(ArgumentError, match=r"imu.* have shape \(2, 5\)"):
        world.restore(wrong)


@settings(max_examples=20)
@given(st.floats(0.2, 3.0), st.floats(-0.4, 0.4), st.floats(-0.4, 0.4))
def test_a_ray_hits_a_ball_where_geometry_says(height: float, x: float, y: float) -> None:
    """From a body, whose own shape is passed through, down on a ball of 0.6 m on the ground."""
    eye = sphere("eye", 0.05, pose=Pose((x, y, 1.2 + height)), mass=1.0)
    ball = sphere("ball", 0.6, pose=Pose((0.0, 0.0, 0.6)))
    down = Pose(rpy=(math.pi, 0.0, 0.0))
    sensor = RaySensor("ray", "eye", pose=down)
    scene = Scene("balls", bodies=(eye, ball, ground()), sensors=(sensor,), gravity=(0.0, 0.0, 0.0))
    with World(scene, "mujoco") as world:
        world.step()
        found = world.read_sensors()["ray"]["distance"]
    under = 0.6 + math.sqrt(max(0.36 - x * x - y * y, 0.0)) if x * x + y * y < 0.36 else 0.0
    assert abs(found - (1.2 + height - under)) < 1e-7 * (1.0 + 1.0 / (1e-6 + abs(0.36 - x * x - y * y)))


def test_scenes_with_sensors_are_documents() -> None:
    scene, _ = field()
    again = scene_from_document(scene_document(scene))
    assert again.sensors == scene.sensors
    assert again == scene
    matrix = SensorErrors(cross_axis=[[0.0, 0.1], [0.2, 0.0]], saturation=[1.0, 2.0])
    assert SensorErrors(cross_axis=np.array([[0.0, 0.1], [0.2, 0.0]]), saturation=[1.0, 2.0]) == matrix
    document = scene_document(scene)
    document["sensors"][0]["rat"] = 5.0
    with pytest.raises(ArgumentError, match=r"sensors\[0\].* no key 'rat'; did you mean 'rate'"):
        scene_from_document(document)
    document = scene_document(scene)
    document["sensors"][4]["gyroscope"] = {"noise": 1.0}
    with pytest.raises(ArgumentError, match="of kind 'joint_torque' has no gyroscope"):
        scene_from_document(document)


def test_a_scenario_keeps_its_sensors() -> None:
    arm = dynx.load("ur5")
    law = control.ComputedTorque(arm, kp=100, kd=20)
    sensors = [Imu("imu", "tool0", pose=POSE, gyroscope=NOISY), Encoder("elbow", "elbow_joint")]
    rollout = dynx.simulate(arm, law, np.array(Q0), duration=0.02, sensors=sensors)
    scenario = rollout.scenario
    assert scenario is not None
    again = dynx.Scenario.from_json(scenario.to_json())
    assert again == scenario
    assert again.sensors == tuple(sensors)
    assert list(rollout.sensors) == ["imu", "elbow"]
    np.testing.assert_array_equal(dynx.simulate(again).sensors["imu"].values, rollout.sensors["imu"].values)
    with pytest.raises(UnknownNameError, match="no sensor 'imo'; did you mean 'imu'"):
        _ = rollout.sensors["imo"]
    assert "imu" in rollout.sensors
    assert "imo" not in rollout.sensors
    assert rollout.sensors.get("imo") is None
    assert rollout.sensors.get("imu") is rollout.sensors["imu"]
    with pytest.raises(ArgumentError, match="sensors were given, and a batch records no accelerations"):
        dynx.simulate_batch(arm, law, np.array(Q0), duration=0.02, q0=np.array([Q0, Q0]), sensors=sensors)


def test_what_cannot_be_sensed_is_refused_before_the_first_step() -> None:
    scene, _ = field()
    arm = scene.robots[1].model
    with pytest.raises(UnknownNameError, match=r"'trunc'.*trunk"):
        replace(scene, sensors=(Imu("imu", "dog/trunc"),))
    for of_joints in (ForceTorqueSensor, JointTorqueSensor, Encoder):
        with pytest.raises(
            ArgumentError, match="on the body 'ground', which no joint carries; wanted a part"
        ):
            replace(scene, sensors=(of_joints("s", "ground"),))
    with pytest.raises(ArgumentError, match="sensors has 'imu'; wanted a sensor"):
        replace(scene, sensors=("imu",))  # type: ignore[arg-type]
    with pytest.raises(ArgumentError, match="wanted at most 1000 Hz"):
        World(replace(scene, sensors=(Encoder("e", "arm/elbow_joint", rate=1100.0),)), "mujoco")
    touch = replace(scene, sensors=(ContactSensor("touch", "arm/tool0"),))
    with pytest.raises(UnsupportedFeatureError, match="'touch' is on 'arm/tool0', which has no collision"):
        World(touch, "mujoco")
    for kind in (ContactSensor, RaySensor):
        blind = replace(scene, sensors=(kind("blind", "arm/wrist_3_link"),))
        World(blind, "mujoco").close()
        with pytest.raises(
            UnsupportedFeatureError, match=r"'blind' is on .* a world without collisions=False"
        ):
            World(blind, "mujoco", collisions=False)
    with pytest.raises(UnsupportedFeatureError, match="needs a scene"):
        dynx.simulate(arm, None, duration=0.01, sensors=RaySensor("ray", "tool0"))
    # Of the other robot of a scene neither velocity nor acceleration is recorded.
    rollout = dynx.simulate(arm, None, duration=0.01, plant=ScenePlant(scene, "arm", "mujoco"))
    assert set(rollout.sensors) == {"tool", "flange", "mount", "elbow", "foot", "floor", "range"}
    with pytest.raises(UnsupportedFeatureError, match="is on 'dog', whose acceleration is not recorded"):
        _ = rollout.sensors["imu"]


def test_a_rollout_in_a_scene_has_the_gravity_of_the_scene() -> None:
    """An arm at rest without gravity transmits nothing, whatever the gravity of its model."""
    arm = dynx.load("ur5")
    scene = Scene("space", robots=(SceneRobot("arm", arm, q=Q0),), gravity=(0.0, 0.0, 0.0))
    rollout = dynx.simulate(arm, None, duration=0.01, plant=ScenePlant(scene, "arm", "mujoco"))
    np.testing.assert_allclose(rollout.joint_wrenches(), 0.0, rtol=0, atol=1e-12)
    assert np.ptp(rollout.energy) < 1e-12


CENTER = (0.02, -0.01, 0.03)
SPIN = (1.0, -2.0, 3.0)
LEVER = (0.05, 0.1, -0.02)
ROTATION = (0.3, -0.4, 0.5)


def thrown() -> Scene:
    """Return a ball with equal moments of inertia that flies and spins, whose centre of mass is not in the
    middle, an IMU there and one elsewhere, and one on a shelf that is fixed."""
    ball = sphere("ball", 0.1, mass=0.4, center_of_mass=CENTER, pose=Pose((0.0, 0.0, 2.0), (0.1, 0.2, 0.3)))
    ball = replace(ball, twist=(1.0, 0.5, 2.0, *SPIN))
    shelf = box("shelf", (0.1, 0.1, 0.1), pose=Pose((3.0, 0.0, 1.0), (math.pi / 2, 0.0, 0.0)))
    sensors = (
        Imu("middle", "ball", pose=Pose(CENTER)),
        Imu("edge", "ball", pose=Pose(LEVER, ROTATION)),
        Imu("rest", "shelf"),
    )
    return Scene("thrown", bodies=(ball, shelf), sensors=sensors)


@pytest.mark.parametrize("engine", [*WORLDS, "dynx"])
def test_an_imu_on_a_body_in_flight_reads_its_spin_alone(engine: str) -> None:
    """In free fall the centre of mass has no proper acceleration; about it the body turns at a constant rate,
    so that another point has omega x (omega x r)."""
    with World(thrown(), engine, dt=1e-3, collisions=False) as world:
        before = world.state.bodies["ball"]
        for _ in range(3):
            world.step(20)
        found, state = world.read_sensors(), world.state.bodies["ball"]
        R = state.T_world_body[:3, :3]
        spin = Pose(rpy=ROTATION).matrix[:3, :3].T @ R.T @ state.twist[3:]
        arm = Pose(rpy=ROTATION).matrix[:3, :3].T @ (np.array(LEVER) - CENTER)
        np.testing.assert_allclose(np.linalg.norm(before.twist[3:]), np.linalg.norm(SPIN), rtol=1e-12)
        np.testing.assert_allclose(found["middle"]["acceleration"], 0.0, atol=1e-9)
        np.testing.assert_allclose(found["edge"]["angular_velocity"], spin, atol=1e-9)
        expected = np.cross(spin, np.cross(spin, arm))
        np.testing.assert_allclose(found["edge"]["acceleration"], expected, atol=1e-9)
        np.testing.assert_allclose(found["rest"]["acceleration"], [0.0, 9.81, 0.0], atol=1e-12)
        np.testing.assert_array_equal(found["rest"]["angular_velocity"], np.zeros(3))
        with World(thrown(), engine, dt=1e-3, collisions=False) as other:
            other.restore(world.save())
            np.testing.assert_array_equal(other.read_sensors()["edge"].values, found["edge"].values)


def test_mujoco_alone_reads_an_imu_on_a_body_as_the_world() -> None:
    """A body whose moments of inertia differ tumbles; MuJoCo's own sensors measure it."""
    tumbling = box("phone", (0.07, 0.15, 0.01), mass=0.2, pose=Pose((0.0, 0.0, 2.0)), center_of_mass=CENTER)
    phone = replace(tumbling, twist=(1.0, 0.5, 2.0, *SPIN))
    scene = Scene("phone", bodies=(phone,), sensors=(Imu("imu", "phone", pose=Pose(LEVER, ROTATION)),))
    mujoco = pytest.importorskip("mujoco")
    with World(scene, "mujoco", dt=1e-3) as world:
        alone = mujoco.MjModel.from_xml_string(world.to_mjcf())
        data = mujoco.MjData(alone)
        mujoco.mj_resetDataKeyframe(alone, data, 0)
        world.step(50)
        for _ in range(50):
            mujoco.mj_step(alone, data)
        np.testing.assert_allclose(world.read_sensors()["imu"].values, data.sensordata, atol=1e-9)


def test_the_record_of_a_simulation_has_no_acceleration_of_bodies() -> None:
    arm = dynx.load("ur5")
    scene = thrown()
    scene = replace(scene, robots=(SceneRobot("arm", arm, q=Q0),), sensors=scene.sensors[:1])
    rollout = dynx.simulate(arm, None, q0=np.array(Q0), duration=0.01, plant=ScenePlant(scene))
    with pytest.raises(UnsupportedFeatureError, match="is on 'ball', whose acceleration is not recorded"):
        _ = rollout.sensors["middle"]
