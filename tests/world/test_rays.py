"""Rays hit every shape where it is, on every engine, also hulls with many faces."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import dynx
from dynx import Pose
from dynx.model.geometry import Mesh
from dynx.model.geometry.ray_casting import cast_on_shape
from dynx.spatial.scalar import Floats
from dynx.testing.strategies import scenes
from dynx.world import Scene, SceneBody, World
from dynx.world.boxes import OwnerPoses
from dynx.world.queries import first_hits
from tests.conftest import needs_examples
from tests.world.engines import WORLDS


def distances_to_triangles(corners: Floats, origin: Floats, direction: Floats) -> Floats:
    """Return the distances along a ray to the triangles (n, 3, 3) that it passes (Moeller, Trumbore 1997)."""
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    p = np.cross(direction, c - a)
    determinant = np.einsum("ij,ij->i", b - a, p)
    with np.errstate(divide="ignore", invalid="ignore"):
        u = np.einsum("ij,ij->i", origin - a, p) / determinant
        q = np.cross(origin - a, b - a)
        v, t = q @ direction / determinant, np.einsum("ij,ij->i", c - a, q) / determinant
    passed = (u >= 0.0) & (v >= 0.0) & (u + v <= 1.0) & (t >= 0.0)
    return np.asarray(t[passed])


def mesh_of_hyq(link: str) -> Mesh:
    """Return the mesh of a link: the trunk has a hull of 300 faces, a leg reaches away from its origin."""
    (placed,) = dynx.load("hyq").geometry.collisions(link)
    assert isinstance(placed.shape, Mesh)
    return placed.shape


@needs_examples
@pytest.mark.parametrize("link", ["trunk", "lf_upperleg"])
@pytest.mark.parametrize("engine", WORLDS)
def test_rays_hit_a_hull_of_many_faces_where_its_triangles_are(engine: str, link: str) -> None:
    mesh, pose = mesh_of_hyq(link), Pose((0.3, -0.2, 1.0), (0.4, -0.3, 0.8))
    vertices, faces = mesh.hull
    corners = (vertices @ pose.matrix[:3, :3].T + pose.matrix[:3, 3])[faces]
    rng = np.random.default_rng(0)
    origins = pose.matrix[:3, 3] + 2.0 * rng.standard_normal((300, 3))
    aims = corners.reshape(-1, 3)[rng.integers(corners.size // 3, size=(300, 3))].mean(axis=1)
    directions = (aims - origins) / np.linalg.norm(aims - origins, axis=1, keepdims=True)
    with World(Scene("s", bodies=(SceneBody("part", mesh, pose=pose),)), engine) as world:
        hits = world.cast_rays(origins, directions, length=100.0)
    for k, name in enumerate(hits.names):
        # The mean of three vertices lies inside the hull, so that every ray hits it.
        assert name == "part"
        found = distances_to_triangles(corners, origins[k], directions[k])
        # MuJoCo keeps vertices as float32.
        assert hits.distance[k] == pytest.approx(found.min(), abs=2e-6)


@settings(max_examples=30)
@given(scenes(ground="any"), st.integers(0, 2**32 - 1))
def test_no_hit_is_lost_to_the_balls_around_shapes(scene: Scene, seed: int) -> None:
    rng = np.random.default_rng(seed)
    with World(scene, WORLDS[0]) as world:
        layout = world._motion.engine.layout
        poses = OwnerPoses(layout, world.state)
    owners = [poses[collider.owner][:3, 3] for collider in layout.colliders]
    aims = np.array(owners)[rng.integers(len(owners), size=40)]
    origins = aims + rng.standard_normal((40, 3)) * rng.choice([0.1, 1.0, 10.0], (40, 1))
    directions = aims + 0.1 * rng.standard_normal((40, 3)) - origins
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    nearest = np.full(40, np.inf)
    for collider in layout.colliders:
        for placed in collider.shapes:
            T = poses[collider.owner] @ placed.T
            nearest = np.minimum(nearest, cast_on_shape(placed.shape, T, origins, directions)[0])
    found = first_hits(layout, poses, origins, directions, 1e3)
    within = nearest <= 1e3
    distance = np.array([hit.distance for hit in found])
    assert np.array_equal(distance[within], nearest[within])
    assert np.array_equal([hit.collider is not None for hit in found], within)
    assert np.isinf(distance[~within]).all()
    assert np.isnan([hit.normal for hit, hits in zip(found, within, strict=True) if not hits]).all()
