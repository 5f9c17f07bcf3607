"""Attacks on files, of the kinds that were published against other readers of the same formats."""

from __future__ import annotations

import bz2
import io
import json
import lzma
import os
import pickle
import shutil
import struct
import tarfile
import zipfile
import zlib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from tests.security.attack import TRAINING, Box, Deed, Harmful, archive_of, attacks_on, sparse
from tests.security.surfaces import arrays, description, mesh, recording, scene, table, world_state

TEN_THOUSAND_DIGITS = "9" * 10_000
"""Number that Python refuses to read, because that takes long."""

LONE = "\ud800\udfff"[:1]
"""Half of a pair of surrogates, which no stream can write."""


# -- archives -------------------------------------------------------------------------------------


def overlapping(members: dict[str, bytes], name: str, data: bytes, count: int) -> bytes:
    """Return an archive in which many members are one and the same compressed stretch (Fifield, 2019)."""
    content = bytearray(archive_of({**members, name: data}, zipfile.ZIP_DEFLATED))
    begin = content.rindex(b"PK\x01\x02")
    end = content.rindex(b"PK\x05\x06")
    entry = bytes(content[begin:end])
    directory = struct.unpack_from("<I", content, end + 16)[0]
    copies = b"".join(entry.replace(name.encode(), f"{k:0{len(name)}d}".encode()) for k in range(count))
    out = content[:begin] + entry + copies
    total = len(members) + 1 + count
    return bytes(
        out + b"PK\x05\x06\0\0\0\0" + struct.pack("<HHIIH", total, total, len(out) - directory, directory, 0)
    )


def with_method(members: dict[str, bytes], name: str, method: int, data: bytes, size: int) -> bytes:
    """Return an archive with a member that states a method of compression and a size, with any data."""
    content = bytearray(archive_of({**members, name: data}))
    for mark, offset in ((b"PK\x03\x04", 8), (b"PK\x01\x02", 10)):
        at = content.rindex(mark, 0, content.rindex(name.encode()) if mark[2] == 1 else None)
        if mark[2] == 3:
            at = content.index(name.encode()) - 30
        struct.pack_into("<H", content, at + offset, method)
        struct.pack_into("<I", content, at + offset + 14, size)
    return bytes(content)


def wide_window() -> bytes:
    """Return LZMA data, as in archives, whose dictionary is of four gigabytes."""
    packed = lzma.compress(bytes(10**6), lzma.FORMAT_ALONE)
    properties = packed[:1] + struct.pack("<I", 0xFFFFFFFF)
    return b"\x09\x14\x05\x00" + properties + packed[13:]


def encrypted(members: dict[str, bytes], name: str) -> bytes:
    """Return an archive with a member that is marked as encrypted."""
    content = bytearray(archive_of(members))
    struct.pack_into("<H", content, content.index(name.encode()) - 30 + 6, 1)
    struct.pack_into("<H", content, content.rindex(name.encode()) - 46 + 8, 1)
    return bytes(content)


def archives(
    members: Callable[[], dict[str, bytes]], important: str
) -> Iterator[tuple[str, str, Callable[[], bytes]]]:
    """Yield attacks by an archive of the right members: kind, name and content."""
    yield "bomb", "members that are one stretch", lambda: overlapping(members(), "x" * 8, bytes(10**8), 400)
    yield (
        "bomb",
        "dictionary of four gigabytes",
        lambda: with_method(members(), important, zipfile.ZIP_LZMA, wide_window(), 10**6),
    )
    yield (
        "bomb",
        "compressed twice by bzip2",
        lambda: with_method(members(), important, zipfile.ZIP_BZIP2, bz2.compress(bytes(10**9)), 100),
    )
    yield "type", "encrypted member", lambda: encrypted(members(), important)
    yield (
        "type",
        "method of compression that nobody has",
        lambda: with_method(members(), important, 99, b"x", 1),
    )
    yield (
        "bomb",
        "hundred thousand members",
        lambda: archive_of({**members(), **{f"{k}": b"" for k in range(10**5)}}),
    )
    yield (
        "terminal",
        "escape sequences in names of members",
        lambda: archive_of({"\x1b]0;owned\x07": b"", "\u202e\x9b2J": b"x", **members()}),
    )
    yield (
        "type",
        "program in front of the archive",
        lambda: b"#!/bin/sh\ntouch owned\n" * 100 + archive_of(members()),
    )
    yield (
        "type",
        "directory that lies in front of the file",
        lambda: archive_of(members())[:-6] + struct.pack("<I", 0xFFFFFF00) + b"\0\0",
    )


attack = attacks_on("npz")
for _kind, _name, _content in archives(lambda: dict(arrays.members()), "q.npy"):

    def _prepare(box: Box, content: Callable[[], bytes] = _content) -> Deed:
        return Deed((box.file("r.npz", content()),), "rollout", (0, 2))

    attack(_kind, f"archive: {_name}")(_prepare)


@attack("recursion", "header of many brackets")
def _(box: Box) -> Deed:
    text = "{'descr': '<f8', 'fortran_order': False, 'shape': " + "(" * 4000 + ")" * 4000 + "}"
    return arrays.deed(box, q=arrays.header(text, bytes(8)))


@attack("bomb", "header that multiplies")
def _(box: Box) -> Deed:
    text = "{'descr': '<f8', 'fortran_order': False, 'shape': (9**9**9,)}"
    return arrays.deed(box, q=arrays.header(text, bytes(8)))


@attack("bomb", "array of arrays by its type")
def _(box: Box) -> Deed:
    text = "{'descr': ('<f8', (1000000000,)), 'fortran_order': False, 'shape': (2,)}"
    return arrays.deed(box, q=arrays.header(text, bytes(8)))


@attack("bomb", "records of no size without end")
def _(box: Box) -> Deed:
    text = "{'descr': '|V0', 'fortran_order': False, 'shape': (4611686018427387904,)}"
    return arrays.deed(box, q=arrays.header(text))


@attack("bomb", "lengths whose product is small again")
def _(box: Box) -> Deed:
    text = f"{{'descr': '<f8', 'fortran_order': False, 'shape': ({2**33}, {2**31}, 3)}}"
    return arrays.deed(box, q=arrays.header(text, bytes(24)))


@attack("type", "times in the place of numbers")
def _(box: Box) -> Deed:
    n = len(arrays.rollout().t)
    return arrays.deed(box, t=arrays.npy(np.arange(n).astype("datetime64[s]")))


