"""Attacks by files of which `dynx view` writes a page: robots, meshes, materials, images, motions, scenes.

`tests/viewer/test_hostile_files.py` opens the pages in a browser without a network.
"""

from __future__ import annotations

import json
import struct
from collections.abc import Callable
from typing import Any
from xml.sax.saxutils import quoteattr

import numpy as np

from tests.security.attack import Box, Deed, Harmful, attacks_on
from tests.security.surfaces import arrays, recording
from tests.security.surfaces.description import arm
from tests.security.surfaces.mesh import INLINE, PLACED, TETRAHEDRON, collada, gltf
from tests.security.surfaces.page import MARK, harmless

attack = attacks_on("view")

HTML = f"\"'></script><img src=x onerror={MARK}()><script>{MARK}()</script>"
"""Text that runs a script where a page takes it for HTML."""

SVG = f'<svg xmlns="http://www.w3.org/2000/svg" onload="{MARK}()"><script>{MARK}()</script></svg>'

ELSEWHERE = "http://192.0.2.1"
"""Address of another machine."""


def exported(box: Box, file: str, *words: str, says: str, ends: tuple[int, ...]) -> Deed:
    """Let the victim write the page of a file. Its output `says` what is wrong with the file."""
    page = box.here / "out.html"

    def check(output: str) -> str | None:
        if says not in " ".join(output.split()):
            return f"the output does not say {says!r}: {output[-1000:]!r}"
        return harmless(page)(output) if page.exists() else None

    return Deed(("view", file, *words, "--export", "out.html"), ends=ends, check=check)


def refused(box: Box, file: str, *words: str, says: str) -> Deed:
    """Let the victim write the page of a file that is an error."""
    return exported(box, file, *words, says=says, ends=(2,))


def noted(box: Box, file: str, *words: str, says: str = "") -> Deed:
    """Let the victim write the page of a file of which a part is not shown."""
    return exported(box, file, *words, says=says, ends=(0,))


def drawn(box: Box, mesh: str, content: str | bytes = b"", *, says: str = "", image: str = "") -> Deed:
    """Write a robot with a mesh, and perhaps an image of its material, and let the victim write its page."""
    look = f"<material name='m'><texture filename={quoteattr(image)}/></material>" if image else ""
    shape = f"<visual><geometry><mesh filename={quoteattr(mesh)}/></geometry>{look}</visual>"
    if content:
        box.file(mesh, content)
    return noted(box, box.file("r.urdf", arm(extra=shape)), says=says)


def with_materials(box: Box, library: str, *, name: str = "a", says: str = "") -> Deed:
    """Write a robot with a mesh in OBJ and its materials, and let the victim write its page."""
    box.file("m.mtl", library)
    return drawn(box, "m.obj", f"mtllib m.mtl\nusemtl {name}\n{PLACED}", says=says)


