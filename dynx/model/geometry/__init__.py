"""Shapes of links and bodies: primitives and meshes, their volumes and moments, and the files of meshes."""

from dynx.model.geometry.links import Appearance, Collision, ContactFilter, Geometry, LinkGeometry, Visual
from dynx.model.geometry.mesh import Mesh
from dynx.model.geometry.shapes import Box, Capsule, Cylinder, Ellipsoid, HeightField, Plane, Sphere
from dynx.model.geometry.solids import Shape, SolidProperties, solid_properties

__all__ = [
    "Appearance",
    "Box",
    "Capsule",
    "Collision",
    "ContactFilter",
    "Cylinder",
    "Ellipsoid",
    "Geometry",
    "HeightField",
    "LinkGeometry",
    "Mesh",
    "Plane",
    "Shape",
    "SolidProperties",
    "Sphere",
    "Visual",
    "solid_properties",
]
