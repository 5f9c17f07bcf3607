"""Files of meshes, good and damaged, for tests."""

from __future__ import annotations

import base64
import json
import struct
from typing import Any

import numpy as np

CORNERS = "v 0 0 0\nv 1 0 0\nv 0 2 0\nv 0 0 3\n"
FACES = "f 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"
TETRAHEDRON = np.array([[0, 0, 0], [1, 0, 0], [0, 2, 0], [0, 0, 3]], np.float32)
TRIANGLES = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]], np.uint32)


def stl(count: int = 4, announced: int | None = None) -> bytes:
    """Return a binary STL file of the tetrahedron, whose head may announce another number of triangles."""
    facets = (struct.pack("<12fH", 0, 0, 1, *TETRAHEDRON[face].ravel(), 0) for face in TRIANGLES[:count])
    return b" " * 80 + struct.pack("<I", count if announced is None else announced) + b"".join(facets)


def text_stl(corner: str = "0 0 0", end: str = "endloop\nendfacet\nendsolid") -> bytes:
    """Return a text STL file of one triangle."""
    lines = f"solid a\nfacet normal 0 0 1\nouter loop\nvertex {corner}\nvertex 1 0 0\nvertex 0 1 0\n{end}\n"
    return lines.encode()


def obj(more: str = "") -> bytes:
    """Return an OBJ file of the tetrahedron with more lines."""
    return (CORNERS + FACES + more).encode()


def gltf(**changed: Any) -> bytes:
    """Return a glTF file of the tetrahedron, with parts changed."""
    content = TETRAHEDRON.tobytes() + TRIANGLES.tobytes()
    uri = "data:application/octet-stream;base64," + base64.b64encode(content).decode()
    tree = {
        "asset": {"version": "2.0"},
        "buffers": [{"byteLength": 96, "uri": uri}],
        "bufferViews": [
            {"buffer": 0, "byteOffset": 0, "byteLength": 48},
            {"buffer": 0, "byteOffset": 48, "byteLength": 48},
        ],
        "accessors": [accessor(0, 5126, 4, "VEC3"), accessor(1, 5125, 12, "SCALAR")],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "nodes": [{"mesh": 0}],
        "scenes": [{"nodes": [0]}],
        "scene": 0,
    }
    return json.dumps({**tree, **changed}).encode()


def accessor(view: int | None, component: int, count: int, kind: str) -> dict[str, Any]:
    """Return an accessor of glTF; without a view its entries are zero."""
    content = {"componentType": component, "count": count, "type": kind}
    return content if view is None else {"bufferView": view, **content}


def dae(
    primitive: str = "triangles", p: str = "0 2 1 0 1 3 0 3 2 1 2 3", node: str = "", vcount: str = ""
) -> bytes:
    """Return a COLLADA file of the tetrahedron."""
    counts = f"<vcount>{vcount}</vcount>" if vcount else ""
    return f"""<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
<asset><unit meter="1"/><up_axis>Y_UP</up_axis></asset>
<library_geometries><geometry id="g"><mesh><source id="s">
<float_array id="a" count="12">0 0 0 1 0 0 0 2 0 0 0 3</float_array>
<technique_common><accessor source="#a" count="4" stride="3"/></technique_common></source>
<vertices id="v"><input semantic="POSITION" source="#s"/></vertices>
<{primitive} count="4"><input semantic="VERTEX" source="#v" offset="0"/>{counts}<p>{p}</p></{primitive}>
</mesh></geometry></library_geometries><library_visual_scenes><visual_scene id="w">
<node>{node}<instance_geometry url="#g"/></node></visual_scene></library_visual_scenes></COLLADA>""".encode()
