"""Attacks by recordings in MCAP: `dynx compare`, `dynx view`, `Rollout.load`."""

from __future__ import annotations

import io
import json
import os
import struct
import tempfile
import zlib
from collections.abc import Callable
from functools import cache
from pathlib import Path

from tests.security.attack import Box, Deed, attacks_on, sparse
from tests.security.surfaces.arrays import rollout

attack = attacks_on("mcap")

MAGIC = b"\x89MCAP0\r\n"


@cache
def good() -> bytes:
    """Return a recording of a short rollout."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "r.mcap"
        rollout().save(path)
        return path.read_bytes()


def deed(box: Box, content: bytes, ends: tuple[int, ...] = (2,)) -> Deed:
    """Write a recording, which the victim loads."""
    return Deed((box.file("r.mcap", content),), "rollout", ends)


def record(code: int, body: bytes, length: int | None = None) -> bytes:
    """Return a record, perhaps with a false length."""
    return bytes([code]) + struct.pack("<Q", len(body) if length is None else length) + body


def text(value: str) -> bytes:
    """Return a text as MCAP writes it."""
    return struct.pack("<I", len(value.encode())) + value.encode()


def recording(*records: bytes) -> bytes:
    """Return a recording of records without a summary."""
    return MAGIC + record(1, text("ros2") + text("x")) + b"".join(records) + END


END = record(15, bytes(4)) + record(2, bytes(20)) + MAGIC


def chunk(data: bytes, compression: str, size: int, crc: int = 0) -> bytes:
    """Return a chunk of compressed records that states a size."""
    body = struct.pack("<QQQI", 0, 0, size, crc) + text(compression) + struct.pack("<Q", len(data)) + data
    return record(6, body)


def copied(
    change: Callable[[str, dict[str, str]], object] | None = None,
    topic: Callable[[str], str] = str,
    data: Callable[[str, bytes], bytes] = lambda _, data: data,
    **options: object,
) -> bytes:
    """Return the recording with other metadata, topics or messages."""
    from mcap.reader import make_reader
    from mcap.writer import Writer

    reader, out = make_reader(io.BytesIO(good())), io.BytesIO()
    writer = Writer(out, **options)  # type: ignore[arg-type]  # options of the writer
    writer.start(profile="ros2", library="x")
    for each in reader.iter_metadata():
        metadata = dict(each.metadata)
        if change is not None:
            change(each.name, metadata)
        writer.add_metadata(each.name, metadata)
    channels: dict[str, int] = {}
    for schema, channel, message in reader.iter_messages(log_time_order=False):
        assert schema is not None
        if channel.topic not in channels:
            number = writer.register_schema(schema.name, schema.encoding, schema.data)
            channels[channel.topic] = writer.register_channel(topic(channel.topic), "cdr", number)
        given = data(channel.topic, message.data)
        writer.add_message(channels[channel.topic], message.log_time, given, message.publish_time)
    writer.finish()
    return out.getvalue()


def set_to(**values: str) -> Callable[[str, dict[str, str]], object]:
    """Return a function that changes metadata."""
    return lambda _, metadata: metadata.update(values)


@attack("path", "mesh in the description of the robot")
def _(box: Box) -> Deed:
    def described(topic: str, data: bytes) -> bytes:
        if topic != "/robot_description":
            return data
        mesh = f'<visual><geometry><mesh filename="{box.outside}/secret.stl"/></geometry></visual>'
        urdf = f'<robot name="r"><link name="b">{mesh}</link></robot>'
        return b"\0\1\0\0" + struct.pack("<I", len(urdf) + 1) + urdf.encode() + b"\0"

    return deed(box, copied(data=described))


@attack("path", "description of the robot that is a path")
def _(box: Box) -> Deed:
    path = str(box.outside / "secret.urdf")

    def described(topic: str, data: bytes) -> bytes:
        named = b"\0\1\0\0" + struct.pack("<I", len(path) + 1) + path.encode() + b"\0"
        return named if topic == "/robot_description" else data

    return deed(box, copied(data=described))


@attack("path", "attachment that leads outside")
def _(box: Box) -> Deed:
    body = struct.pack("<QQ", 0, 0) + text("../../outside/new") + text("x") + struct.pack("<Q", 3) + b"abc"
    return deed(box, recording(record(9, body + struct.pack("<I", zlib.crc32(body)))))


@attack("link", "link to a file of the system")
def _(box: Box) -> Deed:
    (box.here / "r.mcap").symlink_to("/proc/self/mem")
    return Deed(("r.mcap",), "rollout")


@attack("device", "endless device")
def _(box: Box) -> Deed:
    (box.here / "r.mcap").symlink_to("/dev/zero")
    return Deed(("compare", "r.mcap", "r.mcap"))


@attack("device", "pipe")
def _(box: Box) -> Deed:
    os.mkfifo(box.here / "r.mcap")
    return Deed(("view", "r.mcap", "--export", "r.html"))


@attack("bomb", "chunk that expands a thousandfold")
def _(box: Box) -> Deed:
    import zstandard

    data = zstandard.compress(bytes(3 * 10**9 // 2) * 2)
    return deed(box, recording(chunk(data, "zstd", 100)))


@attack("bomb", "chunks that state what they expand to")
def _(box: Box) -> Deed:
    import zstandard

    size = 2 * 10**8
    empty = record(5, bytes(22))
    data = zstandard.compress(empty * (size // len(empty)))
    return deed(box, recording(*[chunk(data, "zstd", size // len(empty) * len(empty))] * 20))


@attack("bomb", "chunk without a stated size")
def _(box: Box) -> Deed:
    import zstandard

    compressor = zstandard.ZstdCompressor(write_content_size=False).compressobj()
    data = b"".join([*(compressor.compress(bytes(10**8)) for _ in range(30)), compressor.flush()])
    return deed(box, recording(chunk(data, "zstd", 2**62)))


@attack("bomb", "frame that claims to be huge")
def _(box: Box) -> Deed:
    frame = b"\x28\xb5\x2f\xfd\xe0" + struct.pack("<Q", 2**38) + b"\x01\x00\x00"
    return deed(box, recording(chunk(frame, "zstd", 100)))


@attack("bomb", "records that claim to be huge")
def _(box: Box) -> Deed:
    return deed(box, recording(record(12, text("x"), 2**62)))


@attack("bomb", "index that names one chunk many times")
def _(box: Box) -> Deed:
    import zstandard

    message = record(5, struct.pack("<HIQQ", 1, 0, 0, 0))
    size = len(message) * 10**6
    start = MAGIC + record(1, text("ros2") + text("x"))
    part = chunk(zstandard.compress(message * 10**6), "zstd", size)
    channel = record(4, struct.pack("<HH", 1, 0) + text("/joint_states") + text("cdr") + bytes(4))
    index = struct.pack("<QQQQ", 0, 0, len(start), len(part)) + bytes(4) + struct.pack("<Q", 0) + text("zstd")
    summary = channel + record(8, index + struct.pack("<QQ", len(part), size)) * 500
    data = start + part + record(15, bytes(4))
    return deed(box, data + summary + record(2, struct.pack("<QQI", len(data), 0, 0)) + MAGIC)


@attack("bomb", "sparse file")
def _(box: Box) -> Deed:
    sparse(box.here / "r.mcap", 2**36, good())
    return Deed(("compare", "r.mcap", "r.mcap"))


@attack("bomb", "sequence that claims to be long")
def _(box: Box) -> Deed:
    def lengthened(topic: str, data: bytes) -> bytes:
        return data if topic != "/joint_states" else data[:12] + b"\xff" * 4 + data[16:]

    return deed(box, copied(data=lengthened))


@attack("recursion", "deep metadata")
def _(box: Box) -> Deed:
    return deed(box, copied(set_to(rotors="[" * 10**5)))


@attack("recursion", "chunk in a chunk")
def _(box: Box) -> Deed:
    inside = b""
    for _ in range(2000):
        inside = chunk(inside, "", len(inside))
    return deed(box, recording(inside))


@attack("type", "metadata of other types")
def _(box: Box) -> Deed:
    return deed(box, copied(set_to(rotors='{"a": [NaN]}', gravity='"x"', base="3", base_pose="[1e999]")))


@attack("type", "messages that are cut")
def _(box: Box) -> Deed:
    return deed(box, copied(data=lambda _, data: data[:7]))


@attack("type", "text in the place of text, not in UTF-8")
def _(box: Box) -> Deed:
    return deed(box, recording(record(12, struct.pack("<I", 4) + b"\xff\xfe\xfd\xfc")))


@attack("type", "compression that nobody has")
def _(box: Box) -> Deed:
    return deed(box, recording(chunk(b"x", "os.system", 1)))


@attack("type", "checksum that is wrong")
def _(box: Box) -> Deed:
    return deed(box, recording(chunk(b"xyz", "", 3, crc=1)))


@attack("terminal", "escape sequences in topics")
def _(box: Box) -> Deed:
    return deed(box, copied(topic=lambda name: f"{name}\x1b[2J\u202e"))


@attack("terminal", "escape sequences in the settings")
def _(box: Box) -> Deed:
    return deed(box, copied(set_to(schema="\x1b]0;owned\x07\u202e", base="\x1b[2J")))


@attack("printf", "formats in metadata")
def _(box: Box) -> Deed:
    return deed(box, copied(set_to(base="%s%n{0.__class__}", rotors=json.dumps("%d%n"))))
