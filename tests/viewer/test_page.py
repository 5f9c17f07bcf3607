"""The page in a browser: drawn as the world's camera draws; moved by sliders, handles, buttons and keys."""

from __future__ import annotations

import re
import urllib.request
from collections.abc import Mapping
from functools import reduce
from html import escape
from pathlib import Path
from typing import Any
from xml.sax.saxutils import quoteattr

import numpy as np
import pytest

import dynx
from dynx.errors import ArgumentError
from dynx.model import Model, Pose
from dynx.model.geometry.drawn_shapes import link_shapes
from dynx.spatial.scalar import Floats
from dynx.spatial.so3 import quat_from_rotation
from dynx.steppers.camera import Camera
from dynx.steppers.state import RobotState, WorldState
from dynx.viewer import Viewer, export, view
from dynx.viewer.export import MAX_EMBEDDED
from dynx.viewer.motion import PARTED, motion_separation
from dynx.world import Scene, SceneRobot, World, box, ground, read_scene
from dynx.world.camera import draw_picture
from tests.conftest import needs_examples
from tests.viewer.conftest import (
    PATIENCE,
    Opened,
    OpenPage,
    antialiased,
    connected,
    pixel_of,
    poses_of_nodes,
    until,
    wait_for_rest,
    without_surroundings,
)

SAME = 0.93
"""Share of the pixels of a silhouette that two renderers have in common; edges differ by a pixel."""


def rendered_silhouette(viewer: Viewer, camera: Camera, opacity: float = 0.5) -> Any:
    """Return where the page, drawn from a camera's place, shows something of an opacity (height, width)."""
    (client,) = connected(viewer)
    T = camera.pose.matrix
    x, y, z, w = quat_from_rotation(T[:3, :3])
    width, height = camera.size
    picture = client.get_render(
        height=height,
        width=width,
        wxyz=(w, x, y, z),
        position=tuple(T[:3, 3]),
        fov=camera.field_of_view,
        transport_format="png",
        timeout=PATIENCE,
    )
    return picture[..., 3] > 255.0 * opacity


def drawn_silhouette(model: Model, q: Floats, camera: Camera) -> Any:
    """Return where the world's camera sees the robot (height, width)."""
    scene = Scene("robot", robots=[SceneRobot("robot", model)])
    state = WorldState(0.0, {"robot": RobotState(q, np.zeros(model.nv))}, {})
    return draw_picture(scene, state, camera).segmentation >= 0


@needs_examples
def test_the_page_shows_what_the_camera_of_the_world_sees(open_page: OpenPage) -> None:
    model = dynx.load("ur5")
    camera = Camera.look_at((1.3, -1.3, 0.8), (0.2, 0.0, 0.3), size=(320, 240))
    with view(model, whole_meshes=True) as viewer:
        without_surroundings(viewer)
        page = open_page(viewer.url)
        for seed in (0, 1):
            q = model.random(seed)
            viewer.view.put(q)
            expected = drawn_silhouette(model, q, camera)
            assert expected.sum() > 1000

            def common(expected: Any = expected) -> float:
                found = rendered_silhouette(viewer, camera)
                return float((found & expected).sum() / (found | expected).sum())

            until(lambda: common() > SAME, "the picture of the configuration")
        assert antialiased(page)
        shapes = [node.name for nodes in viewer.view.visuals.values() for node in nodes]
        assert len(shapes) == sum(len(list(link_shapes(model.geometry, link.name))) for link in model.links)
        assert page.page.evaluate(
            "names => names.every(name => __viserMutable.nodeRefFromName[name])", shapes
        )
        assert not page.errors


