"""Meshes with fewer triangles, for machines that draw by software.

What a mesh is reduced to is kept in the cache on disk (`dynx.files.cache`): the meshes of a humanoid take
half a second.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Mapping
from functools import cache, lru_cache
from glob import glob
from hashlib import sha256
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from dynx.files.cache import keep, read_cached, source_hash
from dynx.model.geometry import Mesh, Shape
from dynx.spatial.scalar import Floats
from dynx.viewer.library import SIMPLIFY_VERSION, simplify
from dynx.viewer.surfaces.triangles import Triangles, distinct_rows, triangles_of

TRIANGLE_BUDGET = 15_000
"""Largest number of triangles of all visual meshes together where they are reduced."""

FEWEST_TRIANGLES = 100
"""Number of triangles below which a mesh is not reduced."""

_JOINED = 1e-3
"""Distance within which vertices of a reduced mesh are joined, as a share of its size."""


def budgets(meshes: Mapping[Mesh, int], total: int = TRIANGLE_BUDGET) -> dict[Mesh, int]:
    """Divide `total` triangles between meshes that occur so many times each, in proportion to what each has.

    A mesh with few triangles keeps them. Meshes that together have fewer than `total` keep all.
    """
    sizes = {mesh: len(mesh.triangles[1]) for mesh in meshes}
    everything = sum(sizes[mesh] * count for mesh, count in meshes.items())
    share = min(1.0, total / max(everything, 1))
    return {mesh: max(math.floor(size * share), min(size, FEWEST_TRIANGLES)) for mesh, size in sizes.items()}


def has_graphics_processor() -> bool:
    """Check whether this machine has a graphics processor that a browser on it can use; True if unknown."""
    if not sys.platform.startswith("linux"):
        return True
    return bool(glob("/dev/dri/renderD*") or glob("/dev/nvidia[0-9]*"))


def reduced(shape: Shape, budget: int | None) -> Triangles:
    """Return a shape as triangles: a mesh with at most `budget`, or four, unless that is None.

    Raises DescriptionError for a mesh that cannot be read.
    """
    if not isinstance(shape, Mesh) or budget is None or len(shape.triangles[1]) <= budget:
        return triangles_of(shape)
    return _reduced(shape, budget)


@lru_cache(maxsize=256)
def _reduced(mesh: Mesh, budget: int) -> Triangles:
    vertices, faces = mesh.triangles
    name = _name(vertices, faces, budget)
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
    found, kept = simplify(points.astype(np.float32), remaining.astype(np.int32), target_count=max(budget, 4))
    return Triangles.of(found, kept) if len(kept) else Triangles.of(vertices, faces)


def _name(vertices: Floats, faces: NDArray[np.intp], budget: int) -> str:
    """Return the name in the cache of what a mesh is reduced to: a hash of all that determines it."""
    digest = sha256(f"{_version()} {vertices.dtype} {faces.dtype} {len(vertices)} {budget}".encode())
    digest.update(vertices.tobytes())
    digest.update(faces.tobytes())
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
