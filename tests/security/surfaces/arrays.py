"""Attacks by `.npz` files of rollouts: `dynx compare`, `dynx view`, `Rollout.load`."""

from __future__ import annotations

import io
import json
import os
import pickle
import tempfile
import zipfile
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from tests.security.attack import Box, Deed, Harmful, archive_of, attacks_on, sparse

attack = attacks_on("npz")


@cache
def rollout() -> Any:
    """Return a short rollout of a pendulum."""
    import dynx
    from dynx import control

    model = dynx.load("pendulum")
    return dynx.simulate(
        model, control.PD(model, kp=1.0, kd=1.0), [0.3], plant="reference", duration=0.01, control_dt=0.005
    )


@cache
def members() -> dict[str, bytes]:
    """Return the members of its file."""
    with tempfile.TemporaryDirectory() as folder:
        rollout().save(Path(folder) / "r.npz")
        with zipfile.ZipFile(Path(folder) / "r.npz") as archive:
            return {name: archive.read(name) for name in archive.namelist()}


def npy(array: Any, **options: Any) -> bytes:
    """Return an array as NumPy writes it."""
    content = io.BytesIO()
    np.save(content, array, **options)
    return content.getvalue()


def header(text: str, data: bytes = b"", version: bytes = b"\x01\x00") -> bytes:
    """Return an array with a header of the attacker's."""
    written = text.encode("latin-1") + b"\n"
    length = len(written).to_bytes(2 if version == b"\x01\x00" else 4, "little")
    return b"\x93NUMPY" + version + length + written + data


def deed(box: Box, ends: tuple[int, ...] = (2,), **parts: bytes) -> Deed:
    """Write a rollout with other arrays, which the victim loads."""
    content = archive_of({**members(), **{f"{name}.npy": each for name, each in parts.items()}})
    return Deed((box.file("r.npz", content),), "rollout", ends)


def described(box: Box, change: Callable[[dict[str, Any]], object], ends: tuple[int, ...] = (2,)) -> Deed:
    """Write a rollout whose document is changed."""
    document = json.loads(str(np.load(io.BytesIO(members()["robot.npy"]))))
    change(document)
    return deed(box, ends, robot=npy(np.array(json.dumps(document))))


def named(box: Box, class_name: str, fields: dict[str, Any], ends: tuple[int, ...] = (0, 2)) -> Deed:
    """Write a rollout whose scenario has an object of a class as its reference."""
    part = {"class": class_name, "fields": fields}
    return described(box, lambda document: _put(document["scenario"], "reference", part), ends)


def _put(document: Any, key: str, part: Any) -> None:
    where = document.get("scenario", document) if isinstance(document, dict) else document
    where[key] = part


@attack("code", "pickled objects in an array")
def _(box: Box) -> Deed:
    return deed(box, q=npy(np.array([Harmful(box.owned)], dtype=object), allow_pickle=True))


@attack("code", "pickle in the place of an array")
def _(box: Box) -> Deed:
    return deed(box, q=pickle.dumps(Harmful(box.owned)))


@attack("code", "header that is an expression")
def _(box: Box) -> Deed:
    text = f"{{'descr': {box.code}, 'fortran_order': False, 'shape': (1,)}}"
    return deed(box, q=header(text, bytes(8)))


@attack("code", "class of another module")
def _(box: Box) -> Deed:
    return named(box, "os:system", {"command": f"touch {box.owned}"})


@attack("code", "class that starts a process")
def _(box: Box) -> Deed:
    return named(box, "subprocess:Popen", {"args": ["touch", str(box.owned)]})


@attack("code", "module of the current folder")
def _(box: Box) -> Deed:
    box.file("planted.py", box.code)
    return named(box, "planted:Own", {})


@attack("code", "class of a room that a scenario has no part of")
def _(box: Box) -> Deed:
    return named(
        box, "dynx.model.xacro_reading:expand_here", {"path": "r.xacro", "roots": [], "arguments": {}}
    )


@attack("path", "robot that is a file")
def _(box: Box) -> Deed:
    return described(box, lambda document: document.update(urdf=str(box.outside / "secret.urdf")))


@attack("path", "mesh in the text of the robot")
def _(box: Box) -> Deed:
    mesh = f'<link name="l"><visual><geometry><mesh filename="file://{box.outside}/secret.stl"/></geometry></visual>'
    return described(
        box,
        lambda document: document.update(urdf=document["urdf"].replace("<link", f"{mesh}</link><link", 1)),
    )


@attack("path", "members that lead out of the folder")
def _(box: Box) -> Deed:
    content = archive_of({**members(), "../../outside/new.npy": npy(np.zeros(3))})
    return Deed((box.file("r.npz", content),), "rollout", (0, 2))


@attack("link", "link to a file of the system")
def _(box: Box) -> Deed:
    (box.here / "r.npz").symlink_to("/proc/self/mem")
    return Deed(("r.npz",), "rollout")


@attack("device", "endless device")
def _(box: Box) -> Deed:
    (box.here / "r.npz").symlink_to("/dev/zero")
    return Deed(("compare", "r.npz", "r.npz"))


@attack("device", "pipe")
def _(box: Box) -> Deed:
    os.mkfifo(box.here / "r.npz")
    return Deed(("view", "r.npz", "--export", "r.html"))


@attack("bomb", "compressed array")
def _(box: Box) -> Deed:
    data = header("{'descr': '<f8', 'fortran_order': False, 'shape': (40000000,)}", bytes(3 * 10**8))
    content = archive_of({**members(), "q.npy": data}, zipfile.ZIP_DEFLATED)
    return Deed((box.file("r.npz", content),), "rollout")


