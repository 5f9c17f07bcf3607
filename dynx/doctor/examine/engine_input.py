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

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory

from dynx.doctor.examine.mesh_boxes import with_mesh_boxes
from dynx.model.xml.source import SourceElement, XmlSource
from dynx.rules.geometry import collision_meshes, has_shape, may_be_refused, texture_replacements

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