def test_sliders_buttons_and_keys_reach_the_program(open_page: OpenPage) -> None:
    model = dynx.load("six_axis_arm")
    with view(model) as viewer:
        page, again = open_page(viewer.url), open_page(viewer.url)
        connected(viewer, 2)
        start = viewer.view.q
        page.page.locator("[role=slider]").first.focus()
        page.page.keyboard.press("ArrowRight")
        until(lambda: viewer.view.q[0] > start[0], "the slider to move the joint")
        assert np.array_equal(viewer.view.q[1:], start[1:])
        moved = viewer.view.q
        again.page.get_by_role("button", name="random").click()
        until(lambda: not np.array_equal(viewer.view.q, moved), "the button")
        again.page.context.grant_permissions(["clipboard-read", "clipboard-write"])
        # The button is made anew with the new positions; what it said before would be lost.
        text = f"q = np.array({viewer.view.q.tolist()})"
        holds = "text => [...document.querySelectorAll('button')].some(b => b.dataset.text === text)"
        again.page.wait_for_function(holds, arg=text)
        again.page.get_by_role("button", name="copy").click()
        again.page.get_by_role("button", name="copied").wait_for()
        assert again.page.evaluate("navigator.clipboard.readText()") == text

        pressed: list[str] = []
        viewer.on_key("k", lambda: pressed.append("k"))
        viewer.button("press me", lambda: pressed.append("button"))
        page.page.get_by_role("button", name="press me").click()
        page.page.mouse.click(40, 350)  # The key goes to the scene, not to a control.
        page.page.keyboard.press("k")
        until(lambda: sorted(pressed) == ["button", "k"], "the button and the key of the program")

        page.page.reload()
        page.page.wait_for_selector("canvas[data-engine]")
        again.page.close()
        until(lambda: len(viewer.page.server.get_clients()) == 1, "one page after the other closed")
        assert not page.errors
        assert not again.errors


def test_held_keys_the_pointer_and_choices_reach_the_program(open_page: OpenPage) -> None:
    cube = box("cube", (0.4, 0.4, 0.4), mass=1.0, pose=Pose((0.0, 0.0, 0.2)))
    with World(Scene(bodies=(ground(), cube))) as world, world.view(steps=False) as viewer:
        page = open_page(viewer.url)
        (client,) = connected(viewer)
        told: list[Any] = []
        viewer.on_key("k", lambda: told.append("pressed"), lambda: told.append("released"))
        viewer.on_pointer_moved(lambda part, origin, direction: told.append((part, origin, direction)))
        wind = viewer.checkbox("wind", changed=told.append)
        number = viewer.number("mass", 1.0, changed=told.append)
        text = viewer.text("<i>here</i>", (0.0, 0.0, 0.5), colour=(255, 0, 0), size=30.0)
        page.page.get_by_label("wind").check()
        page.page.get_by_role("textbox", name="mass").fill("2.5")
        until(lambda: {True, 2.5} <= {each for each in told if not isinstance(each, tuple)}, "both controls")
        assert (wind.value, number.value) == (True, 2.5)
        written = page.page.get_by_text("<i>here</i>")
        written.wait_for()
        style = written.evaluate("node => [getComputedStyle(node).color, getComputedStyle(node).fontSize]")
        assert style == ["rgb(255, 0, 0)", "30px"]

        # Letters that are typed into a field are no keys.
        page.page.keyboard.press("k")
        page.page.mouse.click(40, 350)
        page.page.wait_for_timeout(500.0)
        assert "released" not in told
        told.clear()
        page.page.keyboard.down("k")
        page.page.keyboard.down("Home")
        until(lambda: viewer.keys == {"k", "home"}, "the keys that are held")
        until(lambda: "pressed" in told, "the press")
        assert "released" not in told
        page.page.keyboard.up("k")
        until(lambda: "released" in told, "the release")
        assert viewer.keys == {"home"}
        page.page.keyboard.up("Home")
        until(lambda: not viewer.keys, "no key")

        target = cube.pose.matrix[:3, 3]
        wait_for_rest(page, viewer)

        def seen() -> Any:
            page.page.mouse.move(*(pixel_of(client, target) + np.array([len(told) % 2, 0.0])))
            page.page.wait_for_timeout(200.0)
            return [each for each in told if isinstance(each, tuple) and each[0] == "cube"]

        def is_aimed_at() -> bool:
            """Check the last ray; on a busy machine the page may still be on its way to this view."""
            rays = seen()
            towards = target - client.camera.position
            return bool(
                rays
                and np.allclose(rays[-1][1], client.camera.position, atol=1e-3)
                and rays[-1][2] @ towards / np.linalg.norm(towards) > 0.999
            )

        until(is_aimed_at, "the ray to the part under the pointer")
        assert np.linalg.norm(seen()[-1][2]) == pytest.approx(1.0)

        text.remove()
        until(lambda: written.count() == 0, "the text to go")
        page.page.keyboard.down("k")
        until(lambda: viewer.keys == {"k"}, "the key")
        assert not page.errors
        page.page.close()
        until(lambda: not viewer.keys, "no key of a page that was closed")


