"""Parts that are hidden or seen through, views that are saved, and the camera of a page."""

from __future__ import annotations

import io
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import pytest

import dynx
from dynx.errors import ArgumentError
from dynx.model import Pose
from dynx.spatial.scalar import Floats
from dynx.steppers.camera import Camera
from dynx.viewer import Viewer, view
from dynx.viewer.moving_picture import MOVING
from dynx.world import Material, Scene, SceneRobot, World, box, ground
from tests.viewer.conftest import OpenPage, connected, pixel_of, until, wait_for_rest

DARK_GREY = Material(rgba=(0.25, 0.25, 0.25, 1.0))
CUBE = box("cube", (0.4, 0.4, 0.4), mass=1.0, pose=Pose((0.0, 0.0, 0.2)), material=DARK_GREY)
SCENE = Scene("yard", bodies=(ground(), CUBE))


ROBOT = (
    "<robot name='r'><link name='base'><visual><geometry><sphere radius='0.1'/></geometry></visual>"
    "<collision><geometry><sphere radius='0.1'/></geometry></collision></link></robot>"
)


def shown(viewer: Viewer, part: str) -> set[bool]:
    return {node.visible for node in viewer.view.visuals[part]}


def test_a_part_stays_hidden_whichever_shapes_are_shown() -> None:
    robot = dynx.load(ROBOT)
    scene = Scene("two", robots=(SceneRobot("arm", robot),), bodies=(ground(), CUBE))
    with World(scene) as world, world.view(steps=False) as viewer:
        link = "arm/base"
        for part in ("cube", link):
            viewer.set_visible(part, False)
            assert shown(viewer, part) == {False}
            viewer.set_visible(part)
            assert shown(viewer, part) == {True}
        viewer.set_visible(link, False)
        viewer.view.drawn.show(visuals=False, collisions=True)
        viewer.view.drawn.show(visuals=True, collisions=True)
        assert shown(viewer, link) == {False}
        inside = viewer.view.drawn.robots["arm"]
        assert {node.visible for node in inside._collisions["base"]} == {False}
        viewer.set_visible(None)
        assert shown(viewer, link) == {True}
        wrong: list[Callable[[], None]] = [
            lambda: viewer.set_visible("cub", False),
            lambda: viewer.set_visible("cube", 1),
            lambda: viewer.set_opacity(1.5),
            lambda: viewer.set_opacity(0.5, "cub"),
        ]
        for call in wrong:
            with pytest.raises(ArgumentError):
                call()


RATIO = "window.__viserMutable?.scene?.__r3f?.root?.getState?.()?.viewport?.dpr"
"""Pixels of the picture for a pixel of the page, in its script."""


def colour_at(page: Any, place: Sequence[float] | Floats) -> Floats:
    """Return the colour (3,) at a place (2,) [pixels] of the page, once it is drawn whole: while something
    moves, software draws it with fewer pixels and without gloss."""
    page.wait_for_function(f"() => {RATIO} !== {MOVING}")
    page.evaluate("() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")
    pillow = pytest.importorskip("PIL.Image")
    picture = pillow.open(io.BytesIO(page.screenshot())).convert("RGB")
    return np.asarray(picture.getpixel((round(place[0]), round(place[1]))), dtype=np.float64)


def test_the_page_hides_parts_and_lets_them_be_seen_through(open_page: OpenPage) -> None:
    with World(SCENE) as world, world.view(steps=False) as viewer:
        page = open_page(viewer.url)
        (client,) = connected(viewer)
        wait_for_rest(page, viewer)
        place = pixel_of(client, CUBE.pose.matrix[:3, 3])
        solid = colour_at(page.page, place)
        viewer.set_opacity(0.5, "cube")
        until(lambda: np.abs(colour_at(page.page, place) - solid).max() > 15, "the cube to be seen through")
        half = colour_at(page.page, place)
        viewer.set_opacity(1.0)
        until(lambda: np.abs(colour_at(page.page, place) - solid).max() < 5, "the cube")
        page.page.get_by_text("parts", exact=True).click()
        page.page.get_by_label("visible").last.uncheck()
        until(lambda: shown(viewer, "cube") == {False}, "the part to be hidden")
        until(lambda: np.abs(colour_at(page.page, place) - solid).max() > 15, "the background")
        behind = colour_at(page.page, place)
        # Of a box that is seen through its far sides are seen, too.
        assert ((half > solid + 10) & (half < behind - 10)).all()
        assert not page.errors


def test_views_are_saved_and_shown_again_in_the_page(open_page: OpenPage) -> None:
    with view(dynx.load("six_axis_arm")) as viewer:
        with pytest.raises(ArgumentError, match="no page is open"):
            _ = viewer.camera
        above = Camera.look_at((0.0, 0.1, 5.0), (0.0, 0.0, 0.0), (0.0, 1.0, 0.0), field_of_view=0.5)
        viewer.save_view("above", above)
        page = open_page(viewer.url)
        (client,) = connected(viewer)
        wait_for_rest(page, viewer)
        start = viewer.camera
        assert start.size == (client.camera.image_width, client.camera.image_height)
        point = np.array([0.1, 0.2, 0.3])
        seen = start.intrinsics @ (np.linalg.inv(start.pose.matrix) @ [*point, 1.0])[:3]
        assert seen[:2] / seen[2] + 0.5 == pytest.approx(pixel_of(client, point), abs=0.01)
        page.page.get_by_text("views", exact=True).click()
        page.page.get_by_role("button", name="save this view").click()
        until(lambda: "view 2" in viewer.views, "the view")
        viewer.show_view("above")
        until(lambda: np.allclose(viewer.camera.pose.matrix, above.pose.matrix, atol=1e-3), "from above")
        assert viewer.camera.field_of_view == pytest.approx(0.5, abs=1e-6)
        page.page.get_by_label("view", exact=True).click()
        page.page.get_by_role("option", name="view 2").click()
        until(lambda: np.allclose(viewer.camera.pose.matrix, start.pose.matrix, atol=1e-3), "the start")
        viewer.show(dynx.load("pendulum"))
        assert set(viewer.views) == {"above", "view 2"}
        with pytest.raises(ArgumentError, match="no view 'abve'; did you mean 'above'"):
            viewer.show_view("abve")
        with pytest.raises(ArgumentError, match="on the part 'tip'"):
            viewer.look_from(Camera(part="tip"))
        assert not page.errors
