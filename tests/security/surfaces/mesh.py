"""Attacks by meshes in STL, OBJ, COLLADA and glTF."""

from __future__ import annotations

import base64
import json
import os
import struct
import zlib
from typing import Any

from tests.security.attack import Box, Deed, attacks_on, sparse

attack = attacks_on("mesh")

TETRAHEDRON = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 2 3\nf 1 2 4\nf 1 3 4\nf 2 3 4\n"


def deed(box: Box, name: str, content: str | bytes, ends: tuple[int, ...] = (2,)) -> Deed:
    """Write a mesh, of which the victim makes a convex hull."""
    return Deed((box.file(name, content),), "hull", ends)


def drawn(box: Box, name: str, content: str | bytes, ends: tuple[int, ...] = (0, 2)) -> Deed:
    """Write a mesh whose look the victim reads."""
    return Deed((box.file(name, content),), "drawn", ends)


def simulated(box: Box, name: str, content: str | bytes, ends: tuple[int, ...] = (0, 2)) -> Deed:
    """Write a mesh of a body, which the victim lets fall in every engine."""
    document = {"schema": "dynx.scene/1", "bodies": [{"name": "b", "mass": 1, "shape": {"mesh": name}}]}
    box.file(name, content)
    return Deed(
        ("world", box.file("s.json", json.dumps(document)), "--duration", "0.002", "--quiet"), ends=ends
    )


def gltf(buffers: list[dict[str, Any]], accessor: dict[str, Any] | None = None, **parts: Any) -> str:
    """Return a glTF file of a mesh whose points are in the first buffer."""
    view = {"buffer": 0, "byteOffset": 0, "byteLength": 36}
    points = {"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"}
    tree = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
        "accessors": [{**points, **(accessor or {})}],
        "bufferViews": [view],
        "buffers": buffers,
    }
    return json.dumps({**tree, **parts})


INLINE = {
    "uri": "data:application/octet-stream;base64,"
    + base64.b64encode(struct.pack("<9f", 0, 0, 0, 1, 0, 0, 0, 1, 1)).decode(),
    "byteLength": 36,
}


def collada(body: str, root: str = "") -> str:
    """Return a COLLADA file."""
    return f'<?xml version="1.0"?>{root}<COLLADA version="1.4.1">{body}</COLLADA>'


@attack("path", "buffer of glTF outside")
def _(box: Box) -> Deed:
    return deed(box, "m.gltf", gltf([{"uri": "../outside/secret.bin", "byteLength": 36}]))


@attack("path", "buffer of glTF outside, encoded")
def _(box: Box) -> Deed:
    return deed(box, "m.gltf", gltf([{"uri": "%2e%2e/outside/secret.bin", "byteLength": 36}]))


@attack("path", "buffer of glTF by its full path")
def _(box: Box) -> Deed:
    return deed(box, "m.gltf", gltf([{"uri": f"file:{box.outside}/secret.bin", "byteLength": 36}]))


@attack("path", "image of glTF outside")
def _(box: Box) -> Deed:
    images: dict[str, Any] = {"images": [{"uri": f"{box.outside}/secret.bin"}], "textures": [{"source": 0}]}
    materials = [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}]
    return deed(box, "m.gltf", gltf([INLINE], materials=materials, **images), (0, 2))


@attack("path", "materials of OBJ outside")
def _(box: Box) -> Deed:
    head = f"mtllib {box.outside}/secret.txt\nmtllib ../outside/secret.txt\nusemtl {box.outside}/secret.bin\n"
    return simulated(box, "m.obj", head + TETRAHEDRON, (0,))


PLACED = TETRAHEDRON.replace("f 1 2 3", "vt 0 0\nf 1/1 2/1 3/1")


def with_image(box: Box, name: str) -> Deed:
    """Write a mesh with an image of that name, whose look the victim reads."""
    box.file("m.mtl", f"newmtl a\nKd 1 0 0\nmap_Kd {name}\n")
    return drawn(box, "m.obj", f"mtllib m.mtl\nusemtl a\n{PLACED}", (0,))