@attack("terminal", "type with escape sequences")
def _(box: Box) -> Deed:
    text = "{'descr': [('\x1b[2J\x9b', '<f8')], 'fortran_order': False, 'shape': (1,)}"
    return arrays.deed(box, q=arrays.header(text, bytes(8)))


@attack("type", "half of a pair of surrogates in the document")
def _(box: Box) -> Deed:
    document = '{"schema": "\\ud800", "scenario": {"name": "\\udfff"}}'
    return arrays.deed(box, robot=arrays.npy(np.array(document)))


@attack("type", "number of ten thousand digits in the document")
def _(box: Box) -> Deed:
    return arrays.deed(box, robot=arrays.npy(np.array(f'{{"schema": {TEN_THOUSAND_DIGITS}}}')))


@attack("code", "class by way of another name")
def _(box: Box) -> Deed:
    return arrays.named(box, "dynx.registry:import_module", {"name": "planted"})


@attack("code", "function of numpy as a class")
def _(box: Box) -> Deed:
    return arrays.named(box, "numpy:fromfile", {"file": str(box.outside / "secret.bin")})


@attack("path", "class that opens the file that it is given")
def _(box: Box) -> Deed:
    return arrays.named(box, "dynx.model.geometry.mesh:Mesh", {"path": str(box.outside / "secret.stl")})


@attack("bomb", "steps of a rerun without end")
def _(box: Box) -> Deed:
    document = json.loads(str(np.load(io.BytesIO(arrays.members()["robot.npy"]))))
    document["scenario"].update(duration={"float": "1e9"}, dt={"float": "1e-9"})
    content = archive_of({**arrays.members(), "robot.npy": arrays.npy(np.array(json.dumps(document)))})
    return Deed(("compare", box.file("r.npz", content), "r.npz"), ends=(0, 1, 2))


# -- tables ---------------------------------------------------------------------------------------

attack = attacks_on("csv")


@attack("bomb", "times whose smallest step is tiny")
def _(box: Box) -> Deed:
    return table.deed(box, "t,q:joint\n0,0\n1e-12,1\n1e6,2\n", (0, 1, 2))


@attack("bomb", "two logs with other steps")
def _(box: Box) -> Deed:
    box.file("a.csv", "t,q:joint\n0,0\n1e-300,1\n1e300,2\n")
    box.file("b.csv", "t,q:joint\n0,0\n1,1\n2,2\n")
    return Deed(("compare", "a.csv", "b.csv", "--robot", table.robot(box)), ends=(0, 1, 2))


@attack("bomb", "number of a million digits")
def _(box: Box) -> Deed:
    return table.deed(box, f"t,q:joint\n0,{'1' * 10**6}\n1,0.{'3' * 10**6}\n", (0, 1, 2))


@attack("bomb", "million columns of other names")
def _(box: Box) -> Deed:
    names = ",".join(f"q:j{k}" for k in range(10**6))
    return table.deed(box, f"t,{names}\n0\n1\n")


@attack("bomb", "line break in quotes, ten million times")
def _(box: Box) -> Deed:
    return table.deed(box, b't,q:joint\n0,"' + b"\n" * 10**7 + b'"\n1,1\n')


@attack("type", "old line breaks, and a mark at the beginning")
def _(box: Box) -> Deed:
    return table.deed(box, b"\xef\xbb\xbft,q:joint\r0,0\r1,1\r2,4\r", (0, 1, 2))


@attack("type", "minus signs and blanks of other scripts")
def _(box: Box) -> Deed:
    return table.deed(box, "t,q:joint\n0,\u22121\n1,\u00a02\u2009\n2,\uff13\n", (0, 1, 2))


@attack("type", "time that goes back, stands, and is no number")
def _(box: Box) -> Deed:
    return table.deed(box, "t,q:joint\n0,0\n0,1\n-1,2\nnan,3\n")


@attack("type", "separator that is stated, as spreadsheets do")
def _(box: Box) -> Deed:
    return table.deed(box, "sep=;\nt;q:joint\n0;=cmd|'/C calc'!A0\n1;@SUM(1)\n")


@attack("code", "formula behind a wide sign")
def _(box: Box) -> Deed:
    return table.written(box, "\uff1dcmd|'/C calc'!A0")


@attack("code", "exchange of data in the name of a joint")
def _(box: Box) -> Deed:
    return table.written(box, '+DDE("cmd";"/C calc";"x")')


@attack("terminal", "controls of eight bits in cells")
def _(box: Box) -> Deed:
    return table.deed(box, "t,q:joint\n0,\x9b2J\x90\x85\n1,\u2028\u2066\n".encode("latin-1", "ignore"))


# -- recordings -----------------------------------------------------------------------------------

attack = attacks_on("mcap")


def _schema(text: str, name: str = "sensor_msgs/msg/JointState") -> bytes:
    """Return the record of a schema of ROS 2."""
    return recording.record(
        3,
        struct.pack("<H", 1)
        + recording.text(name)
        + recording.text("ros2msg")
        + struct.pack("<I", len(text.encode()))
        + text.encode(),
    )


def _channel(topic: str = "/joint_states", schema: int = 1, encoding: str = "cdr") -> bytes:
    return recording.record(
        4,
        struct.pack("<HH", 1, schema)
        + recording.text(topic)
        + recording.text(encoding)
        + struct.pack("<I", 0),
    )


def _message(data: bytes, channel: int = 1, time: int = 0) -> bytes:
    return recording.record(5, struct.pack("<HIQQ", channel, 0, time, time) + data)


def _with_schema(box: Box, text: str, data: bytes = b"\0\1\0\0" + bytes(64)) -> Deed:
    content = recording.recording(_schema(text), _channel(), _message(data))
    return Deed((box.file("r.mcap", content), table.robot(box)), "table", (2,))


@attack("recursion", "type of message that contains itself")
def _(box: Box) -> Deed:
    line = "=" * 80
    return _with_schema(box, f"test_msgs/A a\n{line}\nMSG: test_msgs/A\ntest_msgs/A a\n")


@attack("recursion", "types of message in a circle")
def _(box: Box) -> Deed:
    line = "=" * 80
    types = f"MSG: test_msgs/A\ntest_msgs/B b\n{line}\nMSG: test_msgs/B\ntest_msgs/A[] a\n"
    return _with_schema(box, f"test_msgs/A a\n{line}\n{types}")


@attack("bomb", "array of fixed length without end")
def _(box: Box) -> Deed:
    return _with_schema(box, "float64[4000000000] position\n")


