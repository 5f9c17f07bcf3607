"""Attacks by files of worlds with their states: `World.read`."""

from __future__ import annotations

import hashlib
import json
import os
import signal
import tempfile
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from dynx.steppers.registry import installed_worlds
from tests.security.attack import Box, Deed, attacks_on, sparse

attack = attacks_on("world")

MAGIC = b"dynx world 1\n"


@cache
def parts(engine: str) -> tuple[dict[str, Any], bytes]:
    """Return the header of the file of a world, and the state of its engine."""
    import dynx
    from dynx import world

    scene = dynx.Scene(
        robots=(world.SceneRobot("arm", dynx.load("pendulum")),),
        bodies=(world.ground(), world.box("box", (0.1, 0.1, 0.1), mass=1.0)),
    )
    with tempfile.TemporaryDirectory() as folder, world.World(scene, engine) as made:
        made.step(3)
        made.write(Path(folder) / "w.world")
        content = (Path(folder) / "w.world").read_bytes()[len(MAGIC) + 32 :]
    length = int.from_bytes(content[:8], "little")
    return json.loads(content[8 : 8 + length]), content[8 + length :]


def file_of(header: bytes, data: bytes, length: int | None = None) -> bytes:
    """Return a file with a right checksum."""
    content = (len(header) if length is None else length).to_bytes(8, "little") + header + data
    return MAGIC + hashlib.sha256(content).digest() + content


def deed(box: Box, content: bytes, ends: tuple[int, ...] = (2,), steps: str = "0") -> Deed:
    """Write the file of a world, which the victim reads and steps."""
    return Deed((box.file("w.world", content), steps), "world", ends)


def changed(box: Box, change: Callable[[dict[str, Any]], object], ends: tuple[int, ...] = (2,)) -> Deed:
    """Write a world whose header is changed."""
    header, data = parts("mujoco")
    header = json.loads(json.dumps(header))
    change(header)
    return deed(box, file_of(json.dumps(header).encode(), data), ends)


def scene(box: Box, **values: Any) -> Deed:
    """Write a world whose scene is changed."""
    return changed(box, lambda header: header["world"]["scene"].update(values))


@attack("code", "engine that is a class of a module")
def _(box: Box) -> Deed:
    box.file("planted.py", box.code)
    return changed(box, lambda header: header["world"].update(engine="planted:Stepper"))


@attack("code", "robot that xacro expands")
def _(box: Box) -> Deed:
    return scene(box, robots=[{"name": "arm", "robot": str(box.outside / "secret.xacro")}])


@attack("path", "robot outside")
def _(box: Box) -> Deed:
    return scene(box, robots=[{"name": "arm", "robot": str(box.outside / "secret.urdf")}])


@attack("path", "mesh outside")
def _(box: Box) -> Deed:
    return scene(box, bodies=[{"name": "b", "shape": {"mesh": str(box.outside / "secret.stl")}}])


@attack("path", "folder of meshes outside")
def _(box: Box) -> Deed:
    mesh = f'<visual><geometry><mesh filename="{box.outside}/secret.stl"/></geometry></visual>'
    urdf = f'<robot name="r"><link name="b">{mesh}</link></robot>'
    robot = {"name": "arm", "urdf": urdf, "mesh_folders": [str(box.outside), "/", "../outside"]}
    return scene(box, robots=[robot])


@attack("network", "mesh from elsewhere")
def _(box: Box) -> Deed:
    return scene(box, bodies=[{"name": "b", "shape": {"mesh": "http://192.0.2.1/a.stl"}}])


@attack("link", "link to a file of the system")
def _(box: Box) -> Deed:
    (box.here / "w.world").symlink_to("/proc/self/mem")
    return Deed(("w.world",), "world")


@attack("device", "endless device")
def _(box: Box) -> Deed:
    (box.here / "w.world").symlink_to("/dev/zero")
    return Deed(("w.world",), "world")


