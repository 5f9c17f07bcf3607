"""Triangles of shapes for the page: orientation of surfaces, and reduction to a budget of triangles."""

from __future__ import annotations

import math
import sys
from collections.abc import Mapping
from functools import cache, cached_property, lru_cache
from glob import glob
from hashlib import sha256
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from dynx.files.cache import keep, read_cached, source_hash
from dynx.model.geometry import Box, Capsule, Cylinder, HeightField, Mesh, Plane, Shape, Sphere
from dynx.model.geometry.mesh_reading import Surface
from dynx.spatial.scalar import Floats
from dynx.viewer.library import SIMPLIFY_VERSION, simplify


def turned_outwards(triangles: Triangles) -> Triangles | None:
    """Return triangles that form closed surfaces turned outwards, so that nobody sees one from behind; None
    where a surface is open.

    Each edge of a closed surface is passed as often in one direction as in the other, and a surface that is
    turned inwards encloses a negative volume (divergence theorem). That of a cavity, which nobody sees, is
    turned, too.
    """
    if not len(triangles.faces):
        return None
    places = [np.unique(column, return_inverse=True)[1].reshape(-1) for column in triangles.vertices.T]
    _, number = distinct_rows(np.stack(places, axis=1))
    faces = number[triangles.faces]
    if not _is_closed(faces):
        return None
    count = int(faces.max()) + 1
    first, second = faces.reshape(-1), np.roll(faces, -1, axis=1).reshape(-1)
    surface = np.arange(count)
    while True:
        # Each vertex takes the smallest number among its neighbours', and then that one's.
        smaller = surface.copy()
        np.minimum.at(smaller, first, surface[second])
        smaller = smaller[smaller]
        if np.array_equal(smaller, surface):
            break
        surface = smaller
    a, b, c = np.moveaxis(triangles.vertices[triangles.faces].astype(np.float64), 1, 0)
    surface_of_face = surface[faces[:, 0]]
    volumes = np.bincount(surface_of_face, np.einsum("ij,ij->i", a, np.cross(b, c)), minlength=count)
    inwards = volumes[surface_of_face] < 0.0
    return Triangles(
        triangles.vertices, np.where(inwards[:, None], triangles.faces[:, ::-1], triangles.faces)
    )


TRIANGLE_BUDGET = 15_000
"""Largest number of triangles of all visual meshes together where they are reduced."""

MAX_WHOLE = 1_000
"""Largest number of triangles of a mesh that always stays whole."""

_JOINED = 1e-3
"""Distance within which vertices of a reduced mesh are joined, as a share of its size."""

_GENTLE = 3
"""Aggressiveness of fast-simplification; by its default of 7 thin parts of a mesh collapse."""

_GROWTH = 1.5
"""Ratio of the numbers of triangles in two attempts to reduce a mesh."""

_LEAST_SAVED = 0.2
"""Share of its triangles that a reduced mesh saves at least; otherwise the mesh stays whole."""

_SURFACE_CHANGED, _VOLUME_CHANGED, _MOVED = 0.05, 0.02, 0.01
"""Largest effects of a reduction: on the surface and on the enclosed volume as shares of them, and the
distance by which the box or any point moves as a share of the diagonal of the box."""

_TRIED = 20_000
"""Number of random points on a surface whose distance from another one is measured."""

_SAMPLES = 100_000
"""Number of random points that stand for a surface where distances to it are measured. They lie so densely
that the nearest of them is farther away than the surface by less than half of the distance allowed."""


def budgets(meshes: Mapping[Mesh, int], total: int = TRIANGLE_BUDGET) -> dict[Mesh, int]:
    """Divide `total` triangles between meshes that occur so many times each, in proportion to what each has.

    A mesh with few triangles keeps them. Meshes that together have fewer than `total` keep all. A mesh that
    so few do not represent gets more (`reduced`).
    """
    sizes = {mesh: len(mesh.triangles[1]) for mesh in meshes}
    everything = sum(sizes[mesh] * count for mesh, count in meshes.items())
    share = min(1.0, total / max(everything, 1))
    return {mesh: max(math.floor(size * share), min(size, MAX_WHOLE)) for mesh, size in sizes.items()}