def png(width: int, height: int, pixels: bytes) -> bytes:
    """Return a PNG file of grey values, compressed."""
    parts = (
        (b"IHDR", struct.pack(">IIBBBBB", width, height, 8, 0, 0, 0, 0)),
        (b"IDAT", pixels),
        (b"IEND", b""),
    )
    return b"\x89PNG\r\n\x1a\n" + b"".join(
        struct.pack(">I", len(each)) + kind + each + struct.pack(">I", zlib.crc32(kind + each))
        for kind, each in parts
    )


@attack("path", "materials of OBJ outside, drawn")
def _(box: Box) -> Deed:
    head = f"mtllib {box.outside}/secret.txt\nmtllib ../outside/secret.txt\nusemtl {box.outside}/secret.bin\n"
    return drawn(box, "m.obj", head + TETRAHEDRON, (0,))


@attack("path", "image of OBJ outside")
def _(box: Box) -> Deed:
    return with_image(box, f"{box.outside}/secret.bin")


@attack("path", "image of COLLADA outside")
def _(box: Box) -> Deed:
    library = (
        "<library_images><image id='i'><init_from>../outside/secret.bin</init_from></image></library_images>"
    )
    return drawn(box, "m.dae", collada(library), (2,))


@attack("path", "image of glTF outside, drawn")
def _(box: Box) -> Deed:
    images: dict[str, Any] = {"images": [{"uri": f"{box.outside}/secret.bin"}], "textures": [{"source": 0}]}
    materials = [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}]
    tree = json.loads(gltf([INLINE], materials=materials, **images))
    tree["meshes"][0]["primitives"][0] |= {"material": 0}
    return drawn(box, "m.gltf", json.dumps(tree), (0,))


@attack("link", "image that leads outside")
def _(box: Box) -> Deed:
    (box.here / "p.png").symlink_to(box.outside / "secret.bin")
    return with_image(box, "p.png")


@attack("device", "image that is an endless device")
def _(box: Box) -> Deed:
    (box.here / "p.png").symlink_to("/dev/zero")
    return with_image(box, "p.png")


@attack("device", "image that is a pipe")
def _(box: Box) -> Deed:
    os.mkfifo(box.here / "p.png")
    return with_image(box, "p.png")


@attack("bomb", "image of many pixels")
def _(box: Box) -> Deed:
    box.file("p.png", png(2**15, 2**15, zlib.compress(bytes(2**15 * (2**15 + 1)), 1)))
    return with_image(box, "p.png")


@attack("bomb", "many images of the largest size")
def _(box: Box) -> Deed:
    box.file("p.png", png(2**12, 2**12, zlib.compress(bytes(2**12 * (2**12 + 1)), 1)))
    library, faces = "", ""
    for k in range(100):
        (box.here / f"{k}.png").symlink_to("p.png")
        library += f"newmtl {k}\nmap_Kd {k}.png\n"
        faces += f"usemtl {k}\nf 1/1 2/1 3/1\n"
    box.file("m.mtl", library)
    return drawn(box, "m.obj", f"mtllib m.mtl\n{PLACED}{faces}", (0,))


@attack("bomb", "materials of OBJ of many empty lines")
def _(box: Box) -> Deed:
    box.file("m.mtl", "\n" * (6 * 10**7))
    return drawn(box, "m.obj", f"mtllib m.mtl\n{TETRAHEDRON}", (0,))


@attack("bomb", "uses of materials of OBJ")
def _(box: Box) -> Deed:
    return drawn(box, "m.obj", TETRAHEDRON + "usemtl a\ns 1\n" * (4 * 10**6), (0,))


@attack("bomb", "OBJ of one polygon of thirty million corners, drawn")
def _(box: Box) -> Deed:
    return drawn(box, "m.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\n" + ("f" + " 1" * (4 * 10**5) + "\n") * 70, (2,))


@attack("terminal", "escape sequences in names of images")
def _(box: Box) -> Deed:
    return with_image(box, "\x1b[2J\u202e.png")


