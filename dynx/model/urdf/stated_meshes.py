"""Meshes without a file in URDF: an element that dynx alone reads, so that text states all of a robot."""

from __future__ import annotations

from typing import Any
from xml.sax.saxutils import quoteattr

import numpy as np

from dynx.model.geometry.stated_mesh import StatedMesh
from dynx.model.xml.reading import Element
from dynx.model.xml.values import Reading

MESH_TAG = "dynx_mesh"


def stated_mesh_element(mesh: StatedMesh) -> str:
    """Return the element of a mesh."""
    points, corners = (" ".join(map(repr, _flat(each))) for each in (mesh.points, mesh.corners))
    faces = f' faces="{corners}"' if corners else ""
    scale = " ".join(map(repr, mesh.scale))
    return f'<{MESH_TAG} name={quoteattr(mesh.label)} vertices="{points}"{faces} scale="{scale}"/>'


def read_stated_mesh(element: Element, what: str, reading: Reading) -> StatedMesh:
    """Read the element of a mesh. Raises DescriptionError for malformed content."""
    found: dict[str, np.ndarray[Any, Any]] = {"vertices": np.empty((0, 3)), "faces": np.empty((0, 3))}
    for name in ("vertices", "faces"):
        count = len(element.attributes.get(name, "").split())
        if count % 3 or (name == "vertices" and not count):
            raise reading.error(element, f"{name} of {what} has {count} numbers; wanted three each")
        if count:
            numbers = np.array(reading.numbers(element, name, what, count))
            if name == "faces" and (numbers != np.rint(numbers)).any():
                raise reading.error(element, f"faces of {what} has a number that is not whole")
            found[name] = numbers.reshape(-1, 3)
    corners = tuple(map(tuple, found["faces"].astype(np.intp).tolist()))
    points = tuple(map(tuple, found["vertices"].tolist()))
    scale = reading.vector(element, "scale", what) if "scale" in element.attributes else (1.0, 1.0, 1.0)
    label = element.attributes.get("name") or "mesh"
    return StatedMesh(scale=scale, points=points, corners=corners, label=label)


def _flat(rows: tuple[tuple[float, ...], ...]) -> list[float]:
    return [number for row in rows for number in row]
