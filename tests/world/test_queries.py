"""Distances, boxes and rays in closed form."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

import dynx
from dynx import Pose
from dynx.errors import ShapeError, UnknownNameError
from dynx.model.geometry import Box, Capsule, Collision, Cylinder, Ellipsoid, HeightField, Shape, Sphere
from dynx.model.tree import Base
from dynx.spatial.so3 import rotation_from_rpy
from dynx.world import Scene, SceneBody, SceneRobot, World, box, ground, sphere
from dynx.world.boxes import shape_box
from tests.world.engines import WORLDS
from tests.world.standing import quadruped

angles = st.floats(-3.0, 3.0)


@pytest.mark.parametrize("engine", WORLDS)
def test_distances_of_balls_and_planes(engine: str) -> None:
    bodies = (
        ground(),
        sphere("one", 0.2, pose=Pose((0, 0, 1.0))),
        sphere("two", 0.3, pose=Pose((0, 2.0, 1.0))),
    )
    with World(Scene("s", bodies=bodies), engine) as world:
        (near,) = world.closest_points("one", "two", within=2.0)
        assert near.distance == pytest.approx(1.5, abs=1e-4)
        assert_allclose(near.normal, [0, -1, 0], atol=1e-3)
        assert_allclose(near.point_a, [0, 0.2, 1.0], atol=1e-3)
        assert_allclose(near.point_b, [0, 1.7, 1.0], atol=1e-3)
        (back,) = world.closest_points("two", "one", within=2.0)
        assert_allclose(back.normal, [0, 1, 0], atol=1e-3)
        assert world.closest_points("one", "two", within=1.0) == ()
        assert world.closest_points("one", "ground", 1.0)[0].distance == pytest.approx(0.8, abs=1e-3)


@pytest.mark.parametrize("engine", WORLDS)
def test_rays_hit_what_is_first(engine: str) -> None:
    bodies = (
        ground(),
        sphere("ball", 0.5, pose=Pose((0, 0, 2.0))),
        box("brick", (0.4, 0.6, 0.8), pose=Pose((3, 0, 0.4), (0, 0, np.pi / 2))),
    )
    with World(Scene("s", bodies=bodies), engine) as world:
        origins = np.array([[0.0, 0, 5], [3, 0, 5], [3, 5, 0.4], [9, 9, 5], [0, 0, 5]])
        hits = world.cast_rays(origins, [[0, 0, -2]] * 4 + [[0, 0, 1]])
        assert hits.names[:2] == ("ball", "brick")
        assert hits.names[3:] == ("ground", None)
        assert_allclose(hits.distance[[0, 1, 3]], [2.5, 4.2, 5.0], atol=1e-3)
        assert_allclose(hits.points[0], [0, 0, 2.5], atol=1e-3)
        assert_allclose(hits.normals[:2], [[0, 0, 1], [0, 0, 1]], atol=1e-3)
        assert hits.distance[4] == np.inf
        assert np.isnan(hits.points[4]).all()
        side = world.cast_rays([3, 5, 0.4], [0, -1, 0])
        assert side.names == ("brick",)
        assert_allclose(side.distance, [4.8], atol=1e-3)
        assert world.cast_rays([0, 0, 5], [0, 0, -1], length=2.0).names == (None,)


@pytest.mark.parametrize("engine", WORLDS)
def test_links_are_named_across_fixed_joints(engine: str) -> None:
    model = dynx.load("a1", base="floating")
    q = np.zeros(model.nq)
    q[6], q[2] = 1.0, 1.0
    with World(
        Scene("s", robots=(SceneRobot("dog", model, q=tuple(q)),), bodies=(ground(),)), engine
    ) as world:
        lower, upper = world.aabb("dog/FR_foot")
        assert_allclose((upper - lower)[:2], [0.04, 0.04], atol=1e-9)
        foot = (lower + upper) / 2
        hit = world.cast_rays(foot * [1, 1, 0], [0, 0, 1])
        assert hit.names == ("dog/FR_foot",)
        assert hit.distance[0] == pytest.approx(lower[2], abs=1e-3)
        found = world.overlapping(lower, upper)
        assert "dog/FR_foot" in found
        assert "dog/RL_foot" not in found
        assert world.closest_points("dog", "ground", within=2.0)[0].b == "ground"


@pytest.mark.parametrize("engine", WORLDS)
def test_a_ball_rests_on_a_height_field(engine: str) -> None:
    heights = ((0.0, 0.5, 0.0), (0.0, 0.5, 0.0), (0.0, 0.5, 0.0))
    valley = ((0.5, 0.0, 0.5),) * 3
    for field in (valley, heights):
        bodies = (
            SceneBody("terrain", (Collision(HeightField(field, (4.0, 4.0))),)),
            sphere("ball", 0.2, mass=1.0, pose=Pose((0.0, 0.3, 1.0))),
        )
        with World(Scene("s", bodies=bodies), engine) as world:
            hit = world.cast_rays([1.0, 0.3, 5.0], [0, 0, -1])
            assert hit.names == ("terrain",)
            assert_allclose(hit.distance, [4.75], atol=1e-3)


@given(
    angles,
    angles,
    angles,
    st.sampled_from(
        [Box((0.2, 0.5, 0.9)), Cylinder(0.3, 0.7), Capsule(0.2, 0.5), Sphere(0.4), Ellipsoid((0.2, 0.5, 0.9))]
    ),
)
def test_boxes_are_those_of_surface_points(roll: float, pitch: float, yaw: float, shape: Shape) -> None:
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = rotation_from_rpy(np.array([roll, pitch, yaw])), [0.3, -0.2, 0.1]
    points = surface(shape) @ T[:3, :3].T + T[:3, 3]
    lower, upper = shape_box(shape, T)
    assert (points >= lower - 1e-12).all()
    assert (points <= upper + 1e-12).all()
    assert_allclose(points.min(axis=0), lower, atol=5e-3)
    assert_allclose(points.max(axis=0), upper, atol=5e-3)


def surface(shape: Shape) -> np.ndarray[tuple[int, ...], np.dtype[np.float64]]:
    """Return points of the surface of a shape, dense enough for its box."""
    if isinstance(shape, Box):
        return np.stack(np.meshgrid(*([-s / 2, s / 2] for s in shape.size)), axis=-1).reshape(-1, 3)
    turns, tilts = np.meshgrid(np.linspace(0, 2 * np.pi, 181), np.linspace(0, np.pi, 91))
    ball = np.stack(
        [np.sin(tilts) * np.cos(turns), np.sin(tilts) * np.sin(turns), np.cos(tilts)], -1
    ).reshape(-1, 3)
    if isinstance(shape, Sphere):
        return shape.radius * ball
    if isinstance(shape, Ellipsoid):
        return ball * shape.radii
    assert isinstance(shape, Cylinder | Capsule)
    half = np.array([0, 0, shape.length / 2])
    if isinstance(shape, Capsule):
        return np.concatenate([shape.radius * ball + half, shape.radius * ball - half])
    rim = shape.radius * ball[np.abs(ball[:, 2]) < 1e-9]
    return np.concatenate([rim + half, rim - half])


def test_contacts_of_one_part_are_those_of_all_that_name_it() -> None:
    bodies = (ground(), *(box(f"b{k}", (0.2,) * 3, mass=1.0, pose=Pose((k, 0, 0.1))) for k in range(2)))
    model, q = quadruped("solo12")
    dog = SceneRobot("dog", model, q).at(Pose((5.0, 0.0, q[2])))
    with World(Scene("s", robots=(dog,), bodies=bodies)) as world:
        world.run(0.2)
        every = world.contacts()
        assert {c.b for c in world.contacts("b0")} == {"b0"}
        assert len(world.contacts("dog")) == sum(c.a.startswith("dog/") for c in every) > 0
        assert len(world.contacts("ground")) == len(every)
        assert world.state.bodies["b1"].position == pytest.approx([1.0, 0.0, 0.1], abs=1e-3)
        with pytest.raises(UnknownNameError, match="did you mean 'dog'"):
            world.contacts("dig")


@pytest.mark.parametrize("engine", WORLDS)
def test_touching_pairs_are_those_of_the_contacts(engine: str) -> None:
    crate = box("crate", (0.2, 0.2, 0.2), mass=1.0, pose=Pose((0, 0, 0.1)))
    ball = sphere("ball", 0.1, mass=0.5, pose=Pose((0, 0, 0.3)))
    away = sphere("away", 0.1, mass=0.5, pose=Pose((2, 0, 1.0)))
    with World(Scene("s", bodies=(ball, away, crate, ground())), engine) as world:
        for _ in range(2):
            assert world.touching_pairs() == {(contact.a, contact.b) for contact in world.contacts()}
            world.step(20)
        assert world.touching_pairs() == {("ball", "crate"), ("crate", "ground")}


@pytest.mark.parametrize("base", ["fixed", "floating"])
def test_a_robot_is_placed_by_a_pose(base: Base) -> None:
    pose = Pose((1.0, 2.0, 3.0), (0.3, -0.2, 0.5))
    robot = SceneRobot("arm", dynx.load("planar_2r", base=base)).at(pose)
    frame = dynx.backend("reference", robot.model).forward_kinematics(np.array(robot.q), "base")
    np.testing.assert_allclose(frame, pose.matrix, atol=1e-12)
    with pytest.raises(ShapeError, match=r"such as Pose\(\(0, 0, 1\)\)"):
        robot.at((0.0, 0.0, 1.0))
