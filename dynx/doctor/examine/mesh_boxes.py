"""Collision meshes for PyBullet's plain call, each replaced by the eight corners of its bounding box.

Without ``URDF_USE_INERTIA_FROM_FILE`` PyBullet computes inertias from the bounding boxes of shapes in their
own frames, so the corners give the same inertia as the mesh. They load faster, and PyBullet never sees the
file that a description names: its readers end the process on damaged files, and open any path.

PyBullet adds another margin to the hull of an OBJ file than to that of STL and COLLADA files, so the corners
keep that difference. It reads no text STL, and ignores the up axis of COLLADA. A mesh that dynx cannot find
or read is left out.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import product
from pathlib import Path

import numpy as np

from dynx.model.geometry.formats.stl import STL_FACET
from dynx.model.xml.source import Edit, XmlSource
from dynx.rules.geometry import bullet_box, collision_meshes

_FACES = (
    *((0, 1, 2), (1, 3, 2), (4, 6, 5), (5, 6, 7), (0, 4, 1), (1, 4, 5)),
    *((2, 3, 6), (3, 7, 6), (0, 2, 4), (2, 6, 4), (1, 5, 3), (3, 5, 7)),
)
"""Triangles of a box by the numbers of its corners."""


def with_mesh_boxes(source: XmlSource, folder: Path) -> XmlSource:
    """Replace each collision mesh by a mesh of the corners of its box, written into `folder`; those that
    cannot be found or read are removed."""
    return source.apply(*_edits(source, folder))


def _edits(source: XmlSource, folder: Path) -> Iterator[Edit]:
    written: dict[str, Path | None] = {}
    for link in source.root.all("link"):
        for collision, mesh in collision_meshes(link):
            name = mesh.attributes.get("filename", "")
            if name not in written:
                written[name] = _write_corners(folder / f"mesh{len(written)}", name, source.source)
            path = written[name]
            if path is None:
                yield source.keeping_lines(source.removal(collision))
            else:
                yield source.attribute_edit(mesh, "filename", str(path))


def _write_corners(path: Path, name: str, source: str) -> Path | None:
    """Write the corners of the box of a mesh, as OBJ for an OBJ file, else as STL; None if it is not read."""
    found = bullet_box(name, source)
    if found is None:
        return None
    (low, high), suffix = found
    corners = list(product(*zip(low, high, strict=True)))
    if suffix == ".obj":
        lines = [f"v {x!r} {y!r} {z!r}" for x, y, z in corners]
        lines += [f"f {i + 1} {j + 1} {k + 1}" for i, j, k in _FACES]
        path = path.with_suffix(suffix)
        path.write_text("\n".join([*lines, ""]), encoding="ascii")
        return path
    facets = np.zeros(len(_FACES), STL_FACET)
    facets["corners"] = np.array(corners)[np.array(_FACES)]
    path = path.with_suffix(".stl")
    path.write_bytes(bytes(80) + len(_FACES).to_bytes(4, "little") + facets.tobytes())
    return path