def has_graphics_processor() -> bool:
    """Check whether this machine has a graphics processor that a browser on it can use; True if unknown."""
    if not sys.platform.startswith("linux"):
        return True
    return bool(glob("/dev/dri/renderD*") or glob("/dev/nvidia[0-9]*"))


def reduced(shape: Shape, budget: int | None) -> Triangles:
    """Return a shape as triangles: a mesh with at most `budget`, unless that is None, or with as many as its
    surface, its box and, if it is closed, its volume need.

    Raises DescriptionError for a mesh that cannot be read.
    """
    if not isinstance(shape, Mesh) or budget is None or len(shape.triangles[1]) <= budget:
        return triangles_of(shape)
    return _reduced(shape, budget)


def with_edges(shape: Shape, budget: int | None) -> tuple[Triangles, bool]:
    """Return what `reduced` returns, with vertices of their own on both sides of sharp edges, where the file
    of a mesh says so, and whether all edges are sharp.

    Raises DescriptionError for a mesh that cannot be read.
    """
    if not isinstance(shape, Mesh):
        return triangles_of(shape), False
    return _with_edges(shape, budget)


@lru_cache(maxsize=256)
def _with_edges(mesh: Mesh, budget: int | None) -> tuple[Triangles, bool]:
    surface, found = mesh.surface, reduced(mesh, budget)
    if surface.normals is None:
        return found, True
    if len(found.faces) == len(surface.faces):
        return split_at_edges(surface)[0], False
    name = _hash(found.vertices, found.faces, surface.vertices, surface.faces, surface.normals)
    split = _unpacked(read_cached(name))
    if split is None:
        normals = _nearest_normals(found, surface)
        vertices, faces = found.vertices.astype(np.float64), found.faces.astype(np.intp)
        split, _ = split_at_edges(Surface(vertices, faces, normals))
        keep(name, _packed(split))
    return split, False


_NORMALS_TRIED = 8
"""Number of the nearest corners of the whole mesh, among whose normals that of a reduced mesh is chosen."""

_NORMAL_STEPS = 64
"""Number of steps between 0 and 1 by which normals are told apart."""


def _nearest_normals(found: Triangles, whole: Surface) -> Floats:
    """Return normals (m, 3, 3) for the corners of a reduced mesh: of the normals at the nearest corners of
    the whole one, that which is the nearest to the normal of the triangle."""
    assert whole.normals is not None
    points = whole.vertices[whole.faces].reshape(-1, 3)
    normals = whole.normals.reshape(-1, 3)
    _, chosen = np.unique(
        np.concatenate([points, np.rint(4.0 * normals)], axis=1).astype(np.float32), axis=0, return_index=True
    )
    _, near = cKDTree(points[chosen]).query(found.vertices, k=min(_NORMALS_TRIED, len(chosen)))
    near = chosen[near.reshape(len(found.vertices), -1)]
    a, b, c = np.moveaxis(found.vertices[found.faces].astype(np.float64), 1, 0)
    tried = normals[near[found.faces]]
    best = np.argmax(np.einsum("ijkl,il->ijk", tried, np.cross(b - a, c - a)), axis=2)
    return np.asarray(np.take_along_axis(tried, best[:, :, None, None], axis=2)[:, :, 0])