def test_a_choice_reaches_the_program_and_everything_is_removed_at_once(open_page: OpenPage) -> None:
    with view("six_axis_arm") as viewer:
        page = open_page(viewer.url)
        connected(viewer)
        told: list[Any] = []
        gait = viewer.dropdown("gait", ["walk", "trot"], changed=told.append)
        wind, mass = viewer.checkbox("wind", changed=told.append), viewer.number("mass", 1.0)
        viewer.button("press me", lambda: told.append("pressed"))
        written = viewer.text("here", (0.0, 0.0, 0.5), colour="red", size=20.0)
        names = {"gait": gait, "wind": wind, "mass": mass, "here": written}
        shown = {name: page.page.get_by_text(name, exact=True) for name in (*names, "press me")}
        for each in shown.values():
            each.first.wait_for()
        page.page.locator("input[value=walk]").first.click()
        page.page.get_by_role("option", name="trot").click()
        until(lambda: told == ["trot"], "the choice")
        assert gait.value == "trot"
        wind.value, mass.value, gait.value = True, 2.0, "walk"
        page.page.wait_for_function(
            """() => {
              const values = [...document.querySelectorAll("input")].map((each) => each.value);
              return values.includes("walk") && values.includes("2") && !values.includes("trot");
            }"""
        )
        assert page.page.get_by_label("wind").is_checked()
        # What the program sets is not told to it.
        assert told == ["trot"]
        viewer.remove_all()
        until(lambda: not any(each.count() for each in shown.values()), "everything to go")
        assert page.page.get_by_role("button", name="random").count() == 1
        assert not page.errors


def poses_in_page(page: Opened, paths: Mapping[str, str]) -> dict[str, Floats]:
    """Return the pose (4, 4) in the world of the page's nodes, by the names of the parts at these paths."""
    placed = "paths => paths.every((path) => window.__viserMutable?.nodeRefFromName?.[path])"
    page.page.wait_for_function(placed, arg=list(paths))
    found = page.page.evaluate(
        """paths => paths.map(path => {
          const nodes = __viserMutable.nodeRefFromName, root = nodes["/" + path.split("/")[1]], chain = [];
          for (let node = nodes[path]; node !== root; node = node.parent) {
            node.updateMatrix();
            chain.push([...node.matrix.elements]);
          }
          return chain;
        })""",
        list(paths),
    )
    poses = {}
    for name, chain in zip(paths.values(), found, strict=True):
        assert chain, name
        poses[name] = reduce(lambda T, over: np.reshape(over, (4, 4)).T @ T, chain, np.eye(4))
    return poses


def test_the_panel_of_a_narrow_page_lies_below_the_robot(open_page: OpenPage) -> None:
    with view(dynx.load("six_axis_arm"), whole_meshes=False) as viewer:
        page = open_page(viewer.url, (400, 800))
        (client,) = connected(viewer)
        assert not page.page.locator("#webgl-software-rendering").is_visible()
        panel = page.page.locator(".mantine-Paper-root", has_text="show").first
        until(lambda: panel.bounding_box()["width"] == 400, "the panel to be as wide as the page")
        top = panel.bounding_box()["y"]
        robot = viewer.view.robot
        until(
            lambda: all(0.0 < pixel_of(client, robot.pose(link)[:3, 3])[1] < top for link in robot.links),
            "room",
        )
        assert not page.errors


def test_a_rollout_played_in_the_page_ends_at_its_last_configuration(open_page: OpenPage) -> None:
    arm = dynx.load("six_axis_arm")
    motion = dynx.trajectory.cycloidal(np.zeros(6), [0.5, -0.4, 0.3, 0.2, -0.3, 0.4], duration=0.5)
    rollout = dynx.simulate(arm, dynx.control.ComputedTorque(arm, kp=100.0, kd=20.0), motion)
    with rollout.view() as viewer:
        page = open_page(viewer.url)
        drawn = viewer.view.drawn
        paths = {node.name: name for name, node in drawn.parts.items()}
        start = poses_in_page(page, paths)
        page.page.get_by_role("button", name="play", exact=True).click()
        until(lambda: viewer.view.time == rollout.t[-1], "the end of the motion")
        last = viewer.view.motion.at(-1)
        assert max(np.abs(last[name] - T).max() for name, T in start.items()) > 0.1

        def farthest() -> float:
            found = poses_in_page(page, paths)
            return max(float(np.abs(found[name] - T).max()) for name, T in last.items())

        until(lambda: farthest() < 1e-5, "the last configuration in the page")
        assert not page.errors


