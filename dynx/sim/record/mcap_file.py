"""Rollouts as MCAP recordings of ROS 2 messages, for PlotJuggler, Foxglove and ``ros2 bag``; the only import
of mcap.

`dynx.sim.record.ros_topics` lists the topics. Time stamps are the times of the record, starting at 0 s, in
whole nanoseconds as in ROS. The metadata record ``dynx.rollout`` has the settings of the simulation and the
other fields of a `Rollout`: numbers and lists as JSON, text as it is.
"""

from __future__ import annotations

import json
from typing import BinaryIO

import numpy as np

from dynx._version import __version__
from dynx.errors import ArgumentError, NotInstalledError
from dynx.files.reading import open_regular, printable
from dynx.model.documents import pose_numbers
from dynx.sim.record.rollout_data import RolloutData
from dynx.sim.record.ros_definitions import schema_name, schema_text
from dynx.sim.record.ros_topics import topics_of

SCHEMA = "dynx.rollout.mcap/1"
"""Name and version of the layout, in the metadata record."""

BLOCK = 1000
"""Number of states that are encoded together; it limits the memory that a long recording needs."""

ABOUT_CHANNEL = {"offered_qos_profiles": ""}
"""Entry that the ROS 2 profile of MCAP requires; an empty one leaves the quality of service to the player."""


def write_mcap(rollout: RolloutData, file: BinaryIO) -> None:
    """Write `rollout` as a recording. Raises NotInstalledError without mcap (``dynx[mcap]``)."""
    try:
        from mcap.writer import Writer
    except ImportError as error:
        raise NotInstalledError("a .mcap file needs mcap: pip install 'dynx[mcap]'") from error
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

    Raises ArgumentError for a file that cannot be read as MCAP, NotInstalledError without mcap.
    """
    try:
        from mcap.reader import make_reader
    except ImportError as error:
        raise NotInstalledError("a .mcap file needs mcap: pip install 'dynx[mcap]'") from error
    try:
        with open_regular(path) as file:
            reader = make_reader(file, validate_crcs=True)
            about = {each.name: dict(each.metadata) for each in reader.iter_metadata()}
            messages = [
                (channel.topic, message.log_time, message.data)
                for _, channel, message in reader.iter_messages(log_time_order=False)
            ]
    # A damaged file raises what its records lead to: struct.error, KeyError, errors of zstandard.
    except Exception as error:
        reason = str(error) or type(error).__name__
        raise ArgumentError(f"{printable(path)} is no whole MCAP file: {reason}") from error
    return messages, about


def _metadata(rollout: RolloutData) -> dict[str, str]:
    model = rollout.model
    known = {
        "schema": SCHEMA,
        "robot": model.name,
        "base": model.base,
        "base_pose": pose_numbers(model.base_pose),
        "gravity": list(model.gravity),
        "rotors": rollout.rotors.tolist(),
        **rollout.settings,
    }
    return {name: value if isinstance(value, str) else json.dumps(value) for name, value in known.items()}
