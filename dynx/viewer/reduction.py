"""Reduction of surfaces to fewer triangles, which keep area, box, place, volume and the colours of corners or
of an image."""

from __future__ import annotations

import math
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dynx.model.geometry.mesh_reading import Surface
from dynx.spatial.scalar import Floats
from dynx.viewer.library import simplify

if TYPE_CHECKING:
    from scipy.spatial import cKDTree

Whole = NDArray[np.intp]

_JOINED = 1e-3
"""Distance within which vertices of a reduced mesh are joined, as a share of its size."""

_THIN = 1e-4
"""Height below which a triangle is left out, as a share of the size: fast-simplification finds no plane of
it, and moves its corners anywhere."""

_ALIKE = 1e-4
"""Difference of the values at a vertex of two triangles up to which they are one value."""

_GENTLE = 3
"""Aggressiveness of fast-simplification; by its default of 7 thin parts of a mesh collapse."""

_RATIO = 1.25
"""Ratio of the numbers of triangles of two attempts, of which one is near enough, below which the search
ends."""

_LEAST_SAVED = 0.2
"""Share of its triangles that a reduced mesh saves at least; otherwise the mesh stays whole."""

_AREA_CHANGED, _VOLUME_CHANGED, _MOVED = 0.045, 0.018, 0.009
"""Largest effects of a reduction: on the surface and on the enclosed volume as shares of them, and the
distance by which the box or any point moves as a share of the diagonal of the box. They are 0.05, 0.02 and
0.01 for any other samples of the surfaces."""

_RECOLOURED, _COLOUR_CHANGED = 0.01, 3.0 / 255.0
"""Largest share of a surface whose colour changes, and the change that counts, from 0 to 1."""

_SEEN = 500
"""Pixels that the diagonal takes in the picture in which colours are compared."""

_SAMPLES = 20_000
"""Number of random points that stand for a surface, beside those on its edges."""

_EDGE_STEP = 0.5 * _MOVED
"""Distance of points on an edge, as a share of the diagonal."""

_NEAREST = 16
"""Number of points on another surface, the nearest to a point, whose triangles are tried."""


def simplified(surface: Surface, budget: int) -> Surface | None:
    """Return a surface of at most `budget` triangles, without normals, or of as many as it needs to be near
    the given one; None where nearly all are needed.

    It keeps area, box and, if it is closed, volume; no point moves far, and no colour that varies. It is cut
    where triangles do not form one smooth surface, more than two of them at an edge, and where values at
    corners jump. What lies along a border or a cut stays.
    """
    # Files repeat vertices, not always to the last digit, and only edges that are shared can be collapsed.
    vertices = surface.vertices
    grid = _JOINED * float(np.ptp(vertices, axis=0).max()) or 1.0
    cells = np.rint(vertices / grid).astype(np.int64)
    first, number = distinct_rows(cells - cells.min(axis=0))
    joined = number[surface.faces]
    distinct = np.flatnonzero(
        (joined[:, 0] != joined[:, 1]) & (joined[:, 1] != joined[:, 2]) & (joined[:, 0] != joined[:, 2])
    )
    if not len(distinct):
        return None
    values = _values(surface)
    whole = _Measures(
        vertices[first], joined[distinct], None if values is None else values[distinct], surface
    )
    if not whole.area > 0.0:
        return None
    if len(distinct) <= budget:
        return _surface(whole.corners, whole.values, surface)
    cut = _cut(whole)
    forms = [cut]
    if values is None and len(cut[0]) != len(first):
        # A file that has each triangle twice, or has pieces that touch, can be reduced only as it is.
        forms.append((vertices[first], joined[distinct]))
    low, high = max(budget, 4), math.floor((1.0 - _LEAST_SAVED) * len(surface.faces))
    for target in (low, high, math.isqrt(low * high), math.isqrt(math.isqrt(low * high) * high)):
        best = _attempt(whole, forms, target) if low <= target <= high else None
        if best is not None:
            break
    if best is None or target == low:
        return best
    high = len(best.faces)
    while high > _RATIO * low:
        target = math.isqrt(low * high)
        found = _attempt(whole, forms, target)
        if found is None or len(found.faces) >= high:
            low = target
        else:
            best, high = found, len(found.faces)
    return best


def _attempt(whole: _Measures, forms: list[tuple[Floats, Whole]], target: int) -> Surface | None:
    """Return a surface of `target` triangles, or as many as a form of the whole one keeps, that is near it;
    None where there is none."""
    best: Surface | None = None
    for points, faces in forms:
        if target > len(faces):
            continue
        found, kept = simplify(
            points, faces.astype(np.int32), target_count=target, agg=_GENTLE, preserve_border=True
        )
        if not 0 < len(kept) <= (1.0 - _LEAST_SAVED) * len(whole.surface.faces):
            continue
        found, kept = np.asarray(found, dtype=np.float64), np.asarray(kept, dtype=np.intp)
        values = None if whole.values is None else whole.values_at(found, kept)
        measures = _Measures(found, kept, values, whole.surface)
        if (best is None or len(kept) < len(best.faces)) and whole.is_near(measures):
            best = _surface(measures.corners, values, whole.surface)
            if len(kept) <= _RATIO * target:
                break
    return best


