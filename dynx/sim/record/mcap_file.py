"""Rollouts as MCAP recordings of ROS 2 messages, written and read, for PlotJuggler, Foxglove and
``ros2 bag``; the only import of mcap.

`dynx.sim.record.ros_messages` lists the topics. Time stamps are the times of the record, starting at 0 s, in
whole nanoseconds as in ROS. The metadata record ``dynx.rollout`` has the settings of the simulation and the
other fields of a `Rollout`: numbers and lists as JSON, text as it is.
"""

from __future__ import annotations

import json
import os
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import replace
from typing import Any, BinaryIO

import numpy as np

from dynx._version import __version__
from dynx.errors import ArgumentError, DynxError, importing, shown
from dynx.files.documents import parse_json
from dynx.files.reading import MAX_BINARY_BYTES, checked_path, open_regular, printable, require_size
from dynx.model import Model
from dynx.model.documents import pose_numbers, robot_from_document
from dynx.sim.record.rollout import Rollout
from dynx.sim.record.ros_messages import (
    JointColumns,
    MessageReader,
    schema_name,
    schema_text,
    topics_of,
)
from dynx.spatial.scalar import Floats
from dynx.trajectory.base import Setpoint

SCHEMA = "dynx.rollout.mcap/1"
"""Name and version of the layout, in the metadata record."""

BLOCK = 1000
"""Number of states that are encoded together; it limits the memory that a long recording needs."""

MAX_CHUNK = 32 * 2**20
"""Largest size of the records of a chunk [bytes]; writers of MCAP begin a new one after 1 to 4 MiB."""

MAX_MESSAGES = 4_000_000
"""Largest number of messages that are read: each takes 150 bytes beside its own."""

ABOUT_CHANNEL = {"offered_qos_profiles": ""}
"""Entry that the ROS 2 profile of MCAP requires; an empty one leaves the quality of service to the player."""


def write_mcap(rollout: Rollout, file: BinaryIO) -> None:
    """Write `rollout` as a recording. Raises NotInstalledError without mcap (extra ``mcap``)."""
    with importing("a .mcap file needs mcap: pip install 'dynx[mcap]'"):
        from mcap.writer import Writer
    writer = Writer(file)
    writer.start(profile="ros2", library=f"dynx {__version__}")
    writer.add_metadata("dynx.rollout", _metadata(rollout))
    schemas: dict[str, int] = {}
    channels: dict[str, int] = {}
    topics = topics_of(rollout)
    for name, message in {topic.name: topic.message for topic in topics}.items():
        if message not in schemas:
            text = schema_text(message).encode()
            schemas[message] = writer.register_schema(schema_name(message), "ros2msg", text)
        channels[name] = writer.register_channel(name, "cdr", schemas[message], ABOUT_CHANNEL)
    stamps = np.rint(rollout.t * 1e9).astype(np.int64)
    times = stamps.tolist()
    for begin in range(0, len(stamps), BLOCK):
        messages = [
            (k, channels[topic.name], data)
            for topic in topics
            for k, data in topic.encoded(stamps, begin, begin + BLOCK)
        ]
        for k, channel, data in sorted(messages, key=lambda message: message[0]):
            writer.add_message(channel, times[k], data, times[k], sequence=k)
    writer.finish()


def read_messages(path: str) -> tuple[list[tuple[str, int, bytes]], dict[str, dict[str, str]]]:
    """Return topic, time stamp [ns] and data of the messages of a recording, in their order, and its metadata
    by name.

    Raises ArgumentError, which names the file, for one that cannot be read as MCAP; NotInstalledError
    without mcap.
    """
    with importing("a .mcap file needs mcap: pip install 'dynx[mcap]'"):
        from mcap.records import Channel, Message, Metadata
    about: dict[str, dict[str, str]] = {}
    messages: list[tuple[str, int, bytes]] = []
    topics: dict[int, str] = {}
    try:
        with open_regular(path) as file:
            for record in _records(file):
                if isinstance(record, Metadata):
                    about[record.name] = dict(record.metadata)
                elif isinstance(record, Channel):
                    topics[record.id] = record.topic
                elif isinstance(record, Message):
                    messages.append((topics[record.channel_id], record.log_time, record.data))
                    if len(messages) > MAX_MESSAGES:
                        raise ValueError(f"it has more than {MAX_MESSAGES:,} messages")
    except OSError as error:
        raise ArgumentError(f"{printable(path)} cannot be read: {error.strerror or error}") from error
    # A damaged file raises what its records lead to: struct.error, KeyError, errors of zstandard.
    except Exception as error:
        reason = str(error) or type(error).__name__
        raise ArgumentError(f"{printable(path)} is no whole MCAP file: {reason}") from error
    return messages, about