def split_at_edges(surface: Surface, *corners: Floats) -> tuple[Triangles, list[Floats]]:
    """Return the triangles of a surface with vertices that have one place, one normal and one value of each
    array of values at corners (m, 3, k), and these values at the vertices (n, k).

    A page computes normals anew as means of the triangles at a vertex, so that edges are smooth between
    triangles that have a vertex in common, and sharp between others.
    """
    faces = surface.faces
    keys = [np.unique(surface.vertices, axis=0, return_inverse=True)[1].reshape(-1)[faces].reshape(-1)]
    if surface.normals is None:
        keys.append(np.repeat(np.arange(len(faces)), 3))
    else:
        steps = np.rint(_NORMAL_STEPS * (surface.normals.reshape(-1, 3) + 1.0)).astype(np.int64)
        keys.append((steps * [1, 4 * _NORMAL_STEPS, (4 * _NORMAL_STEPS) ** 2]).sum(axis=1))
    for values in corners:
        rows = np.ascontiguousarray(values.reshape(-1, values.shape[-1]))
        keys.append(np.unique(rows, axis=0, return_inverse=True)[1].reshape(-1))
    number = keys[0]
    for key in keys[1:]:
        distinct, of = np.unique(key, return_inverse=True)
        number = np.unique(number * len(distinct) + of.reshape(-1), return_inverse=True)[1].reshape(-1)
    _, first, number = np.unique(number, return_index=True, return_inverse=True)
    triangles = Triangles.of(surface.vertices[faces.reshape(-1)[first]], number.reshape(-1, 3))
    return triangles, [values.reshape(-1, values.shape[-1])[first] for values in corners]


@lru_cache(maxsize=256)
def _reduced(mesh: Mesh, budget: int) -> Triangles:
    vertices, faces = mesh.triangles
    name = _hash(vertices, faces, np.array(budget))
    found = _unpacked(read_cached(name))
    if found is None:
        found = _simplified(vertices, faces, budget)
        keep(name, _packed(found))
    return found


def _simplified(vertices: Floats, faces: NDArray[np.intp], budget: int) -> Triangles:
    # Files repeat vertices, not always to the last digit, and only edges that are shared can be collapsed.
    grid = _JOINED * float(np.ptp(vertices, axis=0).max()) or 1.0
    cells = np.rint(vertices / grid).astype(np.int64)
    first, number = distinct_rows(cells - cells.min(axis=0))
    points = vertices[first]
    joined = number[faces]
    distinct = (
        (joined[:, 0] != joined[:, 1]) & (joined[:, 1] != joined[:, 2]) & (joined[:, 0] != joined[:, 2])
    )
    remaining = joined[distinct]
    if len(remaining) <= budget:
        return Triangles.of(points, remaining)
    points, remaining = points.astype(np.float32), remaining.astype(np.int32)
    whole = _Measures(points, remaining)
    target = max(budget, 4)
    while whole.surface > 0.0 and target <= (1.0 - _LEAST_SAVED) * len(faces):
        found, kept = simplify(points, remaining, target_count=target, agg=_GENTLE)
        if len(kept) and whole.is_near(_Measures(found, kept)):
            return Triangles.of(found, kept)
        target = math.ceil(_GROWTH * target)
    return Triangles.of(vertices, faces)


class _Measures:
    """What a reduction keeps of a mesh: surface, box, place and, if it is closed, volume."""

    def __init__(self, vertices: NDArray[np.floating[Any]], faces: NDArray[np.integer[Any]]) -> None:
        self.corners: Floats = vertices.astype(np.float64)[faces]
        self._faces = faces
        self._box = np.stack([self.corners.min(axis=(0, 1)), self.corners.max(axis=(0, 1))])
        self.a, b, c = np.moveaxis(self.corners, 1, 0)
        self._normals = np.cross(b - self.a, c - self.a)
        self._areas = 0.5 * np.linalg.norm(self._normals, axis=1)
        self.surface = float(self._areas.sum())

    def is_near(self, found: _Measures) -> bool:
        """Check whether a reduced mesh is near this one."""
        volume = self._volume
        largest = _MOVED * float(np.linalg.norm(np.ptp(self._box, axis=0)))
        return bool(
            abs(found.surface - self.surface) <= _SURFACE_CHANGED * self.surface
            and np.abs(found._box - self._box).max() <= largest
            and (volume is None or abs(found._enclosed() - volume) <= _VOLUME_CHANGED * abs(volume))
            and found.distance(self) <= largest
            and self.distance(found) <= largest
        )

    def distance(self, other: _Measures) -> float:
        """Return the largest distance of a corner, or of a point on the surface, from the other surface, or a
        little more."""
        # A triangle that closes a hole has its corners on the other surface.
        corners = np.unique(self.corners.reshape(-1, 3), axis=0)
        return float(np.max(other._points.query(np.concatenate([corners, self._points.data[:_TRIED]]))[0]))

    def _enclosed(self) -> float:
        from_middle = self.a - self._box.mean(axis=0)
        return float(np.einsum("ij,ij->", from_middle, self._normals)) / 6.0

    @cached_property
    def _volume(self) -> float | None:
        return self._enclosed() if _is_closed(self._faces) else None

    @cached_property
    def _points(self) -> cKDTree:
        """Points on the surface."""
        random = np.random.default_rng(0)
        of = random.choice(len(self._areas), _SAMPLES, p=self._areas / self.surface)
        weights = random.dirichlet((1.0, 1.0, 1.0), _SAMPLES)
        return cKDTree(np.einsum("ij,ijk->ik", weights, self.corners[of]))