@attack("device", "pipe")
def _(box: Box) -> Deed:
    os.mkfifo(box.here / "w.world")
    return Deed(("w.world",), "world")


@attack("bomb", "sparse file of a gigabyte")
def _(box: Box) -> Deed:
    sparse(box.here / "w.world", 2**30 - 1, MAGIC)
    return Deed(("w.world",), "world")


@attack("bomb", "sparse file without end")
def _(box: Box) -> Deed:
    sparse(box.here / "w.world", 2**37, MAGIC)
    return Deed(("w.world",), "world")


@attack("bomb", "header of many empty lists")
def _(box: Box) -> Deed:
    return deed(box, file_of(b"[" + b"[]," * (5 * 10**7) + b"[]]", b""))


@attack("bomb", "state of a gigabyte")
def _(box: Box) -> Deed:
    header, _ = parts("mujoco")
    content = file_of(json.dumps(header).encode(), bytes(8 * 10**8))
    return deed(box, content)


@attack("bomb", "length of the header beyond the file")
def _(box: Box) -> Deed:
    return deed(box, file_of(b"{}", b"", 2**63))


@attack("bomb", "field of heights without end")
def _(box: Box) -> Deed:
    heights = {"heights": [[0.0] * 4000] * 1000, "size": [1.0, 1.0]}
    return scene(box, bodies=[{"name": "b", "shape": heights}])


@attack("recursion", "deep header")
def _(box: Box) -> Deed:
    return deed(box, file_of(b"[" * 10**6, b""))


@attack("recursion", "deep settings")
def _(box: Box) -> Deed:
    deep: Any = 0
    for _ in range(500):
        deep = {"a": deep}
    return changed(box, lambda header: header["world"].update(settings=deep))


@attack("type", "options and settings of other types")
def _(box: Box) -> Deed:
    options = {"dt": "x", "substeps": [1], "nothing": {}, "self": 1, "scene": 3}
    return changed(box, lambda header: header["world"].update(options=options))


@attack("type", "option that is none")
def _(box: Box) -> Deed:
    return changed(box, lambda header: header["world"]["options"].update(dt=None))


@attack("type", "times that are not finite")
def _(box: Box) -> Deed:
    return changed(box, lambda header: header.update(time="nan", start="inf", steps=-(10**300)))


@attack("type", "memory of another shape")
def _(box: Box) -> Deed:
    return changed(box, lambda header: header.update(memory=[[["0x1p+9999"], []]]))


@attack("type", "numbers beyond all floats")
def _(box: Box) -> Deed:
    return scene(box, gravity=[1e308, -1e308, 10**300], name=["x"])


CRASHES = (-signal.SIGSEGV, -signal.SIGABRT, 139, 134)
"""Ends of a process by PyBullet, which docs/security.md and `World.read` state: no other program knows its
format."""


def _state(engine: str, number: int) -> Callable[[Box], Deed]:
    def prepare(box: Box) -> Deed:
        header, data = parts(engine)
        rng = np.random.default_rng(number)
        wrong = bytearray(data)
        for at in rng.integers(len(wrong), size=40 if len(wrong) else 0):
            wrong[at] = int(rng.integers(256))
        content = bytes(wrong) if number else rng.bytes(len(data))
        ends = (0, 2, *(CRASHES if engine == "pybullet" else ()))
        return deed(box, file_of(json.dumps(header).encode(), content), ends, "3")

    return prepare


for _engine in installed_worlds():
    for _number in range(2):
        _how = "with other bytes" if _number else "of random bytes"
        attack("type", f"state of {_engine} {_how}")(_state(_engine, _number))


@attack("terminal", "escape sequences in names")
def _(box: Box) -> Deed:
    return changed(box, lambda header: header["world"].update(engine="muj\x1b[2Joco\u202e"))


@attack("printf", "formats in names")
def _(box: Box) -> Deed:
    return scene(box, **{"%s%n{0.__class__}": "%d"})
