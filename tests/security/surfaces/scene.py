"""Attacks by scenes in TOML and JSON: `dynx world`, `dynx view`."""

from __future__ import annotations

import json
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

from tests.security.attack import URDF, Box, Deed, attacks_on, sparse

attack = attacks_on("scene")

RUN = ("--engine", "mujoco", "--duration", "0.002", "--quiet")
HEAD: dict[str, Any] = {"schema": "dynx.scene/1"}
BOX: dict[str, Any] = {"name": "b", "mass": 1.0, "shape": {"box": [0.1, 0.1, 0.1]}}


def deed(
    box: Box,
    document: dict[str, Any] | str,
    *words: str,
    ends: tuple[int, ...] = (2,),
    check: Callable[[str], str | None] | None = None,
) -> Deed:
    """Write a scene, which the victim runs."""
    text = document if isinstance(document, str) else json.dumps({**HEAD, **document})
    return Deed(("world", box.file("s.json", text), *(words or RUN)), ends=ends, check=check)


def body(box: Box, shape: dict[str, Any]) -> Deed:
    """Write a scene of one body."""
    return deed(box, {"bodies": [{**BOX, "shape": shape}]})


def robot(box: Box, name: str) -> Deed:
    """Write a scene of one robot."""
    return deed(box, {"robots": [{"name": "a", "robot": name}]})


@attack("path", "robot outside")
def _(box: Box) -> Deed:
    return robot(box, "../outside/secret.urdf")


@attack("path", "robot outside by its full path")
def _(box: Box) -> Deed:
    return robot(box, str(box.outside / "secret.urdf"))


@attack("path", "robot in the home folder")
def _(box: Box) -> Deed:
    return robot(box, "~/../outside/secret.urdf")


@attack("path", "mesh in a package that leads outside")
def _(box: Box) -> Deed:
    return body(box, {"mesh": "package://pybullet_data/../../../../../../../../../etc/passwd"})


@attack("path", "folders of meshes outside")
def _(box: Box) -> Deed:
    mesh = f'<collision><geometry><mesh filename="{box.outside}/secret.stl"/></geometry></collision>'
    urdf = f'<robot name="r"><link name="b">{mesh}</link></robot>'
    return deed(box, {"robots": [{"name": "a", "urdf": urdf, "mesh_folders": ["../outside", "/"]}]})


@attack("path", "name of a scene that is a path")
def _(box: Box) -> Deed:
    return Deed(("world", "../outside/secret", *RUN))


@attack("path", "names of bodies that are paths of files to write")
def _(box: Box) -> Deed:
    names = ["../../outside/new", str(box.outside / "new2"), "/../../../outside/new3"]
    return deed(
        box, {"bodies": [{**BOX, "name": name} for name in names]}, "--export", "out.urdf", ends=(0, 2)
    )


@attack("path", "names of robots that are paths of files to write")
def _(box: Box) -> Deed:
    robots = [{"name": name, "urdf": URDF} for name in ("../../outside/new", "..", ".")]
    return deed(box, {"robots": robots}, "--export", "out.urdf", ends=(0, 2))


@attack("link", "robot that leads outside")
def _(box: Box) -> Deed:
    (box.here / "r.urdf").symlink_to(box.outside / "secret.urdf")
    return robot(box, "r.urdf")


@attack("link", "folder that leads outside")
def _(box: Box) -> Deed:
    (box.here / "meshes").symlink_to(box.outside)
    return body(box, {"mesh": "meshes/secret.stl"})


@attack("device", "mesh that is an endless device")
def _(box: Box) -> Deed:
    (box.here / "m.stl").symlink_to("/dev/zero")
    return body(box, {"mesh": "m.stl"})


@attack("device", "robot that is a pipe")
def _(box: Box) -> Deed:
    os.mkfifo(box.here / "r.urdf")
    return robot(box, "r.urdf")


@attack("device", "scene that is a pipe")
def _(box: Box) -> Deed:
    os.mkfifo(box.here / "s.toml")
    return Deed(("world", "s.toml", *RUN))


@attack("network", "robot from elsewhere")
def _(box: Box) -> Deed:
    return robot(box, "http://192.0.2.1/r.urdf")


@attack("network", "mesh from elsewhere")
def _(box: Box) -> Deed:
    return body(box, {"mesh": "ftp://192.0.2.1/m.stl"})


@attack("bomb", "sparse file")
def _(box: Box) -> Deed:
    sparse(box.here / "s.toml", 2**36, b'schema = "dynx.scene/1"\n')
    return Deed(("world", "s.toml", *RUN))


@attack("bomb", "many empty lists")
def _(box: Box) -> Deed:
    return deed(box, '{"schema": "dynx.scene/1", "x": [' + "[]," * (2 * 10**7) + "[]]}")


@attack("bomb", "many tables of TOML")
def _(box: Box) -> Deed:
    text = 'schema = "dynx.scene/1"\n' + "".join(f"[a{k}]\n" for k in range(5 * 10**6))
    return Deed(("world", box.file("s.toml", text), *RUN))


@attack("bomb", "many keys of one table of TOML")
def _(box: Box) -> Deed:
    text = 'schema = "dynx.scene/1"\n' + "".join(f"a.b.c.d{k}=1\n" for k in range(4 * 10**6))
    return Deed(("world", box.file("s.toml", text), *RUN))


