"""The camera begins with a view of most of a motion, and ghosts lie inside what they coincide with."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import dynx
from dynx.model.geometry import Box, Sphere
from dynx.model.geometry.links import link_shapes
from dynx.rbd.kinematics import link_poses
from dynx.spatial.scalar import Floats
from dynx.steppers.camera import Camera
from dynx.viewer import view
from dynx.viewer.drawn_robot import GHOST_SIZE
from dynx.viewer.framing import VIEW_DIRECTION, box_around, fitting_distance, has_ground, round_length
from dynx.viewer.triangles import resized, triangles_of
from dynx.world import World
from dynx.world.scene import box, ground, read_scene
from tests.conftest import needs_examples


def along_x(x: Floats) -> Floats:
    """Return poses (n, 4, 4) at the places x (n,)."""
    T = np.tile(np.eye(4), (len(x), 1, 1))
    T[:, 0, 3] = x
    return T


@given(st.floats(0.0, 1e3), st.integers(2, 50))
def test_one_part_that_leaves_does_not_make_the_others_small(end: float, count: int) -> None:
    still = {f"pin{k}": along_x(np.full(count, 0.1 * k)) for k in range(11)}
    low, high = box_around({**still, "ball": along_x(np.linspace(-1.0, end, count))})
    # All parts at the start, and then no more than the part of the way that most parts are on.
    assert low[0] == -1.0
    assert 1.0 <= high[0] <= 1.0 + 1e-9 or end < 1.0


@given(st.lists(st.floats(-10.0, 10.0), min_size=1, max_size=20))
def test_the_box_holds_the_start_and_lies_within_all_places(places: list[float]) -> None:
    x = np.array(places)
    low, high = box_around({"part": along_x(x)})
    assert x.min() <= low[0] <= x[0] <= high[0] <= x.max()


def test_shapes_of_bodies_count() -> None:
    cube = box("cube", (0.2, 0.2, 0.2), mass=1.0)
    low, high = box_around({"cube": along_x(np.zeros(2))}, [cube])
    assert -low == pytest.approx(np.full(3, 0.1), rel=1e-6)
    assert high == pytest.approx(-low)
    both = {"cube": along_x(np.zeros(2)), "ground": along_x(np.full(2, 5.0))}
    assert np.array_equal(box_around(both, [cube, ground()]), (low, high))
    assert np.array_equal(box_around({"ground": both["ground"]}, [ground()])[0], [5.0, 0.0, 0.0])
    assert np.array_equal(box_around({}), np.zeros((2, 3)))
    table = box("table", (0.2, 0.2, 0.2))
    fixed = {"table": both["cube"], "ground": both["ground"]}
    assert np.array_equal(box_around(fixed, [table, ground()]), (low, high))


@needs_examples
@pytest.mark.parametrize("name", ["panda", "solo12", "tiago"])
def test_the_box_around_a_robot_holds_every_triangle_and_no_more_than_its_shapes_take(name: str) -> None:
    model = dynx.load(name)
    poses = {f"robot/{link}": T[None] for link, T in link_poses(model, model.random(0))}
    low, high = box_around(poses, robots={"robot": model})
    points = []
    for link in model.links:
        for shape, _, T in link_shapes(model.geometry, link.name):
            T = poses[f"robot/{link.name}"][0] @ T
            points.append(triangles_of(shape).vertices @ T[:3, :3].T + T[:3, 3])
    every = np.concatenate(points)
    assert (low <= every.min(axis=0) + 1e-6).all()
    assert (high >= every.max(axis=0) - 1e-6).all()
    # Boxes along the axes of a link are at most so much larger than what they hold.
    assert np.linalg.norm(high - low) < 1.5 * np.linalg.norm(np.ptp(every, axis=0))


def test_a_mesh_that_cannot_be_read_leaves_a_link_its_origin() -> None:
    mesh = '<visual><geometry><mesh filename="none.stl"/></geometry></visual>'
    text = f'<robot name="r"><link name="base">{mesh}</link></robot>'
    low, high = box_around({"r/base": along_x(np.ones(2))}, robots={"r": dynx.load(text)})
    assert np.array_equal([low, high], [[1.0, 0.0, 0.0]] * 2)


@given(st.lists(st.floats(1e-3, 1e3), min_size=3, max_size=3), st.floats(0.1, 2.0), st.floats(0.1, 2.0))
def test_a_camera_at_the_fitting_distance_sees_the_corners_and_one_at_the_edge(
    size: list[float], across: float, upward: float
) -> None:
    half = 0.5 * np.array(size)
    eye = fitting_distance(-half, half, across, upward) * VIEW_DIRECTION
    camera = np.linalg.inv(Camera.look_at(eye, np.zeros(3)).pose.matrix)
    signs = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
    x, y, depth = camera[:3, :3] @ (signs * half).T + camera[:3, 3:]
    shares = np.maximum(np.abs(x / depth) / across, np.abs(y / depth) / upward)
    assert shares.max() == pytest.approx(1.0, rel=1e-9)
    assert (depth > 0.0).all()


@given(st.floats(1e-6, 1e6))
def test_round_lengths_are_not_greater_and_not_much_smaller(length: float) -> None:
    found = round_length(length)
    assert 0.4 * length < found <= length * (1.0 + 1e-12)
    assert f"{found:e}"[0] in "125"


def test_what_has_no_size_is_seen_from_a_distance() -> None:
    point = np.ones(3)
    assert fitting_distance(point, point, 1.0, 1.0) > 0.1
    with dynx.load('<robot name="r"><link name="base"/></robot>').view() as viewer:
        camera = viewer.page.server.initial_camera
        assert np.linalg.norm(np.subtract(camera.position, camera.look_at)) > 0.1


def test_a_scene_with_a_ground_gets_no_other() -> None:
    assert has_ground([box("cube", (1.0, 1.0, 1.0), mass=1.0), ground()])
    assert not has_ground([box("cube", (1.0, 1.0, 1.0), mass=1.0)])
    with World(read_scene("stack")) as world, world.view() as viewer:
        assert viewer.page.scene.get_handle_by_name("/ground") is None
    with dynx.load("six_axis_arm").view() as viewer:
        assert viewer.page.scene.get_handle_by_name("/ground") is not None


def test_a_ghost_lies_inside_what_it_coincides_with() -> None:
    assert GHOST_SIZE < 1.0
    for shape in (Box((0.1, 0.2, 0.3)), Sphere(0.4)):
        whole = triangles_of(shape)
        ghost = resized(whole, GHOST_SIZE)
        assert (np.abs(ghost.vertices) <= np.abs(whole.vertices)).all()
        assert np.ptp(ghost.vertices, axis=0) == pytest.approx(GHOST_SIZE * np.ptp(whole.vertices, axis=0))
    rollout = dynx.simulate("ur5", duration=0.1)
    with view((rollout, rollout), names=("a", "b"), whole_meshes=False) as viewer:
        drawn = [each.visuals for each in (viewer.view.drawn, viewer.view._ghost_drawn)]
        for name, nodes in drawn[0].items():
            for node, inner in zip(nodes, drawn[1][name], strict=True):
                sizes = [np.ptp(each.vertices, axis=0).max() for each in (inner, node)]
                assert sizes[0] == pytest.approx(GHOST_SIZE * sizes[1], rel=1e-5)
