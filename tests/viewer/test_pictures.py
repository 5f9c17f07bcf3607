"""Pictures that are drawn without a browser show what the page shows: marks, text, parts that are hidden."""

from __future__ import annotations

import itertools
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

import dynx
from dynx.errors import ArgumentError
from dynx.model import Pose
from dynx.model.geometry import Box, Plane, Sphere
from dynx.spatial.se3 import homogeneous
from dynx.steppers.camera import Camera, DrawnShape, DrawnTriangles
from dynx.viewer import Viewer
from dynx.viewer.colours import RGB
from dynx.viewer.export import stage_for
from dynx.viewer.lettering import length_text, write_caption
from dynx.viewer.node_shapes import arrow, node_shapes
from dynx.world import Material, Scene, SceneRobot, World, box, ground, sphere
from dynx.world.camera import BEHIND_OPACITY, cast_rays_smoothly, drawn_shapes
from dynx.world.comparison import compare_engines
from dynx.world.scenery import DARK, LIGHT
from tests.viewer.test_colours import DICHROMATS, TOLD_APART, distance

ROBOT = (
    "<robot name='r'><link name='base'><inertial><mass value='1'/>"
    "<inertia ixx='0.01' iyy='0.01' izz='0.01' ixy='0' ixz='0' iyz='0'/></inertial>"
    "<visual><geometry><box size='0.2 0.2 0.2'/></geometry>"
    "<material name='m'><color rgba='0.1 0.7 0.1 1'/></material></visual>"
    "<collision><geometry><sphere radius='0.15'/></geometry></collision></link></robot>"
)

SIZE = (120, 90)
EYE = Camera.look_at((0.6, -0.6, 0.5), (0.0, 0.0, 0.0), size=SIZE)


def drawn(viewer: Viewer) -> NDArray[np.int64]:
    return viewer._picture(None, EYE, None).astype(int)


def count(picture: NDArray[np.int64], rgb: tuple[int, int, int], within: int = 70) -> int:
    """Return the number of pixels of nearly a colour."""
    return int((np.abs(picture - rgb).max(axis=2) < within).sum())


def greenish(picture: NDArray[np.int64]) -> int:
    return int((picture[..., 1] > picture[..., [0, 2]].max(axis=2) + 30).sum())


def test_a_picture_shows_marks_text_and_lines_of_the_page() -> None:
    with dynx.load(ROBOT).view() as viewer:
        before = drawn(viewer)
        viewer.set_shown("inertia ellipsoids")
        solid = drawn(viewer)
        # The ellipsoid is a blue ball of 0.32 m around the green box, which is seen through it.
        assert (np.abs(solid - before).max(axis=2) > 10).mean() > 0.03
        viewer.set_shown("inertia ellipsoids", False)
        assert np.array_equal(drawn(viewer), before)
        viewer.line([[-0.5, 0.0, 0.3], [0.5, 0.0, 0.3]], colour=(1.0, 0.0, 0.0), thickness=0.03)
        lined = drawn(viewer)
        assert (lined[..., 0] > lined[..., 1] + 60).sum() > 20
        written = viewer.text("here", (0.0, 0.0, 0.4), colour="red", size=60)
        assert (np.abs(drawn(viewer) - lined).max(axis=2) > 30).sum() > 5
        written.remove()
        assert np.array_equal(drawn(viewer), lined)
        viewer.text("here", (0.0, 0.0, 0.4))
        assert count(drawn(viewer), (255, 255, 255), 20) > count(lined, (255, 255, 255), 20) + 20


def test_the_caption_says_what_marks_are_in_lines_that_fit() -> None:
    with dynx.load(ROBOT).view() as viewer:
        assert node_shapes(viewer.page, EYE).legends == ()
        for kind in ("inertia ellipsoids", "inertia boxes", "centres of mass", "frames"):
            viewer.set_shown(kind)
        legends = node_shapes(viewer.page, EYE).legends
    assert len(legends) == 4
    assert any("inertia" in each for each in legends)
    # In a narrow picture the caption has more lines; none reaches over the left edge.
    grey = np.full((300, 400, 3), 128, dtype=np.uint8)
    written = write_caption(grey, "; ".join(["tiles: 20 cm and 4 cm", *legends]))
    changed = (written != grey).any(axis=2)
    assert not changed[:, 0].any()
    one_line = (write_caption(grey, "tiles: 20 cm") != grey).any(axis=(1, 2))
    assert changed.any(axis=1).sum() > 1.8 * one_line.sum()


