"""What sensors without errors read: closed forms, other backends, and the recorded motion on four engines."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import dynx
from dynx import Pose, control
from dynx.backends import backend
from dynx.errors import ArgumentError, UnknownNameError, UnsupportedFeatureError
from dynx.model import Model
from dynx.spatial.scalar import Floats
from dynx.testing.strategies import models, samples, vectors
from dynx.world import (
    ContactSensor,
    Encoder,
    ForceTorqueSensor,
    Imu,
    JointTorqueSensor,
    RaySensor,
    Sensor,
    SensorErrors,
)
from dynx.world.sensors.motion import RobotMotion, SensedMotion
from dynx.world.sensors.readings import Readings, read_sensor, sample_numbers

ENGINES = ("pybullet", "mujoco", "drake", "pinocchio")
"""Plants that move a robot by an engine's own steps, and by dynx's."""

TURNTABLE = """
<robot name="turntable">
  <link name="base"/>
  <joint name="yaw" type="revolute">
    <parent link="base"/><child link="arm"/><axis xyz="0 0 1"/>
    <limit lower="-9" upper="9" effort="9" velocity="9"/>
  </joint>
  <link name="arm">
    <inertial><mass value="2"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial>
  </link>
  <joint name="mount" type="fixed"><parent link="arm"/><child link="tool"/><origin xyz="0.4 0 0"/></joint>
  <link name="tool">
    <inertial><mass value="1.5"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial>
  </link>
</robot>
"""


def instant(model: Model, q: Floats, v: Floats, a: Floats, **wrenches: Floats) -> SensedMotion:
    """Return a motion of one instant."""
    forces = {frame: np.array([wrench]) for frame, wrench in wrenches.items()}
    robot = RobotMotion(model, q[None], v[None], a[None], forces)
    return SensedMotion(np.zeros(1), 1e-3, {"robot": robot}, "robot")


def reading(sensor: Sensor, motion: SensedMotion) -> Floats:
    """Return the values of the only sample."""
    found: Floats = read_sensor(sensor, motion).values[0]
    return found


numbers = st.floats(-5.0, 5.0)


@given(numbers, numbers, numbers, st.floats(-1.0, 1.0))
def test_an_imu_on_a_spinning_arm_feels_centripetal_tangential_and_upward_acceleration(
    angle: float, speed: float, alpha: float, lever: float
) -> None:
    """Specific force (-w^2 r, alpha r, g) and rate (0, 0, w) at the radius r, at any angle."""
    table = dynx.load(TURNTABLE)
    motion = instant(table, *(np.array([x]) for x in (angle, speed, alpha)))
    found = reading(Imu("imu", "tool", pose=Pose((lever, 0.0, 0.3))), motion)
    r = 0.4 + lever
    exact = [-(speed**2) * r, alpha * r, 9.81, 0.0, 0.0, speed]
    np.testing.assert_allclose(found, exact, rtol=1e-13, atol=1e-12)
    # Turned by 90 degrees about z, its x axis points along the tangent.
    turned = reading(Imu("imu", "tool", pose=Pose((lever, 0.0, 0.0), (0.0, 0.0, 0.5 * math.pi))), motion)
    np.testing.assert_allclose(turned[:3], [exact[1], -exact[0], 9.81], rtol=1e-13, atol=1e-12)


@given(numbers, numbers, numbers)
def test_a_force_torque_sensor_holds_the_tool_against_inertia_and_weight(
    angle: float, speed: float, alpha: float
) -> None:
    """At the fixed joint of a tool of 1.5 kg at the radius 0.4 m, and with the mount's weight left out."""
    table = dynx.load(TURNTABLE)
    motion = instant(table, *(np.array([x]) for x in (angle, speed, alpha)))
    inertial = 1.5 * np.array([-(speed**2) * 0.4, alpha * 0.4, 0.0])
    weight = np.array([0.0, 0.0, 1.5 * 9.81])
    twist = [0.0, 0.0, alpha]
    for on in ("mount", "tool"):
        found = reading(ForceTorqueSensor("ft", on), motion)
        np.testing.assert_allclose(found, [*(inertial + weight), *twist], rtol=1e-13, atol=1e-12)
    # Mounted 0.1 m behind the tool, with axes turned by 90 degrees about z, and compensated.
    sensor = ForceTorqueSensor(
        "ft", "mount", pose=Pose((-0.1, 0.0, 0.0), (0.0, 0.0, 0.5 * math.pi)), weight=False
    )
    moment = np.array(twist) + np.cross([0.1, 0.0, 0.0], inertial)
    exact = [inertial[1], -inertial[0], 0.0, moment[1], -moment[0], moment[2]]
    np.testing.assert_allclose(reading(sensor, motion), exact, rtol=1e-13, atol=1e-12)
    # The foundation bears both links.
    base = reading(ForceTorqueSensor("ft", "base"), motion)
    np.testing.assert_allclose(base[2], 3.5 * 9.81, rtol=1e-13)
    assert abs(base[5] - (1.0 + 1.0 + 1.5 * 0.16) * alpha) < 1e-12 * (1.0 + abs(alpha))


