"""The file that engines are given: the user's text, without the shapes that dynamics does not need.

Engines look for the mesh files that a description names, each in its own way, and a description is
often examined where they are not. No mesh changes the dynamics of a link that states its inertia. So
``<visual>`` and mesh ``<collision>`` elements are cut out; shapes that need no file stay, for there are
engines that take the mass of a link without ``<inertial>`` from them.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory

from dynx.model.xml.source import SourceElement, XmlSource


def without_meshes(source: XmlSource) -> XmlSource:
    """The document without visual shapes and without collision shapes that are meshes."""
    return source.edited(*(source.removing(each) for link in source.root.all("link") for each in _cut(link)))


@contextmanager
def written(source: XmlSource) -> Iterator[Path]:
    """A file of the document, there while the context lasts."""
    with TemporaryDirectory(prefix="dynx-", ignore_cleanup_errors=True) as folder:
        path = Path(folder) / "robot.urdf"
        path.write_bytes(source.to_bytes())
        yield path


def _cut(link: SourceElement) -> Iterator[SourceElement]:
    yield from link.all("visual")
    for collision in link.all("collision"):
        if any(element.tag in ("mesh", "sdf_mesh", "convex") for element in collision.walk()):
            yield collision