def _records(file: BinaryIO) -> Iterator[Any]:
    """Yield the records of a recording in their order, those of its chunks included.

    A chunk is expanded here, because readers of MCAP expand one to any size. Raises ValueError for a
    recording that is larger than what is read, and any exception for a damaged one.
    """
    from mcap.records import Chunk
    from mcap.stream_reader import StreamReader, breakup_chunk

    size = require_size(file)
    expanded = 0
    for record in StreamReader(file, emit_chunks=True, validate_crcs=True, record_size_limit=size).records:
        if isinstance(record, Chunk):
            data = _expanded(record)
            expanded += len(data)
            if expanded > MAX_BINARY_BYTES:
                raise ValueError(f"its chunks have more than {MAX_BINARY_BYTES:,} bytes")
            yield from breakup_chunk(replace(record, compression="", data=data), validate_crc=True)
        else:
            yield record


def _expanded(chunk: Any) -> bytes:
    """Return the records of a chunk. Raises ValueError for more bytes than `MAX_CHUNK`."""
    if chunk.compression == "zstd":
        import zstandard

        with zstandard.ZstdDecompressor(max_window_size=MAX_CHUNK).stream_reader(chunk.data) as stream:
            data: bytes = stream.read(MAX_CHUNK + 1)
    elif chunk.compression == "lz4":
        import lz4.frame

        data = lz4.frame.LZ4FrameDecompressor().decompress(chunk.data, MAX_CHUNK + 1)
    elif chunk.compression == "":
        data = chunk.data
    else:
        raise ValueError(f"a chunk has the compression {shown(chunk.compression)}; wanted zstd or lz4")
    if len(data) > MAX_CHUNK:
        raise ValueError(f"a chunk has more than {MAX_CHUNK:,} bytes")
    return data


def _metadata(rollout: Rollout) -> dict[str, str]:
    model = rollout.model
    known = {
        "schema": SCHEMA,
        "robot": model.name,
        "base": model.base,
        "base_pose": pose_numbers(model.base_pose),
        "gravity": list(model.gravity),
        "rotors": rollout.rotors.tolist(),
        **({"ball_joints": [joint.name for joint in model.ball_joints]} if model.ball_joints else {}),
        **rollout.settings,
    }
    return {name: value if isinstance(value, str) else json.dumps(value) for name, value in known.items()}


Messages = dict[str, list[tuple[int, bytes]]]
"""Time stamp [ns] and data of the messages of each topic."""


def load_mcap(path: str | os.PathLike[str]) -> dict[str, Any]:
    """Read the fields of a rollout from a ``.mcap`` of `save`.

    Every number is that of the record, except times, which are whole nanoseconds. The scenario and what a
    scene holds besides the robot are not in a recording. Raises ArgumentError for any other file,
    NotInstalledError without mcap.
    """
    name = checked_path(path)
    found, about = read_messages(name)
    settings = about.get("dynx.rollout", {})
    if settings.get("schema") != SCHEMA:
        raise ArgumentError(f"{shown(name, 300)} is no recording of dynx, which writes {SCHEMA}")
    messages: Messages = defaultdict(list)
    for topic, stamp, data in found:
        messages[topic].append((stamp, data))
    try:
        return _fields(messages, settings)
    except DynxError as error:
        raise ArgumentError(f"{shown(name, 300)} cannot be read as a rollout: {error}") from error
    # Numbers of another length, topics that are missing, and text that is not JSON.
    except (ValueError, KeyError, IndexError, TypeError, RecursionError) as error:
        raise ArgumentError(
            f"{shown(name, 300)} cannot be read as a rollout: {type(error).__name__}: {error}"
        ) from error


