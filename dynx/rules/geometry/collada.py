"""Points of a COLLADA file, placed as its scene places them.

COLLADA 1.4.1: <unit> scales; <node>s nest, with <matrix>, <translate>, <rotate> and <scale> applied in
document order; <instance_geometry> places a mesh. Some loaders rotate a file whose <up_axis> is not z and
some do not, so the points of both readings are returned. A file with other elements that move points (skins,
<lookat>, <skew>, nodes of other files) is not read, so that no box is too small.
"""

from __future__ import annotations

from collections.abc import Iterator
from xml.etree import ElementTree

import numpy as np

from dynx.spatial.scalar import Floats
from dynx.spatial.so3 import rotation_about

_DEEPEST = 50
_TO_Z_UP = {
    "Y_UP": ((1.0, 0.0, 0.0), (0.0, 0.0, -1.0), (0.0, 1.0, 0.0)),
    "X_UP": ((0.0, -1.0, 0.0), (0.0, 0.0, -1.0), (1.0, 0.0, 0.0)),
}
_UNREADABLE = ("lookat", "skew", "instance_controller")


def collada_points(data: bytes) -> Floats | None:
    """Return all points of the scene (n, 3) [m]; None where the file has elements that are not supported."""
    # By entities a small file can grow without bound, and no mesh needs one.
    if b"<!DOCTYPE" in data or b"<!ENTITY" in data:
        return None
    try:
        root = ElementTree.fromstring(data)
    except ElementTree.ParseError:
        return None
    for element in root.iter():
        _, _, element.tag = element.tag.rpartition("}")
    scene = _Scene(root)
    try:
        found = [points @ T[:3, :3].T + T[:3, 3] for points, T in scene.placed()]
    except (_NotSupported, KeyError):
        return None
    if not found:
        return None
    points = scene.unit * np.concatenate(found)
    turned = _TO_Z_UP.get(scene.up_axis)
    return points if turned is None else np.concatenate([points, points @ np.array(turned).T])


class _NotSupported(Exception):
    """An element that is not supported."""


class _Scene:
    def __init__(self, root: ElementTree.Element) -> None:
        unit = root.find("asset/unit")
        self.unit = float(unit.get("meter", "1")) if unit is not None else 1.0
        self.up_axis = (root.findtext("asset/up_axis") or "Y_UP").strip()
        self._root = root
        self._by_id = {key: element for element in root.iter() if (key := element.get("id"))}

    def placed(self) -> Iterator[tuple[Floats, Floats]]:
        """Yield the points of each mesh, and its pose (4, 4) in the scene, scale included."""
        for scene in self._root.findall("library_visual_scenes/visual_scene"):
            for node in scene.findall("node"):
                yield from self._of_node(node, np.eye(4), 0)

    def _of_node(self, node: ElementTree.Element, T: Floats, depth: int) -> Iterator[tuple[Floats, Floats]]:
        if depth > _DEEPEST or any(node.find(tag) is not None for tag in _UNREADABLE):
            raise _NotSupported
        for child in node:
            T = T @ _transform(child)
        for instance in node.findall("instance_geometry"):
            yield self._points(self._target(instance, "url")), T
        for instance in node.findall("instance_node"):
            yield from self._of_node(self._target(instance, "url"), T, depth + 1)
        for below in node.findall("node"):
            yield from self._of_node(below, T, depth + 1)

    def _points(self, geometry: ElementTree.Element) -> Floats:
        found = []
        for semantic in geometry.iterfind("mesh/vertices/input"):
            if semantic.get("semantic") != "POSITION":
                continue
            source = self._target(semantic, "source")
            array, accessor = source.find("float_array"), source.find("technique_common/accessor")
            if array is None or accessor is None:
                raise _NotSupported
            numbers = np.array((array.text or "").split(), dtype=np.float64)
            stride, offset = int(accessor.get("stride", "1")), int(accessor.get("offset", "0"))
            if stride < 3:
                raise _NotSupported
            rows = (len(numbers) - offset) // stride
            found.append(numbers[offset : offset + rows * stride].reshape(rows, stride)[:, :3])
        if not found:
            raise _NotSupported
        return np.concatenate(found)

    def _target(self, element: ElementTree.Element, attribute: str) -> ElementTree.Element:
        reference = element.get(attribute, "")
        if not reference.startswith("#"):
            raise _NotSupported
        return self._by_id[reference[1:]]


def _transform(element: ElementTree.Element) -> Floats:
    """Return the matrix (4, 4) of one element of a node; the identity for elements that move nothing."""
    T = np.eye(4)
    if element.tag not in ("matrix", "translate", "rotate", "scale"):
        return T
    numbers = np.array((element.text or "").split(), dtype=np.float64)
    if element.tag == "matrix":
        return numbers.reshape(4, 4)
    if element.tag == "translate":
        T[:3, 3] = numbers
    elif element.tag == "scale":
        T[:3, :3] = np.diag(numbers)
    else:
        x, y, z, angle_deg = numbers.tolist()
        axis = np.array([x, y, z])
        T[:3, :3] = rotation_about(axis / np.linalg.norm(axis), np.asarray(np.radians(angle_deg)))
    return T