def _values(surface: Surface) -> Floats | None:
    """Return what varies at the corners (m, 3, k) of a surface: places in its image, or colours."""
    return surface.uv if surface.texture is not None else surface.colours


def _surface(corners: Floats, values: Floats | None, whole: Surface) -> Surface:
    vertices, number = np.unique(corners.reshape(-1, 3), axis=0, return_inverse=True)
    faces = number.reshape(-1, 3)
    if whole.texture is not None:
        return Surface(vertices, faces, uv=values, texture=whole.texture)
    return Surface(vertices, faces, colours=values)


def _cut(whole: _Measures) -> tuple[Floats, Whole]:
    """Return vertices (n, 3) and triangles (m, 3), without thin ones, that have vertices in common only
    across edges that two triangles pass in opposite directions, with the same values at both ends."""
    thick = whole.is_thick
    faces, values = whole.faces[thick], None if whole.values is None else whole.values[thick]
    start, end = faces.reshape(-1), np.roll(faces, -1, axis=1).reshape(-1)
    after = np.roll(np.arange(faces.size).reshape(-1, 3), -1, axis=1).reshape(-1)
    edge = np.minimum(start, end) * (int(faces.max()) + 1) + np.maximum(start, end)
    order = np.argsort(edge, kind="stable")
    begins = np.flatnonzero(np.diff(edge[order], prepend=-1))
    begins = begins[np.diff(begins, append=len(order)) == 2]
    a, b = order[begins], order[begins + 1]
    joined = start[a] == end[b]
    if values is not None:
        flat = values.reshape(-1, values.shape[-1])
        joined &= np.abs(flat[a] - flat[after[b]]).max(axis=1) <= _ALIKE
        joined &= np.abs(flat[after[a]] - flat[b]).max(axis=1) <= _ALIKE
    a, b = a[joined], b[joined]
    corner = _connected(np.concatenate([a, after[a]]), np.concatenate([after[b], b]), faces.size)
    _, first, number = np.unique(corner, return_index=True, return_inverse=True)
    return whole.corners[thick].reshape(-1, 3)[first], number.reshape(-1, 3)


def _connected(first: Whole, second: Whole, count: int) -> Whole:
    """Return the number of the group of each of `count` things of which pairs belong together."""
    # Imported here, because SciPy takes long to load, and a mesh that was reduced before is read from a file.
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    pairs = coo_matrix((np.ones(len(first), dtype=bool), (first, second)), shape=(count, count))
    return np.asarray(connected_components(pairs, directed=False)[1], dtype=np.intp)


class _SurfacePoints(NamedTuple):
    """Points on triangles."""

    triangles: Whole
    """The triangle of each point (n,)."""
    weights: Floats
    """The shares of its corners in each point (n, 3)."""
    points: Floats
    """Shape (n, 3) [m]."""