@attack("path", "entity of COLLADA that is a file")
def _(box: Box) -> Deed:
    kind = f'<!DOCTYPE C [<!ENTITY x SYSTEM "file://{box.outside}/secret.txt">]>'
    return simulated(box, "m.dae", collada("<asset>&x;</asset>", kind), (2,))


@attack("path", "geometry of COLLADA in another file")
def _(box: Box) -> Deed:
    scene = f'<instance_geometry url="file://{box.outside}/secret.stl"/>'
    scene += '<instance_node url="../outside/secret.txt#a"/>'
    return deed(
        box,
        "m.dae",
        collada(
            f"<library_visual_scenes><visual_scene><node>{scene}</node></visual_scene></library_visual_scenes>"
        ),
    )


@attack("network", "buffer of glTF from elsewhere")
def _(box: Box) -> Deed:
    return deed(box, "m.gltf", gltf([{"uri": "http://192.0.2.1/b.bin", "byteLength": 36}]))


@attack("network", "document type of COLLADA from elsewhere")
def _(box: Box) -> Deed:
    return simulated(box, "m.dae", collada("", '<!DOCTYPE C SYSTEM "http://192.0.2.1/c.dtd">'), (2,))


@attack("link", "buffer of glTF that leads outside")
def _(box: Box) -> Deed:
    (box.here / "b.bin").symlink_to(box.outside / "secret.bin")
    return deed(box, "m.gltf", gltf([{"uri": "b.bin", "byteLength": 36}]))


@attack("device", "buffer of glTF that is an endless device")
def _(box: Box) -> Deed:
    (box.here / "b.bin").symlink_to("/dev/zero")
    return deed(box, "m.gltf", gltf([{"uri": "b.bin", "byteLength": 36}]))


@attack("device", "buffer of glTF that is a pipe")
def _(box: Box) -> Deed:
    os.mkfifo(box.here / "b.bin")
    return deed(box, "m.gltf", gltf([{"uri": "b.bin", "byteLength": 36}]))


@attack("device", "mesh that is an endless device")
def _(box: Box) -> Deed:
    (box.here / "m.stl").symlink_to("/dev/zero")
    return Deed(("m.stl",), "hull")


@attack("device", "mesh that is a pipe")
def _(box: Box) -> Deed:
    os.mkfifo(box.here / "m.dae")
    return Deed(("m.dae",), "hull")


@attack("bomb", "buffer of glTF that is read many times")
def _(box: Box) -> Deed:
    box.file("b.bin", bytes(6 * 10**7))
    return deed(box, "m.gltf", gltf([{"uri": "b.bin", "byteLength": 36}] * 1000), (0, 2))


@attack("bomb", "counts of glTF that cancel")
def _(box: Box) -> Deed:
    tree = json.loads(gltf([INLINE], {"count": 10**10}))
    tree["accessors"].append({**tree["accessors"][0], "count": -(10**10)})
    return deed(box, "m.gltf", json.dumps(tree))


@attack("bomb", "strides of glTF that repeat a number")
def _(box: Box) -> Deed:
    view = {"buffer": 0, "byteOffset": 0, "byteLength": 36, "byteStride": 0}
    return deed(box, "m.gltf", gltf([INLINE], {"count": 6 * 10**6}, bufferViews=[view]), (0, 2))


@attack("type", "strides and offsets of glTF beyond the buffer")
def _(box: Box) -> Deed:
    view = {"buffer": 0, "byteOffset": -(10**6), "byteLength": 10**9, "byteStride": 10**6}
    return deed(box, "m.gltf", gltf([INLINE], {"count": 1000, "byteOffset": 10**9}, bufferViews=[view]))


@attack("type", "indices of glTF beyond the points")
def _(box: Box) -> Deed:
    tree = json.loads(gltf([INLINE]))
    tree["accessors"].append({"bufferView": 0, "componentType": 5125, "count": 9, "type": "SCALAR"})
    tree["meshes"][0]["primitives"][0]["indices"] = 1
    return deed(box, "m.gltf", json.dumps(tree))


@attack("type", "parts of glTF of other types")
def _(box: Box) -> Deed:
    return deed(
        box,
        "m.gltf",
        gltf([INLINE], {"count": "3"}, nodes=[{"mesh": 0, "matrix": "x", "children": {"0": 1}}]),
    )


