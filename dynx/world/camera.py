"""Pictures of scenes by rays through the shapes of every part at its pose, the same for every engine.

Shapes are lit by the `Scenery`, with shadows, and planes are tiled. A picture has colour, depth and
segmentation, and PNG files.
"""

from __future__ import annotations

import math
import os
import struct
import zlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dynx.argument_types import checks_types
from dynx.errors import ArgumentError, UnknownNameError, nearest, shown
from dynx.files.reading import checked_path
from dynx.files.writing import write_bytes
from dynx.model.geometry import Box, HeightField, Mesh, Plane, Shape
from dynx.model.geometry.drawn_shapes import link_look_notes, link_shapes, look_notes
from dynx.model.geometry.ray_casting import cast_on_shape
from dynx.rbd.kinematics import link_poses
from dynx.spatial.scalar import Floats
from dynx.spatial.se3 import inverse
from dynx.steppers.camera import Camera, Draw, Drawing, DrawnShape, DrawnTriangles
from dynx.steppers.state import WorldState
from dynx.world.boxes import shape_box
from dynx.world.scene.scene import Scene
from dynx.world.scenery import (
    GAMMA,
    KEY_DIRECTION,
    LEAST_OPENNESS,
    LIGHT,
    MATTE,
    OCCLUSION_REACH,
    OCCLUSION_SHARE,
    OCCLUSION_SLOPE,
    OCCLUSION_STEPS,
    OCCLUSION_TURNS,
    TILE,
    Scenery,
    tiles,
)

if TYPE_CHECKING:
    from dynx.model.geometry.mesh_reading import Surface

DEPTH_UNIT = 1e-3
"""Length [m] of one step of the grey values in a PNG file of depths."""


@dataclass(frozen=True, eq=False)
class Picture:
    """A picture of a camera; the first row is the upper one, the first column the left one."""

    rgb: NDArray[np.uint8]
    """Colour (height, width, 3)."""
    depth: Floats
    """Distance along the optical axis (height, width) [m]; infinite where nothing is seen."""
    segmentation: NDArray[np.intp]
    """Index in `names` of the part that is seen (height, width); -1 where nothing is seen."""
    names: tuple[str, ...]
    """Links as ``robot/link``, and bodies."""
    notes: tuple[str, ...] = ()
    """Sentences on what cannot be drawn, such as a missing image."""

    @checks_types
    def mask(self, name: str) -> NDArray[np.bool_]:
        """Return where a body, ``robot/link``, or any link of a robot is seen (height, width).

        Raises UnknownNameError for another name.
        """
        numbers = [k for k, each in enumerate(self.names) if each == name or each.startswith(f"{name}/")]
        if not isinstance(name, str) or not numbers:
            raise UnknownNameError(f"no part {shown(name)} in the picture{nearest(name, self.names)}")
        return np.isin(self.segmentation, numbers)

    @checks_types
    def write_png(self, path: str | os.PathLike[str], what: str = "rgb") -> None:
        """Write the picture as a PNG file, atomically.

        `what` is ``"rgb"``, ``"depth"`` (16 bits of grey, in millimetres, 65535 for 65.535 m and farther and
        for nothing) or ``"segmentation"`` (16 bits of grey, the number in `names` plus 1, 0 for nothing).
        """
        if not checked_path(path).lower().endswith(".png"):
            raise ArgumentError(f"a picture is written as .png, not as {shown(os.path.basename(path))}")
        pixels: NDArray[Any]
        if what == "rgb":
            pixels = self.rgb
        elif what == "depth":
            pixels = np.minimum(np.rint(self.depth / DEPTH_UNIT), 65535.0).astype(np.uint16)
        elif what == "segmentation":
            pixels = (self.segmentation + 1).astype(np.uint16)
        else:
            raise ArgumentError(f"what is {shown(what)}; wanted 'rgb', 'depth' or 'segmentation'")
        write_bytes(path, png_bytes(pixels))

    def _repr_png_(self) -> bytes:
        return png_bytes(self.rgb)

    def __repr__(self) -> str:
        height, width = self.depth.shape
        seen = sorted({self.names[k] for k in np.unique(self.segmentation) if k >= 0})
        return f"<Picture of {width} x {height} pixels: {', '.join(seen) or 'nothing'}>"


def png_bytes(pixels: NDArray[Any]) -> bytes:
    """Return a PNG file of colours (height, width, 3) of 8 bits, or of grey values (height, width) of 16."""
    height, width = pixels.shape[:2]
    depth, colour_type = (8, 2) if pixels.ndim == 3 else (16, 0)
    rows = np.ascontiguousarray(pixels, ">u2" if depth == 16 else "u1").reshape(height, -1).view(np.uint8)
    # Each row begins with the number of its filter, 0 for none.
    lines = np.concatenate([np.zeros((height, 1), np.uint8), rows], axis=1).tobytes()
    head = struct.pack(">IIBBBBB", width, height, depth, colour_type, 0, 0, 0)
    parts = ((b"IHDR", head), (b"IDAT", zlib.compress(lines)), (b"IEND", b""))
    return b"\x89PNG\r\n\x1a\n" + b"".join(
        struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
        for kind, data in parts
    )


MAX_PAIRS = 1_000_000
"""Largest number of pairs of a triangle and a pixel that are computed at once."""

