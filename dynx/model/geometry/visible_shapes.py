"""The shapes by which the links of a robot are drawn."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

from dynx.errors import DynxError
from dynx.model.geometry.links import Collision, Colour, Geometry, Visual
from dynx.model.geometry.mesh import Mesh
from dynx.model.geometry.solids import Shape
from dynx.spatial.scalar import Floats

_GREY: Colour = (0.7, 0.7, 0.7, 1.0)
"""Colour of shapes without one of their own."""


def link_shapes(geometry: Geometry, link: str) -> Iterator[tuple[Shape, Colour, Floats]]:
    """Yield the shapes by which a link is drawn, each with its colour and its pose in the link (4, 4).

    These are its visual shapes, else its collision shapes; nothing where neither can be read.
    """
    for each in _readable(geometry.visuals, link) or _readable(geometry.collisions, link):
        material = each.material if isinstance(each, Visual) else None
        rgba = _GREY if material is None or material.rgba is None else material.rgba
        yield each.shape, rgba, each.origin.matrix


def _readable(
    shapes_of: Callable[[str], Sequence[Visual | Collision]], link: str
) -> Sequence[Visual | Collision]:
    """Return the shapes of a link; none where one has a fault or a mesh that cannot be read."""
    try:
        shapes = shapes_of(link)
        for each in shapes:
            if isinstance(each.shape, Mesh):
                _ = each.shape.triangles
    except DynxError:
        return ()
    return shapes