@attack("bomb", "shape without data")
def _(box: Box) -> Deed:
    return deed(box, q=header("{'descr': '<f8', 'fortran_order': False, 'shape': (10**15, 3)}"))


@attack("bomb", "text of no length, many times")
def _(box: Box) -> Deed:
    text = "{'descr': '<U0', 'fortran_order': False, 'shape': (1000000000000000,)}"
    return deed(box, (0, 2), more=header(text))


@attack("bomb", "text that is wide by its type")
def _(box: Box) -> Deed:
    wide = {"array": ["a"], "dtype": "<U800000000"}
    return described(box, lambda document: _put(document["scenario"], "q0", wide), (0, 2))


@attack("bomb", "header of four gigabytes")
def _(box: Box) -> Deed:
    return deed(box, q=b"\x93NUMPY\x02\x00\xff\xff\xff\xff{")


@attack("bomb", "sparse array of 40 GB")
def _(box: Box) -> Deed:
    path = box.here / "r.npz"
    size = 40 * 10**9
    text = f"{{'descr': '<f8', 'fortran_order': False, 'shape': ({size // 8},)}}"
    with zipfile.ZipFile(path, "w") as archive:
        for name, each in members().items():
            archive.writestr(name, each)
        with archive.open("more.npy", "w", force_zip64=True) as stream:
            stream.write(header(text))
    _enlarge(path, size)
    return Deed(("r.npz",), "rollout", (0, 2))


def _enlarge(path: Path, size: int) -> None:
    """Let the last member of an archive have `size` further bytes, which are a hole in the file."""
    data = path.read_bytes()
    directory = data.index(b"PK\x01\x02")
    content, listed = data[:directory], bytearray(data[directory:])
    last = listed.rindex(b"PK\x01\x02", 0, listed.rindex(b"PK\x05\x06"))
    end = listed.rindex(b"PK\x05\x06")
    was = int.from_bytes(listed[last + 20 : last + 24], "little")
    extra = b"\x01\x00\x10\x00" + 2 * (was + size).to_bytes(8, "little")
    name = int.from_bytes(listed[last + 28 : last + 30], "little")
    known = int.from_bytes(listed[last + 30 : last + 32], "little")
    listed[last + 20 : last + 28] = b"\xff" * 8
    listed[last + 30 : last + 32] = len(extra).to_bytes(2, "little")
    listed[last + 46 + name : last + 46 + name + known] = extra
    end += len(extra) - known
    start, length = len(content) + size, end
    record = b"PK\x06\x06" + (44).to_bytes(8, "little") + b"\x2d\x00\x2d\x00" + bytes(8)
    count = int.from_bytes(listed[end + 10 : end + 12], "little")
    record += 2 * count.to_bytes(8, "little") + length.to_bytes(8, "little") + start.to_bytes(8, "little")
    locator = b"PK\x06\x07" + bytes(4) + (start + length).to_bytes(8, "little") + (1).to_bytes(4, "little")
    tail = bytearray(listed[end:])
    tail[16:20] = b"\xff" * 4
    with open(path, "wb") as file:
        file.write(content)
        file.seek(start)
        file.write(bytes(listed[:end]) + record + locator + bytes(tail))


@attack("recursion", "deep document")
def _(box: Box) -> Deed:
    return deed(box, robot=npy(np.array("[" * 10**5)))


@attack("recursion", "deep scenario")
def _(box: Box) -> Deed:
    deep: Any = 1.0
    for _ in range(150):
        deep = {"mapping": [["a", [deep]]]}
    return described(box, lambda document: _put(document["scenario"], "q0", deep), (0, 2))


@attack("type", "shape of negative lengths")
def _(box: Box) -> Deed:
    return deed(box, q=header("{'descr': '<f8', 'fortran_order': False, 'shape': (-1, -2)}", bytes(16)))


@attack("type", "types that no array has")
def _(box: Box) -> Deed:
    text = "{'descr': [('a', '<f8', (3,)), ('b', '|O')], 'fortran_order': False, 'shape': (2,)}"
    return deed(box, q=header(text, bytes(64)))


@attack("type", "text that is no character")
def _(box: Box) -> Deed:
    return deed(box, schema=header("{'descr': '<U1', 'fortran_order': False, 'shape': ()}", b"\xff" * 4))


@attack("type", "numbers that are not finite")
def _(box: Box) -> Deed:
    n = len(rollout().t)
    return deed(box, (0, 2), q=npy(np.full((n, 1), np.nan)), t=npy(np.full(n, np.inf)))


@attack("type", "parts of a scenario of other types")
def _(box: Box) -> Deed:
    wrong = {"duration": {"array": [[1], [2, 3]]}, "plant": ["a"], "gravity": {"float": "x"}, "controller": 3}
    return described(box, lambda document: document["scenario"].update(wrong))


@attack("terminal", "escape sequences in the schema")
def _(box: Box) -> Deed:
    return deed(box, schema=npy(np.array("dynx.rollouts\x1b[2J\u202e/1")))


@attack("printf", "formats in the names of members")
def _(box: Box) -> Deed:
    content = archive_of({**members(), "%s%n{0.__class__}\x1b[2J.npy": b"x"})
    return Deed((box.file("r.npz", content),), "rollout")


@attack("bomb", "sparse file without end")
def _(box: Box) -> Deed:
    sparse(box.here / "r.npz", 2**36, b"PK\x03\x04")
    return Deed(("compare", "r.npz", "r.npz"))
