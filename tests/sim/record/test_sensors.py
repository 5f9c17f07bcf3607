"""Readings of sensors in the files of rollouts, read without dynx."""

from __future__ import annotations

import csv
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import dynx
from dynx import control
from dynx.sim.plants.scene_plant import ScenePlant
from dynx.world import (
    ContactSensor,
    Encoder,
    ForceTorqueSensor,
    Imu,
    JointTorqueSensor,
    RaySensor,
    Scene,
    SceneRobot,
    SensorErrors,
    ground,
)
from tests.world.standing import quadruped

NOISE = SensorErrors(noise_density=0.02)


@pytest.fixture(scope="module")
def rollout() -> dynx.Rollout:
    dog, q = quadruped("a1")
    robot = SceneRobot("dog", dog, q=tuple(q))
    sensors = (
        Imu("imu", "dog/trunk", rate=200.0, delay=0.0023, gyroscope=NOISE),
        ForceTorqueSensor("thigh wrench", "dog/FR_thigh_joint", force=NOISE),
        ContactSensor("foot", "dog/FR_foot"),
        RaySensor("range", "dog/trunk"),
    )
    scene = Scene("fall", robots=(robot,), bodies=(ground(),), sensors=sensors)
    own = (Encoder("knee", "FR_calf_joint", rate=50.0), JointTorqueSensor("torque", "FR_calf_joint"))
    law = control.PD(dog, kp=50.0, kd=1.0)
    plant = ScenePlant(scene, "dog", "pybullet")
    return dynx.simulate(dog, law, q, duration=0.05, plant=plant, sensors=own)


def test_an_npz_has_the_samples_and_gives_them_again(rollout: dynx.Rollout, tmp_path: Path) -> None:
    path = tmp_path / "run.npz"
    rollout.save(path)
    with np.load(path) as arrays:
        for name, readings in rollout.sensors.items():
            np.testing.assert_array_equal(arrays[f"sensor:{name}:t"], readings.t)
            for channel, rows in readings.channels.items():
                np.testing.assert_array_equal(arrays[f"sensor:{name}:{channel}"], rows)
    again = dynx.Rollout.load(path)
    assert (
        list(again.sensors)
        == list(rollout.sensors)
        == ["knee", "torque", "imu", "thigh wrench", "foot", "range"]
    )
    for name, readings in rollout.sensors.items():
        np.testing.assert_array_equal(again.sensors[name].values, readings.values)


