"""Meshes with an image or colours of corners, as nodes of a page: each is a small file of glTF."""

from __future__ import annotations

import json
import struct
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dynx.model.geometry.mesh_reading import Surface
from dynx.spatial.scalar import Floats
from dynx.viewer.triangles import Triangles, split_at_edges

_FLOAT, _WHOLE = 5126, 5125
"""Numbers of glTF for types of 4 bytes."""

_REPEAT, _CLAMP = 10497, 33071


class PaintedNode:
    """A node of the page that shows a file, with the triangles in it, which the page knows alone."""

    def __init__(self, node: Any, triangles: Triangles) -> None:
        self._node = node
        self.vertices, self.faces = triangles

    @property
    def visible(self) -> bool:
        """Whether the node is shown."""
        return bool(self._node.visible)

    @visible.setter
    def visible(self, shown: bool) -> None:
        self._node.visible = shown

    def __getattr__(self, name: str) -> Any:
        return getattr(self._node, name)


def glb(surface: Surface, rgba: tuple[float, float, float, float]) -> tuple[bytes, Triangles]:
    """Return a surface as a .glb file, seen in a colour with an opacity, and the triangles in it.

    Each value of the image or of the colours of corners is multiplied by that of the colour.
    """
    corners: list[Floats] = []
    if surface.uv is not None and surface.texture is not None:
        # In glTF the origin is the upper left corner of the image.
        corners.append(np.stack([surface.uv[..., 0], 1.0 - surface.uv[..., 1]], axis=-1))
    elif surface.colours is not None:
        corners.append(light_of(surface.colours))
    triangles, values = split_at_edges(surface, *corners)
    parts: list[NDArray[Any]] = [triangles.faces.reshape(-1), triangles.vertices]
    attributes = {"POSITION": 1}
    material: dict[str, Any] = {
        "pbrMetallicRoughness": {
            "baseColorFactor": [*light_of(np.array(rgba[:3])).tolist(), rgba[3]],
            "metallicFactor": 0.0,
            "roughnessFactor": 1.0,
        },
        "doubleSided": True,
        "alphaMode": "OPAQUE" if rgba[3] == 1.0 else "BLEND",
    }
    tree: dict[str, Any] = {"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}]}
    if values:
        attributes["COLOR_0" if surface.texture is None else "TEXCOORD_0"] = len(parts)
        parts.append(values[0].astype(np.float32))
    contents = [each.tobytes() for each in parts]
    if surface.texture is not None:
        wraps = [_REPEAT if each else _CLAMP for each in surface.texture.wraps]
        tree["images"] = [{"bufferView": len(contents), "mimeType": "image/png"}]
        tree["samplers"] = [{"wrapS": wraps[0], "wrapT": wraps[1], "magFilter": 9729, "minFilter": 9987}]
        tree["textures"] = [{"source": 0, "sampler": 0}]
        material["pbrMetallicRoughness"]["baseColorTexture"] = {"index": 0}
        contents.append(surface.texture.png)
    views, content = [], b""
    for each in contents:
        views.append({"buffer": 0, "byteOffset": len(content), "byteLength": len(each)})
        content += each + bytes(-len(each) % 4)
    tree |= {
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": attributes, "indices": 0, "material": 0}]}],
        "materials": [material],
        "accessors": [_accessor(number, each) for number, each in enumerate(parts)],
        "bufferViews": views,
        "buffers": [{"byteLength": len(content)}],
    }
    text = json.dumps(tree).encode()
    text += b" " * (-len(text) % 4)
    head = struct.pack("<4sII", b"glTF", 2, 28 + len(text) + len(content))
    chunks = struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(content), b"BIN\0")
    return head + chunks + content, triangles


def _accessor(number: int, values: NDArray[Any]) -> dict[str, Any]:
    width = {1: "SCALAR", 2: "VEC2", 3: "VEC3"}[1 if values.ndim == 1 else values.shape[1]]
    kind = _WHOLE if values.dtype.kind == "u" else _FLOAT
    found: dict[str, Any] = {
        "bufferView": number,
        "componentType": kind,
        "count": len(values),
        "type": width,
    }
    if width == "VEC3":
        found |= {"min": values.min(axis=0).tolist(), "max": values.max(axis=0).tolist()}
    return found


def light_of(values: Floats) -> Floats:
    """Return the amounts of light of values of sRGB from 0 to 1 (IEC 61966-2-1), as glTF has them."""
    return np.asarray(np.where(values <= 0.04045, values / 12.92, ((values + 0.055) / 1.055) ** 2.4))
