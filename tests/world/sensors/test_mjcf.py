"""Sensors of exported documents: raw MuJoCo reads what the world reads."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import dynx
from dynx import Pose
from dynx.spatial.scalar import Floats
from dynx.world import (
    ContactSensor,
    Encoder,
    ForceTorqueSensor,
    Imu,
    JointTorqueSensor,
    PointToPoint,
    RaySensor,
    Scene,
    SceneRobot,
    SensorReading,
    World,
    box,
    ground,
    sphere,
)
from tests.world.standing import quadruped

mujoco = pytest.importorskip("mujoco")

POSE = Pose((0.02, -0.05, 0.1), (0.3, -0.4, 0.5))
UP, BESIDE = Pose((0.0, 0.0, 0.05)), Pose((0.0, -0.04, 0.0), (0.7 * math.pi, 0.0, 0.0))


def field() -> Scene:
    """Return a floating and a fixed robot, a slide, and a box with its centre of mass beside its origin."""
    dog, q = quadruped("a1")
    dog = dog.with_frame("camera", "trunk", POSE)
    arm = dynx.load("ur5").with_base_pose(Pose((3.0, 0.0, 0.5), (0.1, 0.2, 0.3)))
    cart = dynx.load("cart_pole").with_base_pose(Pose((0.0, 5.0, 1.0)))
    crate = box(
        "crate", (0.4, 0.4, 0.4), mass=2.0, pose=Pose((-2.0, 0.0, 0.199)), center_of_mass=(0.05, 0.0, 0.0)
    )
    ball = sphere("ball", 0.1, mass=1.0, pose=Pose((-2.0, 0.0, 0.498)))
    robots = (SceneRobot("dog", dog, q=tuple(q)), SceneRobot("arm", arm), SceneRobot("cart", cart))
    pole = next(joint for joint in cart.joints if joint.type != "prismatic" and joint.moves)
    rail = next(joint for joint in cart.joints if joint.type == "prismatic")
    sensors = (
        Imu("imu", "dog/camera", pose=POSE),
        Imu("foot imu", "dog/FR_foot", pose=POSE),
        Imu("tool", "arm/tool0", pose=POSE),
        ForceTorqueSensor("thigh", "dog/FR_thigh_joint", pose=POSE),
        ForceTorqueSensor("wrist", "arm/wrist_3_link", pose=POSE),
        ForceTorqueSensor("flange", "arm/tool0"),
        JointTorqueSensor("knee", "dog/FR_calf_joint"),
        JointTorqueSensor("pole", f"cart/{pole.name}"),
        JointTorqueSensor("rail", f"cart/{rail.name}"),
        Encoder("elbow", "arm/elbow_joint"),
        ContactSensor("foot", "dog/FR_foot"),
        ContactSensor("floor", "ground"),
        ContactSensor("crate", "crate", pose=POSE),
        RaySensor("crate up", "crate", pose=UP),
        RaySensor("trunk", "dog/trunk", pose=Pose((0.0, 0.0, -0.1), (math.pi, 0.0, 0.0))),
        RaySensor("sole", "dog/FR_foot", pose=BESIDE),
        RaySensor("sky", "ball", length=50.0),
    )
    return Scene("field", robots=robots, bodies=(ground(), crate, ball), sensors=sensors)


def raw_values(data: Any, reading: SensorReading, world: World) -> Floats:
    """Return the values that raw MuJoCo has for a reading of dynx, with the differences that it states."""
    sensor = reading.sensor
    values = [data.sensor(f"{sensor.name}/{channel.name}").data for channel in sensor.channels]
    if sensor.kind == "joint_torque":
        return np.array([values[0][2]])
    if isinstance(sensor, ContactSensor):
        R = data.body(sensor.on).xmat.reshape(3, 3) @ sensor.pose.matrix[:3, :3]
        return np.asarray(R.T @ values[0])
    if isinstance(sensor, RaySensor) and values[0][0] == -1.0:
        return np.array([sensor.length])
    return np.concatenate(values)


def test_raw_mujoco_reads_what_the_world_reads() -> None:
    scene = field()
    rng = np.random.default_rng(0)
    with World(scene, "mujoco", joint_friction=False) as world:
        text = world.to_mjcf()
        model = mujoco.MjModel.from_xml_string(text)
        data = mujoco.MjData(model)
        mujoco.mj_resetDataKeyframe(model, data, model.key("start").id)
        seen = dict.fromkeys([each.name for each in scene.sensors], 0.0)
        for _ in range(40):
            torques = {robot.name: rng.normal(size=robot.model.nv) for robot in scene.robots}
            torques["dog"][:6] = 0.0
            for robot in scene.robots:
                for name in robot.model.joint_names:
                    tau = torques[robot.name][robot.model.coordinate_index(name)]
                    data.actuator(f"{robot.name}/{name}").ctrl[0] = tau
            world.step(torques=torques)
            mujoco.mj_step(model, data)
            found = world.read_sensors()
            assert set(found) == set(seen)
            for name, reading in found.items():
                if name == "flange":
                    continue
                raw = raw_values(data, reading, world)
                size = 1.0 + float(np.abs(raw).max())
                np.testing.assert_allclose(reading.values, raw, rtol=0, atol=1e-9 * size, err_msg=name)
                seen[name] = max(seen[name], float(np.abs(raw).max()))
        assert [name for name, most in seen.items() if not most and name != "flange"] == []
    assert "<!-- flange: MuJoCo measures no force at fixed joints" in text
    assert "flange/force" not in text


def test_the_document_names_robots_whose_accelerations_mujoco_reads_otherwise() -> None:
    """Damping that MuJoCo adds at the end of a step, and mimic joints that follow softly."""
    panda, arm = dynx.load("panda"), dynx.load("ur5")
    robots = (SceneRobot("hand", panda), SceneRobot("arm", arm))
    sensors = (Imu("imu", "arm/tool0"), Encoder("joint", "hand/panda_joint1"))
    scene = Scene("two", robots=robots, sensors=sensors)

    def named(scene: Scene, **options: bool) -> list[str]:
        with World(scene, "mujoco", **options) as world:
            text = world.to_mjcf()
        reads = "MuJoCo's sensors read"
        return [line.split(reads)[1].split()[1] for line in text.splitlines() if f"hand: {reads}" in line]

    assert named(scene) == ["mimic"]
    moved = replace(scene, sensors=(Imu("imu", "hand/panda_link7"),))
    assert named(moved) == ["acceleration", "mimic"]
    assert named(moved, joint_damping=False) == ["mimic"]
    assert named(replace(scene, sensors=sensors[:1])) == []


def test_a_sensor_may_be_called_like_an_anchor_of_a_constraint() -> None:
    arm = dynx.load("ur5")
    cup = box("cup", (0.1, 0.1, 0.1), mass=1.0, pose=Pose((2.0, 0.0, 1.0)))
    scene = Scene(
        "tied",
        robots=(SceneRobot("arm", arm),),
        bodies=(cup,),
        constraints=(PointToPoint("cup", "world", (0.0, 0.0, 0.0), (2.0, 0.0, 1.0)),),
        sensors=(Imu("constraint0/a", "arm/tool0"), Imu("constraint0/a/site", "arm/tool0")),
    )
    with World(scene, "mujoco") as world:
        world.step()
        assert set(world.read_sensors()) == {"constraint0/a", "constraint0/a/site"}


def test_the_document_of_a_scene_without_sensors_has_none() -> None:
    with World(replace(field(), sensors=()), "mujoco") as world:
        assert "<sensor" not in world.to_mjcf()
    unread = Scene("one", robots=(SceneRobot("arm", dynx.load("ur5")),))
    compensated = replace(unread, sensors=(ForceTorqueSensor("ft", "wrist_3_joint", weight=False),))
    with World(compensated, "mujoco") as world:
        assert "ft: the weight of what it carries is not subtracted." in world.to_mjcf()