def test_a_picture_hides_what_the_page_hides() -> None:
    with dynx.load(ROBOT).view() as viewer:
        whole = greenish(drawn(viewer))
        assert whole > 200
        viewer.set_opacity(0.3)
        clear = drawn(viewer)
        strong = (clear[..., 1] > clear[..., 0] + 60).sum()
        assert strong < 0.5 * whole
        viewer.set_visible("base", False)
        assert greenish(drawn(viewer)) == 0


def test_the_ground_stays_when_everything_is_seen_through() -> None:
    scene = Scene("yard", robots=[SceneRobot("r", dynx.load(ROBOT))], bodies=[ground()])
    with World(scene) as world, world.view(steps=False) as viewer:
        before = drawn(viewer)
        viewer.set_opacity(0.0)
        after = drawn(viewer)
        assert greenish(after) == 0
        corner = np.s_[-12:, :12]
        assert np.array_equal(after[corner], before[corner])
        viewer.set_opacity(0.0, "ground")
        assert np.abs(drawn(viewer)[corner] - before[corner]).max() > 20


def test_what_is_seen_through_casts_a_weak_shadow() -> None:
    camera = Camera.look_at((0.0, -1.0, 2.0), (0.0, 0.0, 0.0), size=(60, 45))
    plane = DrawnShape(0, Plane(), (0.7, 0.7, 0.7, 1.0), np.eye(4))
    T = np.eye(4)
    T[:3, 3] = 0.0, 0.0, 1.5
    shadows = []
    for opacity in (1.0, 0.5, 0.0):
        ball = DrawnShape(0, Sphere(0.2), (0.7, 0.7, 0.7, opacity), T)
        solid, veils = ([plane, ball], []) if opacity == 1.0 else ([plane], [ball] if opacity else [])
        picture = cast_rays_smoothly(solid, camera.pose.matrix, camera, LIGHT, veils=veils)
        shadows.append(picture.rgb.reshape(45, 60, 3).astype(int))
    # The ball is above the picture, and its shadow in it.
    dark, weak, none = (int((each.min(axis=2)).min()) for each in shadows)
    assert dark + 10 < weak < none - 10


def test_a_picture_of_a_motion_sees_what_moves_at_its_time() -> None:
    ball = sphere("ball", 0.1, mass=1.0, pose=Pose((0.0, 0.0, 0.1)), twist=(9.0, 0.0, 0.0, 0.0, 0.0, 0.0))
    slippery = Material(friction=0.0)
    scene = Scene("lane", bodies=[ground(material=slippery), replace(ball, material=slippery)])
    run = compare_engines(scene, ["mujoco"], duration=1.0)
    with Viewer(run, port=0) as viewer:
        viewer.view.go_to(1.0)
        seen = viewer._stage(SIZE, None, None, SIZE, viewer.view.time).camera
        whole = viewer._stage(SIZE, None, None, SIZE).camera
        first = viewer.view.motions[0]
        both = stage_for(first, time=1.0, ghost=replace(first, name="other"))
        assert both.caption.startswith("solid: mujoco, blue: other; tiles: ")
        place = viewer.view.motions[0].poses["ball"][-1][:3, 3]
        shares = [
            0.2 * each.focal_length / (each.pose.matrix[:3, 2] @ (place - each.pose.matrix[:3, 3]))
            for each in (seen, whole)
        ]
    # The box around a ball, which takes the share, is larger than the ball.
    assert shares[0] / SIZE[1] > 0.4
    assert shares[1] / SIZE[1] < 0.2


