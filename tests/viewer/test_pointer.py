"""The pointer in the page: names of what it is over, a click, and a drag."""

from __future__ import annotations

from html import escape
from itertools import combinations
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import dynx
from dynx.spatial.scalar import Floats
from dynx.viewer import view
from dynx.viewer.browser import HOVERED
from dynx.viewer.marks import CORNERS, arranged, overlap, rectangle, seen_by
from dynx.world import World, read_scene
from tests.viewer.conftest import Opened, OpenPage, antialiased, connected, until, wait_for_rest

MESSAGE = 160.0
"""Height of the part of a page on which viser tells that software draws [pixels]."""

PIXEL = """path => {
  const page = window.__viserMutable, picture = page?.scene?.__r3f?.root?.getState?.();
  if (!picture || !page.nodeRefFromName[path]) return null;
  const place = picture.camera.position.clone();
  page.nodeRefFromName[path].getWorldPosition(place).project(picture.camera);
  const box = picture.gl.domElement.getBoundingClientRect();
  return [box.left + 0.5 * (place.x + 1) * box.width, box.top + 0.5 * (1 - place.y) * box.height];
}"""
"""Script that returns where the page draws the origin of a node [pixels], and null while it does not."""


def hover(page: Opened, path: str, part: str, *, shown: bool = True) -> None:
    """Move the pointer over the origin of a node until the page shows, or no longer shows, a part's name.

    What the page draws comes after what it is told, and a pointer at rest is asked nothing.
    """
    label = page.page.locator(f"#{HOVERED}")

    def done() -> bool:
        pixel = page.page.evaluate(PIXEL, path)
        if pixel is None:
            return False
        page.page.mouse.move(*(np.array(pixel) + np.random.default_rng().uniform(-3.0, 3.0, 2)))
        page.page.wait_for_timeout(50.0)
        return bool((label.is_visible() and label.text_content() == part) == shown)

    until(done, f"the name of {part}: {shown}")


def name_beside(page: Opened, pixel: Floats, part: str) -> float:
    """Return where the name of a part begins while the pointer is on this pixel [pixels, to the right]."""
    label = page.page.locator(f"#{HOVERED}")
    # A pointer that stays is asked nothing.
    for each in (pixel - 1.0, pixel):
        page.page.mouse.move(*each)
        wait_for_rest(page)
    assert label.text_content() == part
    box = label.bounding_box()
    assert box is not None, f"the name of {part} is not shown"
    return float(box["x"])


def test_a_click_names_a_body_of_a_world_and_the_pointer_drags_it(open_page: OpenPage) -> None:
    with World(read_scene("stack")) as world, world.view() as viewer:
        page = open_page(viewer.url)
        connected(viewer)
        wait_for_rest(page, viewer)
        nodes = {name: viewer.view.drawn.parts[name].name for name in world.state.bodies}
        # From the page: the camera that the server knows may be of an earlier picture.
        pixels = {name: np.array(page.page.evaluate(PIXEL, node)) for name, node in nodes.items()}
        # Below the message on software, which lies over the upper left of the page.
        name, held = min(
            ((name, pixel) for name, pixel in pixels.items() if pixel[1] > MESSAGE),
            key=lambda each: each[1][1],
        )
        mouse = page.page.mouse
        hover(page, nodes[name], name)
        mouse.move(*held)
        wait_for_rest(page)
        # Once, since a second click takes the name away.
        mouse.click(*held)
        until(lambda: viewer.view.names.shown == name, "the name of the part that was clicked")
        steps = [lambda x=x: mouse.move(held[0] + x, held[1]) for x in (30.0, 60.0)]
        for action in (mouse.down, *steps):
            action()
            wait_for_rest(page)

        def pulled() -> Floats:
            found = viewer.view._spring.forces(world)
            return np.asarray(found[0].wrench)[:3] if found else np.zeros(3)

        until(lambda: np.linalg.norm(pulled()) > 1e-3, "the spring")
        # From the camera's place, right in the picture is along (1, 1, 0).
        assert pulled() @ [1.0, 1.0, 0.0] > 0.9 * np.sqrt(2.0) * np.linalg.norm(pulled())
        mouse.up()
        until(lambda: not viewer.view._spring.pulls, "the end of the pull")
        assert not page.errors


def test_the_name_of_the_part_under_the_pointer_is_shown(open_page: OpenPage, tmp_path: Path) -> None:
    name = "<b>upper & 'arm'</b>"
    path = tmp_path / "robot.urdf"
    box = '<geometry><box size="0.3 0.3 0.3"/></geometry>'
    box = f"<visual>{box}</visual><collision>{box}</collision>"
    path.write_text(
        f'<robot name="r"><link name="base">{box}</link><link name="{escape(name)}">{box}</link>'
        f'<joint name="j" type="prismatic"><parent link="base"/><child link="{escape(name)}"/>'
        '<origin xyz="0 0 0.6"/><axis xyz="0 0 1"/>'
        '<limit lower="-1" upper="1" effort="1" velocity="1"/></joint></robot>'
    )
    with view(dynx.load(path), whole_meshes=False) as viewer:
        page = open_page(viewer.url)
        connected(viewer)
        label = page.page.locator(f"#{HOVERED}")
        for part in ("base", name):
            hover(page, viewer.view.robot.links[part].name, part)
            pixel = np.array(page.page.evaluate(PIXEL, viewer.view.robot.links[part].name))
            before = name_beside(page, pixel, part)
            assert name_beside(page, pixel + 4.0, part) > before
        assert not antialiased(page)
        page.page.mouse.move(20.0, 430.0)
        label.wait_for(state="hidden")

        node = viewer.view.robot.links[name].name
        viewer.view.robot.show(visuals=False, collisions=False)
        hover(page, node, name, shown=False)
        viewer.view.robot.show(visuals=False, collisions=True)
        hover(page, node, name)
        assert not page.errors
        exported = tmp_path / "page.html"
        viewer.export(exported)
        recorded = open_page(exported.as_uri())
        for part in ("base", name):
            hover(recorded, viewer.view.robot.links[part].name, part)
        assert not recorded.errors


