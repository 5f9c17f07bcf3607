"""Visual meshes of robots as a page draws them without a graphics processor, beside the whole ones.

``python -m benchmarks.reduced_meshes`` reduces the meshes of every robot of the library (``--robots`` names
some) to the number of triangles that a page of that robot has, and prints for each robot: how many of its
meshes are reduced, how many stay whole, the least surface that is kept, the largest difference of a box and
the largest distance of a point, both as shares of the diagonal, and of closed meshes the largest difference
of the volume. The distance is that of 10,000 random points on each surface to the nearest point of the other
(Hausdorff), to the triangles themselves. ``--mesh`` prints each mesh. It ends with an error where a mesh is
beyond a bound.
"""

from __future__ import annotations

import argparse
import warnings
from collections import Counter
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

import dynx
from dynx.errors import DynxError
from dynx.model import Model
from dynx.model.geometry import Mesh
from dynx.model.geometry.drawn_shapes import link_shapes
from dynx.model.library import robots
from dynx.spatial.scalar import Floats
from dynx.viewer.triangles import budgets, reduced

SURFACE, BOX, DISTANCE, VOLUME, WHOLE = 0.95, 0.01, 0.01, 0.02, 0.2
"""Least share of the surface, largest changes of box, distance and volume, largest share of whole meshes."""

SAMPLES = 10_000
"""Number of random points on a surface."""

_NEAREST = 24
"""Number of triangles, by their nearest corners or middles, to which the distance of a point is computed."""


class Comparison(NamedTuple):
    """A mesh, and what is drawn of it."""

    name: str
    triangles: int
    drawn: int
    asked: int
    """Number of triangles that the page of the robot has for it."""
    surface: float
    """Share of the surface that is kept."""
    box: float
    """Largest change of a side of the box, as a share of the diagonal."""
    distance: float
    """Hausdorff distance, as a share of the diagonal."""
    volume: float
    """Change of the volume of a closed mesh, as a share of it; 0 for another."""

    @property
    def is_good(self) -> bool:
        """Whether the mesh keeps to all bounds."""
        return (
            self.surface >= SURFACE
            and self.box <= BOX
            and self.distance <= DISTANCE
            and self.volume <= VOLUME
        )


def compare(name: str, whole: Floats, found: Floats, asked: int) -> Comparison:
    """Compare the corners (m, 3, 3) of the triangles of a mesh with those that are drawn."""
    low, high = whole.min(axis=(0, 1)), whole.max(axis=(0, 1))
    diagonal = float(np.linalg.norm(high - low))
    box = max(np.abs(found.min(axis=(0, 1)) - low).max(), np.abs(found.max(axis=(0, 1)) - high).max())
    distance = max(_distance(_samples(whole), found), _distance(_samples(found), whole))
    volume = 0.0
    if _is_closed(whole):
        volume = abs(_volume(found) / _volume(whole) - 1.0)
    kept = float(_areas(found).sum() / _areas(whole).sum())
    sizes = (len(whole), len(found), asked)
    return Comparison(name, *sizes, kept, float(box) / diagonal, distance / diagonal, volume)


def _areas(corners: Floats) -> Floats:
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    return np.asarray(0.5 * np.linalg.norm(normals, axis=1))


def _volume(corners: Floats) -> float:
    return float(np.linalg.det(corners - corners.mean(axis=(0, 1))).sum() / 6.0)


def _is_closed(corners: Floats) -> bool:
    grid = 1e-6 * float(np.ptp(corners))
    _, number = np.unique(np.rint(corners.reshape(-1, 3) / grid), axis=0, return_inverse=True)
    faces = number.reshape(-1, 3)
    first, second = faces.reshape(-1), np.roll(faces, -1, axis=1).reshape(-1)
    edges, reverse = Counter(zip(first, second, strict=True)), Counter(zip(second, first, strict=True))
    return edges == reverse and abs(_volume(corners)) > 1e-9 * float(np.ptp(corners)) ** 3


def _samples(corners: Floats) -> Floats:
    random, areas = np.random.default_rng(1), _areas(corners)
    chosen = random.choice(len(corners), SAMPLES, p=areas / areas.sum())
    weights = random.dirichlet((1.0, 1.0, 1.0), SAMPLES)
    return np.asarray(np.einsum("ij,ijk->ik", weights, corners[chosen]))


def _distance(points: Floats, corners: Floats) -> float:
    """Return the largest distance of points (n, 3) from triangles (m, 3, 3) [m], or a little more."""
    # Large triangles are found by points on them: their own samples.
    of, on = _points_on(corners)
    _, near = cKDTree(on).query(points, k=min(_NEAREST, len(on)))
    best = np.full(len(points), np.inf)
    for column in near.reshape(len(points), -1).T:
        best = np.minimum(best, _to_triangles(points, corners[of[column]]))
    return float(best.max())