def test_a_plane_in_the_default_grey_has_the_colour_of_the_ground() -> None:
    grey, red = Material().rgba, (0.9, 0.1, 0.1, 1.0)
    assert DARK.own_colour(Plane(), grey) == (*DARK.ground, 1.0)
    assert DARK.own_colour(Plane(), red) == red
    assert DARK.own_colour(Sphere(1.0), grey) == grey


def test_numbers_of_contact_forces_stand_at_their_arrows() -> None:
    cube = box("cube", (0.2, 0.2, 0.2), mass=2.0, pose=Pose((0.0, 0.0, 0.1)))
    with World(Scene("one", bodies=[ground(), cube]), "mujoco") as world:
        world.step(500)
        with world.view(steps=False) as viewer:
            assert not viewer._nodes(EYE).words
            viewer.set_shown("force numbers")
            words = viewer._nodes(EYE).words
            forces = [float(each.text.removesuffix(" N")) for each in words]
            assert sum(forces) == pytest.approx(2.0 * 9.81, rel=0.02)
            assert all(each.point[2] > 0.01 for each in words)
            viewer.set_shown("contact forces", False)
            assert not viewer._nodes(EYE).words


def test_pictures_of_motions_and_worlds_show_collision_shapes() -> None:
    model = dynx.load(ROBOT)
    with dynx.simulate(model, None, duration=0.01).view(collisions=True) as viewer:
        assert greenish(drawn(viewer)) == 0
        viewer.set_shown("collision shapes", False)
        assert greenish(drawn(viewer)) > 200
    scene = Scene("one", robots=[SceneRobot("r", model)])
    with World(scene) as world, world.view(steps=False, collisions=True) as viewer:
        assert greenish(drawn(viewer)) == 0


def test_the_view_of_a_picture_can_be_chosen(tmp_path: Path) -> None:
    with dynx.load(ROBOT).view() as viewer:
        above = viewer._stage((80, 60), None, (0.1, 0.0, 1.0), SIZE).camera
        assert above.size == (80, 60)
        axis = above.pose.matrix[:3, 2]
        assert axis == pytest.approx(-np.array([0.1, 0.0, 1.0]) / np.hypot(0.1, 1.0), abs=1e-9)
        wrong = [
            ({"direction": (0.0, 0.0, 1.0)}, "along the z axis"),
            ({"size": (10, 10), "camera": EYE}, "give it alone"),
            ({"size": (10,)}, "wanted width and height"),
            ({"camera": "above"}, "wanted a Camera"),
        ]
        for options, message in wrong:
            with pytest.raises(ArgumentError, match=message):
                viewer.export(tmp_path / "a.png", **options)  # type: ignore[arg-type]
        with pytest.raises(ArgumentError, match="of a picture or a film, not of a page"):
            viewer.export(tmp_path / "a.html", size=(10, 10))
        with pytest.raises(ArgumentError, match="did you mean 'frames'"):
            viewer.set_shown("frame")
        assert not list(tmp_path.iterdir())


def test_exported_pages_have_coloured_text_and_opacity(tmp_path: Path) -> None:
    with dynx.load(ROBOT).view() as viewer:
        viewer.text("red text", (0.0, 0.0, 0.4), colour="red")
        viewer.set_opacity(0.25, "base")
        viewer.export(tmp_path / "a.html")
    page = (tmp_path / "a.html").read_text(encoding="utf-8")
    assert re.search("data-texts=.{0,40}red text", page)
    assert re.search("data-opacities=.{0,60}0.25", page)