def test_a_csv_has_a_sample_in_the_row_of_its_time(rollout: dynx.Rollout, tmp_path: Path) -> None:
    path = tmp_path / "run.csv"
    rollout.save(path)
    with open(path, newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    for name, readings in rollout.sensors.items():
        for k, value in enumerate(readings.sensor.value_names):
            cells = [row[f"sensor:{name}:{value}"] for row in rows]
            found = {float(row["t"]): float(cell) for row, cell in zip(rows, cells, strict=True) if cell}
            assert found == dict(zip(readings.t.tolist(), readings.values[:, k].tolist(), strict=True))
    assert len(dynx.Rollout.load(path, rollout.model)) == len(rollout)


def test_a_recording_has_messages_of_ros_when_samples_can_be_read(
    rollout: dynx.Rollout, tmp_path: Path
) -> None:
    reader = pytest.importorskip("mcap.reader")
    decoder = pytest.importorskip("mcap_ros2.decoder")
    path = tmp_path / "run.mcap"
    rollout.save(path)
    found: dict[str, list[tuple[float, str, object]]] = {}
    with open(path, "rb") as file:
        for schema, channel, message, decoded in reader.make_reader(
            file, decoder_factories=[decoder.DecoderFactory()]
        ).iter_decoded_messages():
            if channel.topic.startswith("/sensors/"):
                found.setdefault(channel.topic, []).append((message.log_time * 1e-9, schema.name, decoded))
    assert set(found) == {f"/sensors/{name}" for name in (*rollout.sensors, "thigh_wrench")} - {
        "/sensors/thigh wrench"
    }
    for name, readings in rollout.sensors.items():
        messages = found[f"/sensors/{name.replace(' ', '_')}"]
        end = rollout.t[-1] + 1e-9
        assert len(messages) == int(np.sum(readings.available <= end))
        for k, (logged, kind, message) in enumerate(messages):
            ready = readings.available[k]
            assert ready - 1e-9 <= logged <= ready + 1e-3
            values = _values(kind, message)
            np.testing.assert_array_equal(values[: readings.sensor.size], readings.values[k])
            if kind != "std_msgs/msg/Float64":
                stamp = message.header.stamp  # type: ignore[attr-defined]
                assert abs(stamp.sec + 1e-9 * stamp.nanosec - readings.t[k]) < 1e-9
    _, _, imu = found["/sensors/imu"][0]
    assert imu.orientation_covariance[0] == -1.0  # type: ignore[attr-defined]
    covariance = imu.angular_velocity_covariance  # type: ignore[attr-defined]
    np.testing.assert_allclose(np.reshape(covariance, (3, 3)), 0.02**2 * 200.0 * np.eye(3), rtol=1e-12)


@pytest.mark.parametrize(("rate", "delay"), [(500.0, 0.004), (None, 0.004), (None, 0.0), (250.0, 1.0)])
def test_a_recording_leaves_out_samples_that_can_be_read_after_its_end_only(
    rate: float | None, delay: float, tmp_path: Path
) -> None:
    pytest.importorskip("mcap")
    arm = dynx.load("ur5")
    encoder = Encoder("elbow", "elbow_joint", rate=rate, delay=delay)
    late = dynx.simulate(arm, q0=arm.neutral(), duration=0.01, sensors=encoder)
    late.save(tmp_path / "late.mcap")
    assert len(dynx.Rollout.load(tmp_path / "late.mcap")) == len(late)


def _values(kind: str, message: object) -> list[float]:
    """Return the values of a message in the order of a reading."""
    if kind == "sensor_msgs/msg/Imu":
        return [*_vector(message, "linear_acceleration"), *_vector(message, "angular_velocity")]
    if kind == "geometry_msgs/msg/WrenchStamped":
        wrench = message.wrench  # type: ignore[attr-defined]
        return [*_vector(wrench, "force"), *_vector(wrench, "torque")]
    if kind == "sensor_msgs/msg/JointState":
        assert list(message.name) == ["FR_calf_joint"]  # type: ignore[attr-defined]
        return [x for part in ("position", "velocity", "effort") for x in getattr(message, part)]
    assert kind == "std_msgs/msg/Float64"
    return [message.data]  # type: ignore[attr-defined]


def _vector(message: object, name: str) -> list[float]:
    vector = getattr(message, name)
    return [vector.x, vector.y, vector.z]


def test_a_record_without_steps_has_no_samples(rollout: dynx.Rollout) -> None:
    """Of a simulation at its start, and of a log."""
    for record in (rollout.first(0), replace(rollout.first(0), scenario=None, surroundings=None)):
        found = record.read_sensors(Imu("slow", "dog/trunk" if record.scenario else "trunk", rate=200.0))
        assert len(found["slow"]) == 0
        assert found["slow"].values.shape == (0, 6)
        assert np.isnan(found["slow"].held(np.zeros(2))).all()
    own = rollout.first(0).sensors
    assert [len(own[name]) for name in own] == [0] * len(rollout.sensors)


def test_a_sensor_without_a_rate_samples_every_step_of_a_log() -> None:
    """Whose steps are not alike, with numbers of its noise that do not repeat."""
    arm = dynx.load("ur5")
    even = dynx.simulate(arm, None, duration=0.1)
    rng = np.random.default_rng(0)
    t = 5.0 + np.concatenate([[0.0], np.cumsum(rng.uniform(2e-4, 1.8e-3, len(even)))])
    log = replace(even, t=t, scenario=None)
    readings = log.read_sensors(Encoder("knee", "elbow_joint", position=NOISE))["knee"]
    np.testing.assert_array_equal(readings.t, t[:-1])
    errors = readings["position"] - log.q[:-1, 2]
    assert len(np.unique(errors)) == len(log)