@settings(max_examples=12)
@given(st.data())
def test_sensors_agree_with_pinocchio_on_random_robots(data: st.DataObject) -> None:
    """On both bases, with mimic joints, at a random pose of a random link, under external wrenches."""
    model = data.draw(models(mimics=True))
    sample = data.draw(samples(model))
    offset = Pose(data.draw(vectors()), data.draw(vectors(3.0)))
    on = data.draw(st.sampled_from([link.name for link in model.links]))
    wrench = np.array([*data.draw(vectors(20.0)), *data.draw(vectors(5.0))])
    motion = instant(model, *sample, **{on: wrench})
    with_sensor = model.with_frame("sensor", on, offset)
    with backend("pinocchio", with_sensor) as engine:
        T = engine.forward_kinematics(sample.q, "sensor")
        v = engine.frame_velocity(sample.q, sample.v, "sensor", reference="local")
        a = engine.frame_acceleration(sample.q, sample.v, sample.a, "sensor", reference="local")
        imu = [*(a[:3] + np.cross(v[3:], v[:3]) - T[:3, :3].T @ model.gravity), *v[3:]]
        size = 1.0 + float(np.abs(imu).max())
        found = reading(Imu("imu", on, pose=offset), motion)
        np.testing.assert_allclose(found, imu, rtol=0, atol=1e-10 * size)
        external: dict[str, Any] = {"external_forces": {on: wrench}, "force_reference": "world"}
        if model.joints:
            k = data.draw(st.integers(0, len(model.joints) - 1))
            joint = model.joints[k]
            with backend("pinocchio", model.with_frame("sensor", joint.child, offset)) as mounted:
                wrenches = mounted.joint_wrenches(*sample, frame="sensor", **external)[k]
            size = 1.0 + float(np.abs(wrenches).max())
            found = reading(ForceTorqueSensor("ft", joint.name, pose=offset), motion)
            np.testing.assert_allclose(found, wrenches, rtol=0, atol=1e-9 * size)
        tau = engine.inverse_dynamics(*sample, **external)
    driven = {joint.mimic.joint for joint in model.joints if joint.mimic is not None}
    for joint in model.coordinate_joints:
        if joint.name not in driven:
            (torque,) = reading(JointTorqueSensor("torque", joint.name), motion)
            exact = tau[model.coordinate_index(joint.name)]
            assert abs(torque - exact) <= 1e-9 * (1.0 + float(np.abs(tau).max()))


def test_an_encoder_of_a_mimic_joint_reads_its_own_angle() -> None:
    gripper = dynx.load(
        TURNTABLE.replace('type="fixed"', 'type="revolute"').replace(
            '<origin xyz="0.4 0 0"/>',
            '<axis xyz="0 0 1"/><limit lower="-9" upper="9" effort="9" velocity="9"/>'
            '<mimic joint="yaw" multiplier="-2" offset="0.3"/>',
        )
    )
    motion = instant(gripper, np.array([0.4]), np.array([1.5]), np.zeros(1))
    np.testing.assert_allclose(reading(Encoder("encoder", "mount"), motion), [-0.5, -3.0], rtol=1e-15)
    np.testing.assert_allclose(reading(Encoder("encoder", "yaw"), motion), [0.4, 1.5], rtol=1e-15)


@given(vectors(), vectors(), vectors(2.0))
def test_in_free_fall_an_imu_feels_rotation_alone(lever: Floats, axis: Floats, omega: Floats) -> None:
    """Zero at the centre of mass of a sphere, omega x (omega x r) beside it."""
    ball = dynx.load(
        '<robot name="ball"><link name="ball"><inertial><mass value="1"/><inertia ixx="1" ixy="0" ixz="0" '
        'iyy="1" iyz="0" izz="1"/></inertial></link></robot>',
        base="floating",
    )
    v = np.array([*axis, *omega])
    with backend("reference", ball) as engine:
        a = engine.forward_dynamics(ball.neutral(), v, np.zeros(6))
    found = reading(Imu("imu", "ball", pose=Pose(tuple(lever))), instant(ball, ball.neutral(), v, a))
    exact = np.cross(omega, np.cross(omega, lever))
    np.testing.assert_allclose(found, [*exact, *omega], rtol=0, atol=1e-12)


