"""What of the shapes of links and bodies is drawn, and in which colours and images."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

from dynx.errors import DynxError, shown
from dynx.model.geometry.imaged import image_fault, imaged_shape
from dynx.model.geometry.links import Appearance, Collision, Colour, Geometry, LinkGeometry, Visual
from dynx.model.geometry.mesh import Faces, Mesh
from dynx.model.geometry.mesh_reading import Surface
from dynx.model.geometry.solids import Shape
from dynx.spatial.scalar import Floats

_GREY: Colour = (0.7, 0.7, 0.7, 1.0)
"""Colour of shapes without one of their own."""


def link_shapes(geometry: Geometry, link: str) -> Iterator[tuple[Shape, Colour, Floats]]:
    """Yield the shapes by which a link is drawn, each with its colour and its pose in the link (4, 4).

    These are its visual shapes, else its collision shapes; nothing where neither can be read. They are
    coloured as `coloured_shapes` says, in grey where nothing gives a colour.
    """
    for visual in _readable(geometry.visuals, link):
        yield from coloured_shapes(visual, None, _GREY)
        link = ""
    for each in _readable(geometry.collisions, link) if link else ():
        yield each.shape, _GREY, each.origin.matrix


def coloured_shapes(
    placed: Visual | Collision, rgba: Colour | None, otherwise: Colour
) -> Iterator[tuple[Shape, Colour, Floats]]:
    """Yield a placed shape, or the parts of a mesh by the look that its file gives them, each with its colour
    and its pose (4, 4).

    A shape has the colour of its own material, else `rgba`, else that of its file, else `otherwise`. The
    image of its own material, else those of its file, and the colours of corners of its file, are seen in
    that colour: each value is multiplied by it. Raises DescriptionError for a mesh that cannot be read.
    """
    shape, T = placed.shape, placed.origin.matrix
    own = placed.material if isinstance(placed, Visual) and placed.material is not None else Appearance()
    colour = own.rgba or rgba
    imaged = None if own.texture is None or own.fault else imaged_shape(shape, own.texture)
    if imaged is not None:
        yield imaged, colour or (1.0, 1.0, 1.0, 1.0), T
        return
    parts = shape.parts if isinstance(shape, Mesh) else ()
    if not parts or (colour is not None and not any(part.is_varied for _, part in parts)):
        yield shape, colour or otherwise, T
        return
    for mesh, part in parts:
        yield mesh, colour or part.rgba or otherwise, T


@dataclass(frozen=True)
class _HullMesh(Mesh):
    """The convex hull of a mesh, which has one colour."""

    parts = ()
    mesh: Mesh | None = None

    @cached_property
    def triangles(self) -> tuple[Floats, Faces]:
        """Vertices (n, 3) [m] and triangles (m, 3) of the hull."""
        assert self.mesh is not None
        return self.mesh.hull

    @cached_property
    def surface(self) -> Surface:
        """The hull, flat between its edges."""
        return Surface(*self.triangles)


def colliding_geometry(geometry: Geometry, links: Iterable[str], rgba: Colour) -> Geometry:
    """Return a geometry whose visual shapes are the collision shapes of another, as engines collide them: of
    a mesh the convex hull. A link has none where one of its collision shapes cannot be read."""
    look = Appearance(rgba=rgba)

    def visuals(link: str) -> tuple[Visual, ...]:
        try:
            return tuple(
                Visual(_collided(each.shape), each.origin, look) for each in geometry.collisions(link)
            )
        except DynxError:
            return ()

    return Geometry({link: LinkGeometry(visuals(link)) for link in links})


def _collided(shape: Shape) -> Shape:
    """Return a shape as engines collide it; raises DescriptionError for a mesh that cannot be read."""
    if not isinstance(shape, Mesh):
        return shape
    hull = _HullMesh(shape.file or shape.name, shape.scale, shape.fault, shape.part, shape)
    _ = hull.triangles
    return hull


def link_look_notes(geometry: Geometry, link: str) -> Iterator[str]:
    """Yield what the shapes of a link are drawn without, and why its visual shapes are not drawn."""
    try:
        for each in geometry.visuals(link):
            yield from look_notes(each)
    except DynxError as error:
        yield str(error)


def look_notes(placed: Visual | Collision) -> tuple[str, ...]:
    """Return what a shape is drawn without, such as an image that is missing, one sentence each.

    Raises DescriptionError for a mesh that cannot be read.
    """
    found: tuple[str, ...] = ()
    if isinstance(placed, Visual) and placed.material is not None and placed.material.texture is not None:
        name, fault = os.path.basename(placed.material.texture), placed.material.fault
        fault = f"image {shown(name)} is not shown: {fault}" if fault else ""
        fault = fault or image_fault(placed.shape, placed.material.texture)
        if not fault:
            return ()
        found = (fault,)
    return (*found, *placed.shape.notes) if isinstance(placed.shape, Mesh) else found


def _readable(
    shapes_of: Callable[[str], Sequence[Visual | Collision]], link: str
) -> Sequence[Visual | Collision]:
    """Return the shapes of a link; none where one has a fault or a mesh that cannot be read."""
    try:
        shapes = shapes_of(link)
        for each in shapes:
            if isinstance(each.shape, Mesh):
                _ = each.shape.parts if isinstance(each, Visual) else each.shape.triangles
    except DynxError:
        return ()
    return shapes