def _fields(messages: Messages, settings: dict[str, str]) -> dict[str, Any]:
    known = {key: parse_json(settings[key]) for key in ("gravity", "base_pose", "rotors")}
    description = MessageReader(messages["/robot_description"][0][1]).text()
    model = robot_from_document(
        {
            "urdf": description,
            "base": settings["base"],
            "gravity": known["gravity"],
            "base_pose": known["base_pose"],
            "ball_joints": parse_json(settings.get("ball_joints", "[]")),
        }
    )
    states = messages["/joint_states"]
    n = len(states) - 1
    q, v = _states(model, messages, "/joint_states", "/ball_joints", "/base/odometry", n + 1)
    columns = JointColumns.of(model)
    tau = np.zeros((n, model.nv))
    saturated = np.zeros((n, model.nv), dtype=bool)
    a = _accelerations_of(model, messages, "/accelerations", "/ball_joints/accelerations", n)
    for k in range(n):
        tau[k, columns.in_v] = _joint_state(states[k][1])[2]
        saturated[k, columns.in_v] = _joint_state(messages["/saturated"][k][1])[2] > 0.5
        if columns.balls:
            tau[k, columns.balls_in_v] = _ball_state(messages["/ball_joints"][k][1])[2]
            flags = _ball_state(messages["/ball_joints/saturated"][k][1])[2]
            saturated[k, columns.balls_in_v] = flags > 0.5
        if model.floating:
            a[k, :6] = _vectors(messages["/base/acceleration"][k][1])
            tau[k, :6] = _vectors(messages["/base/wrench"][k][1])
    return {
        "model": model,
        "t": np.array([stamp for stamp, _ in states]) * 1e-9,
        "q": q,
        "v": v,
        "a": a,
        "tau": tau,
        "saturated": saturated,
        "reference": _reference(model, messages, n + 1),
        "rotors": np.array(known["rotors"], dtype=np.float64).reshape(model.nv, model.nv),
    }


def _reference(model: Model, messages: Messages, n: int) -> Setpoint | None:
    if "/reference" not in messages:
        return None
    q, v = _states(model, messages, "/reference", "/ball_joints/reference", "/base/reference", n)
    a = _accelerations_of(
        model, messages, "/reference_accelerations", "/ball_joints/reference_accelerations", n
    )
    for k in range(n if model.floating else 0):
        a[k, :6] = _vectors(messages["/base/reference_acceleration"][k][1])
    return Setpoint(q, v, a)


def _accelerations_of(model: Model, messages: Messages, joints: str, balls: str, n: int) -> Floats:
    """Return the accelerations (n, nv) of the joints, of two topics."""
    columns, a = JointColumns.of(model), np.zeros((n, model.nv))
    for k in range(n):
        a[k, columns.in_v] = _acceleration(messages[joints][k][1])
        if columns.balls:
            a[k, columns.balls_in_v] = _ball_acceleration(messages[balls][k][1])
    return a


def _states(
    model: Model, messages: Messages, joints: str, balls: str, base: str, n: int
) -> tuple[Floats, Floats]:
    """Return configurations (n, nq) and velocities (n, nv) of three topics."""
    columns = JointColumns.of(model)
    q, v = np.zeros((n, model.nq)), np.zeros((n, model.nv))
    for k in range(n):
        q[k, columns.in_q], v[k, columns.in_v], _ = _joint_state(messages[joints][k][1])
        if columns.balls:
            q[k, columns.balls_in_q], v[k, columns.balls_in_v], _ = _ball_state(messages[balls][k][1])
        if model.floating:
            q[k, :7], v[k, :6] = _odometry(messages[base][k][1])
    return q, v


def _after_header(data: bytes) -> MessageReader:
    message = MessageReader(data)
    message.whole(), message.whole(), message.text()
    return message


def _joint_state(data: bytes) -> tuple[Floats, Floats, Floats]:
    """Return the positions, velocities and efforts of a JointState."""
    message = _after_header(data)
    message.texts()
    return message.numbers(), message.numbers(), message.numbers()


def _ball_state(data: bytes) -> tuple[Floats, Floats, Floats]:
    """Return the quaternions, angular velocities and torques of a MultiDOFJointState, each in one array."""
    message = _after_header(data)
    message.texts()
    return _structures(message, 7), _structures(message, 6), _structures(message, 6)


def _ball_acceleration(data: bytes) -> Floats:
    """Return the angular accelerations of the only point of a MultiDOFJointTrajectory, in one array."""
    message = _after_header(data)
    message.texts()
    message.whole(), _structures(message, 7), _structures(message, 6)
    return _structures(message, 6)


def _structures(message: MessageReader, size: int) -> Floats:
    """Return the numbers of a sequence of structures of `size` numbers, without the first three of each."""
    count = message.whole()
    return message.numbers(count * size).reshape(count, size)[:, 3:].ravel()


def _acceleration(data: bytes) -> Floats:
    """Return the accelerations of the only point of a JointTrajectory."""
    message = _after_header(data)
    message.texts()
    message.whole(), message.numbers(), message.numbers()
    return message.numbers()


def _odometry(data: bytes) -> tuple[Floats, Floats]:
    """Return the pose (7,) and the twist (6,) of an Odometry."""
    message = _after_header(data)
    message.text()
    pose, _ = message.numbers(7), message.numbers(36)
    return pose, message.numbers(6)


def _vectors(data: bytes) -> Floats:
    """Return the two vectors (6,) of a stamped message."""
    return _after_header(data).numbers(6)
