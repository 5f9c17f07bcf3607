"""Shapes as triangles: closed, turned outwards, of the right volume, and reduced to a budget."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial import cKDTree

import dynx
from dynx.model.geometry import (
    Box,
    Capsule,
    Cylinder,
    Ellipsoid,
    HeightField,
    Mesh,
    Shape,
    Sphere,
    solid_properties,
)
from dynx.model.geometry.images import Texture
from dynx.model.geometry.mesh_reading import Surface
from dynx.spatial.scalar import Floats
from dynx.viewer import reduction
from dynx.viewer import triangles as meshes_module
from dynx.viewer.library import simplify
from dynx.viewer.reduction import distinct_rows, simplified
from dynx.viewer.triangles import (
    MAX_WHOLE,
    TRIANGLE_BUDGET,
    Triangles,
    budgets,
    hull_of,
    reduced,
    triangles_of,
    turned_outwards,
)
from tests.conftest import needs_examples

SOLIDS: list[Shape] = [
    Box((0.1, 0.2, 0.3)),
    Sphere(0.4),
    Cylinder(0.2, 0.5),
    Capsule(0.1, 0.3),
    Ellipsoid((0.1, 0.3, 0.2)),
]


def volume(triangles: Triangles) -> float:
    """Return the volume that outward triangles enclose (divergence theorem)."""
    a, b, c = np.moveaxis(triangles.vertices[triangles.faces].astype(float), 1, 0)
    return float(np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6.0)


def edges_in_one_direction_only(triangles: Triangles) -> bool:
    """Check that each edge is passed once in each direction: the surface is closed and turned one way."""
    _, number = np.unique(np.round(triangles.vertices, 6), axis=0, return_inverse=True)
    faces = number.reshape(-1)[triangles.faces]
    edges = [tuple(edge) for k in range(3) for edge in zip(faces[:, k], faces[:, (k + 1) % 3], strict=True)]
    return len(set(edges)) == len(edges) and {(b, a) for a, b in edges} == set(edges)


@pytest.mark.parametrize("shape", SOLIDS, ids=lambda shape: type(shape).__name__)
def test_solids_are_closed_and_turned_outwards(shape: Shape) -> None:
    triangles = triangles_of(shape)
    assert edges_in_one_direction_only(triangles)
    exact = solid_properties(shape).volume
    # Of a circle's area 32 sides leave out this share, of a ball's volume less than three times that.
    missing = 3.0 * (1.0 - math.sin(2.0 * math.pi / 32) / (2.0 * math.pi / 32))
    assert exact * (1.0 - missing) <= volume(triangles) <= exact * (1.0 + 1e-6)


@pytest.mark.parametrize("shape", SOLIDS, ids=lambda shape: type(shape).__name__)
def test_a_closed_surface_that_is_turned_inwards_is_turned(shape: Shape) -> None:
    outwards = triangles_of(shape)
    inwards = Triangles(outwards.vertices + np.float32(1.0), outwards.faces[:, ::-1])
    count = len(outwards.vertices)
    both = Triangles(
        np.concatenate([outwards.vertices, inwards.vertices]),
        np.concatenate([outwards.faces, inwards.faces + np.uint32(count)]),
    )
    found = turned_outwards(both)
    assert found is not None
    assert np.array_equal(found.faces[: len(outwards.faces)], outwards.faces)
    assert volume(found) == pytest.approx(2.0 * volume(outwards), rel=1e-4)
    # Without one triangle it can be seen from behind.
    assert turned_outwards(Triangles(both.vertices, both.faces[1:])) is None


def test_a_height_field_has_two_triangles_a_cell() -> None:
    triangles = triangles_of(HeightField(((0.0, 1.0, 0.0), (0.0, 0.0, 0.0)), (2.0, 1.0)))
    assert len(triangles.faces) == 4
    assert triangles.vertices[:, 2].max() == 1.0


def surface(triangles: Triangles) -> float:
    """Return the area of triangles."""
    a, b, c = np.moveaxis(triangles.vertices[triangles.faces].astype(float), 1, 0)
    return float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2.0)


def points_on(triangles: Triangles, n: int) -> Floats:
    """Return `n` points (n, 3) on the surface, equally dense everywhere."""
    random = np.random.default_rng(1)
    corners = triangles.vertices[triangles.faces].astype(float)
    areas = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    chosen = corners[random.choice(len(corners), n, p=areas / areas.sum())]
    return np.asarray(np.einsum("ij,ijk->ik", random.dirichlet((1.0, 1.0, 1.0), n), chosen))


@needs_examples
@pytest.mark.parametrize(
    ("robot", "links"),
    [
        ("ur5", ("wrist_3_link", "base_link")),
        ("anymal", ("LF_THIGH", "LF_SHANK")),
        ("talos", ("leg_right_5_link", "head_2_link")),
    ],
)
def test_reduced_meshes_keep_surface_box_place_and_volume(robot: str, links: tuple[str, ...]) -> None:
    model = dynx.load(robot)
    meshes = {visual.shape for link in links for visual in model.geometry.visuals(link)}
    for mesh in meshes:
        assert isinstance(mesh, Mesh)
        whole, found = triangles_of(mesh), reduced(mesh, MAX_WHOLE)
        assert len(found.faces) <= 0.8 * len(whole.faces) or len(found.faces) == len(whole.faces)
        assert 0.95 <= surface(found) / surface(whole) <= 1.05
        diagonal = np.linalg.norm(np.ptp(whole.vertices, axis=0))
        for corner in (np.min, np.max):
            moved = corner(found.vertices[found.faces], axis=(0, 1)) - corner(whole.vertices, axis=0)
            assert np.abs(moved).max() <= 0.01 * diagonal
        for ours, theirs in [(whole, found), (found, whole)]:
            # The nearest of so many points is farther away than the surface by half a hundredth at most.
            apart, _ = cKDTree(points_on(theirs, 100_000)).query(points_on(ours, 10_000))
            assert np.max(apart) <= 0.015 * diagonal
        if turned_outwards(whole) is not None:
            assert volume(found) == pytest.approx(volume(whole), rel=0.021)


@needs_examples
@pytest.mark.parametrize("robot", ["ur5", "anymal_c"])
def test_budgets_are_kept_but_for_small_meshes(robot: str) -> None:
    model = dynx.load(robot)
    meshes = [
        visual.shape
        for link in model.links
        for visual in model.geometry.visuals(link.name)
        if isinstance(visual.shape, Mesh)
    ]
    parts = budgets({mesh: meshes.count(mesh) for mesh in meshes})
    wanted = sum(min(parts[mesh], len(mesh.triangles[1])) for mesh in meshes)
    assert wanted <= TRIANGLE_BUDGET + MAX_WHOLE * len(meshes)


def ball(folder: Path) -> Mesh:
    """Return a mesh with the triangles of a sphere."""
    vertices, faces = triangles_of(Sphere(0.4))
    lines = [f"v {x} {y} {z}" for x, y, z in vertices.tolist()] + [f"f {a} {b} {c}" for a, b, c in faces + 1]
    path = folder / "ball.obj"
    path.write_text("\n".join(lines))
    return Mesh(str(path))


def test_reduced_meshes_are_kept_on_disk(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("DYNX_CACHE_DIR", str(tmp_path / "cache"))
    monkeypatch.delenv("DYNX_CACHE", raising=False)
    counts = list[int]()

    def counted(*given: Any, target_count: int, **options: Any) -> Any:
        counts.append(target_count)
        return simplify(*given, target_count=target_count, **options)

    monkeypatch.setattr(reduction, "simplify", counted)
    mesh = ball(tmp_path)

    def again(mesh: Mesh, budget: int) -> Triangles:
        meshes_module._reduced.cache_clear()
        return reduced(mesh, budget)

    first = again(mesh, 200)
    assert 4 <= len(first.faces) < len(mesh.triangles[1])
    attempts = list(counts)
    assert attempts[0] == 200
    kept = again(mesh, 200)
    assert all(map(np.array_equal, first, kept))
    assert [array.dtype for array in first] == [array.dtype for array in kept]
    assert counts == attempts
    # Another budget, scale or content of the file is another mesh.
    again(mesh, 100)
    larger = again(Mesh(mesh.file, (2.0, 2.0, 2.0)), 200)
    assert np.ptp(larger.vertices) == pytest.approx(2.0 * np.ptp(first.vertices), rel=0.05)
    Path(mesh.file).write_text(Path(mesh.file).read_text().replace("v 0.0 0.0 -0.4", "v 0.0 0.0 -0.5"))
    again(Mesh(mesh.file), 200)
    assert [count for count in counts if count in (100, 200)] == [200, 100, 200, 200]
    counts.clear()
    for file in (tmp_path / "cache").rglob("*.triangles"):
        file.write_bytes(file.read_bytes()[:-1])
    assert all(map(np.array_equal, again(mesh, 200), first))
    monkeypatch.setenv("DYNX_CACHE", "0")
    assert all(map(np.array_equal, again(mesh, 200), first))
    assert counts == 2 * attempts
    meshes_module._reduced.cache_clear()


def wavy_square() -> tuple[Surface, Floats]:
    """Return a slightly curved square of two triangles a cell, and the places (m, 3, 2) of its corners."""
    x, y = np.meshgrid(np.linspace(0.0, 1.0, 41), np.linspace(0.0, 1.0, 41), indexing="ij")
    vertices = np.stack([x, y, 0.02 * np.sin(3.0 * x)], axis=-1).reshape(-1, 3)
    first = (np.arange(40)[:, None] * 41 + np.arange(40)).reshape(-1, 1)
    faces = np.concatenate([first + np.array([0, 41, 42]), first + np.array([0, 42, 1])])
    return Surface(vertices, faces), vertices[faces][..., :2]


def test_an_image_stays_in_its_place_where_triangles_are_fewer() -> None:
    bare, places = wavy_square()
    levels = np.rint(np.linspace(0, 255, 64)).astype(np.uint8)
    pixels = np.stack(np.broadcast_arrays(levels[:, None], levels, np.uint8(0)), axis=-1)
    # Each half of the square shows the whole image: places jump in the middle.
    halves = places.copy()
    half = np.floor(2.0 * places[..., 0].mean(axis=1))
    halves[..., 0] = 2.0 * places[..., 0] - half[:, None]
    for uv, least in ((places, 500), (halves, 600)):
        whole = bare._replace(uv=uv, texture=Texture(np.ascontiguousarray(pixels), (False, False)))
        found = simplified(whole, 300)
        assert found is not None
        assert found.uv is not None
        assert found.texture is whole.texture
        assert len(found.faces) < least
        corners = found.vertices[found.faces]
        side = np.floor(2.0 * corners[..., 0].mean(axis=1))[:, None]
        wanted = corners[..., 0] if uv is places else 2.0 * corners[..., 0] - side
        assert np.abs(found.uv[..., 0] - wanted).max() < 0.01
        assert np.abs(found.uv[..., 1] - corners[..., 1]).max() < 0.01


def test_an_edge_between_colours_stays_sharp() -> None:
    bare, places = wavy_square()
    right = places[..., 0].mean(axis=1) > 0.5
    colours = np.where(right[:, None, None], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]) * np.ones((1, 3, 1))
    found = simplified(bare._replace(colours=colours), 300)
    assert found is not None
    assert found.colours is not None
    assert len(found.faces) < 600
    middle = found.vertices[found.faces][..., 0].mean(axis=1)
    assert np.allclose(found.colours[middle > 0.5], [1.0, 0.0, 0.0])
    assert np.allclose(found.colours[middle < 0.5], [0.0, 0.0, 1.0])


@needs_examples
def test_a_mesh_collides_as_its_hull() -> None:
    model = dynx.load("ur5")
    mesh = model.geometry.collisions("forearm_link")[0].shape
    assert isinstance(mesh, Mesh)
    hull = hull_of(mesh)
    assert edges_in_one_direction_only(hull)
    assert volume(hull) >= volume(triangles_of(mesh)) > 0.0


def test_budgets_leave_light_robots_whole() -> None:
    assert budgets({}) == {}


numbers = st.integers(0, 3)


@given(st.lists(st.tuples(numbers, numbers, numbers), min_size=1), st.sampled_from([1, 2**61]))
def test_distinct_rows_are_found(given_rows: list[tuple[int, int, int]], scale: int) -> None:
    # The large scale exceeds what one number holds.
    rows = np.array(given_rows) * [1, 1, scale]
    first, number = distinct_rows(rows)
    assert np.array_equal(rows[first][number], rows)
    assert len(first) == len(set(map(tuple, rows.tolist())))
