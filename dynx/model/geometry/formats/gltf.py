"""Triangles of glTF files by trimesh, after a check that bounds its work. No other module imports trimesh.

Coordinates are those of the file, as in trimesh and Pinocchio; no axis is turned up. Materials, images, skins
and animations are removed before trimesh reads the file; materials are read here. Buffers in other files are
refused unless they lie in the folder of the mesh.
"""

from __future__ import annotations

import base64
import binascii
import io
import json
import os
from collections.abc import Callable
from typing import Any, NamedTuple
from urllib.parse import unquote

import numpy as np
from numpy.typing import NDArray

from dynx.errors import importing, shown
from dynx.files.documents import parse_json
from dynx.files.reading import MAX_BYTES
from dynx.model.geometry.formats.surface import MAX_TRIANGLES, Colour, FileMaterial, FileSurface, ImageFile
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
_OF_LOOK = ("materials", "textures", "images", "samplers")
_OF_PRIMITIVE = ("indices", "mode")
_OF_CORNERS = {
    "NORMAL": "_NORMAL",
    "COLOR_0": "_COLOR",
    "TEXCOORD_0": "_TEXCOORD_0",
    "TEXCOORD_1": "_TEXCOORD_1",
}
"""Attributes of vertices, and names by which trimesh passes them on as they are."""
_CLAMPED = 33071
_INLINE = "data:"

ReadBeside = Callable[[str], bytes]


def gltf_triangles(data: bytes, read_beside: ReadBeside) -> tuple[Floats, NDArray[np.intp]]:
    """Return the vertices (n, 3) [m] and triangles (m, 3) of the scene of a .gltf or .glb file.

    `read_beside` returns the bytes of a file in the folder of the mesh. Raises ValueError for a file that is
    damaged, too large or not supported, NotInstalledError without trimesh.
    """
    found = _surface(data, read_beside, drawn=False)
    return found.vertices, found.faces


def gltf_surface(data: bytes, read_beside: ReadBeside) -> FileSurface:
    """Return the triangles of the scene with their normals, images and colours.

    A material gives its base colour, which glTF states as amounts of light, as a colour of files and screens
    (sRGB), or its image of base colours; other images are not read. Raises the errors of `gltf_triangles`.
    """
    return _surface(data, read_beside, drawn=True)


def _surface(data: bytes, read_beside: ReadBeside, *, drawn: bool) -> FileSurface:
    """Return the triangles; what they look like is read if they are to be `drawn`."""
    tree, binary = _tree(data)
    look = {key: tree.pop(key) for key in _OF_LOOK if key in tree}
    primitives = _one_for_each_mesh(tree)
    _refuse_excess(tree)
    buffers: dict[str, bytes] = {}
    for number, buffer in enumerate(tree.get("buffers", [])):
        buffers[str(number)] = _buffer(buffer, binary, read_beside)
        buffer["uri"] = str(number)
        if sum(map(len, buffers.values())) > MAX_BUFFER_BYTES:
            raise ValueError(f"its buffers have more than {MAX_BUFFER_BYTES:,} bytes")
    for mesh in tree.get("meshes", []):
        mesh["primitives"] = [_passed(each, drawn=drawn) for each in mesh["primitives"]]
    scene = _trimesh().load_scene(
        io.BytesIO(json.dumps(tree).encode()), file_type="gltf", resolver=buffers, process=False
    )
    placed = [scene.graph[node] for node in scene.graph.nodes_geometry]
    most = MAX_TRIANGLES if drawn else MAX_PLACED
    if sum(len(getattr(scene.geometry[name], "faces", ())) for _, name in placed) > most:
        raise ValueError(f"it places more than {most} triangles")
    vertices, faces, count = [np.zeros((0, 3))], [np.zeros((0, 3), np.intp)], 0
    looks, notes = list[_PrimitiveLook](), list[str]()
    materials = _Materials(look, tree, list(buffers.values()), notes) if drawn else None
    for T, name in placed:
        part = scene.geometry[name]
        if hasattr(part, "faces"):
            # A mirrored triangle is seen from behind.
            order = -1 if np.linalg.det(T[:3, :3]) < 0.0 else 1
            own = np.array(part.faces, np.intp)[:, ::order]
            faces.append(own + count)
            vertices.append(np.array(part.vertices, np.float64) @ T[:3, :3].T + T[:3, 3])
            count += len(part.vertices)
            if materials is not None:
                looks.append(
                    _PrimitiveLook.of(primitives[name], part.vertex_attributes, own, T[:3, :3], materials)
                )
    found = FileSurface(np.concatenate(vertices), np.concatenate(faces))
    if materials is None or not looks:
        return found
    sizes = [len(each) for each in faces[1:]]
    return found._replace(
        normals=_joined([each.normals for each in looks], sizes, 3),
        uv=_joined([each.uv for each in looks], sizes, 2),
        colours=_joined([each.colours for each in looks], sizes, 3),
        materials=tuple(materials.known),
        material_of=np.repeat([each.material for each in looks], sizes),
        notes=tuple(dict.fromkeys(notes)),
    )