PIXEL_MARGIN = 1e-6
"""Distance [pixels] from a triangle in the picture within which rounding may place a pixel's centre."""

_FACE_MARGIN = 1e-9
"""Share by which faces of a box are larger, so that rounding leaves no pixel between two of them."""

_COINCIDENT = 0.005
"""Share of its depth by which a ghost has to be nearer than a shape, to be seen before it."""

_LEAST_SLOPE = 0.02
"""Least cosine of the angle between a ray and the normal of a painted mesh."""

_SMOOTH = math.cos(math.radians(12.0))
"""Cosine of the angle between normals above which the rays of a pixel see one surface."""

Whole = NDArray[np.intp]


BEHIND_OPACITY = 0.75
"""Opacity of a mark that is seen through the shapes before it."""


class DepthBuffer:
    """Depth, normal and number of the shape seen in each pixel; all in the axes of the camera.

    A ray has z = 1, so that its parameter is the depth. Primitives are intersected in closed form, triangles
    by the signs of the volumes that a ray spans with their edges: two triangles share these bits for a common
    edge, so that no ray passes between them. Surfaces are seen from both sides.
    """

    def __init__(self, camera: Camera) -> None:
        self._camera = camera
        self._x, self._y = camera.rays()
        count = camera.size[0] * camera.size[1]
        self.depth = np.full(count, np.inf)
        self.normal = np.zeros((count, 3))
        self.number = np.full(count, -1, np.intp)
        self.factors: Floats | None = None
        """Factors (n, 3) of the colours of shapes, from images and corners; None where all are 1."""

    def draw(self, number: int, shape: Shape | DrawnTriangles, T: Floats, *, painted: bool = False) -> None:
        """Draw a shape at the pose T (4, 4) in the frame of the camera, scale excluded; a mesh that is
        `painted` with its normals, its image, and the colours of its corners."""
        if painted and isinstance(shape, Mesh):
            surface = shape.surface
            vertices = surface.vertices @ T[:3, :3].T + T[:3, 3]
            self._draw_triangles(number, vertices, surface.faces, _Paint(surface, T[:3, :3]))
            return
        if isinstance(shape, Mesh | HeightField | DrawnTriangles):
            if isinstance(shape, DrawnTriangles):
                vertices, faces = shape
            else:
                vertices, faces = shape.triangles if isinstance(shape, Mesh) else shape.triangles()
            self._draw_triangles(number, vertices @ T[:3, :3].T + T[:3, 3], faces)
            return
        if isinstance(shape, Plane):
            self._draw_plane(number, T[:3, 2], float(T[:3, 2] @ T[:3, 3]))
            return
        low, high = shape_box(shape, T)
        first, last = self._window(low[None], high[None])
        columns, rows = (np.arange(first[0, k], last[0, k] + 1) for k in range(2))
        if not len(columns) or not len(rows):
            return
        pixels = (rows[:, None] * self._camera.size[0] + columns).ravel()
        if isinstance(shape, Box):
            self._draw_box(number, 0.5 * np.array(shape.size), T, columns, rows, pixels)
            return
        rays = self.rays(pixels)
        start = self._camera.near * rays
        distance, normal = cast_on_shape(shape, T, start, rays)
        self._keep(number, pixels, distance + self._camera.near, normal)

    def _draw_box(
        self, number: int, half: Floats, T: Floats, columns: Whole, rows: Whole, pixels: Whole
    ) -> None:
        """Draw the faces of a box with half its edges (3,) that can be seen in the pixels of some rows and
        columns: those that face the eye, unless it is near enough to look inside."""
        x, y, R, p = self._x[columns], self._y[rows], T[:3, :3], T[:3, 3]
        eye = -R.T @ p
        clear = float(np.linalg.norm(np.maximum(np.abs(eye) - half, 0.0)))
        outside = clear > self._camera.near * math.sqrt(1.0 + self._x[0] ** 2 + self._y[0] ** 2)
        # Products of the axes of the box with the rays, by row and column.
        along = [axis[0] * x + (axis[1] * y + axis[2])[:, None] for axis in R.T]
        for k, side in ((k, side) for k in range(3) for side in (-1.0, 1.0)):
            if outside and side * eye[k] <= half[k]:
                continue
            with np.errstate(divide="ignore", invalid="ignore"):
                depth = (side * half[k] - eye[k]) / along[k]
                inside = depth >= self._camera.near
                for j in {0, 1, 2} - {k}:
                    inside &= np.abs(depth * along[j] + eye[j]) <= half[j] * (1.0 + _FACE_MARGIN)
            found = np.flatnonzero(inside)
            normal = np.broadcast_to(side * R[:, k], (len(found), 3))
            self._keep(number, pixels[found], depth.ravel()[found], normal)

    def _draw_plane(self, number: int, normal: Floats, offset: float) -> None:
        """Draw the plane of the points whose product with a unit normal is `offset` [m]."""
        slope = normal[0] * self._x + (normal[1] * self._y + normal[2])[:, None]
        with np.errstate(divide="ignore", invalid="ignore"):
            depth = np.where(slope != 0.0, offset / slope, np.inf).ravel()
        pixels = np.flatnonzero(depth >= self._camera.near)
        self._keep(number, pixels, depth[pixels], np.broadcast_to(normal, (len(pixels), 3)))

    def lay_over(self, other: DepthBuffer, first: int) -> None:
        """Show what another buffer of the same camera sees where it is clearly nearer.

        Its numbers are counted from `first`."""
        nearer = np.flatnonzero(other.depth < (1.0 - _COINCIDENT) * self.depth)
        self.depth[nearer], self.normal[nearer] = other.depth[nearer], other.normal[nearer]
        self.number[nearer] = first + other.number[nearer]
        if self.factors is not None:
            self.factors[nearer] = 1.0

    def rays(self, pixels: Whole) -> Floats:
        """Return the rays (n, 3) through the centres of pixels (n,), with z = 1."""
        width = self._camera.size[0]
        return np.stack([self._x[pixels % width], self._y[pixels // width], np.ones(len(pixels))], axis=1)

    def _window(self, low: Floats, high: Floats) -> tuple[Whole, Whole]:
        """Return the first and last column and row (m, 2) of the pixels that boxes from `low` to `high`
        (m, 3) can cover; the last is before the first for a box that is not seen."""
        far = np.maximum(high[:, 2:], self._camera.near)
        near = np.maximum(low[:, 2:], self._camera.near)
        side = np.array(self._camera.size)
        scale, middle = self._camera.focal_length, 0.5 * side - 0.5
        with np.errstate(invalid="ignore", over="ignore"):
            # An infinite box covers the picture: infinity divided by infinity is as good as no bound.
            least = scale * np.fmin(low[:, :2] / near, low[:, :2] / far) + middle
            most = scale * np.fmax(high[:, :2] / near, high[:, :2] / far) + middle
        least, most = np.where(np.isnan(least), -np.inf, least), np.where(np.isnan(most), np.inf, most)
        # One pixel of margin, because the bounds are rounded.
        first = np.clip(np.floor(least), 0, side).astype(np.intp)
        last = np.clip(np.ceil(most), -1, side - 1).astype(np.intp)
        last[(high[:, 2] < self._camera.near) | (low[:, 2] > self._camera.far)] = -1
        return first, last

    def _draw_triangles(
        self, number: int, vertices: Floats, faces: Whole, paint: _Paint | None = None
    ) -> None:
        first, last = self._triangle_windows(vertices, faces)
        seen = np.flatnonzero((last >= first).all(axis=1))
        faces, first, sides = faces[seen], first[seen], (last - first + 1)[seen]
        total = np.cumsum(sides[:, 0] * sides[:, 1])
        begin = 0
        while begin < len(faces):
            done = total[begin - 1] if begin else 0
            end = max(begin + 1, int(np.searchsorted(total, done + MAX_PAIRS, side="right")))
            part = slice(begin, end)
            self._draw_some(
                number, vertices[faces[part]], first[part], sides[part], paint and paint.on(seen[part])
            )
            begin = end

    def _triangle_windows(self, vertices: Floats, faces: Whole) -> tuple[Whole, Whole]:
        """Return the first and last column and row (m, 2) of the pixels whose centres triangles can cover;
        the last is before the first for a triangle that is not seen."""
        corners = np.ascontiguousarray(faces.T)
        z = vertices[:, 2]
        behind = z < self._camera.near
        side = np.array(self._camera.size)
        first, last = np.empty((2, len(faces), 2), np.intp)
        for axis in range(2):
            with np.errstate(divide="ignore", invalid="ignore"):
                image = self._camera.focal_length * vertices[:, axis] / z + (0.5 * side[axis] - 0.5)
            a, b, c = image[corners]
            least, most = np.minimum(np.minimum(a, b), c), np.maximum(np.maximum(a, b), c)
            with np.errstate(invalid="ignore"):
                first[:, axis] = np.ceil(np.clip(least - PIXEL_MARGIN, 0, side[axis]))
                last[:, axis] = np.floor(np.clip(most + PIXEL_MARGIN, -1, side[axis] - 1))
        hidden = behind[corners]
        crossing = np.flatnonzero(hidden.any(axis=0))
        if len(crossing):
            points = vertices[faces[crossing]]
            first[crossing], last[crossing] = self._window(points.min(axis=1), points.max(axis=1))
        return first, last

    def _draw_some(
        self, number: int, corners: Floats, first: Whole, sides: Whole, paint: _Paint | None
    ) -> None:
        a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
        edges = np.stack([np.cross(b, c), np.cross(c, a), np.cross(a, b)], axis=1)
        normal = np.cross(b - a, c - a)
        height = np.einsum("ij,ij->i", normal, a)
        count = sides[:, 0] * sides[:, 1]
        triangle = np.repeat(np.arange(len(corners)), count)
        within = np.arange(len(triangle)) - np.repeat(np.cumsum(count) - count, count)
        column = first[triangle, 0] + within % sides[triangle, 0]
        row = first[triangle, 1] + within // sides[triangle, 0]
        pixels = row * self._camera.size[0] + column
        x, y = self._x[column], self._y[row]
        signs = [
            edges[triangle, k, 0] * x + edges[triangle, k, 1] * y + edges[triangle, k, 2] for k in range(3)
        ]
        inside = (np.minimum.reduce(signs) >= 0.0) | (np.maximum.reduce(signs) <= 0.0)
        triangle, pixels, x, y = triangle[inside], pixels[inside], x[inside], y[inside]
        slope = normal[triangle, 0] * x + normal[triangle, 1] * y + normal[triangle, 2]
        with np.errstate(divide="ignore", invalid="ignore"):
            depth = np.where(slope != 0.0, height[triangle] / slope, np.inf)
        order = np.lexsort((depth, pixels))
        ahead = order[depth[order] >= self._camera.near]
        nearest = ahead[np.unique(pixels[ahead], return_index=True)[1]]
        seen = self._keep(number, pixels[nearest], depth[nearest], normal[triangle[nearest]])
        if paint is None:
            return
        hits = np.flatnonzero(inside)[nearest[seen]]
        weights = np.stack([each[hits] for each in signs], axis=1)
        weights /= weights.sum(axis=1, keepdims=True)
        triangle, pixels = triangle[nearest[seen]], pixels[nearest[seen]]
        rays = self.rays(pixels)
        if paint.surface.normals is not None:
            self.normal[pixels] = paint.normals(triangle, weights, normal[triangle], rays)
        pixel = self.depth[pixels] / self._camera.focal_length
        factors = paint.factors(triangle, weights, corners, normal, rays, pixel)
        if factors is not None:
            if self.factors is None:
                self.factors = np.ones((len(self.depth), 3))
            self.factors[pixels] = factors

    def _keep(self, number: int, pixels: Whole, depth: Floats, normal: Floats) -> Whole:
        """Store what is nearer than all before, and return which pixels these are; each occurs once."""
        better = np.flatnonzero((depth < self.depth[pixels]) & (depth <= self._camera.far))
        chosen = pixels[better]
        self.depth[chosen] = depth[better]
        self.normal[chosen] = normal[better]
        self.number[chosen] = number
        if self.factors is not None:
            self.factors[chosen] = 1.0
        return better


class _Paint(NamedTuple):
    """What the triangles of a mesh look like."""

    surface: Surface
    R: Floats
    """Rotation (3, 3) from the frame of the mesh to that of the camera."""
    chosen: Whole = np.zeros(0, np.intp)
    """Numbers of the triangles that are drawn."""

    def on(self, chosen: Whole) -> _Paint:
        """Return what these triangles look like."""
        return self._replace(chosen=chosen)

    def normals(self, triangle: Whole, weights: Floats, flat: Floats, rays: Floats) -> Floats:
        """Return the normals (n, 3), in the axes of the camera and towards it, where rays (n, 3) meet
        triangles by their number in `chosen` (n,), at mean values of their corners by weights (n, 3); `flat`
        are those of the triangles."""
        assert self.surface.normals is not None
        given = self.surface.normals[self.chosen[triangle]]
        normal = np.einsum("ij,ijk->ik", weights, given) @ self.R.T
        flat = flat * np.where(np.einsum("ij,ij->i", flat, rays) > 0.0, -1.0, 1.0)[:, None]
        normal *= np.where(np.einsum("ij,ij->i", normal, flat) < 0.0, -1.0, 1.0)[:, None]
        # Near the outline of a round mesh the mean of normals may point away from the camera.
        unit = rays / np.linalg.norm(rays, axis=1)[:, None]
        away = np.einsum("ij,ij->i", normal, unit)
        normal -= np.maximum(away + _LEAST_SLOPE, 0.0)[:, None] * unit
        return np.asarray(normal)

    def factors(
        self, triangle: Whole, weights: Floats, corners: Floats, normal: Floats, rays: Floats, pixel: Floats
    ) -> Floats | None:
        """Return the factors (n, 3) of the colour there; None without image and colours of corners. `corners`
        (m, 3, 3) and `normal` (m, 3) are those of all triangles of `chosen`, `pixel` (n,) the extent of a
        pixel [m]."""
        number = self.chosen[triangle]
        if self.surface.colours is not None:
            return np.asarray(np.einsum("ij,ijk->ik", weights, self.surface.colours[number]))
        if self.surface.texture is None or self.surface.uv is None:
            return None
        uv = self.surface.uv[self.chosen]
        (a, b), size = (uv[:, 1] - uv[:, 0]).T, self.surface.texture.pixels.shape
        c, d = (uv[:, 2] - uv[:, 0]).T
        double_area = np.linalg.norm(normal, axis=1)
        with np.errstate(divide="ignore", invalid="ignore"):
            density = np.sqrt(np.abs(a * d - b * c) * (size[0] * size[1]) / double_area)[triangle]
            slope = np.abs(np.einsum("ij,ij->i", normal[triangle], rays)) / (
                double_area[triangle] * np.linalg.norm(rays, axis=1)
            )
            extent = density * pixel / np.sqrt(np.maximum(slope, _LEAST_SLOPE))
        return self.surface.texture.colours(np.einsum("ij,ijk->ik", weights, self.surface.uv[number]), extent)


SHADOW_SIDES = (160, 1024)
"""Least and largest width and height of the picture from the key light, in which shadows are looked up
[pixels]: half of those of the picture, because edges of shadows are soft."""

_LIGHT_DISTANCE = 12.0
"""Distance of the eye of that picture, in radii of the ball around what casts shadows; the key light itself
is infinitely far away."""

_SOFTNESS = 0.009
"""Radius of the light around an edge of a shadow, in radii of that ball."""

_COARSE_STEPS = np.array([[x, y] for x in (-1.0, 0.0, 1.0) for y in (-1.0, 0.0, 1.0)])
"""Places (9, 2) around a point at which its shadow is looked up first, in units of the softness."""

_FINE_STEPS = np.array([[x, y] for x in np.linspace(-1.0, 1.0, 7) for y in np.linspace(-1.0, 1.0, 7)])
_FINE_STEPS = _FINE_STEPS[np.hypot(*_FINE_STEPS.T) <= 1.1]
"""Places (n, 2) at which it is looked up where not all of the coarse ones agree."""

_RIM = 0.4
"""Share by which a see-through surface becomes opaque where it is seen along itself: its outline shows."""


def cast_rays(
    shapes: Sequence[DrawnShape],
    T_world_camera: Floats,
    camera: Camera,
    scenery: Scenery = MATTE,
    tile: float = TILE,
) -> Drawing:
    """Draw shapes by the rays through the centres of pixels; planes have tiles with edges of `tile` [m]."""
    buffer = _buffer_of(shapes, T_world_camera, camera)
    shading = _Shading(shapes, shapes, T_world_camera, camera, scenery, tile)
    colours = shading.colours(buffer, np.arange(len(buffer.depth)))
    return Drawing(_bytes(colours), buffer.depth, buffer.number)


def cast_rays_smoothly(
    shapes: Sequence[DrawnShape],
    T_world_camera: Floats,
    camera: Camera,
    scenery: Scenery = LIGHT,
    tile: float = TILE,
    ghosts: Sequence[DrawnShape] = (),
    veils: Sequence[DrawnShape] = (),
    seen_through: Sequence[DrawnShape] = (),
) -> Drawing:
    """Draw shapes as `cast_rays` does, with the mean colour of four rays in pixels at edges, which are not
    jagged then, and in those of images on meshes.

    Surfaces near others get less light of the sky. `ghosts` cast no shadow and are seen only where they are
    clearly nearer than the shapes; those whose opacity is below 1 are seen through, the nearest of them
    alone. `veils` are further ghosts, whose shadows are as weak as they are see-through. Shapes that are
    `seen_through` others have their own colours without light, paler behind others. Numbers of ghosts
    and veils follow those of the shapes, the opaque ones first. Depth and number, of what is opaque, are
    those of the first of the four rays, a quarter of a pixel from the centre.
    """
    width, height = camera.size
    fine = replace(camera, size=(2 * width, 2 * height))
    opaque = [each for each in ghosts if each.rgba[3] >= 1.0]
    clear = [*veils, *(each for each in ghosts if each.rgba[3] < 1.0)]
    buffer = _buffer_of(shapes, T_world_camera, fine)
    if opaque:
        buffer.lay_over(_buffer_of(opaque, T_world_camera, fine), len(shapes))
    every = np.arange(4 * width * height).reshape(height, 2, width, 2).swapaxes(1, 2).reshape(-1, 4)
    first = every[:, 0]
    seen = [*shapes, *opaque]
    edge = (buffer.number[every] != buffer.number[first, None]).any(axis=1)
    flat = np.array([*(isinstance(each.shape, Plane) for each in seen), True])
    curved = np.flatnonzero(~edge & ~flat[buffer.number[first]])
    normals = buffer.normal[every[curved]]
    size = np.linalg.norm(normals, axis=2)
    bend = np.einsum("ij,ikj->ik", normals[:, 0], normals[:, 1:])
    edge[curved] = (bend < _SMOOTH * size[:, :1] * size[:, 1:]).any(axis=1)
    # An image changes within a pixel.
    varied = np.array([*(_is_varied(each) for each in seen), False])
    edge |= varied[buffer.number[first]]
    openness = _openness(buffer, first, camera, OCCLUSION_REACH * _ball(_casting(shapes))[1])
    shading = _Shading(seen, shapes, T_world_camera, fine, scenery, tile, veils)
    colours = np.empty((len(every), 3))
    colours[~edge] = shading.colours(buffer, first[~edge], openness[~edge])
    colours[edge] = (
        shading.colours(buffer, every[edge].ravel(), np.repeat(openness[edge], 4))
        .reshape(-1, 4, 3)
        .mean(axis=1)
    )
    if clear:
        veil = _buffer_of(clear, T_world_camera, fine)
        _lay_veil(colours, veil, buffer, every, shading._replace(shapes=clear, veils=()))
    if seen_through:
        marks = _buffer_of(seen_through, T_world_camera, fine)
        hit = (marks.number >= 0)[every]
        share = np.where((marks.depth > buffer.depth)[every], BEHIND_OPACITY, 1.0) * hit
        own = np.array([each.rgba[:3] for each in seen_through])[marks.number[every]]
        colours *= 1.0 - share.mean(axis=1)[:, None]
        colours += (share[..., None] * own).mean(axis=1)
    return Drawing(_bytes(colours), buffer.depth[first], buffer.number[first])


def _lay_veil(
    colours: Floats, veil: DepthBuffer, behind: DepthBuffer, every: Whole, shading: _Shading
) -> None:
    """Mix into the colours (n, 3) of pixels, with the numbers of their four rays in `every` (n, 4), what a
    buffer of see-through shapes sees clearly nearer than another."""
    over = (veil.depth < (1.0 - _COINCIDENT) * behind.depth) & (veil.number >= 0)
    pixels = np.flatnonzero(over[every].any(axis=1))
    fine = every[pixels].ravel()
    hit = np.flatnonzero(over[fine])
    rays, normal = veil.rays(fine[hit]), veil.normal[fine[hit]]
    length = np.linalg.norm(normal, axis=1) * np.linalg.norm(rays, axis=1)
    slope = np.abs(np.einsum("ij,ij->i", normal, rays)) / np.where(length > 0.0, length, 1.0)
    opacity = np.array([each.rgba[3] for each in shading.shapes])[veil.number[fine[hit]]]
    opacity += _RIM * (1.0 - opacity) * (1.0 - np.minimum(slope, 1.0)) ** 3
    share = np.zeros(len(fine))
    share[hit] = opacity
    mixed = np.zeros((len(fine), 3))
    mixed[hit] = opacity[:, None] * shading.colours(veil, fine[hit])
    share, mixed = share.reshape(-1, 4).mean(axis=1), mixed.reshape(-1, 4, 3).mean(axis=1)
    colours[pixels] = (1.0 - share[:, None]) * colours[pixels] + mixed


def _openness(buffer: DepthBuffer, pixels: Whole, camera: Camera, reach: float) -> Floats:
    """Return the share (n,) of the sky's light that reaches what is seen in pixels of a buffer (n,), which
    are the pixels of a camera by rows: surfaces within `reach` [m] hide a part of it.

    Only surfaces that the camera sees count (ambient occlusion in the space of the picture)."""
    width, height = camera.size
    lit = np.ones(width * height)
    if not 0.0 < reach < np.inf:
        return lit
    depth, normal = buffer.depth[pixels], buffer.normal[pixels]
    x, y = camera.rays()
    rays = np.stack([np.tile(x, height), np.repeat(y, width), np.ones(width * height)], axis=1)
    radius = reach * camera.focal_length / depth
    # Where all that is near is within a pixel there is nothing to see.
    seen = np.flatnonzero((buffer.number[pixels] >= 0) & (radius > 1.5))
    points = rays[seen] * depth[seen, None]
    unit = normal[seen]
    length = np.linalg.norm(unit, axis=1)
    unit = (
        unit
        * (
            np.where(np.einsum("ij,ij->i", unit, points) > 0.0, -1.0, 1.0)
            / np.where(length > 0.0, length, 1.0)
        )[:, None]
    )
    column, row = seen % width, seen // width
    turn = (column % OCCLUSION_TURNS + OCCLUSION_TURNS * (row % OCCLUSION_TURNS)) / OCCLUSION_TURNS**2
    radius = np.minimum(radius[seen], 0.25 * height)
    hidden = np.zeros(len(seen))
    for k in range(OCCLUSION_STEPS):
        angle = 2.0 * math.pi * (turn + 0.381966 * k)
        away = radius * ((k + turn + 0.1) / OCCLUSION_STEPS)
        other_column = np.clip(np.rint(column + away * np.cos(angle)).astype(np.intp), 0, width - 1)
        other_row = np.clip(np.rint(row + away * np.sin(angle)).astype(np.intp), 0, height - 1)
        other = other_row * width + other_column
        far = depth[other]
        with np.errstate(invalid="ignore"):
            between = rays[other] * far[:, None] - points
            square = np.einsum("ij,ij->i", between, between)
            height_above = np.einsum("ij,ij->i", between, unit) / np.sqrt(np.maximum(square, 1e-18))
            near = np.maximum(1.0 - square / reach**2, 0.0)
            hidden += np.where(np.isfinite(far), np.maximum(height_above - OCCLUSION_SLOPE, 0.0) * near, 0.0)
    lit[seen] = np.maximum(1.0 - OCCLUSION_SHARE * hidden / OCCLUSION_STEPS, LEAST_OPENNESS)
    return _blurred(lit.reshape(height, width), depth.reshape(height, width), reach).ravel()


def _blurred(values: Floats, depth: Floats, reach: float) -> Floats:
    """Return means (h, w) of values over the squares in which pixels look at different places, of surfaces
    at depths that differ by less than half the `reach` [m]."""
    total, count = values.copy(), np.ones_like(values)
    half = OCCLUSION_TURNS // 2
    for down in range(-half, half):
        for right in range(-half, half):
            if down == 0 and right == 0:
                continue
            other = np.roll(depth, (down, right), (0, 1))
            with np.errstate(invalid="ignore"):
                near = np.abs(other - depth) < 0.5 * reach
            total += np.where(near, np.roll(values, (down, right), (0, 1)), 0.0)
            count += near
    return np.asarray(total / count)


def _is_varied(drawn: DrawnShape) -> bool:
    """Check whether a shape is drawn with an image or colours of corners."""
    if not drawn.painted or not isinstance(drawn.shape, Mesh):
        return False
    surface = drawn.shape.surface
    return surface.texture is not None or surface.colours is not None


def _bytes(colours: Floats) -> NDArray[np.uint8]:
    return np.asarray(np.rint(255.0 * colours), dtype=np.uint8)


def _buffer_of(shapes: Sequence[DrawnShape], T_world_camera: Floats, camera: Camera) -> DepthBuffer:
    T_camera_world = np.asarray(inverse(T_world_camera))
    buffer = DepthBuffer(camera)
    for number, each in enumerate(shapes):
        buffer.draw(number, each.shape, T_camera_world @ each.T, painted=each.painted)
    return buffer


class _Shading(NamedTuple):
    """What the colours of pixels depend on, beside the shapes that are seen in them."""

    shapes: Sequence[DrawnShape]
    casters: Sequence[DrawnShape]
    """Those that cast shadows; planes do not."""
    T_world_camera: Floats
    camera: Camera
    scenery: Scenery
    tile: float
    veils: Sequence[DrawnShape] = ()
    """See-through shapes that cast weak shadows."""

    def colours(self, buffer: DepthBuffer, pixels: Whole, openness: Floats | None = None) -> Floats:
        """Return the colours (n, 3) of pixels (n,), from 0 to 1; `openness` (n,) is the share of the light of
        the sky that reaches them."""
        if not len(pixels):
            return np.zeros((0, 3))
        rays = buffer.rays(pixels)
        unit = rays @ self.T_world_camera[:3, :3].T / np.linalg.norm(rays, axis=1)[:, None]
        seen = np.flatnonzero(buffer.number[pixels] >= 0)
        colours = self.scenery.sky(unit)
        if len(seen):
            pixels, rays, unit = pixels[seen], rays[seen], unit[seen]
            R, origin = self.T_world_camera[:3, :3], self.T_world_camera[:3, 3]
            points = origin + (buffer.depth[pixels, None] * rays) @ R.T
            normal = buffer.normal[pixels] @ R.T
            away = np.einsum("ij,ij->i", normal, unit)
            length = np.linalg.norm(normal, axis=1)
            # Of the side that is seen; zero for a triangle without an area.
            normal *= (np.where(away > 0.0, -1.0, 1.0) / np.where(length > 0.0, length, 1.0))[:, None]
            pixel = buffer.depth[pixels] / self.camera.focal_length
            own = np.array([each.rgba[:3] for each in self.shapes])[buffer.number[pixels]]
            if buffer.factors is not None:
                own *= buffer.factors[pixels]
            free = np.ones(len(seen)) if openness is None else openness[seen]
            colours[seen] = self._surfaces(buffer.number[pixels], own, points, normal, unit, pixel, free)
        return colours

    def _surfaces(
        self,
        number: Whole,
        colours: Floats,
        points: Floats,
        normal: Floats,
        rays: Floats,
        pixel: Floats,
        openness: Floats,
    ) -> Floats:
        """Return the colours (n, 3) of points (n, 3) of shapes by their `number` (n,), with their own
        `colours` (n, 3), the unit normals and the unit rays (n, 3) by which they are seen, and the extent of
        a pixel there (n,) [m]; `openness` (n,) is the share of the light of the sky that is not hidden."""
        grounds = [k for k, each in enumerate(self.shapes) if isinstance(each.shape, Plane | HeightField)]
        slopes = {}
        for k in grounds:
            on = np.flatnonzero(number == k)
            slope = np.abs(np.einsum("ij,ij->i", normal[on], rays[on]))
            slopes[k] = on, slope
            T = self.shapes[k].T
            local = (points[on] - T[:3, 3]) @ T[:3, :2]
            colours[on] *= tiles(local, self.tile, pixel[on] / np.maximum(slope, 1e-6))[:, None]
        colours = np.minimum(colours, 1.0)
        side = int(np.clip(max(self.camera.size) // 2, *SHADOW_SIDES))
        lit = _unshadowed(_casting(self.casters), points, normal, side)
        if self.veils:
            opacity = float(np.mean([each.rgba[3] for each in self.veils]))
            lit = np.minimum(
                lit, 1.0 - opacity * (1.0 - _unshadowed(_casting(self.veils), points, normal, side))
            )
        light = self.scenery.light(normal, lit, openness)
        gloss = self.scenery.gloss(normal, rays, lit, openness)
        for on, _ in slopes.values():
            gloss[on] = 0.0
        colours = (colours**GAMMA * light[:, None] + gloss[:, None]) ** (1.0 / GAMMA)
        for k, (on, slope) in slopes.items():
            # A height field has an end.
            if isinstance(self.shapes[k].shape, Plane):
                colours[on] = self.scenery.haze(colours[on], slope)
        return np.asarray(np.clip(colours, 0.0, 1.0))


def _unshadowed(shapes: Sequence[DrawnShape], points: Floats, normal: Floats, side: int) -> Floats:
    """Return the share (n,) of the key light that reaches points (n, 3) of surfaces past the shapes: 1 in the
    light, 0 in the shadow, between them at its edge."""
    lit = np.ones(len(points))
    middle, radius = _ball(shapes)
    if not 0.0 < radius < np.inf:
        return lit
    angle = 2.0 * math.asin(1.0 / _LIGHT_DISTANCE)
    reach = _LIGHT_DISTANCE * radius
    light = Camera.look_at(
        middle + reach * KEY_DIRECTION,
        middle,
        field_of_view=1.02 * angle,
        size=(side, side),
        near=0.5 * reach,
        far=2.0 * reach,
    )
    T_light_world = np.asarray(inverse(light.pose.matrix))
    buffer = DepthBuffer(light)
    for k, each in enumerate(shapes):
        buffer.draw(k, each.shape, T_light_world @ each.T)
    texel = reach / light.focal_length
    facing = np.flatnonzero(normal @ KEY_DIRECTION > 0.0)
    # Away from the surface, which would else lie in the shadow of itself.
    x, y, z = (
        T_light_world[:3, :3] @ (points[facing] + 2.0 * texel * normal[facing]).T + T_light_world[:3, 3:]
    )
    soft = max(1.0, _SOFTNESS * radius / texel)

    def share(chosen: Whole | slice, steps: Floats) -> Floats:
        total = np.zeros(len(x[chosen]))
        for across, upward in soft * steps:
            column = np.floor(light.focal_length * x[chosen] / z[chosen] + 0.5 * side + across)
            row = np.floor(light.focal_length * y[chosen] / z[chosen] + 0.5 * side + upward)
            inside = (column >= 0) & (column < side) & (row >= 0) & (row < side)
            pixels = np.where(inside, row * side + column, 0.0).astype(np.intp)
            total += ~inside | (z[chosen] <= buffer.depth[pixels] + 2.0 * texel * soft)
        return total / len(steps)

    found = share(slice(None), _COARSE_STEPS)
    border = np.flatnonzero((found > 0.0) & (found < 1.0))
    found[border] = share(border, _FINE_STEPS)
    lit[facing] = found
    return lit


def _casting(shapes: Sequence[DrawnShape]) -> list[DrawnShape]:
    """Return the shapes that cast shadows: planes do not."""
    return [each for each in shapes if not isinstance(each.shape, Plane)]


def _ball(shapes: Sequence[DrawnShape]) -> tuple[Floats, float]:
    """Return the middle (3,) and the radius [m] of a ball around shapes; the radius is 0 without shapes."""
    boxes = [shape_box(each.shape, each.T) for each in shapes if not isinstance(each.shape, DrawnTriangles)]
    if not boxes:
        return np.zeros(3), 0.0
    corners = np.array(boxes)
    low, high = corners[:, 0].min(axis=0), corners[:, 1].max(axis=0)
    return 0.5 * (low + high), 0.5 * float(np.linalg.norm(high - low))


def draw_picture(scene: Scene, state: WorldState, camera: Camera, draw: Draw = cast_rays) -> Picture:
    """Return what a camera sees of a scene in a state.

    Links are drawn as their visual shapes, and as their collision shapes where they have none or where one
    cannot be read; bodies as their visual shapes, else as their shapes. Meshes have the materials and images
    of their files, and `notes` of the picture names what is not drawn. Colours are opaque, except for those
    of opacity 0, which are not drawn. Raises UnknownNameError for an unknown part that carries the camera.
    """
    return draw_frames(scene, dict(part_poses(scene, state)), camera, draw)


def draw_frames(scene: Scene, frames: dict[str, Floats], camera: Camera, draw: Draw = cast_rays) -> Picture:
    """Return what a camera sees of a scene whose parts are at the poses (4, 4) given, as `draw_picture`."""
    if not isinstance(camera, Camera):
        raise ArgumentError(f"camera is of type {type(camera).__name__}; wanted a Camera")
    T_world_camera = camera.pose.matrix
    if camera.part is not None:
        scene.material(camera.part)
        T_world_camera = frames[camera.part] @ T_world_camera
    shapes = [each for each in drawn_shapes(scene, frames) if each.rgba[3] > 0.0]
    drawing = draw(shapes, T_world_camera, camera)
    parts = np.array([-1, *(each.part for each in shapes)], np.intp)
    rows = (camera.size[1], camera.size[0])
    return Picture(
        drawing.rgb.reshape(*rows, 3),
        drawing.depth.reshape(rows),
        parts[drawing.number + 1].reshape(rows),
        scene.parts,
        tuple(_look_notes(scene)),
    )


def _look_notes(scene: Scene) -> Iterator[str]:
    for robot in scene.robots:
        for link in robot.model.links:
            for note in link_look_notes(robot.model.geometry, link.name):
                yield f"{robot.name}/{link.name}: {note}"
    for body in scene.bodies:
        for each in body.visuals or body.shapes:
            for note in look_notes(each):
                yield f"{body.name}: {note}"


def part_poses(scene: Scene, state: WorldState) -> Iterator[tuple[str, Floats]]:
    """Yield every body and every link, as ``robot/link``, with its pose in the world (4, 4)."""
    for robot in scene.robots:
        for link, T in link_poses(robot.model, state.robots[robot.name].q):
            yield f"{robot.name}/{link}", T
    for name, body in state.bodies.items():
        yield name, body.T_world_body


def drawn_shapes(scene: Scene, frames: dict[str, Floats]) -> Iterator[DrawnShape]:
    """Yield the shapes of all parts; `frames` are the poses of the parts."""
    number = {name: k for k, name in enumerate(scene.parts)}
    for robot in scene.robots:
        for link in robot.model.links:
            name = f"{robot.name}/{link.name}"
            for shape, rgba, T in link_shapes(robot.model.geometry, link.name):
                yield DrawnShape(number[name], shape, rgba, frames[name] @ T)
    for body in scene.bodies:
        for shape, rgba, T in body.drawn_shapes():
            yield DrawnShape(number[body.name], shape, rgba, frames[body.name] @ T)