def test_names_of_a_file_are_shown_and_not_run(open_page: OpenPage, tmp_path: Path) -> None:
    name = "&lt;img src=x onerror=&quot;window.ran=1&quot;&gt;"
    path = tmp_path / "robot.urdf"
    link = '<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>'
    path.write_text(
        f'<robot name="{name}"><link name="{name}">{link}</link><link name="b/c">{link}</link>'
        f'<joint name="{name}" type="revolute"><parent link="{name}"/><child link="b/c"/>'
        '<axis xyz="0 0 1"/><limit lower="-1" upper="1" effort="1" velocity="1"/></joint></robot>'
    )
    with view(dynx.load(path)) as viewer:
        viewer.view._marks.show("names", True)
        viewer.text("<script>window.ran = 1</script>", (0.0, 0.0, 0.5))
        page = open_page(viewer.url)
        connected(viewer)
        page.page.get_by_label("joint axes").check()
        page.page.wait_for_timeout(500.0)
        assert page.page.evaluate("window.ran") is None
        assert not page.errors


pixels = st.floats(0.0, 300.0)


@given(st.lists(st.tuples(pixels, pixels, st.text("abc_", min_size=1, max_size=12)), max_size=12))
def test_no_name_overlaps_another_and_one_is_hidden_only_without_room(
    labels: list[tuple[float, float, str]],
) -> None:
    points, texts = [label[:2] for label in labels], [label[2] for label in labels]
    corners = arranged(np.array(points).reshape(-1, 2), texts)
    placed = [
        rectangle(point, text, corner)
        for point, text, corner in zip(points, texts, corners, strict=True)
        if corner is not None
    ]
    assert not any(overlap(a, b) for a, b in combinations(placed, 2))
    for point, text, corner in zip(points, texts, corners, strict=True):
        if corner is None:
            assert all(
                any(overlap(rectangle(point, text, each), other) for other in placed) for each in CORNERS
            )


def test_names_behind_the_camera_are_hidden() -> None:
    assert arranged(np.array([[np.nan, np.nan], [10.0, 10.0]]), ["a", "b"]) == [None, "top-left"]


def test_points_lie_in_the_picture_as_a_pinhole_camera_sees_them() -> None:
    camera = SimpleNamespace(
        position=(0.0, -4.0, 1.0),
        look_at=(0.0, 0.0, 1.0),
        up_direction=(0.0, 0.0, 1.0),
        fov=np.pi / 2,
        image_width=800,
        image_height=400,
    )
    points = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 1.0], [0.0, 0.0, 2.0], [0.0, -5.0, 1.0]])
    found = seen_by(camera, points)
    # The picture is 8 m wide at a distance of 4 m, z is up.
    assert np.allclose(found[:3], [[400.0, 200.0], [450.0, 200.0], [400.0, 150.0]])
    assert np.isnan(found[3]).all()


def test_names_of_a_robot_are_shown_and_hidden() -> None:
    with dynx.load("six_axis_arm").view() as viewer:
        marks = viewer.view._marks
        for shown in (True, False, True):
            marks.show("names", shown)
            (labels,) = marks._nodes["names"]
            assert {label.visible for label in labels._labels} == {shown}
            viewer.view.put(np.full(6, 0.3))


@pytest.mark.parametrize("width", [1280, 400])
def test_in_a_page_no_name_overlaps_another(width: int) -> None:
    """The camera of a page that is opened arranges the names; `put` arranges them anew."""
    camera = SimpleNamespace(
        position=(1.0, -1.0, 0.7),
        look_at=(0.0, 0.0, 0.3),
        up_direction=(0.0, 0.0, 1.0),
        fov=1.3,
        image_width=width,
        image_height=800,
    )
    model = dynx.load("seven_axis_arm")
    with model.view() as viewer:
        viewer.view._marks.show("names", True)
        (labels,) = viewer.view._marks._nodes["names"]
        labels._moved(camera)
        for q in (np.zeros(7), model.random(3)):
            viewer.view.put(q)
            shown = [
                rectangle(point, name, label.anchor)
                for name, label, point in zip(
                    labels._names, labels._labels, seen_by(camera, labels._points()), strict=True
                )
                if label.visible
            ]
            assert len(shown) >= 2
            assert not any(overlap(a, b) for a, b in combinations(shown, 2))
