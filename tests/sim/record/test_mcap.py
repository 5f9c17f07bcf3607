"""Recordings in MCAP: what the readers of ROS 2 messages find in them is what the rollout holds."""

from __future__ import annotations

import json
import struct
import sys
from collections import defaultdict
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dynx.control import ComputedTorque
from dynx.control.base import Controller, Measurement
from dynx.errors import ArgumentError, NotInstalledError
from dynx.model import Model
from dynx.model.loading import load
from dynx.sim import Noise, Payload, Rollout, simulate
from dynx.sim.record.ros_messages import DEFINITIONS, SEPARATOR, schema_text
from dynx.spatial.scalar import Floats
from dynx.trajectory import cycloidal
from dynx.trajectory.base import Setpoint
from tests.sim.bars import tutorial_motion, tutorial_robot

INERTIAL = '<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>'
JOINT = 'type="continuous"><axis xyz="0 0 1"/>'
FOLLOWING = f"""
<robot name="mímir">
  <link name="torso">{INERTIAL}</link> <link name="a">{INERTIAL}</link> <link name="b">{INERTIAL}</link>
  <joint name="ellbøgen/関節" {JOINT} <parent link="torso"/> <child link="a"/> </joint>
  <joint name="follower" {JOINT} <parent link="a"/> <child link="b"/>
    <mimic joint="ellbøgen/関節" multiplier="-0.5"/> </joint>
</robot>
"""


class Thrust(Controller[None]):
    """A law that pushes everything, the base too."""

    def __init__(self, model: Model) -> None:
        self.model = model

    def torque(self, measurement: Measurement, setpoint: Setpoint, state: None) -> tuple[Floats, None]:
        """Something else at every state."""
        return 3.0 - measurement.v, None


Messages = dict[str, list[tuple[int, Any]]]


def read(path: Path) -> tuple[Messages, dict[str, tuple[str, int]], dict[str, str]]:
    """(stamp, message) by topic; type and number of messages by topic; the metadata."""
    reading, decoding = pytest.importorskip("mcap.reader"), pytest.importorskip("mcap_ros2.decoder")
    found: Messages = defaultdict(list)
    with path.open("rb") as file:
        reader = reading.make_reader(file, validate_crcs=True, decoder_factories=[decoding.DecoderFactory()])
        assert reader.get_header().profile == "ros2"
        summary = reader.get_summary()
        counts = summary.statistics.channel_message_counts
        topics = {
            channel.topic: (summary.schemas[channel.schema_id].name, counts.get(channel.id, 0))
            for channel in summary.channels.values()
        }
        for channel in summary.channels.values():
            assert channel.message_encoding == "cdr"
            assert "offered_qos_profiles" in channel.metadata
        for schema, channel, message, decoded in reader.iter_decoded_messages(log_time_order=False):
            assert schema.encoding == "ros2msg"
            assert message.publish_time == message.log_time
            found[channel.topic].append((message.log_time, decoded))
        (metadata,) = reader.iter_metadata()
        assert metadata.name == "dynx.rollout"
    return found, topics, metadata.metadata


def rows(messages: list[tuple[int, Any]], field: str) -> Floats:
    """Return a field of all messages; dots lead to fields of fields."""
    found = []
    for _, message in messages:
        value = message
        for name in field.split("."):
            value = value[0] if isinstance(value, list) else value
            value = getattr(value, name)
        found.append(vector(value))
    return np.array(found)


def vector(value: Any) -> list[float]:
    """Return the numbers of a sequence, or of a vector, a quaternion or a pair of them."""
    if isinstance(value, int | float):
        return [value]
    parts = value if isinstance(value, list) else [getattr(value, name) for name in value.__slots__]
    return [x for part in parts for x in vector(part)]


def same(found: Floats, wanted: Floats) -> None:
    """To the last bit."""
    assert found.shape == wanted.shape
    assert found.tobytes() == np.ascontiguousarray(wanted).tobytes()