def _is_closed(faces: NDArray[np.integer[Any]]) -> bool:
    """Check whether each edge is passed as often in one direction as in the other."""
    count = int(faces.max(initial=0)) + 1
    first, second = faces.reshape(-1).astype(np.int64), np.roll(faces, -1, axis=1).reshape(-1)
    return np.array_equal(np.sort(first * count + second), np.sort(second * count + first))


def _hash(*arrays: NDArray[Any]) -> str:
    """Return the name in the cache of what is made of a mesh: a hash of all that determines it."""
    digest = sha256(_version().encode())
    for array in arrays:
        digest.update(f" {array.dtype} {array.shape} ".encode())
        digest.update(array.tobytes())
    return f"{digest.hexdigest()}.triangles"


@cache
def _version() -> str:
    return f"{np.__version__} {SIMPLIFY_VERSION} {source_hash(Path(__file__).parent)}"


def _packed(triangles: Triangles) -> bytes:
    vertices, faces = triangles
    return (
        len(vertices).to_bytes(8, "little") + vertices.astype("<f4").tobytes() + faces.astype("<u4").tobytes()
    )


def _unpacked(content: bytes | None) -> Triangles | None:
    """Return the triangles in a content of the cache, whose checksum was right; None for None."""
    if content is None:
        return None
    count = int.from_bytes(content[:8], "little")
    vertices = np.frombuffer(content, "<f4", 3 * count, 8).reshape(-1, 3)
    return Triangles.of(vertices, np.frombuffer(content, "<u4", offset=8 + vertices.nbytes).reshape(-1, 3))


_SEGMENTS = 32
"""Number of sides of round shapes."""

_GROUND_SIDE = 40.0
"""Length [m] of the sides of the square that stands for a plane without end."""


class Triangles(NamedTuple):
    """Vertices (n, 3) [m] and the vertices of each triangle (m, 3), counter-clockwise from outside."""

    vertices: NDArray[np.float32]
    faces: NDArray[np.uint32]

    @classmethod
    def of(cls, vertices: NDArray[np.generic], faces: NDArray[np.generic]) -> Triangles:
        """Return vertices and faces of any type of number as triangles."""
        return cls(np.asarray(vertices, dtype=np.float32), np.asarray(faces, dtype=np.uint32))


def triangles_of(shape: Shape) -> Triangles:
    """Return a shape as triangles.

    Raises DescriptionError for a mesh that cannot be read.
    """
    if isinstance(shape, Mesh):
        return Triangles.of(*shape.triangles)
    if isinstance(shape, HeightField):
        return Triangles.of(*shape.triangles())
    return _primitive(shape)


def hull_of(shape: Shape) -> Triangles:
    """Return a shape as engines collide it: a mesh as its convex hull.

    Raises DescriptionError for a mesh that cannot be read.
    """
    return Triangles.of(*shape.hull) if isinstance(shape, Mesh) else triangles_of(shape)


def resized(triangles: Triangles, factor: float) -> Triangles:
    """Return triangles of another size, about the middle of the box around them."""
    if factor == 1.0:
        return triangles
    vertices = triangles.vertices
    middle = 0.5 * (vertices.min(axis=0) + vertices.max(axis=0))
    return Triangles.of(middle + factor * (vertices - middle), triangles.faces)