def test_dragging_the_handle_solves_inverse_kinematics(open_page: OpenPage) -> None:
    model = dynx.load("six_axis_arm")
    with view(model, q=[0.3, -0.4, 0.6, 0.2, 0.5, 0.1]) as viewer:
        page = open_page(viewer.url)
        (client,) = connected(viewer)
        page.page.get_by_label("drag it").check()
        until(lambda: viewer.view._handle.visible, "the handle")
        frame, before = viewer.view._handle.frame, viewer.view.q
        with dynx.backend("reference", model) as engine:
            T = engine.forward_kinematics(before, frame)
            scale = float(viewer.view._handle._node.scale)
            # The arrow along z is held at a point of its shaft.
            held, towards = (pixel_of(client, (T @ [0.0, 0.0, s * scale, 1.0])[:3]) for s in (0.6, 1.0))
            mouse = page.page.mouse
            # The arrow is found under the pointer when a picture has been drawn.
            for action in (lambda: mouse.move(*held), mouse.down):
                action()
                wait_for_rest(page)
            for share in np.linspace(0.2, 1.0, 5):
                mouse.move(*(held + share * (towards - held)))
                wait_for_rest(page)
            mouse.up()
            until(lambda: not np.array_equal(viewer.view.q, before), "the robot to follow the handle")
            moved = engine.forward_kinematics(viewer.view.q, frame)
        shift = T[:3, :3].T @ (moved[:3, 3] - T[:3, 3])
        assert shift[2] > 0.02 * scale
        assert np.abs(shift[:2]).max() < 1e-3 * scale
        assert np.abs(moved[:3, :3] - T[:3, :3]).max() < 1e-5
        assert not page.errors


def test_the_camera_moves_with_a_part(open_page: OpenPage) -> None:
    model = dynx.load("six_axis_arm", base="floating")
    with view(model) as viewer:
        page = open_page(viewer.url)
        (client,) = connected(viewer)
        part = model.links[0].name
        before, distance = client.camera.position, np.array([0.4, -0.3, 0.2])
        viewer.follow(part)
        q = model.neutral()
        q[:3] += distance
        viewer.update(q)
        until(lambda: np.allclose(client.camera.position - before, distance, atol=1e-4), "the camera to move")
        viewer.follow(part, first_person=True)

        def looks_ahead() -> bool:
            ahead, view = client.camera.position - distance, client.camera.look_at - client.camera.position
            # The page computes the place from angles, so it may lie behind what was set, by rounding.
            outside = [viewer.view.camera._outside, 0.0, 0.0]
            return bool(
                np.allclose(ahead, outside, atol=1e-6) and np.allclose(view, [1.0, 0.0, 0.0], atol=1e-6)
            )

        # The page may still send where it was before.
        until(looks_ahead, "the camera to look out of the part")
        assert not page.errors


def test_the_page_pushes_a_part_and_jumps_to_where_motions_part(open_page: OpenPage) -> None:
    scene = read_scene("slope")
    body = next(body for body in scene.bodies if not body.fixed)
    with World(scene) as world, world.view() as viewer:
        page = open_page(viewer.url)
        push = page.page.get_by_role("button", name="push", exact=True)
        push.click()
        until(lambda: "choose the part" in viewer.view._message.value, "the message")
        viewer.view._part.value = body.name
        push.click()
        until(lambda: viewer.view._pushes, "the push")
        assert not viewer.view._message.value
        before = world.state.bodies[body.name].twist
        page.page.get_by_role("button", name="one step").click()
        until(lambda: world.time > 0.0, "the step")
        # 1 N s along x, up to what gravity and friction add in a step.
        gained = world.state.bodies[body.name].twist[0] - before[0]
        assert gained == pytest.approx(1.0 / (body.mass or np.inf), rel=0.2)
        assert not page.errors
    arm = dynx.load("six_axis_arm")
    runs = [dynx.simulate(arm, duration=0.2, q0=arm.neutral() + at) for at in (0.0, 1e-3)]
    with view(tuple(runs)) as viewer:
        page = open_page(viewer.url)
        viewer.view.go_to(0.2)
        page.page.get_by_role("button", name="jump to where they part").click()
        distance = motion_separation(viewer.view.motion, viewer.view.ghost).distance
        first = int(np.argmax(distance > PARTED))
        until(lambda: viewer.view.time == viewer.view.motion.t[first], "the time at which they part")
        assert not page.errors


