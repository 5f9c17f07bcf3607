"""The camera begins with a view of most of a motion, and ghosts lie inside what they coincide with."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

import dynx
from dynx.model import Pose
from dynx.model.geometry import Box, Plane, Sphere
from dynx.model.geometry.drawn_shapes import link_shapes
from dynx.rbd.kinematics import link_poses
from dynx.spatial.scalar import Floats
from dynx.steppers.camera import Camera
from dynx.viewer import view
from dynx.viewer.drawn_robot import GHOST_SIZE
from dynx.viewer.export import stage_for
from dynx.viewer.framing import VIEW_DIRECTION, box_around, fitted_view, has_ground, round_length
from dynx.viewer.motion import motion_of_robot, motion_of_state
from dynx.viewer.triangles import resized, triangles_of
from dynx.world import Scene, SceneRobot, World, box, ground, read_scene
from dynx.world.camera import cast_rays, drawn_shapes
from tests.conftest import EXAMPLES_INSTALLED, needs_examples


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


POINTS = st.lists(st.tuples(*[st.floats(-100.0, 100.0)] * 3), min_size=2, max_size=12)


@given(POINTS, st.floats(0.1, 2.0), st.floats(0.1, 2.0))
def test_a_fitted_camera_sees_the_points_in_the_middle_up_to_one_edge(
    places: list[tuple[float, float, float]], across: float, upward: float
) -> None:
    points = np.array(places)
    across_view = points - np.outer(points @ VIEW_DIRECTION, VIEW_DIRECTION)
    assume(np.ptp(across_view, axis=0).max() > 1e-2)
    camera = np.linalg.inv(Camera.look_at(*fitted_view(points, across, upward)).pose.matrix)
    x, y, depth = camera[:3, :3] @ points.T + camera[:3, 3:]
    size = float(depth.max())
    assert (depth > -1e-9 * size).all()
    # How far each point is inside each edge of the picture, times its depth.
    sides = [across * depth - x, across * depth + x, upward * depth - y, upward * depth + y]
    left, right, top, bottom = (float(side.min()) for side in sides)
    assert min(left, right, top, bottom) >= -1e-6 * size
    assert left == pytest.approx(right, abs=1e-6 * size)
    assert top == pytest.approx(bottom, abs=1e-6 * size)
    # Points behind each other are seen from a distance at which they do not reach the edges.
    assert min(left, top) <= 1e-6 * size or depth.min() == pytest.approx(0.5)


@pytest.mark.parametrize("name", ["panda", "solo12", "row"])
def test_what_an_exported_picture_shows_fills_two_thirds_of_it(name: str) -> None:
    if name == "row":
        cubes = tuple(
            box(f"cube{k}", (0.2, 0.2, 0.2), mass=1.0, pose=Pose((0.5 * k, 0.0, 0.1))) for k in range(40)
        )
        with World(Scene(bodies=(ground(), *cubes))) as world:
            motion = motion_of_state(world.scene, world.state)
    else:
        if not EXAMPLES_INSTALLED:
            pytest.skip("needs example-robot-data")
        model = dynx.load(name)
        motion = motion_of_robot(model, model.neutral())
    stage = stage_for(motion, (160, 120))
    scene = Scene(bodies=motion.bodies, robots=[SceneRobot(n, m) for n, m in motion.robots.items()])
    shapes = [each for each in drawn_shapes(scene, motion.at(0)) if not isinstance(each.shape, Plane)]
    seen = cast_rays(shapes, stage.camera.pose.matrix, stage.camera).number.reshape(120, 160) >= 0
    rows, columns = np.flatnonzero(seen.any(axis=1)), np.flatnonzero(seen.any(axis=0))
    shares = (np.ptp(rows) + 1) / 120, (np.ptp(columns) + 1) / 160
    assert 0.55 < max(shares) <= 0.75
    for pixels, side in ((rows, 120), (columns, 160)):
        assert abs(0.5 * (pixels[0] + pixels[-1] + 1) / side - 0.5) < 0.1


@given(st.floats(1e-6, 1e6))
def test_round_lengths_are_not_greater_and_not_much_smaller(length: float) -> None:
    found = round_length(length)
    assert 0.4 * length < found <= length * (1.0 + 1e-12)
    assert f"{found:e}"[0] in "125"


def test_what_has_no_size_is_seen_from_a_distance() -> None:
    eye, target = fitted_view(np.ones((1, 3)), 1.0, 1.0)
    assert np.linalg.norm(eye - target) > 0.1
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
