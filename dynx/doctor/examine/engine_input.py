"""The file that engines load: the user's text without the shapes that do not affect dynamics.

Engines search for the mesh files that a description names, each in its own way, and a description is often
examined where they are absent. No mesh changes the dynamics of a link that states its inertia. So
``<visual>`` and mesh ``<collision>`` elements are removed; shapes that need no file stay, because some
engines compute the mass of a link without ``<inertial>`` from them. Drake also searches for the textures of
the robot's materials: those that it finds beside the description are replaced by colours, because they are
not beside the engine input.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory

from dynx.model.xml.source import SourceElement, XmlSource
from dynx.rules.geometry.textures import texture_replacements


def without_meshes(source: XmlSource) -> XmlSource:
    """Remove visual shapes, collision shapes that are meshes, and textures that engines find."""
    links = source.root.all("link")
    shapes = (source.removal(shape) for link in links for shape in _mesh_shapes(link))
    return source.apply(*shapes, *texture_replacements(source))


@contextmanager
def temporary_urdf(source: XmlSource) -> Iterator[Path]:
    """Write the document to a file that exists while the context lasts."""
    with TemporaryDirectory(prefix="dynx-", ignore_cleanup_errors=True) as folder:
        path = Path(folder) / "robot.urdf"
        path.write_bytes(source.to_bytes())
        yield path


def _mesh_shapes(link: SourceElement) -> Iterator[SourceElement]:
    yield from link.all("visual")
    for collision in link.all("collision"):
        if any(element.tag in ("mesh", "sdf_mesh", "convex") for element in collision.walk()):
            yield collision