@pytest.fixture(scope="module")
def arm() -> Model:
    return dynx.load("ur5")


POSE = Pose((0.02, -0.05, 0.1), (0.3, -0.4, 0.5))
SENSORS = (
    Imu("imu", "tool0", pose=POSE),
    ForceTorqueSensor("flange", "wrist_3_joint", pose=POSE),
    ForceTorqueSensor("tool", "tool0", weight=False),
    JointTorqueSensor("torque", "elbow_joint"),
    Encoder("encoder", "elbow_joint"),
)


def swing(arm: Model, plant: str, **options: object) -> dynx.Rollout:
    q0 = np.array([0.0, -1.2, 1.5, -0.3, 0.2, 0.0])
    law = control.ComputedTorque(arm, kp=100, kd=20)
    return dynx.simulate(
        arm,
        law,
        q0 + 0.2,
        duration=0.1,
        q0=q0,
        plant=plant,
        payload=dynx.Payload("tool0", 1.0),
        pushes=dynx.ExternalForce("tool0", [5.0, -8.0, 3.0, 0.1, 0.2, 0.3]),
        **options,  # type: ignore[arg-type]
    )


@pytest.mark.parametrize("plant", ENGINES)
def test_readings_follow_from_the_recorded_motion_on_each_engine(plant: str, arm: Model) -> None:
    """By Pinocchio at each step, with a payload and a push on the tool."""
    if plant not in dynx.installed_backends():
        pytest.skip(f"needs {plant}")
    rollout = swing(arm, plant)
    found = rollout.read_sensors(SENSORS)
    assert all(len(each) == len(rollout) == 100 for each in found.values())
    model = rollout.model.with_frame("sensor", "tool0", POSE).with_frame("flange", "wrist_3_link", POSE)
    motion = rollout.q[:-1], rollout.v[:-1], rollout.a
    with backend("pinocchio", model) as engine:
        T = engine.forward_kinematics(motion[0], "sensor")
        v = engine.frame_velocity(*motion[:2], "sensor")
        a = engine.frame_acceleration(*motion, "sensor")
        proper = np.einsum("kji,kj->ki", T[:, :3, :3], a[:, :3] - np.array(model.gravity))
        external = {"tool0": np.array([5.0, -8.0, 3.0, 0.1, 0.2, 0.3])}
        wrenches = engine.joint_wrenches(*motion, frame="flange", external_forces=external)
        rest = np.zeros_like(rollout.a)
        tool = engine.joint_wrenches(*motion, external_forces=external) - engine.joint_wrenches(
            motion[0], rest, rest
        )
    number = {joint.name: k for k, joint in enumerate(model.joints)}
    mount = next(joint.name for joint in model.joints if joint.child == "tool0")
    bar: dict[str, Any] = {"rtol": 0, "atol": 1e-9}
    np.testing.assert_allclose(found["imu"]["acceleration"], proper, **bar)
    gyro = np.einsum("kji,kj->ki", T[:, :3, :3], v[:, 3:])
    np.testing.assert_allclose(found["imu"]["angular_velocity"], gyro, **bar)
    np.testing.assert_allclose(found["flange"].values, wrenches[:, number["wrist_3_joint"]], **bar)
    np.testing.assert_allclose(found["tool"].values, tool[:, number[mount]], **bar)
    np.testing.assert_allclose(found["torque"]["torque"], rollout.tau[:, 2], **bar)
    np.testing.assert_array_equal(found["encoder"].values.T, [rollout.q[:-1, 2], rollout.v[:-1, 2]])


def test_samples_have_their_rate_and_are_held_until_the_next(arm: Model) -> None:
    """At 150 Hz in steps of 1 ms: the first step at or after each multiple; 12.5 ms late."""
    rollout = swing(arm, "pinocchio")
    slow = Encoder("slow", "elbow_joint", rate=150.0, delay=0.0125)
    found = rollout.read_sensors([slow, Encoder("fast", "elbow_joint")])
    samples = found["slow"]
    expected = [math.ceil(k / 0.15 - 1e-9) * 1e-3 for k in range(15)]
    np.testing.assert_allclose(samples.t, expected, rtol=0, atol=1e-12)
    rows = np.rint(samples.t * 1000).astype(int)
    np.testing.assert_array_equal(samples.values, found["fast"].values[rows])
    held = samples.held(rollout.t)
    np.testing.assert_array_equal(samples.held(rollout.t.tolist()), held)
    assert np.isnan(held[:13]).all()
    for k in range(13, 101):
        taken = np.flatnonzero(samples.t + 0.0125 <= k * 1e-3 + 1e-9)[-1]
        np.testing.assert_array_equal(held[k], samples.values[taken])