class _Measures:
    """Quantities of a mesh that a reduction keeps: area, box, place, colours and, if it is closed, volume."""

    def __init__(self, vertices: Floats, faces: Whole, values: Floats | None, surface: Surface) -> None:
        """`values` (m, 3, k) are those of corners, of the given `surface`."""
        self.faces, self.values, self.surface = faces, values, surface
        self.corners: Floats = np.asarray(vertices[faces], dtype=np.float64)
        self._box = np.stack([self.corners.min(axis=(0, 1)), self.corners.max(axis=(0, 1))])
        self._diagonal = float(np.linalg.norm(np.ptp(self._box, axis=0)))
        a, b, c = np.moveaxis(self.corners, 1, 0)
        self._normals = np.cross(b - a, c - a)
        self._areas = 0.5 * np.linalg.norm(self._normals, axis=1)
        self.area = float(self._areas.sum())

    @property
    def is_thick(self) -> NDArray[np.bool_]:
        """Mask (m,) of the triangles whose height differs from zero by more than rounding."""
        sides = np.linalg.norm(self.corners - np.roll(self.corners, -1, axis=1), axis=2).max(axis=1)
        return np.asarray(2.0 * self._areas > _THIN * float(np.ptp(self._box, axis=0).max()) * sides)

    def is_near(self, found: _Measures) -> bool:
        """Check whether a reduced mesh is near this one."""
        volume = self._volume
        largest = _MOVED * self._diagonal
        return bool(
            found.area > 0.0
            and abs(found.area - self.area) <= _AREA_CHANGED * self.area
            and np.abs(found._box - self._box).max() <= largest
            and (volume is None or abs(found._enclosed() - volume) <= _VOLUME_CHANGED * abs(volume))
            and self._reaches(found, largest)
            and found._reaches(self, largest)
            and (self.values is None or self._recoloured(found) <= _RECOLOURED)
        )

    def _reaches(self, other: _Measures, largest: float) -> bool:
        """Check that no corner and no sample of this surface is farther from the other one than `largest`."""
        # A triangle that closes a hole has its corners on the other surface.
        corners = np.unique(self.corners.reshape(-1, 3), axis=0)
        points = np.concatenate([self._samples.points[:_SAMPLES], corners])
        far = points[other._tree.query(points, distance_upper_bound=largest)[0] > largest]
        # Samples are so sparse that the nearest may be farther away than its triangle.
        return not len(far) or bool(other._nearest(far)[0].max() <= largest)

    def _nearest(self, points: Floats) -> tuple[Floats, Whole, Floats]:
        """Return the distances (n,) of points (n, 3) from the surface, the triangles (n,) that are nearest,
        and the shares (n, 3) of their corners in the points that are nearest."""
        near = self._tree.query(points, k=min(_NEAREST, len(self._samples.points)))[1].reshape(
            len(points), -1
        )
        return self._nearest_of(points, self._samples.triangles[near])

    def _nearest_of(self, points: Floats, tried: Whole) -> tuple[Floats, Whole, Floats]:
        """Return what `_nearest` returns, among triangles (n, m) of each point."""
        best, weights = np.full(len(points), np.inf), np.zeros((len(points), 3))
        chosen = tried[:, 0].copy()
        for column in tried.T:
            shares = _nearest_shares(points, self.corners[column])
            apart = np.linalg.norm(np.einsum("ij,ijk->ik", shares, self.corners[column]) - points, axis=1)
            nearer = apart < best
            best[nearer], weights[nearer], chosen[nearer] = apart[nearer], shares[nearer], column[nearer]
        return best, chosen, weights

    def values_at(self, vertices: Floats, faces: Whole) -> Floats:
        """Return the values at the corners (m, 3, k) of triangles that were made by collapsing edges of this
        mesh, cut: those of the nearest point of the same piece."""
        assert self.values is not None
        ends = np.concatenate([faces[:, :2], faces[:, 1:]]).T
        pieces = _connected(ends[0], ends[1], len(vertices))
        own = self._piece[self._samples.triangles]
        # The piece of which most of its vertices are parts.
        near = own[self._tree.query(vertices)[1]]
        votes = np.unique(np.stack([pieces, near]), axis=1, return_counts=True)
        of = np.zeros(int(pieces.max()) + 1, dtype=np.intp)
        rising = np.argsort(votes[1], kind="stable")
        of[votes[0][0][rising]] = votes[0][1][rising]
        # Points of other pieces are as far away as nothing of the mesh is.
        apart = 4.0 * self._diagonal
        from scipy.spatial import cKDTree

        tree = cKDTree(np.column_stack([self._samples.points, apart * own]))
        used = np.unique(faces)
        _, tried = tree.query(np.column_stack([vertices[used], apart * of[pieces[used]]]), k=_NEAREST)
        _, triangles, shares = self._nearest_of(vertices[used], self._samples.triangles[tried])
        found = np.zeros((len(vertices), self.values.shape[-1]))
        found[used] = np.einsum("ij,ijk->ik", shares, self.values[triangles])
        return np.asarray(found[faces])

    def _recoloured(self, found: _Measures) -> float:
        """Return the share of a reduced mesh whose colour is another than that of the nearest point, of any
        of the nearest points where surfaces coincide."""
        samples = found._samples
        points, weights = samples.points[:_SAMPLES], samples.weights[:_SAMPLES]
        here = found._colours(samples.triangles[:_SAMPLES], weights)
        near = self._samples.triangles[self._tree.query(points, k=_NEAREST)[1]]
        apart, triangles, shares = zip(
            *(self._nearest_of(points, near[:, [k]]) for k in range(_NEAREST)), strict=True
        )
        least = np.min(apart, axis=0) + 0.1 * _JOINED * self._diagonal
        change = np.full(len(points), np.inf)
        for k in range(_NEAREST):
            other = np.abs(here - self._colours(triangles[k], shares[k])).max(axis=1)
            change = np.where(apart[k] <= least, np.minimum(change, other), change)
        return float(np.mean(change > _COLOUR_CHANGED))

    def _colours(self, triangles: Whole, shares: Floats) -> Floats:
        assert self.values is not None
        values = np.einsum("ij,ijk->ik", shares, self.values[triangles])
        texture = self.surface.texture
        return values if texture is None else texture.colours(values, np.full(len(values), self._extent))

    @cached_property
    def _extent(self) -> float:
        """Number of pixels of the image that are seen as one in a picture of the whole surface."""
        assert self.values is not None
        assert self.surface.texture is not None
        height, width = self.surface.texture.pixels.shape[:2]
        u, v = np.moveaxis(self.values[:, 1:] - self.values[:, :1], 1, 0)
        pixels = 0.5 * np.abs(u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]) * width * height
        return math.sqrt(float(pixels.sum()) / self.area) * self._diagonal / _SEEN

    def _enclosed(self) -> float:
        from_middle = self.corners[:, 0] - self._box.mean(axis=0)
        return float(np.einsum("ij,ij->", from_middle, self._normals)) / 6.0

    @cached_property
    def _volume(self) -> float | None:
        return self._enclosed() if is_closed(self.faces) else None

    @cached_property
    def _piece(self) -> Whole:
        """The number of the connected piece of each triangle, cut; -1 of a thin one."""
        _, faces = _cut(self)
        ends = np.concatenate([faces[:, :2], faces[:, 1:]]).T
        pieces = np.full(len(self.faces), -1, dtype=np.intp)
        pieces[self.is_thick] = _connected(ends[0], ends[1], int(faces.max()) + 1)[faces[:, 0]]
        return pieces

    @cached_property
    def _samples(self) -> _SurfacePoints:
        """Random points on the triangles, then corners and points on long edges, which a thin triangle has
        without having an area."""
        random = np.random.default_rng(0)
        triangles = [random.choice(len(self._areas), _SAMPLES, p=self._areas / self.area)]
        weights = [random.dirichlet((1.0, 1.0, 1.0), _SAMPLES)]
        for k in range(3):
            along = np.linalg.norm(self.corners[:, (k + 1) % 3] - self.corners[:, k], axis=1)
            count = 1 + np.floor(along / (_EDGE_STEP * self._diagonal)).astype(np.intp)
            of = np.repeat(np.arange(len(along)), count)
            place = (np.arange(len(of)) - np.repeat(np.cumsum(count) - count, count)) / count[of]
            shares = np.zeros((len(of), 3))
            shares[:, k], shares[:, (k + 1) % 3] = 1.0 - place, place
            triangles.append(of)
            weights.append(shares)
        chosen, shares = np.concatenate(triangles), np.concatenate(weights)
        return _SurfacePoints(chosen, shares, np.einsum("ij,ijk->ik", shares, self.corners[chosen]))

    @cached_property
    def _tree(self) -> cKDTree:
        from scipy.spatial import cKDTree

        return cKDTree(self._samples.points)


