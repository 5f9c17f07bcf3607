"""Nearest points are those of `dynx.distance` on every engine."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

import dynx
from dynx import Pose
from dynx.distance import Hull, distance, support
from dynx.model.geometry import Box, Capsule, Collision, Cylinder, Ellipsoid, HeightField, Mesh, Sphere
from dynx.spatial.scalar import Floats
from dynx.testing.strategies.geometry import poses
from dynx.world import Scene, SceneBody, SceneRobot, World, box, ground, sphere
from dynx.world.boxes import shape_box
from tests.distance.shapes import random_pose
from tests.world.engines import WORLDS

SHAPES: tuple[Box | Cylinder | Sphere | Capsule | Ellipsoid, ...] = (
    Box((0.5, 0.3, 0.2)),
    Cylinder(0.2, 0.4),
    Sphere(0.25),
    Capsule(0.1, 0.5),
    Cylinder(0.3, 0.1),
    Box((0.1, 0.6, 0.4)),
    Ellipsoid((0.2, 0.1, 0.3)),
)


@pytest.mark.parametrize("engine", WORLDS)
@pytest.mark.parametrize("reach", [1.0, 0.15], ids=["apart", "overlapping"])
def test_every_engine_has_the_distances_of_dynx(engine: str, reach: float) -> None:
    rng = np.random.default_rng(1)
    bodies = [
        SceneBody(
            f"b{k}",
            (Collision(shape),),
            pose=Pose.from_matrix(random_pose(rng, reach)),
            mass=1.0 + k,
        )
        for k, shape in enumerate(SHAPES)
    ]
    with World(Scene("s", bodies=(ground(), *bodies)), engine) as world:
        placed = {name: body.T_world_body for name, body in world.state.bodies.items()}
        for k, first in enumerate(bodies):
            for other, second in zip(SHAPES[:k], bodies, strict=False):
                (near,) = world.closest_points(first.name, second.name, within=10.0)
                exact = distance(SHAPES[k], placed[first.name], other, placed[second.name])
                assert near.distance == exact.distance
                assert_allclose(near.point_a, exact.point_a)
                assert_allclose(near.point_b, exact.point_b)
                assert_allclose(near.normal, exact.normal)
                if near.distance > 0.0:
                    own = world.closest_points(first.name, second.name, within=10.0, native=True)[0]
                    assert own.distance == pytest.approx(near.distance, abs=5e-3)
                    assert world.closest_points(first.name, second.name, 0.99 * near.distance) == ()


@pytest.mark.parametrize("engine", WORLDS)
def test_the_nearest_shape_of_a_body_counts(engine: str) -> None:
    ends = (Collision(Sphere(0.1), Pose((-1.0, 0, 0))), Collision(Box((0.2, 0.2, 0.2)), Pose((1.0, 0, 0))))
    bodies = (SceneBody("bar", ends, pose=Pose((0, 0, 1.0))), sphere("ball", 0.3, pose=Pose((2.0, 0, 1.0))))
    with World(Scene("s", bodies=bodies), engine) as world:
        (near,) = world.closest_points("ball", "bar")
        assert near.distance == pytest.approx(0.6, abs=1e-12)
        assert_allclose(near.point_b, [1.1, 0, 1.0], atol=1e-12)
        assert_allclose(near.normal, [1.0, 0, 0], atol=1e-12)


def test_links_and_meshes_are_where_the_robot_is() -> None:
    arm = dynx.load("ur5")
    q = np.linspace(-1.0, 1.0, 6)
    scene = Scene(
        "s",
        robots=(SceneRobot("arm", arm, q=tuple(q)),),
        bodies=(box("crate", (0.3, 0.3, 0.3), pose=Pose((1.0, 0.2, 0.5))),),
    )
    with World(scene, "pybullet") as world:
        found = {near.a: near for near in world.closest_points("arm", "crate", within=5.0)}
        backend = dynx.backend("reference", arm)
        for link in ("shoulder_link", "wrist_3_link", "forearm_link"):
            (collision,) = arm.geometry.collisions(link)
            T = backend.forward_kinematics(q, link) @ collision.origin.matrix
            assert isinstance(collision.shape, Mesh)
            exact = distance(collision.shape, T, Box((0.3, 0.3, 0.3)), Pose((1.0, 0.2, 0.5)))
            assert found[f"arm/{link}"].distance == pytest.approx(exact.distance, abs=1e-9)


def test_broad_phase_loses_no_pair() -> None:
    balls = (sphere("one", 0.4), sphere("two", 0.5, pose=Pose((1.0, 0, 0))))
    with World(Scene("s", bodies=balls), "pybullet") as world:
        (near,) = world.closest_points("one", "two", within=0.1 + 1e-12)
        assert near.distance == pytest.approx(0.1)
        assert world.closest_points("one", "two", within=0.1 - 1e-12) == ()


@given(poses(), st.sampled_from(SHAPES))
def test_supports_are_where_boxes_end(T: Floats, shape: Box | Cylinder | Sphere | Capsule) -> None:
    lower, upper = shape_box(shape, T)
    for axis in range(3):
        n = np.eye(3)[axis]
        assert support(shape, T, n)[0] == pytest.approx(upper[axis], abs=1e-12)
        assert support(shape, T, -n)[0] == pytest.approx(-lower[axis], abs=1e-12)


def terrain(rng: np.random.Generator) -> HeightField:
    """Return a rough ground."""
    return HeightField(tuple(map(tuple, rng.uniform(0.0, 0.3, (6, 5)).tolist())), (2.0, 3.0))


@pytest.mark.parametrize("shape", [Sphere(0.2), Box((0.2, 0.3, 0.4)), Capsule(0.1, 0.3)])
def test_height_fields_are_the_prisms_below_their_triangles(shape: Box | Sphere | Capsule) -> None:
    rng = np.random.default_rng(2)
    field = terrain(rng)
    vertices, faces = field.triangles()
    T_field = Pose((0.1, 0.2, 0.3), (0.1, -0.2, 0.4))
    for height in (0.9, 0.5, 0.2):
        pose = Pose((*rng.uniform(-0.5, 0.5, 2).tolist(), height), tuple(rng.uniform(-3, 3, 3).tolist()))
        bodies = (
            SceneBody("terrain", (Collision(field),), pose=T_field),
            SceneBody("thing", (Collision(shape),), pose=pose),
        )
        with World(Scene("s", bodies=bodies), "pybullet") as world:
            (near,) = world.closest_points("thing", "terrain", within=5.0)
        exact = min(distance(shape, pose, prism(vertices[face]), T_field).distance for face in faces)
        assert near.distance == pytest.approx(exact, abs=1e-12)
        assert_allclose(near.point_a - near.point_b, near.distance * near.normal, atol=1e-6)


def prism(triangle: Floats) -> Hull:
    """Return a triangle and its shadow far below."""
    return Hull(np.concatenate([triangle, triangle * [1, 1, 0] - [0, 0, 1.0]]))