@attack("bomb", "types that double in each other")
def _(box: Box) -> Deed:
    line = "=" * 80
    parts = [f"test_msgs/T{k + 1} a\ntest_msgs/T{k + 1} b\n" for k in range(40)]
    text = parts[0] + "".join(f"{line}\nMSG: test_msgs/T{k}\n{part}" for k, part in enumerate(parts[1:], 1))
    return _with_schema(box, f"{text}{line}\nMSG: test_msgs/T40\nfloat64 x\n")


@attack("bomb", "pattern of a schema that never matches")
def _(box: Box) -> Deed:
    return _with_schema(box, "string" + " " * 10**6 + "x" + "=" * 10**6 + "\n")


@attack("code", "default values that are expressions")
def _(box: Box) -> Deed:
    return _with_schema(box, f"float64[] position {box.code}\nint32 X={box.code}\n")


@attack("type", "channel without a schema, and message without a channel")
def _(box: Box) -> Deed:
    content = recording.recording(_channel(schema=7), _message(b"\0\1\0\0"), _message(b"", channel=9))
    return Deed((box.file("r.mcap", content), table.robot(box)), "table", (2,))


@attack("type", "messages in other encodings of CDR")
def _(box: Box) -> Deed:
    def other(_: str, data: bytes) -> bytes:
        return b"\0\x0b\0\3" + data[4:]

    return recording.deed(box, recording.copied(data=other), (0, 2))


@attack("type", "times at the end of all times")
def _(box: Box) -> Deed:
    content = recording.recording(
        _schema("string[] name\nfloat64[] position\n"),
        _channel(),
        *(_message(b"\0\1\0\0" + bytes(8), time=each) for each in (2**64 - 1, 0, 2**63, 1)),
    )
    return Deed((box.file("r.mcap", content), table.robot(box)), "table", (2,))


@attack("bomb", "window of zstd of two gigabytes")
def _(box: Box) -> Deed:
    frame = b"\x28\xb5\x2f\xfd\x00" + bytes([(31 - 10) << 3]) + b"\x03\x00\x00" + b"\x02\x00\x10" + b"a"
    return recording.deed(box, recording.recording(recording.chunk(frame, "zstd", 2 * 10**9)))


@attack("bomb", "frames of zstd that are skipped, and empty ones")
def _(box: Box) -> Deed:
    skipped = b"\x50\x2a\x4d\x18" + struct.pack("<I", 0)
    return recording.deed(box, recording.recording(recording.chunk(skipped * 10**6, "zstd", 10)))


@attack("bomb", "blocks of lz4 that repeat one another")
def _(box: Box) -> Deed:
    block = b"\x1f" + b"a" + b"\x01\x00" + b"\xff" * 4 * 10**6 + b"\0"
    frame = b"\x04\x22\x4d\x18\x60\x70\x73" + struct.pack("<I", len(block)) + block + bytes(4)
    return recording.deed(box, recording.recording(recording.chunk(frame, "lz4", 10**9)))


@attack("bomb", "million attachments and metadata")
def _(box: Box) -> Deed:
    each = recording.record(12, recording.text("a") + struct.pack("<I", 0))
    return recording.deed(box, recording.recording(each * 10**6))


@attack("recursion", "summary that begins at its own end")
def _(box: Box) -> Deed:
    content = bytearray(recording.good())
    at = len(content) - 8 - 20
    struct.pack_into("<QQ", content, at, at - 9, 8)
    return recording.deed(box, bytes(content), (0, 2))


@attack("type", "half of a pair of surrogates, and digits without end, in metadata")
def _(box: Box) -> Deed:
    wrong = {"scenario": '{"a": "\\ud800"}', "robot": TEN_THOUSAND_DIGITS, "schema": "\\udfff"}

    def change(_: str, metadata: dict[str, str]) -> object:
        return metadata.update({name: wrong.get(name, f"[{TEN_THOUSAND_DIGITS}]") for name in metadata})

    return recording.deed(box, recording.copied(change))


# -- meshes ---------------------------------------------------------------------------------------

attack = attacks_on("mesh")

TEXTURED = (
    "mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nvt 0 0\nvt 1 0\nvt 0 1\nusemtl m\n"
    "f 1/1 2/2 3/3\nf 1/1 2/2 4/3\nf 1/1 3/2 4/3\nf 2/1 3/2 4/3\n"
)


def drawn(box: Box, material: str, ends: tuple[int, ...] = (0, 2), **files: bytes) -> Deed:
    """Write a mesh with a material, which the victim draws."""
    box.file("m.mtl", f"newmtl m\nKd 1 0 0\n{material}")
    box.file("m.obj", TEXTURED)
    for name, content in files.items():
        box.file(name.replace("_", "."), content)
    return seen(box, "m.obj", ends)


def seen(box: Box, name: str, ends: tuple[int, ...] = (0, 2)) -> Deed:
    """Let the victim draw a mesh."""
    visual = f'<visual><geometry><mesh filename="{name}"/></geometry></visual>'
    words = ("view", box.file("r.urdf", description.arm(extra=visual)), "--export", "out.html")
    return Deed(words, ends=ends, check=_shows_no_secret(box.here / "out.html"))


def _shows_no_secret(path: Path) -> Callable[[str], str | None]:
    import base64

    from tests.security.attack import SECRET

    def check(_: str) -> str | None:
        if not path.exists():
            return None
        content = path.read_bytes()
        words = (SECRET.encode(), base64.b64encode(SECRET.encode())[:20])
        return "the page has a secret" if any(word in content for word in words) else None

    return check