@attack("bomb", "key of many parts")
def _(box: Box) -> Deed:
    text = (
        'schema = "dynx.scene/1"\n'
        + ".".join(["a"] * 40_000)
        + " = 1\n"
        + ".".join(["a"] * 39_999)
        + ".b = 1\n"
    )
    return Deed(("world", box.file("s.toml", text), *RUN))


@attack("bomb", "line of blanks")
def _(box: Box) -> Deed:
    text = 'schema = "dynx.scene/1"\nx = [' + " \n" * (2 * 10**7)
    return Deed(("world", box.file("s.toml", text), *RUN))


@attack("bomb", "hundred thousand bodies in one place")
def _(box: Box) -> Deed:
    bodies = [{**BOX, "name": f"b{k}"} for k in range(100_000)]
    return deed(box, {"bodies": bodies})


@attack("bomb", "thousand bodies in one place")
def _(box: Box) -> Deed:
    bodies = [{**BOX, "name": f"b{k}"} for k in range(1000)]
    return deed(box, {"bodies": bodies}, ends=(0, 2))


@attack("bomb", "field of many heights")
def _(box: Box) -> Deed:
    return deed(
        box,
        {"bodies": [{"name": "b", "shape": {"heights": [[0.0] * 3000] * 3000, "size": [1, 1]}}]},
        ends=(0, 2),
    )


@attack("bomb", "robot of many links in its text")
def _(box: Box) -> Deed:
    links = "".join(f'<link name="l{k}"/>' for k in range(100_000))
    joints = "".join(
        f'<joint name="j{k}" type="revolute"><parent link="l{k}"/><child link="l{k + 1}"/></joint>'
        for k in range(99_999)
    )
    return deed(box, {"robots": [{"name": "a", "urdf": f'<robot name="r">{links}{joints}</robot>'}]})


@attack("recursion", "deep lists in JSON")
def _(box: Box) -> Deed:
    return deed(box, "[" * 10**6)


@attack("recursion", "deep lists in TOML")
def _(box: Box) -> Deed:
    return Deed(("world", box.file("s.toml", "x = " + "[" * 10**5), *RUN))


@attack("recursion", "deep tables")
def _(box: Box) -> Deed:
    deep: Any = 0
    for _ in range(900):
        deep = {"a": deep}
    return deed(box, {"groups": deep})


@attack("type", "names and numbers of other types")
def _(box: Box) -> Deed:
    return deed(box, {"name": ["x"], "bodies": [{**BOX, "mass": {"a": 1}, "pose": "origin"}]})


@attack("type", "numbers beyond all floats")
def _(box: Box) -> Deed:
    return deed(box, '{"schema": "dynx.scene/1", "gravity": [1e999, NaN, ' + "1" * 5000 + "]}")


@attack("type", "dates in the place of numbers")
def _(box: Box) -> Deed:
    text = 'schema = "dynx.scene/1"\ngravity = [1979-05-27, 07:32:00, 1979-05-27T07:32:00Z]\n'
    return Deed(("world", box.file("s.toml", text), *RUN))


@attack("type", "keys of objects of Python")
def _(box: Box) -> Deed:
    return deed(
        box, {"__class__": "x", "bodies": [{**BOX, "__init__": 1}], "motors": [{"kind": "__class__"}]}
    )


@attack("type", "extreme sizes and masses")
def _(box: Box) -> Deed:
    return deed(
        box, {"bodies": [{**BOX, "mass": 1e308, "shape": {"box": [1e-308, 1e308, 1e308]}}]}, ends=(0, 1, 2)
    )


NASTY = "a\x1b]0;owned\x07\x1b[2J\u202e\u2066\r\n\x00b"


@attack("terminal", "escape sequences in names")
def _(box: Box) -> Deed:
    bodies = [{**BOX, "name": f"{NASTY}{k}"} for k in range(3)]
    return deed(box, {"name": NASTY, "bodies": bodies}, *RUN[:-1], ends=(0, 2))


@attack("terminal", "escape sequences in the name of the file")
def _(box: Box) -> Deed:
    name = "s\x1b[2J\u202e\n.json"
    (box.here / name).write_text(json.dumps({**HEAD, "bodies": [BOX]}))
    return Deed(("world", name, *RUN[:-1]), ends=(0, 2))


@attack("printf", "formats in names")
def _(box: Box) -> Deed:
    bodies = [{**BOX, "name": name} for name in ("%s%n%d", "{0.__class__}", "{", "${HOME}", "[red]")]
    return deed(box, {"name": "%s%n", "bodies": bodies}, *RUN[:-1], ends=(0, 2))


@attack("printf", "formulas of LaTeX in names of a plot")
def _(box: Box) -> Deed:
    bodies = [{**BOX, "name": name} for name in ("$\\frac{", "$a_{b$", "$\\input{secret}$", "_$")]
    words = ("--engine", "mujoco,pybullet", "--duration", "0.002", "--plot", "p.png")
    return deed(box, {"bodies": bodies}, *words, ends=(0,))


@attack("code", "element of MJCF in names of an export")
def _(box: Box) -> Deed:
    name = f'"/><include file="{box.outside}/secret.txt"/><x a="'
    return deed(
        box,
        {"bodies": [{**BOX, "name": name}]},
        "--export",
        "out.xml",
        ends=(0, 2),
        check=_no_include(box.here / "out.xml"),
    )


def _no_include(path: Path) -> Callable[[str], str | None]:
    def check(_: str) -> str | None:
        import xml.etree.ElementTree as ElementTree

        included = path.exists() and ElementTree.parse(path).findall(".//include")
        return "an <include> of the attacker's in the export" if included else None

    return check