@given(st.integers(0, 2**32 - 1), st.floats(0.05, 2.0))
def test_an_arrow_is_a_closed_surface_between_its_ends(seed: int, length: float) -> None:
    rng = np.random.default_rng(seed)
    direction = rng.standard_normal(3)
    direction /= np.linalg.norm(direction)
    tail = rng.standard_normal(3)
    vertices, faces = arrow(np.stack([tail, tail + length * direction]), 0.01, 0.02, 0.04)
    edges = np.sort(faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    assert (np.unique(edges, axis=0, return_counts=True)[1] == 2).all()
    along = (vertices - tail) @ direction
    assert along.min() == pytest.approx(0.0, abs=1e-12)
    assert along.max() == pytest.approx(length)
    beside = np.linalg.norm(vertices - tail - along[:, None] * direction, axis=1)
    assert beside.max() == pytest.approx(0.02)


def test_surfaces_near_others_are_darker_in_pictures() -> None:
    cube = box("cube", (0.4, 0.4, 0.4), mass=1.0, pose=Pose((0.0, 0.0, 0.2)))
    scene = Scene(bodies=(ground(), cube))
    frames = {"ground": np.eye(4), "cube": cube.pose.matrix}
    camera = Camera.look_at((0.1, -0.7, 0.3), (0.0, -0.2, 0.05), size=(160, 120))
    sky = LIGHT._replace(key=0.0, fill=0.0)
    with_it, without = (
        cast_rays_smoothly(
            list(drawn_shapes(scene, frames)), camera.pose.matrix, camera, sky._replace(polish=polish)
        ).rgb.reshape(120, 160, 3)
        for polish in (1.0, 0.0)
    )
    share = with_it.astype(float).mean(axis=2) / without.mean(axis=2)

    def at(point: tuple[float, float, float]) -> float:
        x, y, z = camera.pose.matrix[:3, :3].T @ (np.array(point) - camera.pose.matrix[:3, 3])
        row, column = camera.focal_length * np.array([y, x]) / z + 0.5 * np.array([119, 159])
        return float(share[round(row) - 1 : round(row) + 2, round(column) - 1 : round(column) + 2].mean())

    # The ground before the box and the box above the ground, and both where the other is far.
    assert at((0.0, -0.21, 0.0)) < 0.95
    assert at((0.0, -0.2, 0.01)) < 0.95
    assert at((0.0, -0.2, 0.15)) > 0.99
    assert at((0.0, -0.3, 0.0)) > 0.99


def test_a_see_through_shape_shows_what_is_behind_it() -> None:
    red, blue = Material(rgba=(0.8, 0.1, 0.1, 1.0)), (0.1, 0.1, 0.9)
    shapes = list(
        drawn_shapes(Scene(bodies=(sphere("ball", 0.2, mass=1.0, material=red),)), {"ball": np.eye(4)})
    )

    def middle(opacity: float) -> NDArray[np.float64]:
        around = DrawnShape(0, Sphere(0.4), (*blue, opacity), np.eye(4))
        drawing = cast_rays_smoothly(shapes, EYE.pose.matrix, EYE, ghosts=[around])
        return np.asarray(drawing.rgb.reshape(90, 120, 3)[44:47, 59:62].mean(axis=(0, 1)))

    seen = [middle(opacity) for opacity in (0.01, 0.5, 1.0)]
    assert seen[0][0] > seen[0][2] + 60
    assert seen[2][2] > seen[2][0] + 60
    assert seen[1] == pytest.approx(0.5 * (seen[0] + seen[2]), abs=6.0)


def test_a_mark_without_a_surface_to_hide_it_is_drawn_as_it_is() -> None:
    triangle = DrawnTriangles(
        np.array([[0.0, -0.3, -0.3], [0.0, 0.3, -0.3], [0.0, 0.0, 0.4]]), np.array([[0, 1, 2]])
    )
    mark = DrawnShape(0, triangle, (0.9, 0.1, 0.1, 1.0), np.eye(4), painted=False)
    rgb = cast_rays_smoothly([], EYE.pose.matrix, EYE, ghosts=[mark]).rgb.astype(int)
    assert 0.01 < (rgb[:, 0] > rgb[:, 2] + 50).mean() < 0.5


@pytest.mark.parametrize(
    ("length", "text"), [(2.0, "2 m"), (1.0, "1 m"), (0.5, "50 cm"), (0.01, "1 cm"), (0.002, "2 mm")]
)
def test_lengths_have_a_unit_that_suits_them(length: float, text: str) -> None:
    assert length_text(length) == text


@pytest.mark.parametrize("dark", [False, True])
def test_the_parts_of_the_cart_pole_stand_out(dark: bool) -> None:
    """Rail, cart and pole differ from each other and from the ground, also for readers without a kind of
    cone."""
    cart_pole = dynx.load("cart_pole")
    camera = Camera.look_at((1.5, -3.0, 2.0), (0.0, 0.0, 0.2), size=(240, 135))
    with World(Scene("track", robots=(SceneRobot("r", cart_pole),))) as world:
        segments = world.camera(camera)
    with cart_pole.view(q=cart_pole.neutral(), dark=dark) as viewer:
        picture = viewer._picture(None, camera, None)
    parts = {name: segments.mask(f"r/{name}") for name in ("rail", "cart", "pole")}
    # The sky is above.
    parts["ground"] = ~np.any(list(parts.values()), axis=0) & (np.arange(135) > 60)[:, None]
    colours: dict[str, RGB] = {}
    for name, mask in parts.items():
        r, g, b = np.median(picture[mask], axis=0).astype(int).tolist()
        colours[name] = (r, g, b)
    for one, other in itertools.combinations(colours, 2):
        for kind in DICHROMATS:
            assert distance(colours[one], colours[other], kind) > TOLD_APART, (one, other)


LEVER = (
    "<robot name='r'><link name='base'><visual><geometry><box size='0.2 0.2 0.2'/></geometry></visual></link>"
    "<link name='lever'><inertial><origin xyz='0.3 0 0'/><mass value='1'/>"
    "<inertia ixx='0.01' iyy='0.01' izz='0.01' ixy='0' ixz='0' iyz='0'/></inertial>"
    "<visual><origin xyz='0.3 0 0'/><geometry><box size='0.4 0.1 0.1'/></geometry></visual></link>"
    "<joint name='j' type='revolute'><parent link='base'/><child link='lever'/><axis xyz='0 1 0'/>"
    "<limit lower='-1' upper='1' effort='4' velocity='1'/></joint></robot>"
)
"""A lever of grey boxes whose joint bears 2.9 N m at rest."""


def test_gravity_torques_are_seen_outside_of_the_links() -> None:
    lever = dynx.load(LEVER)
    camera = Camera.look_at((0.55, -0.45, 0.35), (0.0, -0.05, 0.0), size=(320, 240))
    with lever.view(q=lever.neutral()) as viewer:
        before = viewer._picture(None, camera, None).astype(int)
        viewer.set_shown("gravity torques")
        after = viewer._picture(None, camera, None).astype(int)
    changed = np.abs(after - before).max(axis=2) > 30
    arrow_shown = changed & (after.max(axis=2) - after.min(axis=2) > 80)
    number_shown = changed & (after.min(axis=2) > 200)
    assert arrow_shown.sum() > 20
    assert number_shown.sum() > 50


def test_axes_are_seen_through_the_shapes_before_them_in_their_own_colour() -> None:
    wall = DrawnShape(0, Box((0.4, 0.4, 0.4)), (0.5, 0.5, 0.5, 1.0), np.eye(4))
    axis = DrawnShape(0, Sphere(0.05), (1.0, 0.0, 0.0, 1.0), np.eye(4))
    pixel = EYE.size[0] * (EYE.size[1] // 2) + EYE.size[0] // 2

    def seen(shapes: list[DrawnShape], through: list[DrawnShape]) -> Any:
        return cast_rays_smoothly(shapes, EYE.pose.matrix, EYE, seen_through=through).rgb[pixel] / 255.0

    assert seen([], [axis]) == pytest.approx([1.0, 0.0, 0.0], abs=0.01)
    mixed = BEHIND_OPACITY * np.array([1.0, 0.0, 0.0]) + (1.0 - BEHIND_OPACITY) * seen([wall], [])
    assert seen([wall], [axis]) == pytest.approx(mixed, abs=0.01)
    before = axis._replace(T=np.asarray(homogeneous(np.eye(3), 0.7 * EYE.pose.matrix[:3, 3])))
    assert seen([wall], [before]) == pytest.approx([1.0, 0.0, 0.0], abs=0.01)