@needs_examples
def test_an_exported_page_plays_without_a_network(open_page: OpenPage, tmp_path: Path) -> None:
    arm = dynx.load("six_axis_arm")
    motion = dynx.trajectory.cycloidal(np.zeros(6), [0.5, -0.4, 0.3, 0.2, -0.3, 0.4], duration=0.5)
    rollout = dynx.simulate(arm, dynx.control.ComputedTorque(arm, kp=100.0, kd=20.0), motion)
    path = tmp_path / "run.html"
    with rollout.view() as viewer:
        viewer.export(path)
    page = open_page(path.as_uri())
    node = "Object.values(__viserMutable.nodePoseData).map(each => each.wxyz.join()).join()"
    before = page.page.evaluate(node)
    page.page.wait_for_function(f"before => {node} !== before", arg=before)
    assert [url for url in page.requests if not url.startswith(("file:", "data:", "blob:"))] == []
    assert not page.errors


def test_a_motion_plays_in_a_notebook_without_a_server(open_page: OpenPage, tmp_path: Path) -> None:
    """The output alone is opened, as hosts of notebooks show it: in a frame with an origin of its own."""
    nbformat, nbclient = pytest.importorskip("nbformat"), pytest.importorskip("nbclient")
    pytest.importorskip("ipykernel")
    code = (
        "import dynx\n"
        "with dynx.simulate('six_axis_arm', duration=0.5).view(whole_meshes=False) as viewer:\n"
        "    made = viewer.embed(400)\n"
        "made"
    )
    notebook = nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell(code)])
    client = nbclient.NotebookClient(notebook, timeout=180, kernel_name="python3")
    with client.setup_kernel():
        client.execute_cell(notebook.cells[0], 0)
    (output,) = notebook.cells[0].outputs
    embedded = output.data["text/html"]
    assert len(embedded.encode()) < MAX_EMBEDDED
    assert "127.0.0.1" not in embedded
    host = f'<iframe sandbox="allow-scripts" width="800" height="500" srcdoc="{escape(embedded)}"></iframe>'
    (tmp_path / "host.html").write_text(f"<!doctype html><title>host</title>{host}", encoding="utf-8")
    page = open_page()
    page.page.goto((tmp_path / "host.html").as_uri())

    def has_frames() -> bool:
        page.page.wait_for_timeout(50)  # Playwright learns of a frame only while one of its calls runs
        return len(page.page.frames) == 3

    until(has_frames, "the frame in the frame")
    inner = page.page.frames[2]
    inner.wait_for_selector("canvas[data-engine]")
    node = "Object.values(__viserMutable.nodePoseData).map(each => each.wxyz.join()).join()"
    before = inner.evaluate(node)
    inner.wait_for_function(f"before => {node} !== before", arg=before)
    assert inner.title() == "dynx: six_axis_arm"
    assert [url for url in page.requests if not url.startswith(("file:", "data:", "blob:", "about:"))] == []
    assert not page.errors


def test_an_exported_comparison_says_which_motion_is_solid(open_page: OpenPage, tmp_path: Path) -> None:
    rollout = dynx.simulate("six_axis_arm", duration=0.1)
    path, name = tmp_path / "both.html", "<b id=bold>a.npz"
    with view((rollout, rollout), names=(name, "b.npz"), whole_meshes=False) as viewer:
        viewer.export(path)
    page = open_page(path.as_uri())
    assert page.page.get_by_text(f"solid: {name}").is_visible()
    assert page.page.get_by_text("see-through: b.npz").is_visible()
    assert page.page.locator("#bold").count() == 0
    assert page.page.title() == "dynx: two rollouts"
    assert not page.page.locator("#webgl-software-rendering").is_visible()
    assert not page.errors


def test_a_screenshot_needs_an_open_page(open_page: OpenPage) -> None:
    with view(dynx.load("pendulum")) as viewer:
        with pytest.raises(ArgumentError, match="no page is open"):
            viewer.screenshot()
        open_page(viewer.url)
        connected(viewer)
        picture = viewer.screenshot((160, 100), timeout=PATIENCE)
        assert picture.shape == (100, 160, 3)
        assert len(np.unique(picture)) > 1