@pytest.fixture(scope="module")
def arm() -> Rollout:
    robot = tutorial_robot()
    return simulate(
        robot,
        ComputedTorque(robot, kp=400, kd=40),
        tutorial_motion(0.05),
        payload=Payload("tool0", 1.0),
        noise=Noise(q=1e-5, v=1e-3, seed=3),
        joint_armature=0.1,
        check_reference=False,
        effort_limits=20.0,
    )


def test_every_number_of_a_fixed_base_is_found(arm: Rollout, tmp_path: Path) -> None:
    arm.save(tmp_path / "run.mcap")
    found, topics, _ = read(tmp_path / "run.mcap")
    assert arm.reference is not None
    assert arm.saturated.any()
    assert not arm.saturated.all()
    assert topics == {
        "/robot_description": ("std_msgs/msg/String", 1),
        "/joint_states": ("sensor_msgs/msg/JointState", 51),
        "/accelerations": ("trajectory_msgs/msg/JointTrajectory", 50),
        "/saturated": ("sensor_msgs/msg/JointState", 50),
        "/energy": ("std_msgs/msg/Float64", 51),
        "/reference": ("sensor_msgs/msg/JointState", 51),
        "/reference_accelerations": ("trajectory_msgs/msg/JointTrajectory", 51),
        "/error": ("sensor_msgs/msg/JointState", 51),
    }
    states = found["/joint_states"]
    same(rows(states, "position"), arm.q)
    same(rows(states, "velocity"), arm.v)
    same(rows(states[:-1], "effort"), arm.tau)
    assert states[-1][1].effort == []
    same(rows(found["/accelerations"], "points.accelerations"), arm.a)
    same(rows(found["/saturated"], "effort"), arm.saturated.astype(np.float64))
    same(rows(found["/energy"], "data")[:, 0], arm.energy)
    same(rows(found["/reference"], "position"), arm.reference.q)
    same(rows(found["/reference"], "velocity"), arm.reference.v)
    same(rows(found["/reference_accelerations"], "points.accelerations"), arm.reference.a)
    same(rows(found["/error"], "position"), arm.error)
    for topic in set(topics) - {"/robot_description", "/energy"}:
        for _, message in found[topic]:
            names = message.joint_names if "accelerations" in topic else message.name
            assert names == list(arm.model.joint_names)


def test_stamps_are_the_times_in_whole_nanoseconds(tmp_path: Path) -> None:
    robot = tutorial_robot()
    moved = simulate(robot, q0=np.zeros(6), dt=3e-4, duration=12e-3)
    assert ((moved.t * 1e9).astype(int) % 1000 == 999).any()
    moved.save(tmp_path / "run.mcap")
    found, _, _ = read(tmp_path / "run.mcap")
    for topic, messages in found.items():
        stamps = [stamp for stamp, _ in messages]
        assert stamps == [k * 300_000 for k in range(len(messages))], topic
        for stamp, message in messages:
            if hasattr(message, "header"):
                assert message.header.stamp.sec * 10**9 + message.header.stamp.nanosec == stamp


def test_the_description_and_the_settings_are_there(arm: Rollout, tmp_path: Path) -> None:
    arm.save(tmp_path / "run.mcap")
    found, _, metadata = read(tmp_path / "run.mcap")
    ((_, description),) = found["/robot_description"]
    assert load(description.data, gravity=arm.model.gravity) == arm.model
    assert metadata["schema"] == "dynx.rollout.mcap/1"
    assert metadata["robot"] == "ur5"
    assert metadata["controller"] == arm.settings["controller"]
    for name in set(arm.settings) - {"plant", "integrator", "controller", "noise"}:
        assert json.loads(metadata[name]) == arm.settings[name]
    assert json.loads(metadata["rotors"]) == arm.rotors.tolist()


