"""The file that engines load: the user's text without the shapes that do not affect dynamics.

Engines search for the mesh files that a description names, each in its own way, and a description is often
examined where they are absent. No mesh changes the dynamics of a link that states its inertia. So
``<visual>`` and mesh ``<collision>`` elements are removed; shapes that need no file stay, because some
engines compute the mass of a link without ``<inertial>`` from them. Where an engine computes inertias from
meshes too, they are replaced by their boxes (`mesh_boxes`). Drake also searches for the textures of the
robot's materials: those that it finds beside the description are replaced by colours, because they are not
beside the engine input.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory

from dynx.doctor.examine.mesh_boxes import with_mesh_boxes
from dynx.model.xml.source import XmlSource
from dynx.rules.geometry.bullet_boxes import collision_meshes
from dynx.rules.geometry.known_shapes import has_shape
from dynx.rules.geometry.textures import texture_replacements


def without_meshes(source: XmlSource, *, collisions: bool = True) -> XmlSource:
    """Remove visual shapes, textures that engines find and, with `collisions`, collision shapes that are
    meshes. Visuals without a shape, for which an engine may refuse the file, are left."""
    links = source.root.all("link")
    shapes = [shape for link in links for shape in link.all("visual") if has_shape(shape)]
    if collisions:
        shapes += [shape for link in links for shape, _ in collision_meshes(link)]
    return source.apply(*map(source.removal, shapes), *texture_replacements(source))


@contextmanager
def temporary_urdf(source: XmlSource, *, mesh_boxes: bool = False) -> Iterator[Path]:
    """Write the document, with `mesh_boxes` in place of collision meshes, to a file that exists while the
    context lasts."""
    with TemporaryDirectory(prefix="dynx-", ignore_cleanup_errors=True) as folder:
        path = Path(folder) / "robot.urdf"
        written = with_mesh_boxes(source, Path(folder)) if mesh_boxes else source
        path.write_bytes(written.to_bytes())
        yield path