def _one_for_each_mesh(tree: dict[str, Any]) -> dict[str, dict[str, Any]]:
    """Divide each mesh into one for each of its primitives, placed by a node of its own; return the
    primitives by the name that trimesh gives them."""
    found: dict[str, dict[str, Any]] = {}
    divided: list[list[int]] = []
    meshes: list[dict[str, Any]] = []
    for mesh in tree.get("meshes", []):
        divided.append(list(range(len(meshes), len(meshes) + len(mesh["primitives"]))))
        for primitive in mesh["primitives"]:
            name = f"primitive {len(meshes)}"
            found[name] = primitive
            meshes.append({"name": name, "primitives": [primitive]})
    nodes = tree.get("nodes", [])
    for node in list(nodes):
        numbers = divided[node.pop("mesh")] if "mesh" in node else []
        if len(nodes) + len(numbers) > MAX_NODES:
            raise ValueError(f"it has more than {MAX_NODES} nodes")
        if len(numbers) == 1:
            node["mesh"] = numbers[0]
        elif numbers:
            node["children"] = [*node.get("children", []), *range(len(nodes), len(nodes) + len(numbers))]
            nodes += [{"mesh": number} for number in numbers]
    if meshes:
        tree["meshes"] = meshes
    return found


class _PrimitiveLook(NamedTuple):
    """What the triangles of one placed primitive look like."""

    material: int
    normals: Floats | None
    uv: Floats | None
    colours: Floats | None

    @classmethod
    def of(
        cls,
        primitive: dict[str, Any],
        attributes: Any,
        faces: NDArray[np.intp],
        M: Floats,
        materials: _Materials,
    ) -> _PrimitiveLook:
        """Return the look of triangles (m, 3), whose normals are transformed by M (3, 3)."""
        material, channel = materials.of(primitive.get("material"))
        given = {
            name: _shares(np.asarray(attributes[name]), name)[faces]
            for name in ("_NORMAL", "_COLOR", channel)
            if name in attributes
        }
        normals, uv = given.get("_NORMAL"), given.get(channel)
        colours = given.get("_COLOR")
        return cls(
            material,
            None if normals is None else normals[..., :3] @ np.linalg.pinv(M),
            None if uv is None else np.stack([uv[..., 0], 1.0 - uv[..., 1]], axis=-1),
            None if colours is None else _from_light(np.clip(colours[..., :3], 0.0, 1.0)),
        )


def _shares(values: NDArray[Any], name: str) -> Floats:
    """Return values of vertices; whole numbers are parts of the largest."""
    if values.dtype.kind == "u" and name != "_NORMAL":
        return values / float(np.iinfo(values.dtype).max)
    return np.asarray(values, np.float64)