def test_a_floating_base_with_a_follower_and_names_of_all_letters(tmp_path: Path) -> None:
    robot = load(FOLLOWING, base="floating")
    assert robot.joint_names == ("ellbøgen/関節",)
    goal = robot.integrate(robot.neutral(), np.linspace(0.1, 0.7, robot.nv))
    v0 = np.linspace(-1.0, 1.0, robot.nv)
    moved = simulate(robot, Thrust(robot), goal, q0=robot.neutral(), v0=v0, duration=0.02)
    moved.save(tmp_path / "läuft.mcap")
    found, topics, metadata = read(tmp_path / "läuft.mcap")
    assert metadata["robot"] == "mímir"
    assert found["/joint_states"][0][1].name == ["ellbøgen/関節"]
    same(rows(found["/joint_states"], "position"), moved.q[:, 7:])
    same(rows(found["/joint_states"][:-1], "effort"), moved.tau[:, 6:])
    assert moved.reference is not None
    assert topics["/tf"] == ("tf2_msgs/msg/TFMessage", 21)
    same(rows(found["/tf"], "transforms.transform"), moved.q[:, :7])
    for topic, (q, v) in {
        "/base/odometry": (moved.q, moved.v),
        "/base/reference": (moved.reference.q, moved.reference.v),
    }.items():
        same(rows(found[topic], "pose.pose"), q[:, :7])
        same(rows(found[topic], "twist.twist"), v[:, :6])
        assert not rows(found[topic], "pose.covariance").any()
        assert {(m.header.frame_id, m.child_frame_id) for _, m in found[topic]} == {("world", "torso")}
    same(rows(found["/base/acceleration"], "accel"), moved.a[:, :6])
    same(rows(found["/base/reference_acceleration"], "accel"), moved.reference.a[:, :6])
    same(rows(found["/base/wrench"], "wrench"), moved.tau[:, :6])
    same(rows(found["/base/error"], "twist"), moved.error[:, :6])
    for _, message in found["/tf"]:
        (transform,) = message.transforms
        assert (transform.header.frame_id, transform.child_frame_id) == ("world", "torso")
    for topic in ("/base/acceleration", "/base/wrench", "/base/error"):
        assert {m.header.frame_id for _, m in found[topic]} == {"torso"}


def test_a_root_called_world_is_not_its_own_parent(tmp_path: Path) -> None:
    robot = load(FOLLOWING.replace('"torso"', '"world"'), base="floating")
    simulate(robot, duration=2e-3).save(tmp_path / "run.mcap")
    found, _, _ = read(tmp_path / "run.mcap")
    assert found["/tf"][0][1].transforms[0].header.frame_id == "map"


@pytest.mark.parametrize("steps", [0, 1])
def test_records_of_no_steps_or_one(arm: Rollout, tmp_path: Path, steps: int) -> None:
    arm.first(steps).save(tmp_path / "run.mcap")
    found, topics, _ = read(tmp_path / "run.mcap")
    assert topics["/joint_states"][1] == steps + 1
    assert topics["/accelerations"][1] == topics["/saturated"][1] == steps
    same(rows(found["/joint_states"], "position"), arm.q[: steps + 1])


def test_a_robot_without_joints(tmp_path: Path) -> None:
    stone = load('<robot name="stone"><link name="stone"/></robot>')
    simulate(stone, duration=2e-3).save(tmp_path / "run.mcap")
    found, _, _ = read(tmp_path / "run.mcap")
    assert [m.name for _, m in found["/joint_states"]] == [[]] * 3