def test_a_notebook_shows_the_page_inline() -> None:
    nbformat, nbclient = pytest.importorskip("nbformat"), pytest.importorskip("nbclient")
    pytest.importorskip("ipykernel")
    code = "import dynx; dynx.load('six_axis_arm').view()"
    notebook = nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell(code)])
    client = nbclient.NotebookClient(notebook, timeout=120, kernel_name="python3")
    with client.setup_kernel():
        client.execute_cell(notebook.cells[0], 0)
        # viser displays its addresses in a notebook unless it is silenced.
        (output,) = notebook.cells[0].outputs
        source = re.search(r'<iframe src="(http://127\.0\.0\.1:\d+/[\w-]+/)"', output.data["text/html"])
        assert source is not None
        with urllib.request.urlopen(source[1], timeout=30.0) as page:
            assert b"<title>dynx: six_axis_arm</title>" in page.read()


def test_one_page_shows_one_thing_after_another() -> None:
    arm = dynx.load("six_axis_arm")
    rollout = dynx.simulate(arm, duration=0.2)
    with World(read_scene("stack")) as world, rollout.view(play=True) as viewer:
        viewer.slider("gain", 0.0, 1.0)
        url, timeline = viewer.url, viewer.view.timeline
        viewer.show(world, steps=False)
        timeline._thread.join(10.0)
        assert not timeline._thread.is_alive()
        world.step(10)
        viewer.update()
        shown, expected = poses_of_nodes(viewer.view.drawn), world.state.bodies
        for name, body in expected.items():
            assert np.allclose(shown[name][:3, 3], body.position, atol=1e-5)
        viewer.show(arm, q=arm.random(0))
        with urllib.request.urlopen(url, timeout=30.0) as page:
            assert b"<title>dynx: six_axis_arm</title>" in page.read()
        assert np.array_equal(viewer.view.q, arm.random(0))
        assert viewer.url == url
        with pytest.raises(ArgumentError, match="no option 'play'"):
            viewer.show(arm, play=True)
        assert not viewer.page.closed
    with pytest.raises(ArgumentError, match="is closed"):
        viewer.show(arm)


def test_a_title_is_no_html() -> None:
    name = "a</title><script>alert(1)</script>"
    robot = dynx.load(f"<robot name={quoteattr(name)}><link name='base'/></robot>")
    with robot.view() as viewer, urllib.request.urlopen(viewer.url, timeout=30.0) as page:
        assert f"<title>dynx: {escape(name)}</title>".encode() in page.read()


def test_an_embedded_page_has_a_size_that_a_notebook_takes(monkeypatch: pytest.MonkeyPatch) -> None:
    rollout = dynx.simulate("six_axis_arm", duration=2.0)
    with rollout.view(whole_meshes=False) as viewer:
        whole = viewer.embed()
        size = len(whole._repr_html_().encode())
        assert size <= MAX_EMBEDDED
        assert repr(whole) == f"<EmbeddedPage of dynx: six_axis_arm, {len(whole.html) / 1e6:.1f} MB>"
        # Fewer updates a second make it smaller; that is not enough for any bound.
        monkeypatch.setattr(export, "MAX_EMBEDDED", size - 1)
        assert len(viewer.embed()._repr_html_().encode()) < size
        monkeypatch.setattr(export, "MAX_EMBEDDED", 1000)
        with pytest.raises(ArgumentError, match=r"the page has .* MB; a notebook takes at most 0.001 MB"):
            viewer.embed()
        with pytest.raises(ArgumentError, match="height is '0'"):
            viewer.embed(0)
    with (
        World(read_scene("stack")) as world,
        world.view(steps=False) as viewer,
        pytest.raises(ArgumentError, match="a live world cannot be embedded"),
    ):
        viewer.embed()


def test_a_closed_viewer_shows_no_page_in_a_notebook() -> None:
    with dynx.load("six_axis_arm").view() as viewer:
        assert "<iframe" in viewer._repr_html_()
    assert "<iframe" not in viewer._repr_html_()
    assert "closed" in viewer._repr_html_()


def test_a_world_with_the_same_parts_replaces_another_below_the_same_controls() -> None:
    scene = read_scene("stack")
    with (
        World(scene) as first,
        World(scene) as second,
        World(read_scene("slope")) as other,
        first.view(steps=False) as viewer,
    ):
        button = viewer.view._button
        second.step(10)
        assert viewer.view.replace(second)
        viewer.follow(next(iter(second.state.bodies)))
        for name, body in second.state.bodies.items():
            assert np.allclose(viewer.view.drawn.pose(name)[:3, 3], body.position)
            assert np.allclose(poses_of_nodes(viewer.view.drawn)[name][:3, 3], body.position, atol=1e-5)
        assert viewer.view._button is button
        assert not viewer.view.replace(other)
        assert viewer.view.world is second
