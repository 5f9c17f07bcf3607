"""Triangles of glTF files by trimesh, after a check that bounds its work. No other module imports trimesh.

Coordinates are those of the file, as in trimesh and Pinocchio; no axis is turned up. Materials, images, skins
and animations are removed before trimesh reads the file, and buffers in other files are refused unless they
lie in the folder of the mesh.
"""

from __future__ import annotations

import base64
import binascii
import io
import json
import os
from collections.abc import Callable
from typing import Any
from urllib.parse import unquote

import numpy as np
from numpy.typing import NDArray

from dynx.errors import importing, shown
from dynx.files.documents import parse_json
from dynx.files.reading import MAX_BYTES
from dynx.spatial.scalar import Floats

MAX_NUMBERS = 20_000_000
"""Largest number of entries of all accessors."""

MAX_BUFFERS = 1000
"""Largest number of buffers."""

MAX_BUFFER_BYTES = 4 * MAX_BYTES
"""Largest size of all buffers; many can be the same file [bytes]."""

MAX_NODES = 100_000
"""Largest number of nodes."""

MAX_PLACED = 10_000_000
"""Largest number of triangles, counted as often as nodes place them."""

_BINARY = b"glTF"
_READ = ("asset", "scene", "scenes", "nodes", "meshes", "accessors", "bufferViews", "buffers")
_OF_PRIMITIVE = ("indices", "mode")
_INLINE = "data:"

ReadBeside = Callable[[str], bytes]


def gltf_triangles(data: bytes, read_beside: ReadBeside) -> tuple[Floats, NDArray[np.intp]]:
    """Return the vertices (n, 3) [m] and triangles (m, 3) of the scene of a .gltf or .glb file.

    `read_beside` returns the bytes of a file in the folder of the mesh. Raises ValueError for a file that is
    damaged, too large or not supported, NotInstalledError without trimesh.
    """
    tree, binary = _tree(data)
    _refuse_excess(tree)
    buffers: dict[str, bytes] = {}
    for number, buffer in enumerate(tree.get("buffers", [])):
        buffers[str(number)] = _buffer(buffer, binary, read_beside)
        buffer["uri"] = str(number)
        if sum(map(len, buffers.values())) > MAX_BUFFER_BYTES:
            raise ValueError(f"its buffers have more than {MAX_BUFFER_BYTES:,} bytes")
    scene = _trimesh().load_scene(
        io.BytesIO(json.dumps(tree).encode()), file_type="gltf", resolver=buffers, process=False
    )
    placed = [scene.graph[node] for node in scene.graph.nodes_geometry]
    if sum(len(getattr(scene.geometry[name], "faces", ())) for _, name in placed) > MAX_PLACED:
        raise ValueError(f"it places more than {MAX_PLACED} triangles")
    vertices, faces, count = [np.zeros((0, 3))], [np.zeros((0, 3), np.intp)], 0
    for T, name in placed:
        part = scene.geometry[name]
        if hasattr(part, "faces"):
            # A mirrored triangle is seen from behind.
            order = -1 if np.linalg.det(T[:3, :3]) < 0.0 else 1
            faces.append(np.array(part.faces, np.intp)[:, ::order] + count)
            vertices.append(np.array(part.vertices, np.float64) @ T[:3, :3].T + T[:3, 3])
            count += len(part.vertices)
    return np.concatenate(vertices), np.concatenate(faces)


def _trimesh() -> Any:
    with importing("glTF meshes are read by trimesh: pip install 'dynx[world]'"):
        import trimesh
    return trimesh


def _tree(data: bytes) -> tuple[dict[str, Any], bytes]:
    """Return the JSON tree of a file with the parts that matter, and the binary chunk of a .glb file."""
    text, binary = data, b""
    if data[:4] == _BINARY:
        length = int.from_bytes(data[8:12], "little")
        if length > len(data):
            raise ValueError(f"it is truncated: its head announces {length} bytes, and it has {len(data)}")
        end = 20 + int.from_bytes(data[12:16], "little")
        text, binary = data[20:end], data[end + 8 :]
    try:
        tree = parse_json(text)
    except ValueError as error:
        raise ValueError(f"it is not JSON: {error}") from None
    if not isinstance(tree, dict):
        raise ValueError("it is no JSON object")
    tree = {key: tree[key] for key in _READ if key in tree}
    for mesh in tree.get("meshes", []):
        mesh["primitives"] = [_positions_only(each) for each in mesh["primitives"]]
    return tree, binary


def _positions_only(primitive: dict[str, Any]) -> dict[str, Any]:
    kept = {key: primitive[key] for key in _OF_PRIMITIVE if key in primitive}
    return {**kept, "attributes": {"POSITION": primitive["attributes"]["POSITION"]}}


def _refuse_excess(tree: dict[str, Any]) -> None:
    """Raise ValueError for a tree on which trimesh would spend memory or time without bound."""
    nodes = tree.get("nodes", [])
    if len(tree.get("buffers", [])) > MAX_BUFFERS:
        raise ValueError(f"it has more than {MAX_BUFFERS} buffers")
    if len(nodes) > MAX_NODES:
        raise ValueError(f"it has more than {MAX_NODES} nodes")
    children = [child for node in nodes for child in node.get("children", [])]
    if len(set(children)) < len(children):
        raise ValueError("a node is the child of two nodes")
    parent = {child: number for number, node in enumerate(nodes) for child in node.get("children", [])}
    for start in parent:
        above, steps = parent.get(start), 0
        while above is not None:
            above, steps = parent.get(above), steps + 1
            if steps > 50:
                raise ValueError("its nodes are nested deeper than 50, or in a cycle")
    counts = [each["count"] for each in tree.get("accessors", [])]
    if not all(type(count) is int and count >= 0 for count in counts):
        raise ValueError("the count of an accessor is no whole number")
    if 3 * sum(counts) > MAX_NUMBERS:
        raise ValueError(f"its accessors have more than {MAX_NUMBERS} entries")
    for accessor in tree.get("accessors", []):
        if "bufferView" not in accessor or "sparse" in accessor:
            raise ValueError("an accessor without a view of a buffer, or a sparse one, is not supported")


def _buffer(buffer: dict[str, Any], binary: bytes, read_beside: ReadBeside) -> bytes:
    uri = buffer.get("uri")
    if uri is None:
        content = binary
    elif uri.startswith(_INLINE):
        try:
            content = base64.b64decode(uri.partition(",")[2], validate=True)
        except binascii.Error as error:
            raise ValueError(f"a buffer is not base64: {error}") from None
    elif "://" in uri or os.path.isabs(uri):
        raise ValueError(f"the buffer {shown(uri, 200)} is outside the folder of the mesh")
    else:
        content = read_beside(unquote(uri))
    if len(content) < buffer["byteLength"]:
        raise ValueError(f"a buffer has {len(content)} bytes, and {buffer['byteLength']} are announced")
    return content