def _points_on(corners: Floats) -> tuple[NDArray[np.intp], Floats]:
    """Return corners, middles and random points of triangles, after the number of the triangle of each."""
    random, areas = np.random.default_rng(2), _areas(corners)
    count = len(corners)
    chosen = random.choice(count, 4 * SAMPLES, p=areas / areas.sum())
    weights = random.dirichlet((1.0, 1.0, 1.0), len(chosen))
    of = np.concatenate([np.repeat(np.arange(count), 3), np.arange(count), chosen])
    inside = np.einsum("ij,ijk->ik", weights, corners[chosen])
    return of, np.concatenate([corners.reshape(-1, 3), corners.mean(axis=1), inside])


def _to_triangles(p: Floats, corners: Floats) -> Floats:
    """Return the distances (n,) of points (n, 3) from a triangle (n, 3, 3) each."""
    a, b, c = np.moveaxis(corners, 1, 0)
    normal = np.cross(b - a, c - a)
    size = np.linalg.norm(normal, axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        height = np.einsum("ij,ij->i", p - a, normal) / size
    inside = size > 0.0
    least = np.full(len(p), np.inf)
    for start, end in ((a, b), (b, c), (c, a)):
        along = end - start
        length = np.maximum(np.einsum("ij,ij->i", along, along), 1e-300)
        share = np.clip(np.einsum("ij,ij->i", p - start, along) / length, 0.0, 1.0)
        least = np.minimum(least, np.linalg.norm(p - start - share[:, None] * along, axis=1))
        inside &= np.einsum("ij,ij->i", np.cross(along, p - start), normal) >= 0.0
    return np.where(inside, np.minimum(np.abs(np.nan_to_num(height, nan=np.inf)), least), least)


def comparisons(model: Model) -> Iterator[Comparison]:
    """Yield the visual meshes of a robot, each beside what a page draws of it."""
    count: Counter[Mesh] = Counter()
    for link in model.links:
        shapes = [shape for shape, _, _ in link_shapes(model.geometry, link.name)]
        count.update(shape for shape in shapes if isinstance(shape, Mesh))
    shares = budgets(count)
    of_file: dict[tuple[str, tuple[float, ...]], list[Mesh]] = {}
    for mesh in count:
        of_file.setdefault((mesh.file, mesh.scale), []).append(mesh)
    # A file is divided by its materials.
    for parts in of_file.values():
        whole = [mesh.triangles[0][mesh.triangles[1]] for mesh in parts]
        drawn = [reduced(mesh, shares[mesh]) for mesh in parts]
        found = [each.vertices.astype(np.float64)[each.faces] for each in drawn]
        asked = sum(shares[mesh] for mesh in parts)
        yield compare(parts[0].name, np.concatenate(whole), np.concatenate(found), asked)


def main() -> None:
    """Print the table; end with an error where a mesh is beyond a bound."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--robots", default="", help="robots of the library, between commas")
    options.add_argument("--mesh", action="store_true", help="print each mesh")
    given = options.parse_args()
    warnings.simplefilter("ignore")
    names = given.robots.split(",") if given.robots else [each.name for each in robots()]
    every: list[Comparison] = []
    print(f"{'robot':24}{'meshes':>8}{'whole':>7}{'area':>9}{'box':>9}{'distance':>10}{'volume':>9}")
    for name in names:
        try:
            found = list(comparisons(dynx.load(name)))
        except DynxError as error:
            print(f"{name:24} is not drawn: {error}", flush=True)
            continue
        if not found:
            continue
        every += found
        whole = sum(each.drawn == each.triangles for each in found)
        print(f"{name:24}{len(found):8}{whole:7}" + _row(found), flush=True)
        for each in found if given.mesh else [each for each in found if not each.is_good]:
            print(f"  {each.name:22}{each.triangles:8}{each.drawn:7}" + _row([each]), flush=True)
    heavy = [each for each in every if each.asked < each.triangles]
    kept = sum(each.drawn == each.triangles for each in heavy)
    bad = sum(not each.is_good for each in every)
    print(f"{len(every)} meshes, {bad} beyond a bound; {kept} of {len(heavy)} that are too heavy stay whole")
    if bad or kept > WHOLE * max(len(heavy), 1):
        raise SystemExit(1)


def _row(found: list[Comparison]) -> str:
    least = min(each.surface for each in found)
    box, distance, volume = (
        100.0 * max(values)
        for values in zip(*((each.box, each.distance, each.volume) for each in found), strict=True)
    )
    return f"{100 * least:7.1f} %{box:7.2f} %{distance:8.2f} %{volume:7.2f} %"


if __name__ == "__main__":
    main()
