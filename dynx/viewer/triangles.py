"""Triangles of shapes for the page: orientation of surfaces, and reduction to a budget of triangles."""

from __future__ import annotations

import math
import sys
from collections.abc import Mapping
from functools import cache, lru_cache
from glob import glob
from hashlib import sha256
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dynx.files.cache import keep, read_cached, source_hash
from dynx.model.geometry import Box, Capsule, Cylinder, Ellipsoid, HeightField, Mesh, Plane, Shape, Sphere
from dynx.model.geometry.mesh_reading import Surface
from dynx.spatial.scalar import Floats
from dynx.viewer.library import SIMPLIFY_VERSION
from dynx.viewer.reduction import distinct_rows, is_closed, simplified


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
    if not is_closed(faces):
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
    surface, its box, its colours and, if it is closed, its volume need.

    Raises DescriptionError for a mesh that cannot be read.
    """
    if not isinstance(shape, Mesh) or budget is None or len(shape.triangles[1]) <= budget:
        return triangles_of(shape)
    found = _reduced(shape, budget)
    return triangles_of(shape) if found is None else Triangles.of(found.vertices, found.faces)


def reduced_surface(mesh: Mesh, budget: int | None) -> Surface:
    """Return the surface of a mesh with the triangles of `reduced`, and what they look like.

    Raises DescriptionError for a mesh that cannot be read.
    """
    found = None if budget is None or len(mesh.triangles[1]) <= budget else _reduced(mesh, budget)
    return mesh.surface if found is None else found


def with_edges(shape: Shape, budget: int | None) -> tuple[Triangles, bool]:
    """Return what `reduced` returns, with vertices of their own on both sides of sharp edges, where the file
    of a mesh says so, and whether all edges are sharp.

    Raises DescriptionError for a mesh that cannot be read.
    """
    if not isinstance(shape, Mesh):
        return triangles_of(shape), False
    surface = reduced_surface(shape, budget)
    if surface.normals is None:
        return reduced(shape, budget), True
    return _with_edges(shape, budget), False


@lru_cache(maxsize=256)
def _with_edges(mesh: Mesh, budget: int | None) -> Triangles:
    return split_at_edges(reduced_surface(mesh, budget))[0]


_NORMALS_TRIED = 8
"""Number of the nearest corners of the whole mesh, among whose normals that of a reduced mesh is chosen."""

_NORMAL_STEPS = 64
"""Number of steps between 0 and 1 by which normals are told apart."""


def _nearest_normals(found: Surface, whole: Surface) -> Floats:
    """Return normals (m, 3, 3) for the corners of a reduced mesh: of the normals at the nearest corners of
    the whole one, that which is the nearest to the normal of the triangle."""
    assert whole.normals is not None
    points = whole.vertices[whole.faces].reshape(-1, 3)
    normals = whole.normals.reshape(-1, 3)
    _, chosen = np.unique(
        np.concatenate([points, np.rint(4.0 * normals)], axis=1).astype(np.float32), axis=0, return_index=True
    )
    # Imported here, because SciPy takes long to load.
    from scipy.spatial import cKDTree

    _, near = cKDTree(points[chosen]).query(found.vertices, k=min(_NORMALS_TRIED, len(chosen)))
    near = chosen[near.reshape(len(found.vertices), -1)]
    a, b, c = np.moveaxis(found.vertices[found.faces], 1, 0)
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
def _reduced(mesh: Mesh, budget: int) -> Surface | None:
    """Return a reduced mesh; None for one that stays whole."""
    whole = mesh.surface
    pixels = () if whole.texture is None else (whole.texture.pixels,)
    given = [each for each in (whole.normals, whole.uv, whole.colours) if each is not None]
    name = _hash(whole.vertices, whole.faces, *given, *pixels, np.array(budget))
    content = read_cached(name)
    if content is not None:
        return _unpacked(content, whole)
    found = simplified(whole, budget)
    if found is not None and whole.normals is not None:
        found = found._replace(normals=_nearest_normals(found, whole))
    keep(name, _packed(found))
    # What is read from the cache is the same.
    return _unpacked(_packed(found), whole)


def _hash(*arrays: NDArray[Any]) -> str:
    """Return the name in the cache of what is made of a mesh: a hash of all that determines it."""
    digest = sha256(_version().encode())
    for array in arrays:
        digest.update(f" {array.dtype} {array.shape} ".encode())
        digest.update(array.tobytes())
    return f"{digest.hexdigest()}.triangles"


@cache
def _version() -> str:
    here = Path(__file__)
    return f"{np.__version__} {SIMPLIFY_VERSION} {source_hash(here, here.with_name('reduction.py'))}"


def _packed(surface: Surface | None) -> bytes:
    """Return a surface without its image as bytes; none for None."""
    if surface is None:
        return b""
    counts = np.array([len(surface.vertices), len(surface.faces)], "<u8")
    parts = (surface.vertices, surface.normals, surface.uv, surface.colours)
    numbers = [each.astype("<f4").tobytes() for each in parts if each is not None]
    return b"".join([counts.tobytes(), surface.faces.astype("<u4").tobytes(), *numbers])


def _unpacked(content: bytes, whole: Surface) -> Surface | None:
    """Return the reduced surface of a whole one in a content of the cache, whose checksum was right."""
    if not content:
        return None
    vertices, faces = np.frombuffer(content, "<u8", 2).tolist()
    place = 16

    def read(kind: str, *shape: int) -> NDArray[Any]:
        nonlocal place
        found = np.frombuffer(content, kind, math.prod(shape), place).reshape(shape)
        place += found.nbytes
        return found

    triangles = read("<u4", faces, 3).astype(np.intp)
    points = read("<f4", vertices, 3).astype(np.float64)
    normals = None if whole.normals is None else read("<f4", faces, 3, 3).astype(np.float64)
    textured = whole.texture is not None
    uv = read("<f4", faces, 3, 2).astype(np.float64) if textured else None
    coloured = not textured and whole.colours is not None
    colours = read("<f4", faces, 3, 3).astype(np.float64) if coloured else None
    return Surface(points, triangles, normals, uv, whole.texture, colours)


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


@lru_cache(maxsize=256)
def _primitive(shape: Shape) -> Triangles:
    if isinstance(shape, Box):
        return _box(np.array(shape.size))
    if isinstance(shape, Sphere):
        return _revolved(*_arc(shape.radius, 0.0))
    if isinstance(shape, Ellipsoid):
        ball = _primitive(Sphere(1.0))
        return Triangles.of(ball.vertices * np.array(shape.radii), ball.faces)
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
