"""Shapes with the image of a material of a description: meshes that say where it lies, and primitives."""

from __future__ import annotations

import math
import os
from dataclasses import dataclass, field
from functools import cached_property, lru_cache

import numpy as np

from dynx.errors import DynxError, shown
from dynx.files.reading import read_file
from dynx.model.geometry.images import Texture, read_texture
from dynx.model.geometry.mesh import Faces, Mesh
from dynx.model.geometry.mesh_reading import Surface, SurfacePart, mesh_file
from dynx.model.geometry.shapes import Box, Cylinder, Ellipsoid, Sphere
from dynx.model.geometry.solids import Shape
from dynx.spatial.scalar import Floats

_SEGMENTS = 64
"""Number of sides of round shapes."""


@dataclass(frozen=True)
class ImagedShape(Mesh):
    """A shape that is drawn with the image in `file`."""

    shape: Shape = field(default_factory=lambda: Sphere(1.0))

    @cached_property
    def surface(self) -> Surface:
        """The triangles with the image on them."""
        texture = read_texture(read_file(self.file))
        if isinstance(self.shape, Mesh):
            found = None
            if self.shape.file:
                found = mesh_file(self.shape.file).textured_surface(texture, np.array(self.shape.scale))
            if found is None:
                raise ValueError(f"{self.shape.name} has no places in an image")
            return found
        return _primitive(self.shape, texture)

    @cached_property
    def triangles(self) -> tuple[Floats, Faces]:
        """Vertices (n, 3) [m] and triangles (m, 3)."""
        return self.surface.vertices, self.surface.faces

    @cached_property
    def parts(self) -> tuple[tuple[Mesh, SurfacePart], ...]:
        """The shape itself."""
        return ((self, SurfacePart(np.arange(len(self.surface.faces)), None, self.surface.texture)),)


@lru_cache(maxsize=256)
def imaged_shape(shape: Shape, image: str) -> ImagedShape | None:
    """Return a mesh, box, ball, ellipsoid or cylinder with an image on it; None for another shape, for a mesh
    without places in images, and for an image that cannot be read (`image_fault` tells why)."""
    return None if image_fault(shape, image) else ImagedShape(image, shape=shape)


@lru_cache(maxsize=256)
def image_fault(shape: Shape, image: str) -> str:
    """Return the reason why an image of a material is not shown on a shape; empty for one that is."""
    if not isinstance(shape, Mesh | Box | Sphere | Cylinder | Ellipsoid):
        return f"image {shown(os.path.basename(image))} is not shown on a {type(shape).__name__}"
    try:
        _ = ImagedShape(image, shape=shape).surface
    except (DynxError, ValueError) as error:
        return f"image {shown(os.path.basename(image))} is not shown: {error}"
    return ""


def _primitive(shape: Shape, texture: Texture) -> Surface:
    """Return the surface of a primitive: each face of a box has the whole image; around a ball, an
    ellipsoid and a cylinder it lies once, with its left edge in the direction of x."""
    if isinstance(shape, Box):
        signs = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
        # Counter-clockwise from outside, from the lower left corner.
        quads = np.array([[2, 0, 1, 3], [4, 6, 7, 5], [0, 4, 5, 1], [6, 2, 3, 7], [2, 6, 4, 0], [1, 5, 7, 3]])
        vertices = (signs * np.array(shape.size))[quads].reshape(-1, 3)
        first = np.arange(0, 24, 4)[:, None]
        faces = np.concatenate([first + np.array([0, 1, 2]), first + np.array([0, 2, 3])])
        uv = np.tile([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]], (6, 1))
        return Surface(vertices, faces, None, uv[faces], texture)
    if isinstance(shape, Ellipsoid):
        ball, radii = _primitive(Sphere(1.0), texture), np.array(shape.radii)
        assert ball.normals is not None
        normals = ball.normals / radii
        normals = normals / np.linalg.norm(normals, axis=-1, keepdims=True)
        return ball._replace(vertices=ball.vertices * radii, normals=normals)
    if isinstance(shape, Sphere):
        height = np.linspace(-0.5 * math.pi, 0.5 * math.pi, _SEGMENTS // 2 + 1)
        radii, z = shape.radius * np.cos(height), shape.radius * np.sin(height)
    else:
        assert isinstance(shape, Cylinder)
        radii, z = np.full(2, shape.radius), np.array([-0.5, 0.5]) * shape.length
    angle = np.linspace(0.0, 2.0 * math.pi, _SEGMENTS + 1)
    x, y = np.outer(radii, np.cos(angle)), np.outer(radii, np.sin(angle))
    vertices = np.stack([x, y, np.broadcast_to(z[:, None], x.shape)], axis=-1).reshape(-1, 3)
    u, v = np.meshgrid(np.linspace(0.0, 1.0, _SEGMENTS + 1), np.linspace(0.0, 1.0, len(z)))
    uv = np.stack([u, v], axis=-1).reshape(-1, 2)
    row = np.arange(len(z) - 1)[:, None] * (_SEGMENTS + 1)
    corner = (row + np.arange(_SEGMENTS)).reshape(-1)
    above = corner + _SEGMENTS + 1
    faces = np.concatenate(
        [np.stack([corner, corner + 1, above + 1], 1), np.stack([corner, above + 1, above], 1)]
    )
    normals = vertices / shape.radius if isinstance(shape, Sphere) else vertices * [1.0, 1.0, 0.0]
    if isinstance(shape, Cylinder):
        return _with_ends(vertices, faces, normals / shape.radius, uv, texture, z)
    return Surface(vertices, faces, normals[faces], uv[faces], texture)


def _with_ends(
    vertices: Floats, faces: Faces, normals: Floats, uv: Floats, texture: Texture, z: Floats
) -> Surface:
    """Return the surface of a cylinder with its ends, each with the largest disc of the image."""
    corners, radius = [uv[faces]], float(vertices[:, 0].max())
    all_normals, places, all_faces = [normals[faces]], [vertices], [faces]
    ring = np.arange(_SEGMENTS)
    for side, height in ((-1.0, z[0]), (1.0, z[1])):
        disc = vertices[: _SEGMENTS + 1] * [1.0, 1.0, 0.0] + [0.0, 0.0, height]
        middle = len(disc)
        own = np.stack([np.full(_SEGMENTS, middle), ring, ring + 1], 1)[:, :: int(side)]
        all_faces.append(own + sum(map(len, places)))
        points = np.concatenate([disc, [[0.0, 0.0, height]]])
        places.append(points)
        on_image = 0.5 + 0.5 * points[:, :2] * [side, 1.0] / radius
        corners.append(on_image[own])
        all_normals.append(np.broadcast_to([0.0, 0.0, side], (*own.shape, 3)))
    return Surface(
        np.concatenate(places),
        np.concatenate(all_faces),
        np.concatenate(all_normals),
        np.concatenate(corners),
        texture,
    )