def png(width: int, height: int, rows: bytes | None = None, extra: bytes = b"") -> bytes:
    """Return a picture of one colour."""

    def part(name: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))

    if rows is None:
        packer = zlib.compressobj(9)
        line = bytes(1 + (width + 7) // 8)
        rows = b"".join(packer.compress(line) for _ in range(height)) + packer.flush()
    head = part(b"IHDR", struct.pack(">IIBBBBB", width, height, 1, 0, 0, 0, 0))
    return b"\x89PNG\r\n\x1a\n" + head + extra + part(b"IDAT", rows) + part(b"IEND", b"")


@attack("path", "image of a material outside")
def _(box: Box) -> Deed:
    (box.outside / "secret.png").write_bytes(png(8, 8))
    return drawn(box, "map_Kd ../outside/secret.png\n")


@attack("path", "image of a material by its full path and behind options")
def _(box: Box) -> Deed:
    (box.outside / "secret.png").write_bytes(png(8, 8))
    return drawn(
        box, f"map_Kd -s 1 1 1 -clamp on {box.outside}/secret.png\nmap_Ka file://{box.outside}/secret.txt\n"
    )


@attack("path", "library of materials outside")
def _(box: Box) -> Deed:
    (box.outside / "secret.mtl").write_text("newmtl m\nmap_Kd secret.txt\n")
    box.file("m.obj", TEXTURED.replace("m.mtl", "../outside/secret.mtl"))
    return seen(box, "m.obj")


@attack("link", "image of a material that leads outside")
def _(box: Box) -> Deed:
    (box.outside / "secret.png").write_bytes(png(8, 8))
    (box.here / "i.png").symlink_to(box.outside / "secret.png")
    return drawn(box, "map_Kd i.png\n")


@attack("device", "image of a material that is an endless device")
def _(box: Box) -> Deed:
    (box.here / "i.png").symlink_to("/dev/zero")
    return drawn(box, "map_Kd i.png\n")


@attack("device", "image and library of materials that are pipes")
def _(box: Box) -> Deed:
    os.mkfifo(box.here / "i.png")
    os.mkfifo(box.here / "n.mtl")
    deed = drawn(box, "map_Kd i.png\n")
    box.file("m.obj", TEXTURED.replace("m.mtl", "n.mtl m.mtl"))
    return deed


@attack("bomb", "image of a billion pixels")
def _(box: Box) -> Deed:
    return drawn(box, "map_Kd i.png\n", i_png=png(32_000, 32_000))


@attack("bomb", "image that states to be larger than all memory")
def _(box: Box) -> Deed:
    return drawn(box, "map_Kd i.png\n", i_png=png(2**31 - 1, 2**31 - 1, zlib.compress(bytes(1000))))


@attack("bomb", "text of an image that is compressed")
def _(box: Box) -> Deed:
    data = b"Comment\0\0" + zlib.compress(bytes(10**9), 9)
    text = struct.pack(">I", len(data)) + b"zTXt" + data + struct.pack(">I", zlib.crc32(b"zTXt" + data))
    return drawn(box, "map_Kd i.png\n", i_png=png(8, 8, extra=text))


@attack("code", "image that is PostScript")
def _(box: Box) -> Deed:
    program = f"%!PS-Adobe-3.0 EPSF-3.0\n%%BoundingBox: 0 0 9 9\n(%pipe%touch {box.owned}) (w) file\n"
    return drawn(box, "map_Kd i.eps\nmap_Ka i.png\n", i_eps=program.encode(), i_png=program.encode())


@attack("path", "image that is a drawing with another file in it")
def _(box: Box) -> Deed:
    svg = (
        f'<svg xmlns:x="http://www.w3.org/1999/xlink"><image x:href="file://{box.outside}/secret.txt"/></svg>'
    )
    return drawn(box, "map_Kd i.svg\nmap_Ka i.png\n", i_svg=svg.encode(), i_png=svg.encode())


@attack("type", "images of other kinds, cut and of no size")
def _(box: Box) -> Deed:
    return drawn(
        box,
        "map_Kd i.png\nmap_Ka j.png\nmap_Ks k.gif\n",
        i_png=png(0, 0),
        j_png=png(8, 8)[:-30],
        k_gif=b"GIF89a\xff\xff\xff\xff\x80\0\0" + b"\0" * 6,
    )


@attack("bomb", "materials without end")
def _(box: Box) -> Deed:
    return drawn(box, "".join(f"newmtl m{k}\n" for k in range(5 * 10**5)) + "newmtl\n" * 10**6)


@attack("code", "commands of the format in OBJ")
def _(box: Box) -> Deed:
    lines = f"csh touch {box.owned}\ncsh -{box.code}\ncall ../outside/secret.obj a b\n"
    lines += "maplib ../outside/secret.txt\n"
    return mesh.deed(box, "m.obj", f"{lines}shadow_obj ../outside/secret.obj\n{mesh.TETRAHEDRON}", (0, 2))


@attack("path", "image of COLLADA by its address")
def _(box: Box) -> Deed:
    library = (
        "<library_images><image id='i'><init_from>../outside/secret.txt</init_from></image></library_images>"
    )
    effect = (
        "<library_effects><effect id='e'><profile_COMMON><newparam sid='s'><surface type='2D'><init_from>i"
        "</init_from></surface></newparam></profile_COMMON></effect></library_effects>"
    )
    return mesh.deed(box, "m.dae", mesh.collada(library + effect), (0, 2))


@attack("path", "archive of COLLADA whose manifest leads outside")
def _(box: Box) -> Deed:
    content = archive_of({"manifest.xml": b"<dae_root>../outside/secret.txt</dae_root>"})
    return mesh.deed(box, "m.zae", content)


@attack("bomb", "compressed glTF that claims to be large")
def _(box: Box) -> Deed:
    draco = {"extensions": {"KHR_draco_mesh_compression": {"bufferView": 0, "attributes": {"POSITION": 0}}}}
    primitive = {"attributes": {"POSITION": 0}, **draco}
    text = mesh.gltf(
        [mesh.INLINE],
        {"count": 2**40},
        meshes=[{"primitives": [primitive]}],
        extensionsRequired=["KHR_draco_mesh_compression"],
    )
    return mesh.deed(box, "m.gltf", text)


@attack("bomb", "sparse accessor of glTF")
def _(box: Box) -> Deed:
    indices = {"bufferView": 0, "componentType": 5125}
    text = mesh.gltf(
        [mesh.INLINE],
        {"count": 3 * 10**9, "sparse": {"count": 1, "indices": indices, "values": {"bufferView": 0}}},
    )
    return mesh.deed(box, "m.gltf", text)


@attack("type", "points that lie in a plane, in one place, and beyond all floats")
def _(box: Box) -> Deed:
    flat = "".join(f"v {k} {k} 0\n" for k in range(100)) + "f 1 2 3\nf 4 5 6\n"
    box.file("flat.obj", flat)
    huge = mesh.TETRAHEDRON.replace("1", "1e308").replace("f 1e308", "f 1")
    return mesh.simulated(box, "m.obj", huge)


# -- descriptions ---------------------------------------------------------------------------------

attack = attacks_on("urdf")


@attack("path", "settings of MuJoCo in a URDF")
def _(box: Box) -> Deed:
    setting = f'<mujoco><compiler meshdir="{box.outside}" discardvisual="false"/></mujoco>'
    text = description.arm(extra=description.mesh("secret.stl"))
    return description.every_engine(box, text.replace('name="r">', f'name="r">{setting}'))


@attack("path", "inclusion of MuJoCo in a URDF")
def _(box: Box) -> Deed:
    include = f'<mujoco><include file="{box.outside}/secret.urdf"/></mujoco>'
    text = description.arm().replace(
        'name="r">', f'name="r">{include}<include file="../outside/secret.urdf"/>'
    )
    return description.every_engine(box, text)


@attack("code", "plugins of Gazebo, ROS and MuJoCo")
def _(box: Box) -> Deed:
    box.file("evil.so", b"\x7fELF" + bytes(100))
    plugins = (
        '<gazebo><plugin name="p" filename="./evil.so"/></gazebo><ros2_control name="r" type="system">'
        "<hardware>"
        '<plugin>evil/System</plugin></hardware></ros2_control><mujoco><extension><plugin plugin="evil">'
        "</plugin></extension></mujoco>"
    )
    return description.every_engine(box, description.arm().replace('name="r">', f'name="r">{plugins}'))


@attack("device", "manifest of a package that is a pipe")
def _(box: Box) -> Deed:
    (box.here / "p").mkdir()
    for folder in (box.here, box.here / "p"):
        os.mkfifo(folder / "package.xml")
        os.mkfifo(folder / "manifest.xml")
    return description.info(box, description.arm(extra=description.mesh("package://p/m.stl")), (0, 2))


@attack("device", "manifest of a package that is an endless device")
def _(box: Box) -> Deed:
    (box.here / "p").mkdir()
    (box.here / "package.xml").symlink_to("/dev/zero")
    (box.here / "p" / "package.xml").symlink_to("/dev/zero")
    text = description.arm(extra=description.mesh("package://other/m.stl"))
    return description.every_engine(box, text)


@attack("link", "folders of a package that contain themselves")
def _(box: Box) -> Deed:
    box.file("package.xml", "<package><name>x</name></package>")
    for k in range(8):
        folder = box.here / f"d{k}"
        folder.mkdir()
        for j in range(8):
            (folder / f"up{j}").symlink_to("..")
    return description.info(box, description.arm(extra=description.mesh("package://p/m.stl")), (0, 2))


@attack("link", "package that leads outside")
def _(box: Box) -> Deed:
    box.file("package.xml", "<package><name>x</name></package>")
    (box.here / "p").symlink_to(box.outside)
    return description.every_engine(box, description.arm(extra=description.mesh("package://p/secret.stl")))


@attack("path", "name of a package that leads up")
def _(box: Box) -> Deed:
    for name in ("..", ".", "../outside", "x/../../outside", "%2e%2e/outside"):
        mesh_of = description.mesh(f"package://{name}/secret.stl") + description.mesh(
            f"model://{name}/secret.stl"
        )
    return description.every_engine(box, description.arm(extra=mesh_of))


@attack("path", "meshes by the files that a process has open")
def _(box: Box) -> Deed:
    names = (
        "/proc/self/fd/0",
        "/dev/stdin",
        "file:///proc/self/environ",
        "/proc/self/cmdline",
        "\\\\host\\a.stl",
    )
    return description.every_engine(box, description.arm(extra="".join(map(description.mesh, names))))


@attack("type", "names of files that are too long, and end in the middle")
def _(box: Box) -> Deed:
    names = ("a" * 5000 + ".stl", "m.stl\t", "m" + "/a" * 3000 + ".stl", "~root/m.stl", "$HOME/m.stl", " ")
    return description.every_engine(box, description.arm(extra="".join(map(description.mesh, names))))


@attack("recursion", "entities in one another, a hundred thousand deep")
def _(box: Box) -> Deed:
    chain = "".join(f'<!ENTITY e{k} "&e{k + 1};">' for k in range(10**5))
    text = f'<!DOCTYPE r [{chain}<!ENTITY e{10**5} "x">]><robot name="&e0;"><link name="a"/></robot>'
    return description.info(box, text)


@attack("recursion", "parameter entities in one another")
def _(box: Box) -> Deed:
    inner = "<!ENTITY &#37; b SYSTEM 'http://192.0.2.1/%c;'>"
    return description.info(box, f'<!DOCTYPE r [<!ENTITY % a "{inner}">%a;%b;]><robot name="r"/>')


@attack("bomb", "hundred thousand namespaces")
def _(box: Box) -> Deed:
    spaces = " ".join(f'xmlns:n{k}="u{k}"' for k in range(10**5))
    return description.info(box, f'<robot name="r" {spaces}><link name="a"/></robot>', (0, 2))


@attack("bomb", "token that is read again and again")
def _(box: Box) -> Deed:
    return description.info(
        box, f'<robot name="r"><!--{"-x" * (2 * 10**7)}--><link name="a"/></robot>', (0, 2)
    )


@attack("type", "encodings that hide the elements")
def _(box: Box) -> Deed:
    text = '<?xml version="1.1" encoding="UTF-7"?>+ADw-robot name=+ACI-r+ACI-+AD4-'
    return description.info(box, text)


@attack("type", "encoding that is a codec of Python")
def _(box: Box) -> Deed:
    text = b'<?xml version="1.0" encoding="zlib_codec"?>' + zlib.compress(bytes(10**8))
    return description.info(box, text)


@attack("terminal", "escape sequences in instructions and the name of the encoding")
def _(box: Box) -> Deed:
    text = b'<?xml version="1.0" encoding="\x1b[2J\x9b"?><?x \x1b]0;owned\x07?>'
    return description.info(box, text + b'<robot name="r"><\x1b[2J/></robot>')


@attack("bomb", "xacro with aliases of YAML that grow")
def _(box: Box) -> Deed:
    lines = ["a0: &a0 [x, x, x, x, x, x, x, x, x, x]"]
    lines += [f"a{k}: &a{k} [{', '.join([f'*a{k - 1}'] * 10)}]" for k in range(1, 12)]
    box.file("b.yaml", "\n".join(lines))
    body = '<xacro:property name="y" value="${xacro.load_yaml(\'b.yaml\')}"/><link name="${len(str(y))}"/>'
    return description.info(box, description.xacro(body), name="r.xacro")


@attack("code", "xacro with YAML that makes objects")
def _(box: Box) -> Deed:
    box.file("b.yaml", f'!!python/object/apply:os.system ["touch {box.owned}"]\n')
    body = '<xacro:property name="y" value="${xacro.load_yaml(\'b.yaml\')}"/><link name="x${y}"/>'
    return description.info(box, description.xacro(body), name="r.xacro")


@attack("code", "xacro with the commands of ROS 1")
def _(box: Box) -> Deed:
    body = f'<link name="$(command touch {box.owned})"/><link name="$(eval {box.code})"/>'
    return description.info(box, description.xacro(body), name="r.xacro")


@attack("bomb", "xacro with a power without end")
def _(box: Box) -> Deed:
    return description.info(box, description.xacro('<link name="${10**10**8}"/>'), name="r.xacro")


@attack("terminal", "escape sequences in errors of xacro")
def _(box: Box) -> Deed:
    body = "<link name=\"${'\\x1b[2J\\x9b' + undefined}\"/><xacro:\u202eno/>"
    return description.info(box, description.xacro(body), name="r.xacro")


@attack("bomb", "warnings of xacro without end")
def _(box: Box) -> Deed:
    body = '<xacro:macro name="m" params="a"><link name="${a}"/></xacro:macro>' + "<m a='x'/>" * 10**5
    return description.info(box, description.xacro(body), ends=(0, 2), name="r.xacro")


@attack("html", "text of a report for machines that ends its elements")
def _(box: Box) -> Deed:
    name = "]]>&lt;/system-out>&lt;testcase name='owned'/>&amp;"
    text = description.arm(name.replace("&lt;", "<").replace("&amp;", "&")).replace('value="1"', 'value="-1"')

    def check(_: str) -> str | None:
        from xml.etree import ElementTree

        root = ElementTree.fromstring((box.here / "o.xml").read_bytes())
        json.loads((box.here / "o.sarif").read_text())
        return "a case of the attacker's" if root.findall(".//testcase[@name='owned']") else None

    return description.examined(box, text, "--junit", "o.xml", "--sarif", "o.sarif", check=check)


# -- scenes ---------------------------------------------------------------------------------------

attack = attacks_on("scene")
_ARM = "planar_3r"


def _sensor(box: Box, ends: tuple[int, ...] = (0, 1, 2), **values: Any) -> Deed:
    """Write a scene with a sensor on a body."""
    sensor = {"kind": "contact", "name": "s", "on": "b", **values}
    return scene.deed(box, {"bodies": [scene.BOX], "sensors": [sensor]}, ends=ends)


@attack("bomb", "sensor that measures without end")
def _(box: Box) -> Deed:
    return _sensor(box, rate=1e15)


@attack("bomb", "sensor that waits for ever")
def _(box: Box) -> Deed:
    return _sensor(box, rate=1e6, delay=1e9)


@attack("bomb", "hundred thousand sensors")
def _(box: Box) -> Deed:
    sensors = [{"kind": "contact", "name": f"s{k}", "on": "b"} for k in range(10**5)]
    return scene.deed(box, {"bodies": [scene.BOX], "sensors": sensors}, ends=(0, 1, 2))


@attack("code", "kind of a sensor that is a class")
def _(box: Box) -> Deed:
    box.file("planted.py", box.code)
    return _sensor(box, (2,), kind="planted:Own")


@attack("type", "sensors of other types")
def _(box: Box) -> Deed:
    return scene.deed(
        box, {"bodies": [scene.BOX], "sensors": [[1], None, {"kind": {}}, {"kind": "imu", "on": []}]}
    )


@attack("terminal", "escape sequences in sensors")
def _(box: Box) -> Deed:
    return _sensor(box, (2,), name="\x1b[2J\u202e", kind="\x9bx", on="\x07")


@attack("bomb", "groups that contain one another")
def _(box: Box) -> Deed:
    groups = {f"g{k}": [f"g{(k + 1) % 1000}"] * 100 for k in range(1000)}
    return scene.deed(box, {"bodies": [scene.BOX], "groups": groups, "ignored": [["g0", "g1"]]})


@attack("bomb", "million pairs that ignore one another")
def _(box: Box) -> Deed:
    return scene.deed(box, {"bodies": [scene.BOX], "ignored": [["b", "b"]] * 10**6}, ends=(0, 1, 2))


@attack("type", "other encodings of JSON")
def _(box: Box) -> Deed:
    text = json.dumps({**scene.HEAD, "bodies": [scene.BOX]})
    box.file("s.json", text.encode("utf-32"))
    return Deed(("world", "s.json", *scene.RUN), ends=(0, 2))


@attack("type", "half of a pair of surrogates, and digits without end")
def _(box: Box) -> Deed:
    text = f'{{"schema": "dynx.scene/1", "name": "\\ud800", "gravity": [{TEN_THOUSAND_DIGITS}, 0, 0]}}'
    return scene.deed(box, text)


@attack("terminal", "half of a pair of surrogates in names")
def _(box: Box) -> Deed:
    return scene.deed(
        box, '{"schema": "dynx.scene/1", "bodies": [{"name": "\\ud800", "shape": {"\\udfff": 1}}]}'
    )


@attack("type", "digits without end in TOML")
def _(box: Box) -> Deed:
    box.file("s.toml", f'schema = "dynx.scene/1"\ngravity = [{TEN_THOUSAND_DIGITS}, 0, 0]\n')
    return Deed(("world", "s.toml", *scene.RUN))


@attack("path", "mesh in the description of a robot of a scene")
def _(box: Box) -> Deed:
    (box.here / "sub").mkdir()
    (box.here / "sub" / "up").symlink_to("../../outside")
    text = description.arm(extra=description.mesh("sub/up/secret.stl"))
    return scene.deed(
        box, {"robots": [{"name": "a", "urdf": text, "mesh_folders": ["sub", "sub/up"]}]}, ends=(0, 1, 2)
    )


@attack("code", "xacro in the text of a robot, and behind a link")
def _(box: Box) -> Deed:
    (box.here / "r.urdf").symlink_to(box.outside / "secret.xacro")
    return scene.deed(box, {"robots": [{"name": "a", "robot": "r.urdf"}]})


@attack("printf", "names that are paths and programs in a film and an export")
def _(box: Box) -> Deed:
    body = {**scene.BOX, "name": "$(touch owned)`touch owned`;touch owned|%n"}
    return scene.deed(
        box,
        {"bodies": [body]},
        "--export",
        "o.xml",
        ends=(0, 1, 2),
    )


# -- worlds ---------------------------------------------------------------------------------------

attack = attacks_on("world")


@attack("code", "random numbers of a class of the attacker's")
def _(box: Box) -> Deed:
    state = {"bit_generator": "os:system", "state": {"state": 1, "inc": 1}}
    return world_state.changed(box, lambda header: header.update(random=state, rng=state), (0, 2))


@attack("code", "settings that are code")
def _(box: Box) -> Deed:
    return world_state.changed(box, lambda header: header["world"].update(settings={"timestep": box.code}))


@attack("path", "engine that is a path")
def _(box: Box) -> Deed:
    return world_state.changed(box, lambda header: header["world"].update(engine="../../outside/secret"))


@attack("path", "inclusion of MuJoCo in the text of a robot")
def _(box: Box) -> Deed:
    include = (
        f'<mujoco><compiler meshdir="{box.outside}"/><include file="{box.outside}/secret.urdf"/></mujoco>'
    )
    text = description.arm(extra=description.mesh("secret.stl")).replace('name="r">', f'name="r">{include}')
    return world_state.scene(box, robots=[{"name": "arm", "urdf": text}])


@attack("network", "folder of meshes elsewhere")
def _(box: Box) -> Deed:
    text = description.arm(extra=description.mesh("a.stl"))
    robot = {"name": "arm", "urdf": text, "mesh_folders": ["http://192.0.2.1/", "//192.0.2.1/share"]}
    return world_state.scene(box, robots=[robot])


@attack("bomb", "steps that were never taken")
def _(box: Box) -> Deed:
    return world_state.changed(box, lambda header: header.update(steps=10**15, time="0x1p+60"), (0, 2))


@attack("bomb", "sensors with samples without end")
def _(box: Box) -> Deed:
    sensor = {"kind": "contact", "name": "s", "on": "box", "rate": 1e12, "delay": 1e6}
    return world_state.scene(box, sensors=[sensor])


@attack("bomb", "substeps without end")
def _(box: Box) -> Deed:
    header, data = world_state.parts("mujoco")
    header = json.loads(json.dumps(header))
    header["world"]["options"].update(substeps=10**9)
    return world_state.deed(box, world_state.file_of(json.dumps(header).encode(), data), (0, 2), "2")


@attack("type", "half of a pair of surrogates, and digits without end")
def _(box: Box) -> Deed:
    text = f'{{"world": {{"engine": "\\ud800", "scene": {TEN_THOUSAND_DIGITS}}}}}'
    return world_state.deed(box, world_state.file_of(text.encode(), b""))


@attack("type", "header that is a list, a number and nothing")
def _(box: Box) -> Deed:
    return world_state.deed(box, world_state.file_of(b"[NaN, Infinity, -0]", bytes(9)))


@attack("type", "keys that are there twice")
def _(box: Box) -> Deed:
    header, data = world_state.parts("mujoco")
    text = json.dumps(header)
    return world_state.deed(
        box, world_state.file_of(f'{text[:-1]}, "world": {{}}, "world": null}}'.encode(), data)
    )


@attack("type", "states that are not finite")
def _(box: Box) -> Deed:
    header, data = world_state.parts("mujoco")
    wrong = np.full(len(data) // 8, np.nan).tobytes()
    return world_state.deed(box, world_state.file_of(json.dumps(header).encode(), wrong), (0, 2), "3")


@attack("terminal", "half of a pair of surrogates in names")
def _(box: Box) -> Deed:
    return world_state.scene(box, bodies=[{"name": LONE, "shape": {"box": [1, 1, 1]}}])


# -- policies and runs ----------------------------------------------------------------------------

if TRAINING:
    from tests.security.surfaces import policy, run_folder

    attack = attacks_on("policy")
    for _kind, _name, _content in archives(lambda: dict(policy.parts()), "policy.pth"):

        def _play(box: Box, content: Callable[[], bytes] = _content) -> Deed:
            return Deed(("play", box.file("p.zip", content()), *policy.PLAY), ends=(0, 2))

        attack(_kind, f"archive: {_name}")(_play)

    def _weights(box: Box, content: bytes) -> Deed:
        return policy.deed(box, {**policy.parts(), "policy.pth": content})

    def _hyperparameters(box: Box, **values: Any) -> Deed:
        return policy.changed(box, lambda document: document["spec"]["hyperparameters"].update(values))

    @attack("code", "weights in a tar archive, as PyTorch once wrote")
    def _(box: Box) -> Deed:
        content = io.BytesIO()
        with tarfile.open(fileobj=content, mode="w") as archive:
            for name in ("storages", "tensors", "pickle"):
                data = pickle.dumps(Harmful(box.owned), 2)
                info = tarfile.TarInfo(name)
                info.size = len(data)
                archive.addfile(info, io.BytesIO(data))
        return _weights(box, content.getvalue())

    @attack("code", "weights in PyTorch's old format")
    def _(box: Box) -> Deed:
        head = pickle.dumps(0x1950A86A20F9469CFC6C, 2) + pickle.dumps(1001, 2) + pickle.dumps({}, 2)
        return _weights(box, head + pickle.dumps(Harmful(box.owned), 2))

    @attack("code", "weights that are a program of TorchScript")
    def _(box: Box) -> Deed:
        members = {
            "archive/constants.pkl": pickle.dumps(Harmful(box.owned), 2),
            "archive/code/__torch__.py": f"def forward(self):\n  return {box.code}\n".encode(),
            "archive/data.pkl": pickle.dumps(Harmful(box.owned), 2),
            "archive/version": b"6\n",
        }
        return _weights(box, archive_of(members))

    @attack("code", "allowed names of PyTorch that lead to others")
    def _(box: Box) -> Deed:
        program = b"\x80\x02c__builtin__\ngetattr\nctorch\n_utils\nU\x0c_rebuild_xla\x86R."
        return _weights(box, policy.torch_file(program))

    @attack("bomb", "weights whose storage claims to be large")
    def _(box: Box) -> Deed:
        import torch

        content = io.BytesIO()
        torch.save({"log_std": torch.zeros(4)}, content)
        data = content.getvalue().replace(b"K\x04", b"J\xff", 1)
        return _weights(box, data)

    @attack("bomb", "text of a pickle that claims to be large")
    def _(box: Box) -> Deed:
        program = b"\x80\x04\x8d" + struct.pack("<Q", 2**62) + b"x."
        return _weights(box, policy.torch_file(program))

    @attack("code", "classes by name in the settings of the networks")
    def _(box: Box) -> Deed:
        options = {
            "activation_fn": "os:system",
            "optimizer_class": "os.system",
            "optimizer_kwargs": {"lr": box.code},
        }
        return _hyperparameters(box, policy_kwargs=options)

    @attack("path", "folders in the settings of the algorithm")
    def _(box: Box) -> Deed:
        return _hyperparameters(
            box, tensorboard_log=str(box.outside), monitor_dir="../outside", device="cuda:99"
        )

    @attack("path", "model of MuJoCo in the options of a task")
    def _(box: Box) -> Deed:
        (box.outside / "secret.xml").write_text("<mujoco><worldbody/></mujoco>")
        return policy.task(box, id="HalfCheetah-v5", options={"xml_file": "../outside/secret.xml"})

    @attack("path", "model of MuJoCo that is a plain word")
    def _(box: Box) -> Deed:
        (box.here / "evil").symlink_to(box.outside / "secret.urdf")
        return policy.task(box, id="HalfCheetah-v5", options={"xml_file": "evil"})

    @attack("bomb", "episode without end")
    def _(box: Box) -> Deed:
        return policy.task(box, id="Pendulum-v1", options={"max_episode_steps": 10**15})

    @attack("bomb", "task of a size without end")
    def _(box: Box) -> Deed:
        return policy.task(box, id="FrozenLake-v1", options={"desc": ["S" * 10**5] * 100})

    @attack("bomb", "picture of a task without end")
    def _(box: Box) -> Deed:
        return policy.changed(
            box,
            lambda document: document["spec"]["task"].update(
                id="dynx/CartPole-v0", options={"render_mode": "rgb_array", "width": 10**6, "height": 10**6}
            ),
        )

    @attack("bomb", "hundred thousand layers")
    def _(box: Box) -> Deed:
        return _hyperparameters(box, policy_kwargs={"net_arch": [1] * 10**5})

    @attack("type", "half of a pair of surrogates, and digits without end")
    def _(box: Box) -> Deed:
        text = f'{{"schema": "\\ud800", "spec": {TEN_THOUSAND_DIGITS}}}'
        return policy.deed(box, {**policy.parts(), "dynx.json": text.encode()})

    @attack("terminal", "half of a pair of surrogates in the id of the task")
    def _(box: Box) -> Deed:
        return policy.task(box, id=f"CartPole{LONE}-v1")

    @attack("code", "engine that is a class")
    def _(box: Box) -> Deed:
        box.file("planted.py", box.code)
        return policy.task(box, id="dynx/CartPole-v0", engine="planted:Own")

    attack = attacks_on("run folder")

    def _document(box: Box, change: Callable[[dict[str, Any]], object], ends: tuple[int, ...] = (2,)) -> Deed:
        path = run_folder.run(box) / "run.json"
        document = json.loads(path.read_text())
        change(document)
        path.write_text(json.dumps(document))
        return Deed(("run",), "resumed", ends)

    @attack("link", "temporary files that are waiting links")
    def _(box: Box) -> Deed:
        folder = run_folder.run(box)
        for path in list(folder.rglob("*")):
            if path.is_file():
                for name in (f"{path.name}.tmp", f".{path.name}.tmp", f"{path.name}~", f".{path.name}"):
                    (path.parent / name).symlink_to(box.outside / "secret.txt")
        return run_folder.GOES_ON

    @attack("link", "run that leads to itself")
    def _(box: Box) -> Deed:
        folder = run_folder.run(box)
        (folder / "run.json").unlink()
        (folder / "run.json").symlink_to("run.json")
        return run_folder.RESUMED

    @attack("link", "checkpoint that leads outside")
    def _(box: Box) -> Deed:
        path = run_folder.newest(run_folder.run(box))
        shutil.move(path, box.outside / "secret.zip")
        path.symlink_to(box.outside / "secret.zip")
        return run_folder.RESUMED

    @attack("type", "names of checkpoints in other digits, and beyond all numbers")
    def _(box: Box) -> Deed:
        folder = run_folder.run(box) / "checkpoints"
        newest = run_folder.newest(folder.parent)
        for name in ("\u0663\u0663", "9" * 200, "-1", "1e9", " 7", "\u00b2", "0x10"):
            shutil.copy(newest, folder / f"{name}.zip")
            shutil.copy(newest.with_suffix(".npz"), folder / f"{name}.npz")
        return run_folder.GOES_ON

    @attack("terminal", "names of checkpoints with escape sequences")
    def _(box: Box) -> Deed:
        folder = run_folder.run(box) / "checkpoints"
        newest = run_folder.newest(folder.parent)
        for path in (newest, newest.with_suffix(".npz")):
            shutil.move(path, folder / f"{path.stem}\x1b[2J\n\x9b{path.suffix}")
        return run_folder.GOES_ON

    @attack("bomb", "hundred thousand checkpoints")
    def _(box: Box) -> Deed:
        folder = run_folder.run(box) / "checkpoints"
        for k in range(10**5):
            (folder / f"{k:09d}.zip").touch()
        return run_folder.GOES_ON

    @attack("bomb", "curve of one line without end")
    def _(box: Box) -> Deed:
        sparse(run_folder.run(box) / "curve.jsonl", 2**35, b'{"steps": 1}\n')
        return run_folder.GOES_ON

    @attack("type", "curve that is no text")
    def _(box: Box) -> Deed:
        (run_folder.run(box) / "curve.jsonl").write_bytes(b"\xff\xfe\0" * 1000 + b'\n{"steps": "\\ud800"}\n')
        return run_folder.GOES_ON

    @attack("type", "replay buffer beyond its end")
    def _(box: Box) -> Deed:
        path = run_folder.newest(run_folder.run(box)).with_suffix(".npz")
        arrays_of = dict(np.load(path))
        for name in arrays_of:
            if arrays_of[name].size == 1:
                arrays_of[name] = np.array(10**12)
        np.savez(path, **arrays_of)
        return run_folder.RESUMED

    @attack("bomb", "replay buffer with a header that claims to be large")
    def _(box: Box) -> Deed:
        path = run_folder.newest(run_folder.run(box)).with_suffix(".npz")
        with zipfile.ZipFile(path) as archive:
            members = {name: archive.read(name) for name in archive.namelist()}
        text = "{'descr': '<f8', 'fortran_order': False, 'shape': (1000000000000,)}"
        path.write_bytes(archive_of({**members, next(iter(members)): arrays.header(text, bytes(80))}))
        return run_folder.RESUMED

    @attack("type", "half of a pair of surrogates, and digits without end")
    def _(box: Box) -> Deed:
        text = f'{{"schema": "\\ud800", "spec": {TEN_THOUSAND_DIGITS}}}'
        (run_folder.run(box) / "run.json").write_text(text)
        return run_folder.RESUMED

    @attack("code", "classes by name in the description of the run")
    def _(box: Box) -> Deed:
        options = {"policy_kwargs": {"activation_fn": "os:system"}, "replay_buffer_class": "os:system"}
        return _document(box, lambda document: document["spec"]["hyperparameters"].update(options))

    @attack("printf", "name of the folder")
    def _(box: Box) -> Deed:
        folder = run_folder.run(box)
        name = "%s%n{0.__class__}$(touch owned)"
        folder.rename(box.here / name)
        (box.here / name / "run.json").write_text("[]")
        return Deed((name,), "resumed", (2,))