def distinct_rows(rows: NDArray[np.integer[Any]]) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return where each distinct row of non-negative integers (n, 3) occurs first, and the number of each row
    among these.

    The three numbers are joined to one where it can hold them: numbers are sorted ten times faster than rows.
    """
    sizes = [int(column.max(initial=0)) + 1 for column in rows.T]
    if math.prod(sizes) < 2**63:
        joined = (rows[:, 0].astype(np.int64) * sizes[1] + rows[:, 1]) * sizes[2] + rows[:, 2]
        _, first, number = np.unique(joined, return_index=True, return_inverse=True)
    else:
        _, first, number = np.unique(rows, axis=0, return_index=True, return_inverse=True)
    return first, number.reshape(-1)


@lru_cache(maxsize=256)
def _primitive(shape: Shape) -> Triangles:
    if isinstance(shape, Box):
        return _box(np.array(shape.size))
    if isinstance(shape, Sphere):
        return _revolved(*_arc(shape.radius, 0.0))
    if isinstance(shape, Capsule):
        return _revolved(*_arc(shape.radius, 0.5 * shape.length))
    if isinstance(shape, Cylinder):
        r, h = shape.radius, 0.5 * shape.length
        # Rows of vertices at the edges stand twice, so that the edges stay sharp when normals are averaged.
        return _revolved(np.array([0.0, r, r, r, r, 0.0]), np.array([-h, -h, -h, h, h, h]))
    if isinstance(shape, Plane):
        half = 0.5 * _GROUND_SIDE
        corners = [[-half, -half, 0.0], [half, -half, 0.0], [half, half, 0.0], [-half, half, 0.0]]
        return Triangles.of(np.array(corners), np.array([[0, 1, 2], [0, 2, 3]]))
    raise TypeError(f"no triangles of a {type(shape).__name__}")


def _box(size: Floats) -> Triangles:
    signs = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
    quads = np.array([[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]])
    # Each face has vertices of its own, so that its edges stay sharp when normals are averaged.
    vertices = (signs * size)[quads].reshape(-1, 3)
    first = np.arange(0, 24, 4)[:, None]
    return Triangles.of(vertices, np.concatenate([first + np.array([0, 1, 2]), first + np.array([0, 2, 3])]))


def _arc(radius: float, half_length: float) -> tuple[Floats, Floats]:
    """Return radius and height along the profile of a ball that is cut in two, from its lowest point up."""
    angle = np.linspace(-0.5 * math.pi, 0.5 * math.pi, _SEGMENTS // 2 + 1)
    apart = np.where(angle < 0.0, -half_length, half_length)
    middle = len(angle) // 2
    r, z = radius * np.cos(angle), radius * np.sin(angle) + apart
    r[0] = r[-1] = 0.0
    if half_length:
        r = np.insert(r, middle, radius)
        z = np.insert(z, middle, -half_length)
    return r, z


def _revolved(radius: Floats, height: Floats) -> Triangles:
    """Return the surface that a profile from the axis back to the axis sweeps around z."""
    angle = np.linspace(0.0, 2.0 * math.pi, _SEGMENTS, endpoint=False)
    x, y = np.outer(radius, np.cos(angle)), np.outer(radius, np.sin(angle))
    vertices = np.stack([x, y, np.repeat(height[:, None], _SEGMENTS, axis=1)], axis=-1).reshape(-1, 3)
    row = np.arange(len(radius) - 1)[:, None] * _SEGMENTS
    here, along = row + np.arange(_SEGMENTS), row + (np.arange(_SEGMENTS) + 1) % _SEGMENTS
    faces = np.concatenate(
        [
            np.stack([here, along, along + _SEGMENTS], axis=-1).reshape(-1, 3),
            np.stack([here, along + _SEGMENTS, here + _SEGMENTS], axis=-1).reshape(-1, 3),
        ]
    )
    corners = vertices[faces]
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    return Triangles.of(vertices, faces[area > 1e-9 * area.max()])