@attack("type", "nodes of glTF that are their own children")
def _(box: Box) -> Deed:
    return deed(box, "m.gltf", gltf([INLINE], nodes=[{"mesh": 0, "children": [0]}]))


@attack("bomb", "many empty lists in glTF")
def _(box: Box) -> Deed:
    return deed(box, "m.gltf", '{"nodes": [' + "[]," * (2 * 10**7) + "[]]}")


@attack("recursion", "deep lists in glTF")
def _(box: Box) -> Deed:
    return deed(box, "m.gltf", '{"nodes": ' + "[" * 10**6)


@attack("type", "chunk of glb that is longer than its file")
def _(box: Box) -> Deed:
    return deed(box, "m.glb", b"glTF" + struct.pack("<IIII", 2, 28, 2**32 - 1, 0x4E4F534A) + b"{}      ")


@attack("bomb", "STL that states many triangles")
def _(box: Box) -> Deed:
    return deed(box, "m.stl", bytes(80) + b"\xff" * 4 + bytes(50))


@attack("type", "STL whose corners are not numbers")
def _(box: Box) -> Deed:
    return simulated(box, "m.stl", bytes(80) + struct.pack("<I", 2) + (b"\xff" * 48 + b"\0\0") * 2, (2,))


@attack("bomb", "STL of lines of blanks")
def _(box: Box) -> Deed:
    return deed(box, "m.stl", b"solid x\n" + b"vertex" + b" " * (6 * 10**7))


@attack("bomb", "OBJ of one polygon of thirty million corners")
def _(box: Box) -> Deed:
    return deed(box, "m.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf" + " 1" * (3 * 10**7))


@attack("bomb", "OBJ of eight million points")
def _(box: Box) -> Deed:
    return deed(box, "m.obj", "v 0 0 0\n" * (8 * 10**6))


@attack("bomb", "OBJ of many empty lines")
def _(box: Box) -> Deed:
    return deed(box, "m.obj", "\n" * (6 * 10**7))


@attack("type", "OBJ whose faces name points that are not there")
def _(box: Box) -> Deed:
    return deed(box, "m.obj", f"v 0 0 0\nv 1 0 0\nv nan inf 1e999\nf 1 2 {10**30}\nf -1 -2 -9\n")


@attack("bomb", "nodes of COLLADA that place one another")
def _(box: Box) -> Deed:
    nodes = "".join(
        f'<node id="n{k}">' + 2 * f'<instance_node url="#n{k + 1}"/>' + "</node>" for k in range(60)
    )
    scene = "<visual_scene><node><instance_node url='#n0'/></node></visual_scene>"
    scene = f"<library_visual_scenes>{scene}</library_visual_scenes>"
    return deed(box, "m.dae", collada(f"<library_nodes>{nodes}<node id='n60'/></library_nodes>{scene}"))


@attack("recursion", "node of COLLADA that places itself")
def _(box: Box) -> Deed:
    scene = "<node id='a'><instance_node url='#a'/></node>"
    return deed(
        box,
        "m.dae",
        collada(f"<library_visual_scenes><visual_scene>{scene}</visual_scene></library_visual_scenes>"),
    )


@attack("bomb", "entities of COLLADA that grow")
def _(box: Box) -> Deed:
    entities = '<!ENTITY a0 "ha">' + "".join(
        f'<!ENTITY a{k} "' + 10 * f"&a{k - 1};" + '">' for k in range(1, 12)
    )
    return deed(box, "m.dae", collada("<asset>&a11;</asset>", f"<!DOCTYPE C [{entities}]>"))


@attack("bomb", "sparse file")
def _(box: Box) -> Deed:
    sparse(box.here / "m.stl", 2**36, b"solid")
    return Deed(("m.stl",), "hull")


@attack("terminal", "escape sequences in names of a mesh")
def _(box: Box) -> Deed:
    return deed(box, "m\x1b[2J\u202e.gltf", gltf([{"uri": "\x1b[2J\u202e.bin", "byteLength": 36}]))
