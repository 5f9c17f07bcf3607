"""The file that engines load: the user's text without the shapes that do not affect dynamics.

Engines search for the mesh files that a description names, each in its own way, and a description is often
examined where they are absent. No mesh changes the dynamics of a link that states its inertia. So
complete ``<visual>`` and mesh ``<collision>`` elements are removed; shapes without a file stay, because some
engines compute the mass of a link without ``<inertial>`` from them. Where an engine computes inertias from
meshes too, they are replaced by their boxes (`mesh_boxes`). Drake also searches for the textures of the
robot's materials: those that it finds beside the description are replaced by colours, because they are not
beside the engine input. Everything else stays on its line, because engines name lines in their messages.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from itertools import product
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from dynx.doctor.lines import line_opcodes, lines_of
from dynx.model.geometry.formats.facets import STL_FACET
from dynx.model.xml.source import Edit, SourceElement, XmlSource
from dynx.rules import Detection, Rule
from dynx.rules.geometry import bullet_box, collision_meshes, has_shape, may_be_refused, texture_replacements

# Collision meshes for PyBullet's plain call, each replaced by the eight corners of its bounding box.
#
# Without ``URDF_USE_INERTIA_FROM_FILE`` PyBullet computes inertias from the bounding boxes of shapes in
# their own frames, so the corners give the same inertia as the mesh. They load faster, and PyBullet never
# sees the file that a description names: its readers end the process on damaged files, and open any path.
#
# PyBullet adds another margin to the hull of an OBJ file than to that of STL and COLLADA files, so the
# corners keep that difference. It reads no text STL, and ignores the up axis of COLLADA. A mesh that dynx
# cannot find or read is left out.


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


# Line map from the file made readable to the user's file, in which the lines of findings are reported.


def with_original_lines(
    found: Sequence[tuple[Rule, Detection]], given: XmlSource, readable: XmlSource
) -> list[tuple[Rule, Detection]]:
    """Translate the lines of detections to the `given` text; rules about the text have these already."""
    if given.data == readable.data:
        return list(found)
    lines = line_map(*(lines_of(each.text_with_lines_before) for each in (given, readable)))
    return [
        (rule, replace(each, line=lines.get(each.line, each.line)))
        if rule.stage == "model" and each.line is not None
        else (rule, each)
        for rule, each in found
    ]


def line_map(given: Sequence[str], readable: Sequence[str]) -> dict[int, int]:
    """Map each line of the readable text to its line in the given text; a new line to where it was added."""
    lines = {}
    for _, first, last, start, end in line_opcodes(readable, given):
        for k in range(first, last):
            lines[k + 1] = min(start + k - first, max(end - 1, 0)) + 1
    return lines


_BOX = '<box size="1 1 1"/>'


def without_meshes(source: XmlSource, *, collisions: bool = True) -> XmlSource:
    """Remove visual shapes, textures that engines find and, with `collisions`, collision shapes that are
    meshes. Visuals for which an engine may refuse the file are left, with a box in place of a mesh file."""
    links = source.root.all("link")
    visuals = [shape for link in links for shape in link.all("visual") if has_shape(shape)]
    left = [shape for shape in visuals if may_be_refused(shape)]
    shapes = [shape for shape in visuals if shape not in left]
    boxes = [source.replacement(mesh, _BOX) for shape in left for mesh in _named_meshes(shape)]
    if collisions:
        shapes += [shape for link in links for shape, _ in collision_meshes(link)]
    edits = (*map(source.removal, shapes), *boxes, *texture_replacements(source))
    return source.apply(*map(source.keeping_lines, edits))


def _named_meshes(shape: SourceElement) -> list[SourceElement]:
    """Return the meshes of a shape that name a file."""
    return [each for each in shape.walk() if each.tag == "mesh" and each.attributes.get("filename")]


@contextmanager
def temporary_urdf(source: XmlSource, *, mesh_boxes: bool = False) -> Iterator[Path]:
    """Write the document, with `mesh_boxes` in place of collision meshes, to a file that exists while the
    context lasts."""
    with TemporaryDirectory(prefix="dynx-", ignore_cleanup_errors=True) as folder:
        path = Path(folder) / "robot.urdf"
        written = with_mesh_boxes(source, Path(folder)) if mesh_boxes else source
        path.write_bytes(written.to_bytes())
        yield path
