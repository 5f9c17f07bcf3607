"""The shapes by which the links of a robot are drawn."""

from __future__ import annotations

from collections.abc import Iterator

from dynx.errors import DynxError
from dynx.model.geometry.links import Colour, Geometry, Visual
from dynx.model.geometry.mesh import Mesh
from dynx.model.geometry.solids import Shape
from dynx.spatial.scalar import Floats

_GREY: Colour = (0.7, 0.7, 0.7, 1.0)
"""Colour of shapes without one of their own."""


def link_shapes(geometry: Geometry, link: str) -> Iterator[tuple[Shape, Colour, Floats]]:
    """Yield the shapes by which a link is drawn, each with its colour and its pose in the link (4, 4)."""
    visuals = _readable_visuals(geometry, link)
    for each in visuals or geometry.collisions(link):
        material = each.material if isinstance(each, Visual) else None
        rgba = _GREY if material is None or material.rgba is None else material.rgba
        yield each.shape, rgba, each.origin.matrix


def _readable_visuals(geometry: Geometry, link: str) -> tuple[Visual, ...]:
    """Return the visual shapes of a link; none where one has a fault or a mesh that cannot be read."""
    try:
        visuals = geometry.visuals(link)
        for each in visuals:
            if isinstance(each.shape, Mesh):
                _ = each.shape.triangles
    except DynxError:
        return ()
    return visuals