@pytest.mark.parametrize("rate", [1e-4, 0.01, 3.0, 299.7, 1000.0])
@pytest.mark.parametrize("h", [1e-3, 1e-5])
def test_samples_begin_with_the_first_step_at_or_after_each_multiple_of_the_period(
    rate: float, h: float
) -> None:
    """From time 0, also where a period has more than a million steps, up to the rate of the steps."""
    sensor = Encoder("encoder", "elbow_joint", rate=rate)
    n = 20_000
    rows, numbers = sample_numbers(sensor, h * np.arange(n, dtype=np.float64), h)
    # In whole numbers of 1e-12 s.
    period, step = round(1e12 / rate), round(1e12 * h)
    expected = [(-(-k * period // step), k) for k in range(n * step // period + 1)]
    expected = [(row, k) for row, k in expected if row < n]
    # A period that is rounded to 1e-12 s drifts from the one that is not, by less than a step.
    assert list(zip(rows.tolist(), numbers.tolist(), strict=True)) == expected
    # In other pieces, as a world takes its samples.
    ones = [sample_numbers(sensor, np.array([k * h]), h) for k in range(3000)]
    found = [(k, int(number[0])) for k, (row, number) in enumerate(ones) if len(row)]
    assert found == [each for each in expected if each[0] < 3000]


def test_noise_depends_on_name_seed_rollout_and_sample_alone(arm: Model) -> None:
    noisy = Imu("imu", "tool0", gyroscope=SensorErrors(noise=0.1, random_walk=0.1), rate=500.0)
    exact = replace(noisy, gyroscope=SensorErrors())

    def errors(rollout: dynx.Rollout, sensor: Imu) -> Floats:
        both: list[Readings] = [
            rollout.read_sensors([JointTorqueSensor("first", "elbow_joint"), each])["imu"]
            for each in (sensor, exact)
        ]
        found: Floats = both[0]["angular_velocity"] - both[1]["angular_velocity"]
        return found

    one = swing(arm, "pinocchio")
    np.testing.assert_allclose(errors(one, noisy), errors(swing(arm, "mujoco"), noisy), rtol=0, atol=1e-12)
    np.testing.assert_array_equal(
        one.read_sensors(noisy)["imu"].values[:20], one.first(40).read_sensors(noisy)["imu"].values
    )
    again = errors(swing(arm, "pinocchio", noise=dynx.Noise(rollout=3)), noisy)
    assert np.abs(again - errors(one, noisy)).min() > 0.0
    assert np.abs(errors(one, replace(noisy, seed=1)) - errors(one, noisy)).min() > 0.0


def test_places_that_do_not_exist_and_motions_that_do_not_tell_are_refused(arm: Model) -> None:
    rollout = swing(arm, "pinocchio")
    for sensor, says in (
        (Imu("imu", "tool"), "the imu sensor 'imu' is on 'tool', which ur5.* wanted a frame.*tool0"),
        (Encoder("encoder", "ee_fixed_joint"), "is a fixed joint of ur5"),
        (Encoder("encoder", "elbow"), "no joint of ur5.*elbow_joint"),
        (ForceTorqueSensor("ft", "wrist_3"), "wanted a joint or frame.*wrist_3"),
        (Imu("imu", "other/tool0"), "is on 'other/tool0', which ur5 does not have"),
    ):
        with pytest.raises(UnknownNameError, match=says):
            rollout.read_sensors(sensor)
    for blind in (ContactSensor("touch", "tool0"), RaySensor("ray", "tool0")):
        with pytest.raises(UnsupportedFeatureError, match="needs a scene"):
            rollout.read_sensors(blind)
    with pytest.raises(ArgumentError, match="wanted at most 1000 Hz"):
        rollout.read_sensors(Encoder("encoder", "elbow_joint", rate=2000.0))
    with pytest.raises(ArgumentError, match="two sensors are called 'imu'"):
        rollout.read_sensors([Imu("imu", "tool0")] * 2)
    floating = dynx.load("ur5", base="floating")
    motion = instant(floating, floating.neutral(), np.zeros(12), np.zeros(12))
    with pytest.raises(ArgumentError, match="which no joint carries"):
        read_sensor(ForceTorqueSensor("ft", floating.root), motion)