def _joined(values: list[Floats | None], sizes: list[int], width: int) -> Floats | None:
    """Return the values (m, 3, `width`) of all triangles, NaN where there are none; None if all are None."""
    if all(each is None for each in values):
        return None
    none = [np.full((size, 3, width), np.nan) for size in sizes]
    return np.concatenate([b if a is None else a for a, b in zip(values, none, strict=True)])


class _Materials:
    """The materials of a file, as they are asked for."""

    def __init__(
        self, look: dict[str, Any], tree: dict[str, Any], buffers: list[bytes], notes: list[str]
    ) -> None:
        self._look, self._tree, self._buffers, self._notes = look, tree, buffers, notes
        self.known = [FileMaterial()]
        self._number: dict[int, tuple[int, str]] = {}

    def of(self, number: int | None) -> tuple[int, str]:
        """Return the number in `known` of a material, and the attribute of the places in its image."""
        if number is None:
            return 0, "_TEXCOORD_0"
        if number not in self._number:
            self._number[number] = len(self.known), self._add(self._look["materials"][number])
        return self._number[number]

    def _add(self, given: dict[str, Any]) -> str:
        base = given.get("pbrMetallicRoughness", {})
        factor = np.array([*map(float, base.get("baseColorFactor", ()))] or [1.0] * 4)
        if factor.shape != (4,) or not np.isfinite(factor).all():
            raise ValueError("a base colour has not four finite numbers")
        factor = np.clip(factor, 0.0, 1.0)
        opacity = float(factor[3]) if given.get("alphaMode") == "BLEND" else 1.0
        red, green, blue = _from_light(factor[:3]).tolist()
        rgba: Colour = (red, green, blue, opacity)
        texture, image = base.get("baseColorTexture"), None
        if texture is not None:
            image = self._image(texture["index"])
            if texture.get("extensions"):
                self._notes.append("transforms of places in images are not read")
        self.known.append(FileMaterial(rgba, image, rgba))
        return f"_TEXCOORD_{0 if texture is None else int(texture.get('texCoord', 0))}"

    def _image(self, number: int) -> ImageFile | None:
        texture = self._look["textures"][number]
        if "source" not in texture:
            self._notes.append("an image in a format of an extension is not read")
            return None
        image, sampler = self._look["images"][texture["source"]], {}
        if "sampler" in texture:
            sampler = self._look["samplers"][texture["sampler"]]
        wraps = (sampler.get("wrapS") != _CLAMPED, sampler.get("wrapT") != _CLAMPED)
        name = f"{texture['source']} of the file"
        if "bufferView" in image:
            view = self._tree["bufferViews"][image["bufferView"]]
            start, content = view.get("byteOffset", 0), self._buffers[view["buffer"]]
            return ImageFile(name, content[start : start + view["byteLength"]], wraps)
        uri = image["uri"]
        if uri.startswith(_INLINE):
            return ImageFile(name, base64.b64decode(uri.partition(",")[2]), wraps)
        return ImageFile(unquote(uri), None, wraps)


def _from_light(amounts: Floats) -> Floats:
    """Return the values of sRGB for amounts of light from 0 to 1 (IEC 61966-2-1)."""
    above = 1.055 * np.maximum(amounts, 1e-9) ** (1.0 / 2.4) - 0.055
    return np.asarray(np.round(np.where(amounts <= 0.0031308, 12.92 * amounts, above), 9), np.float64)


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
    return {key: tree[key] for key in (*_READ, *_OF_LOOK) if key in tree}, binary


def _passed(primitive: dict[str, Any], *, drawn: bool) -> dict[str, Any]:
    """Return what trimesh reads of a primitive."""
    kept = {key: primitive[key] for key in _OF_PRIMITIVE if key in primitive}
    given = primitive["attributes"]
    passed = {"POSITION": given["POSITION"]}
    if drawn:
        passed |= {name: given[key] for key, name in _OF_CORNERS.items() if key in given}
    return {**kept, "attributes": passed}


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