def with_image_of_gltf(box: Box, uri: str, *, says: str) -> Deed:
    """Write a robot with a mesh in glTF that has an image, and let the victim write its page."""
    tree = json.loads(
        gltf(
            [INLINE],
            materials=[{"name": HTML, "pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}],
            textures=[{"source": 0}],
            images=[{"uri": uri, "name": HTML}],
        )
    )
    tree["asset"]["generator"] = HTML
    tree["meshes"][0] |= {"name": HTML}
    tree["meshes"][0]["primitives"][0] |= {"material": 0}
    return drawn(box, "m.gltf", json.dumps(tree), says=says)


def bomb(entities: int = 12) -> str:
    """Return a document type whose last entity has ten to the power of `entities` letters."""
    grown = (f'<!ENTITY a{k} "' + 10 * f"&a{k - 1};" + '">' for k in range(1, entities))
    return f'<!DOCTYPE C [<!ENTITY a0 "ha">{"".join(grown)}]>'


# Robots.


@attack("html", "script in the names of a robot, its links, its materials and its images")
def _(box: Box) -> Deed:
    look = f"<material name={quoteattr(HTML)}><texture filename={quoteattr(HTML)}/></material>"
    shape = f"<visual name={quoteattr(HTML)}><geometry><box size='1 1 1'/></geometry>{look}</visual>"
    text = arm(HTML, shape, joint=HTML).replace('name="r"', f"name={quoteattr(HTML)}")
    return noted(box, box.file("r.urdf", text), says="no file")


@attack("bomb", "entities of a robot that grow")
def _(box: Box) -> Deed:
    return refused(box, box.file("r.urdf", bomb() + arm("&a11;")), says="r.urdf")


@attack("path", "entity of a robot that is a file")
def _(box: Box) -> Deed:
    kind = f'<!DOCTYPE r [<!ENTITY x SYSTEM "file://{box.outside}/secret.txt">]>'
    return refused(box, box.file("r.urdf", kind + arm("&x;")), says="r.urdf")


@attack("path", "mesh of a robot outside")
def _(box: Box) -> Deed:
    return drawn(box, f"{box.outside}/secret.stl", says="secret.stl")


@attack("network", "mesh of a robot from elsewhere")
def _(box: Box) -> Deed:
    return drawn(box, f"{ELSEWHERE}/m.stl", says="dynx reads no 'http://'")


@attack("path", "image of a robot outside")
def _(box: Box) -> Deed:
    return drawn(box, "m.obj", PLACED, image="../outside/secret.bin", says="secret.bin")


@attack("network", "image of a robot from elsewhere")
def _(box: Box) -> Deed:
    return drawn(box, "m.obj", PLACED, image=f"{ELSEWHERE}/i.png", says="dynx reads no 'http://'")


@attack("html", "image of a robot that is a drawing with scripts")
def _(box: Box) -> Deed:
    box.file("i.png", SVG)
    return drawn(box, "m.obj", PLACED, image="i.png", says="it is none of PNG")


# Meshes, their materials and their images.


@attack("html", "scripts in COLLADA")
def _(box: Box) -> Deed:
    asset = f"<asset><contributor><author>{SVG}</author></contributor></asset><script>{MARK}()</script>"
    extra = f"<extra><technique profile={quoteattr(HTML)}><script>{MARK}()</script></technique></extra>"
    return drawn(box, "m.dae", collada(asset + extra), says="m.dae")


@attack("bomb", "entities of COLLADA that grow, drawn")
def _(box: Box) -> Deed:
    return drawn(box, "m.dae", collada("<asset>&a11;</asset>", bomb()), says="m.dae")


@attack("path", "entity of COLLADA that is a file, drawn")
def _(box: Box) -> Deed:
    kind = f'<!DOCTYPE C [<!ENTITY x SYSTEM "file://{box.outside}/secret.txt">]>'
    return drawn(box, "m.dae", collada("<asset>&x;</asset>", kind), says="m.dae")


@attack("network", "document type, image and geometry of COLLADA from elsewhere")
def _(box: Box) -> Deed:
    kind = f'<!DOCTYPE C SYSTEM "{ELSEWHERE}/c.dtd">'
    image = f"<image id='i'><init_from>{ELSEWHERE}/i.png</init_from></image>"
    node = f'<node><instance_geometry url="{ELSEWHERE}/m.dae#a"/></node>'
    body = f"<library_images>{image}</library_images>"
    body += f"<library_visual_scenes><visual_scene>{node}</visual_scene></library_visual_scenes>"
    return drawn(box, "m.dae", collada(body, kind), says="m.dae")


@attack("path", "materials and images of OBJ outside, in a page")
def _(box: Box) -> Deed:
    head = f"mtllib {box.outside}/secret.txt\nmtllib ../outside/secret.txt\nusemtl a\n"
    return drawn(box, "m.obj", head + TETRAHEDRON)


@attack("path", "image of materials of OBJ outside")
def _(box: Box) -> Deed:
    return with_materials(box, "newmtl a\nmap_Kd ../outside/secret.bin\n", says="secret.bin")


@attack("network", "image of materials of OBJ from elsewhere")
def _(box: Box) -> Deed:
    return with_materials(box, f"newmtl a\nmap_Kd {ELSEWHERE}/i.png\n", says="dynx reads no 'http://'")


@attack("html", "names of materials of OBJ")
def _(box: Box) -> Deed:
    name = HTML.replace(" ", "/")
    return with_materials(box, f"newmtl {name}\nmap_Kd {name}.png\n", name=name, says="onerror")


@attack("path", "image of glTF outside, in a page")
def _(box: Box) -> Deed:
    return with_image_of_gltf(box, "%2e%2e/outside/secret.bin", says="secret.bin")


@attack("network", "image of glTF from elsewhere")
def _(box: Box) -> Deed:
    return with_image_of_gltf(box, f"{ELSEWHERE}/i.png", says="dynx reads no 'http://'")


@attack("html", "image of glTF that is a script")
def _(box: Box) -> Deed:
    return with_image_of_gltf(box, f"javascript:{MARK}()", says="javascript")


@attack("html", "image of glTF that is a drawing with scripts")
def _(box: Box) -> Deed:
    return with_image_of_gltf(box, f"data:image/svg+xml,{SVG}", says="it is none of PNG")


@attack("type", "chunk of glb that is longer than its file, drawn")
def _(box: Box) -> Deed:
    content = b"glTF" + struct.pack("<IIII", 2, 28, 2**32 - 1, 0x4E4F534A) + b"{}      "
    return drawn(box, "m.glb", content, says="m.glb")


@attack("bomb", "STL that states many triangles, drawn")
def _(box: Box) -> Deed:
    return drawn(box, "m.stl", bytes(80) + b"\xff" * 4 + bytes(50), says="m.stl")


# Motions.


def renamed(box: Box, change: Callable[[dict[str, Any]], object]) -> str:
    """Write a rollout whose document is changed; return its name."""
    return str(arrays.described(box, change).words[0])


@attack("code", "rollout with an object that runs code when it is read")
def _(box: Box) -> Deed:
    harmful = arrays.npy(np.array([Harmful(box.owned)], dtype=object), allow_pickle=True)
    return refused(box, str(arrays.deed(box, robot=harmful).words[0]), says="r.npz")


@attack("html", "script in the names of a rollout")
def _(box: Box) -> Deed:
    def change(document: dict[str, Any]) -> None:
        text = document["urdf"]
        for name in ("pendulum", "bob"):
            text = text.replace(f'"{name}"', quoteattr(HTML))
        document["urdf"] = text

    return noted(box, renamed(box, change), says="onerror")


@attack("path", "mesh in the robot of a rollout outside")
def _(box: Box) -> Deed:
    shape = f'<visual><geometry><mesh filename="file://{box.outside}/secret.stl"/></geometry></visual>'

    def change(document: dict[str, Any]) -> None:
        document["urdf"] = document["urdf"].replace('<link name="bob">', f'<link name="bob">{shape}', 1)

    return noted(box, renamed(box, change), says="pendulum has no shapes")


@attack("html", "script in the robot of a recording")
def _(box: Box) -> Deed:
    def described(topic: str, data: bytes) -> bytes:
        if topic != "/robot_description":
            return data
        text = arm(HTML, joint=HTML)
        return b"\0\1\0\0" + struct.pack("<I", len(text) + 1) + text.encode() + b"\0"

    return noted(box, box.file("r.mcap", recording.copied(data=described)), says="r has no shapes")


@attack("html", "script in the metadata of a recording")
def _(box: Box) -> Deed:
    content = recording.copied(recording.set_to(name=HTML, title=HTML))
    return exported(box, box.file("r.mcap", content), says="", ends=(0, 2))


# Scenes.


def staged(box: Box, **parts: Any) -> str:
    """Write a scene; return the name of its file."""
    return box.file("s.json", json.dumps({"schema": "dynx.scene/1", **parts}))


RECORDED = ("--duration", "0.02")


@attack("html", "script in the names of a scene")
def _(box: Box) -> Deed:
    name = HTML.replace("/", "")
    bodies = [{"name": name, "mass": 1.0, "shape": {"box": [0.1, 0.1, 0.1]}}]
    return noted(box, staged(box, name=name, bodies=bodies), *RECORDED)


@attack("path", "robot of a scene outside")
def _(box: Box) -> Deed:
    robots = [{"name": "a", "robot": "../outside/secret.urdf"}]
    return refused(box, staged(box, robots=robots), *RECORDED, says="secret.urdf")


@attack("path", "visual mesh of a scene outside")
def _(box: Box) -> Deed:
    visuals = [{"mesh": "../outside/secret.stl"}]
    bodies = [{"name": "a", "mass": 1.0, "shape": {"box": [0.1, 0.1, 0.1]}, "visuals": visuals}]
    return refused(box, staged(box, bodies=bodies), *RECORDED, says="secret.stl")


@attack("network", "mesh of a scene from elsewhere")
def _(box: Box) -> Deed:
    bodies = [{"name": "a", "mass": 1.0, "shape": {"mesh": f"{ELSEWHERE}/m.stl"}}]
    return refused(box, staged(box, bodies=bodies), *RECORDED, says="m.stl")


@attack("code", "robot of a scene in xacro that runs code, with another suffix")
def _(box: Box) -> Deed:
    text = f'<robot xmlns:xacro="http://ros.org/wiki/xacro" name="r"><link name="${{{box.code}}}"/></robot>'
    box.file("r.urdf", text)
    return exported(
        box, staged(box, robots=[{"name": "a", "robot": "r.urdf"}]), *RECORDED, says="", ends=(0, 2)
    )