def _nearest_shares(points: Floats, corners: Floats) -> Floats:
    """Return the shares (n, 3) of the corners in the point of a triangle (n, 3, 3) that is nearest to a point
    (n, 3)."""
    a, b, c = np.moveaxis(corners, 1, 0)
    u, v, w = b - a, c - a, points - a
    uu, uv, vv = (np.einsum("ij,ij->i", x, y) for x, y in ((u, u), (u, v), (v, v)))
    uw, vw = np.einsum("ij,ij->i", u, w), np.einsum("ij,ij->i", v, w)
    size = uu * vv - uv * uv
    with np.errstate(divide="ignore", invalid="ignore"):
        second, third = (vv * uw - uv * vw) / size, (uu * vw - uv * uw) / size
    inside = np.stack([1.0 - second - third, second, third], axis=1)
    # Outside of the triangle, and where it has no area, the nearest point is on one of the edges.
    best, least = inside, np.where((size > 0.0) & (inside >= 0.0).all(axis=1), 0.0, np.inf)
    best[~np.isfinite(least)] = 0.0
    outside = np.isinf(least)
    for k in range(3):
        start, along = corners[:, k], corners[:, (k + 1) % 3] - corners[:, k]
        length = np.maximum(np.einsum("ij,ij->i", along, along), 1e-300)
        place = np.clip(np.einsum("ij,ij->i", points - start, along) / length, 0.0, 1.0)
        apart = np.linalg.norm(points - start - place[:, None] * along, axis=1)
        nearer = outside & (apart < least)
        least[nearer] = apart[nearer]
        best[nearer] = 0.0
        best[nearer, k], best[nearer, (k + 1) % 3] = 1.0 - place[nearer], place[nearer]
    return best


def is_closed(faces: NDArray[np.integer[Any]]) -> bool:
    """Check whether each edge is passed as often in one direction as in the other."""
    count = int(faces.max(initial=0)) + 1
    first, second = faces.reshape(-1).astype(np.int64), np.roll(faces, -1, axis=1).reshape(-1)
    return np.array_equal(np.sort(first * count + second), np.sort(second * count + first))


def distinct_rows(rows: NDArray[np.integer[Any]]) -> tuple[Whole, Whole]:
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