def test_long_records_are_written_block_by_block(
    arm: Rollout, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("mcap.reader")
    arm.save(tmp_path / "at once.mcap")
    monkeypatch.setattr("dynx.sim.record.mcap_file.BLOCK", 7)
    arm.save(tmp_path / "in blocks.mcap")
    assert (tmp_path / "at once.mcap").read_bytes() == (tmp_path / "in blocks.mcap").read_bytes()


def test_a_message_is_cdr_byte_for_byte(arm: Rollout, tmp_path: Path) -> None:
    """Written out by hand, after DDS-XTypes: numbers at multiples of their size, texts closed by a zero."""
    reading = pytest.importorskip("mcap.reader")
    arm.save(tmp_path / "run.mcap")
    with (tmp_path / "run.mcap").open("rb") as file:
        messages = list(reading.make_reader(file).iter_messages(topics=["/joint_states"]))
    body = struct.pack("<iI", 0, 2_000_000)  # stamp
    body += struct.pack("<I", 1) + b"\0"  # frame_id
    body += bytes(-len(body) % 4) + struct.pack("<I", 6)  # name
    for name in arm.model.joint_names:
        body += bytes(-len(body) % 4) + struct.pack("<I", len(name) + 1) + name.encode() + b"\0"
    for values in (arm.q[2], arm.v[2], arm.tau[2]):
        body += bytes(-len(body) % 4) + struct.pack("<I", 6)
        body += bytes(-len(body) % 8) + struct.pack("<6d", *values)
    assert messages[2][2].data == b"\0\1\0\0" + body


def test_definitions_are_complete() -> None:
    built_in = {"bool", "int32", "uint32", "float64", "string"}
    for message in DEFINITIONS:
        own, *others = schema_text(message).split(f"{SEPARATOR}\n")
        assert own == DEFINITIONS[message]
        known = dict(other.removeprefix("MSG: ").split("\n", 1) for other in others)
        assert len(known) == len(others)
        for name, text in [(message, own), *known.items()]:
            assert text == DEFINITIONS[name]
            for line in text.splitlines():
                kind = line.split()[0].split("[")[0]
                package = name.split("/")[0]
                assert kind in built_in or kind in known or f"{package}/{kind}" in known, line


def test_without_mcap_the_extra_is_named(
    arm: Rollout, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "mcap.writer", None)
    with pytest.raises(NotInstalledError, match=r"pip install '\S*\[mcap\]'"):
        arm.save(tmp_path / "run.mcap")
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("base", ["fixed", "floating"])
@pytest.mark.parametrize("followed", [True, False])
def test_a_recording_is_read_back(tmp_path: Path, base: str, followed: bool) -> None:
    pytest.importorskip("mcap")
    model = load(FOLLOWING, base=base)  # type: ignore[arg-type]
    reference: Any = None
    if followed:
        goal = model.integrate(model.neutral(), np.full(model.nv, 0.1))
        reference = goal if base == "floating" else cycloidal(model.neutral(), goal, duration=0.05)
    law = Thrust(model) if followed else None
    rollout = simulate(model, law, reference, duration=0.05)
    path = tmp_path / "run.mcap"
    rollout.save(path)
    same = Rollout.load(path)
    assert same.model.joint_names == model.joint_names
    assert same.model.floating == model.floating
    for name in ("q", "v", "a", "tau", "saturated", "rotors"):
        assert np.array_equal(getattr(same, name), getattr(rollout, name)), name
    assert np.abs(same.t - rollout.t).max() <= 0.5e-9
    assert (same.reference is None) == (rollout.reference is None)
    if rollout.reference is not None:
        assert same.reference is not None
        for found, wanted in zip(same.reference, rollout.reference, strict=True):
            assert np.array_equal(found, wanted)


BALLS = """<mujoco model="ball"><compiler angle="radian"/><default><geom mass="50"/></default><worldbody>{}
<geom type="box" size="0.1 0.2 0.3"/>
<body name="arm" pos="0 0.1 0.2"><joint name="shoulder" type="ball"/><geom size="0.1" pos="0.1 0.2 0"/>
<body name="hand" pos="0.3 0 0"><joint name="elbow" axis="0 1 0"/><geom size="0.05" pos="0.1 0 0"/>
<joint name="wrist" type="slide" axis="1 0 0"/>
<body name="tip" pos="0.1 0 0"><joint name="ball" type="ball" range="0 2"/><geom size="0.04" pos="0 0 0.1"/>
</body></body></body>{}</worldbody></mujoco>"""


@pytest.mark.parametrize("floating", [False, True])
@pytest.mark.parametrize("followed", [True, False])
def test_ball_joints_are_read_back_and_stand_in_messages_of_their_own(
    tmp_path: Path, floating: bool, followed: bool
) -> None:
    pytest.importorskip("mcap")
    around = ('<body name="base"><freejoint/>', "</body>") if floating else ("", "")
    model = load(BALLS.format(*around))
    rng = np.random.default_rng(0)
    goal = model.integrate(model.neutral(), rng.uniform(-1.0, 1.0, model.nv)) if followed else None
    start = model.integrate(model.neutral(), rng.uniform(-0.5, 0.5, model.nv))
    law = Thrust(model) if followed else None
    rollout = simulate(model, law, goal, q0=start, duration=0.02)
    path = tmp_path / "run.mcap"
    rollout.save(path)
    same = Rollout.load(path)
    assert same.model == model
    for name in ("q", "v", "a", "tau", "saturated", "rotors"):
        assert np.array_equal(getattr(same, name), getattr(rollout, name)), name
    if followed:
        assert same.reference is not None
        assert rollout.reference is not None
        for found, wanted in zip(same.reference, rollout.reference, strict=True):
            assert np.array_equal(found, wanted)
    messages, topics, about = read(path)
    assert json.loads(about["ball_joints"]) == ["shoulder", "ball"]
    assert topics["/ball_joints"] == ("sensor_msgs/msg/MultiDOFJointState", len(rollout) + 1)
    assert topics["/ball_joints/accelerations"] == (
        "trajectory_msgs/msg/MultiDOFJointTrajectory",
        len(rollout),
    )
    for k in (0, 5, len(rollout)):
        _, state = messages["/ball_joints"][k]
        assert state.joint_names == ["shoulder", "ball"]
        for number, name in enumerate(state.joint_names):
            i, j = model.position_index(name), model.coordinate_index(name)
            R, twist = state.transforms[number].rotation, state.twist[number]
            assert [R.x, R.y, R.z, R.w] == rollout.q[k, i : i + 4].tolist()
            assert [twist.angular.x, twist.angular.y, twist.angular.z] == rollout.v[k, j : j + 3].tolist()
            assert (twist.linear.x, state.transforms[number].translation.y) == (0.0, 0.0)
            if k < len(rollout):
                torque = state.wrench[number].torque
                assert [torque.x, torque.y, torque.z] == rollout.tau[k, j : j + 3].tolist()
                (point,) = messages["/ball_joints/accelerations"][k][1].points
                alpha = point.accelerations[number].angular
                assert [alpha.x, alpha.y, alpha.z] == rollout.a[k, j : j + 3].tolist()
        assert (state.wrench == []) == (k == len(rollout))
        assert messages["/joint_states"][k][1].name == ["elbow", "wrist"]


def test_other_recordings_are_refused(tmp_path: Path) -> None:
    pytest.importorskip("mcap")
    rollout = simulate(load(FOLLOWING), duration=0.01)
    path = tmp_path / "run.mcap"
    rollout.save(path)
    whole = path.read_bytes()
    for data in (b"", b"no recording", whole[:200], whole[: len(whole) // 2], whole[:-30]):
        path.write_bytes(data)
        with pytest.raises(ArgumentError, match=r"run\.mcap"):
            Rollout.load(path)
    generator = np.random.default_rng(0)
    for _ in range(60):
        damaged = bytearray(whole)
        damaged[generator.integers(len(whole))] ^= 1 << int(generator.integers(8))
        path.write_bytes(damaged)
        # What no checksum covers may be read; whatever fails is one error.
        with suppress(ArgumentError):
            Rollout.load(path)
    with pytest.raises(ArgumentError):
        Rollout.load(tmp_path / "nothing.mcap")


def test_a_recording_is_not_loaded_without_mcap(
    arm: Rollout, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("mcap")
    path = tmp_path / "run.mcap"
    arm.save(path)
    monkeypatch.setitem(sys.modules, "mcap.records", None)
    with pytest.raises(NotInstalledError, match=r"pip install '\S*\[mcap\]'"):
        Rollout.load(path)


@pytest.mark.parametrize("content", [None, b"no recording"])
def test_a_file_that_is_no_recording_is_named_once(tmp_path: Path, content: bytes | None) -> None:
    pytest.importorskip("mcap")
    path = tmp_path / "run.mcap"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(ArgumentError) as caught:
        Rollout.load(path)
    message = str(caught.value)
    assert message.count("run.mcap") == 1
    assert ("No such file" in message) == (content is None)
    assert "Errno" not in message
