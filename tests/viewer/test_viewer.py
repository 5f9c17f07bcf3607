"""The viewer without a browser: what it shows, its errors, its controls, and its exported pages."""

from __future__ import annotations

import socket
import subprocess
import sys
import urllib.request
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import dynx
from dynx.errors import ArgumentError
from dynx.model import Model
from dynx.model.tree import Base
from dynx.viewer import Viewer, view
from dynx.viewer.colours import NAMED, RGB
from dynx.world import World, read_scene
from tests.conftest import EXAMPLES_INSTALLED, needs_examples
from tests.viewer.conftest import poses_of_nodes, until

LARGEST_PAGE = 15_000_000
"""Largest size of an exported page of a rollout of 10 s [bytes]."""


@pytest.fixture(scope="module")
def arm() -> Model:
    return dynx.load("six_axis_arm")


def test_a_robot_is_shown_at_the_configuration_given(arm: Model) -> None:
    q = arm.random(0)
    with view(arm, q=q) as viewer:
        assert np.array_equal(viewer.view.q, q)
        other = arm.random(1)
        viewer.view.put(other)
        assert np.array_equal(viewer.view.q, other)
        with dynx.backend("reference", arm) as engine:
            for link, T in poses_of_nodes(viewer.view.robot).items():
                expected = engine.forward_kinematics(other, link)
                assert np.abs(T - expected).max() < 1e-6
                assert np.abs(viewer.view.robot.pose(link) - expected).max() < 1e-9
    assert viewer.page.closed


def test_the_line_that_installs_the_viewer_is_told() -> None:
    code = "import sys; sys.modules['viser'] = None; import dynx; dynx.load('six_axis_arm').view()"
    ended = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert ended.returncode == 1
    assert ended.stderr.splitlines()[-1].startswith(
        "dynx.errors.NotInstalledError: the viewer needs viser: pip install '.[viewer]'"
    )


def test_every_object_has_its_view(arm: Model, tmp_path: Path) -> None:
    rollout = dynx.simulate(arm, duration=0.1)
    with arm.view() as first, rollout.view() as second:
        assert first.page.port != second.page.port
    scene = read_scene("stack")
    with World(scene) as world, world.view() as viewer:
        viewer.view.step(3)
        assert world.time == pytest.approx(3 * world.dt)


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="needs more than one loopback address")
def test_other_machines_are_let_in_only_if_asked(arm: Model) -> None:
    for options, let_in in (({}, False), ({"host": "0.0.0.0"}, True)):
        with arm.view(**options) as viewer, socket.socket() as other:
            # Every address of the network 127 is this machine's; the page has one of them, or all.
            assert (other.connect_ex(("127.0.0.2", viewer.page.port)) == 0) == let_in
            if let_in:
                # A server that ends before it has taken up a connection leaves it to the garbage collector.
                other.sendall(b"GET / HTTP/1.1\r\nHost: 127.0.0.2\r\n\r\n")
                assert other.recv(9) == b"HTTP/1.1 "


def test_a_port_that_is_taken_is_told(arm: Model) -> None:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        with pytest.raises(ArgumentError, match=f"port {port} of '127.0.0.1' cannot be listened on"):
            Viewer(arm, port=port)


def test_without_a_port_the_page_takes_the_next_one_that_is_free(arm: Model) -> None:
    with Viewer(arm) as first, Viewer(arm) as second:
        assert 8080 <= first.page.port < second.page.port
        assert f":{second.page.port}/" in second.url
        with urllib.request.urlopen(second.url, timeout=10.0) as answer:
            assert answer.status == 200


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"port": 70_000}, "wanted 0 to 65535"),
        ({"port": -1}, "port"),
        ({"port": 0, "host": ""}, "wanted an address of this machine"),
        ({"port": 0, "host": "203.0.113.1"}, "cannot be listened on: .*; wanted an address of this machine"),
        ({"port": 0, "host": "999.1.1.1"}, "host '999.1.1.1' is not found: .* such as 127.0.0.1"),
        ({"port": 0, "q": [np.nan] * 6}, "finite"),
        ({"port": 0, "q": [0.0] * 3}, "shape"),
        ({"port": 0, "plays": True}, "no option 'plays' of a robot"),
        ({"prot": 0}, "did you mean 'port'"),
        ({"port": 0, "play": True}, "no option 'play' of a robot; it has q, engine, .*, open_browser$"),
        ({"port": 0, "collisions": "yes"}, "wanted True or False"),
        ({"port": 0, "dark": "yes"}, "dark is 'yes'; wanted True or False"),
        ({"port": 0, "whole_meshes": 3}, "whole_meshes is '3'; wanted True or False"),
    ],
)
def test_wrong_arguments_are_told(arm: Model, options: dict[str, Any], message: str) -> None:
    with pytest.raises(ArgumentError, match=message):
        Viewer(arm, **options)


@pytest.mark.parametrize("shown", [None, 3, [1, 2], (dynx, dynx, dynx)])
def test_what_cannot_be_shown_is_told(shown: object) -> None:
    with pytest.raises(ArgumentError, match="wanted"):
        view(shown)


def test_wrong_controls_are_told(arm: Model) -> None:
    with view(arm) as viewer:
        wrong: list[Callable[[], object]] = [
            lambda: viewer.slider("x", 1.0, 0.0),
            lambda: viewer.slider("", 0.0, 1.0),
            lambda: viewer.slider("x", 0.0, np.nan),
            lambda: viewer.slider("x", 0.0, 1.0, value=1.5),
            lambda: viewer.slider("x", 0.0, 1.0, changed=3),  # type: ignore[arg-type]
            lambda: viewer.button("x", None),  # type: ignore[arg-type]
            lambda: viewer.on_key("no key", print),
            lambda: viewer.text("x", [0.0, 1.0]),
            lambda: viewer.line([[0.0, 0.0, 0.0]]),
            lambda: viewer.line([[0.0] * 3, [1.0] * 3], colour=(1, 2, 300)),
            lambda: viewer.line([[0.0] * 3, [1.0] * 3], colour="blu"),
            lambda: viewer.line([[0.0] * 3, [1.0] * 3], colour="#12345g"),
            lambda: viewer.line([[0.0] * 3, [1.0] * 3], width=0.0),
            lambda: viewer.text("x", [0.0] * 3, size=-1.0),
            lambda: viewer.text("x", [0.0] * 3, colour=(0.5, 0.5, 2.5)),
            lambda: viewer.checkbox("x", 1),  # type: ignore[arg-type]
            lambda: viewer.dropdown("x", []),
            lambda: viewer.dropdown("x", "ab"),
            lambda: viewer.dropdown("x", ["a", "b"], "c"),
            lambda: viewer.number("x", np.nan),
            lambda: viewer.number("x", 2.0, upper=1.0),
            lambda: viewer.on_key("k", print, 3),  # type: ignore[arg-type]
            lambda: viewer.on_pointer_moved(None),  # type: ignore[arg-type]
            lambda: viewer.screenshot(),
        ]
        for call in wrong:
            with pytest.raises(ArgumentError):
                call()


def test_controls_of_a_program_have_values(arm: Model) -> None:
    with view(arm) as viewer:
        slider = viewer.slider("gain", 0.0, 10.0)
        assert slider.value == 5.0
        slider.value = 12.0
        assert slider.value == 10.0
        box, choice = viewer.checkbox("wind", True), viewer.dropdown("gait", ["walk", "trot"])
        number = viewer.number("mass [kg]", 2.0, lower=0.0)
        assert (box.value, choice.value, number.value) == (True, "walk", 2.0)
        box.value, choice.value, number.value = False, "trot", -1.0
        assert (box.value, choice.value, number.value) == (False, "trot", 0.0)
        with pytest.raises(ArgumentError, match="did you mean 'walk'"):
            choice.value = "wal"
        viewer.text("here", (0.0, 0.0, 1.0)).remove()
        viewer.line([[0.0] * 3, [1.0] * 3]).remove()
        slider.remove()


def test_everything_of_a_program_is_removed_at_once(arm: Model) -> None:
    with view(arm) as viewer:
        gui, scene = viewer.page.gui, viewer.page.scene
        before = set(gui._gui_input_handle_from_uuid), set(scene._handle_from_node_name)
        viewer.slider("gain", 0.0, 1.0).remove()
        viewer.number("x", 0.0)
        viewer.checkbox("x")
        viewer.dropdown("x", ["a"])
        viewer.button("x", print)
        viewer.text("x", [0.0] * 3)
        viewer.text("x", [0.0] * 3, colour="red", size=20.0)
        viewer.line([[0.0] * 3, [1.0] * 3], colour="#102030", width=2.0)
        viewer.remove_all()
        assert (set(gui._gui_input_handle_from_uuid), set(scene._handle_from_node_name)) == before
        viewer.checkbox("x")
        viewer.show(arm)
        # What was shown before has gone, with its controls.
        viewer.remove_all()


@pytest.mark.parametrize(
    ("given", "wanted"),
    [
        ("Red", NAMED["red"]),
        ("#0a10ff", (10, 16, 255)),
        ((1, 0, 0), (255, 0, 0)),
        ((0.0, 0.5, 1.0), (0, 128, 255)),
        ((0, 114, 178), (0, 114, 178)),
        ([200, 1, 1], (200, 1, 1)),
    ],
)
def test_colours_are_given_in_the_usual_ways(arm: Model, given: Any, wanted: RGB) -> None:
    with view(arm) as viewer:
        line = viewer.line([[0.0] * 3, [1.0] * 3], colour=given)
        assert np.array_equal(np.unique(np.reshape(line._node.colors, (-1, 3)), axis=0), [wanted])


def test_sliders_show_a_configuration_beyond_their_ranges() -> None:
    model = dynx.load("six_axis_arm", base="floating")
    q = model.neutral()
    q[:7] = [5.0, 0.0, 0.3, 0.0, 0.0, np.sqrt(0.5), np.sqrt(0.5)]
    with view(model, q=q) as viewer:
        sliders = viewer.view._sliders._handles
        assert [handle.value for handle in sliders[:6]] == [5.0, 0.0, 0.3, 0.0, 0.0, 90.0]
        assert (sliders[0].min, sliders[0].max) == (3.0, 7.0)
        q[0], q[7] = -20.0, model.upper[7] + 1.0
        viewer.update(q)
        assert (sliders[0].value, sliders[0].min, sliders[0].max) == (-20.0, -20.0, 7.0)
        assert sliders[6].value == pytest.approx(np.degrees(q[7]), abs=0.1)
        viewer.update(model.neutral())
        assert sliders[6].max <= np.degrees(model.upper[7])


def test_sliders_turn_a_floating_base() -> None:
    model = dynx.load("six_axis_arm", base="floating")
    with view(model) as viewer:
        sliders = viewer.view._sliders
        sliders._handles[5].value = 90.0
        sliders._moved(5, SimpleNamespace(client=0))
        assert np.allclose(viewer.view.q[:7], [0.0, 0.0, 0.0, 0.0, 0.0, np.sqrt(0.5), np.sqrt(0.5)])
        assert np.array_equal(
            viewer.view.robot.pose(model.root)[:3, :3].round(9), [[0, -1, 0], [1, 0, 0], [0, 0, 1]]
        )
        # At a pitch of 90 degrees the other two angles stay as they were set.
        sliders._handles[4].value = 90.0
        sliders._moved(4, SimpleNamespace(client=0))
        sliders._handles[4].value = 0.0
        sliders._moved(4, SimpleNamespace(client=0))
        assert np.allclose(dynx.rpy_from_quat(viewer.view.q[3:7]), [0.0, 0.0, np.pi / 2])


def test_a_rollout_plays_to_its_end(arm: Model) -> None:
    rollout = dynx.simulate(arm, duration=0.2)
    with rollout.view(play=True) as viewer:
        until(lambda: not viewer.view.timeline.playing, "the end of the motion")
        assert viewer.view.timeline.time == pytest.approx(0.2)
        shown, last = poses_of_nodes(viewer.view.drawn), viewer.view.motion.at(-1)
        assert shown.keys() == last.keys()
        for name, T in shown.items():
            assert np.allclose(T, last[name], atol=1e-5)


def test_a_page_gets_one_message_for_each_joint_that_moves(arm: Model) -> None:
    rollout = dynx.simulate(arm, duration=0.2)
    with rollout.view() as viewer:
        buffer = viewer.page.server._websock_server.get_message_buffer()
        viewer.view.go_to(0.1)
        before = buffer.message_counter
        viewer.view.go_to(0.2)
        # The slider of the time and three plots are the others.
        assert 0 < buffer.message_counter - before <= arm.nv + 4


def test_a_program_shows_its_own_states(arm: Model) -> None:
    with view(arm) as viewer:
        q = arm.random(3)
        viewer.update(q)
        assert np.array_equal(viewer.view.q, q)
        with pytest.raises(ArgumentError, match="needs its configuration q"):
            viewer.update()
        with pytest.raises(ArgumentError, match="shape"):
            viewer.update(np.zeros((2, arm.nq)))
    with World(read_scene("slope")) as world, world.view(steps=False) as viewer:
        name = next(body.name for body in world.scene.bodies if not body.fixed)
        for _ in range(100):
            world.step()
        viewer.update()
        shown = viewer.view.drawn.parts[name].position
        assert np.allclose(shown, world.state.bodies[name].position, atol=1e-6)
        with pytest.raises(ArgumentError, match="takes no q"):
            viewer.update(q)
    with dynx.simulate(arm, duration=0.1).view() as viewer, pytest.raises(ArgumentError, match="recorded"):
        viewer.update()


def test_a_viewer_that_was_closed_is_told(arm: Model, tmp_path: Path) -> None:
    viewer = view(arm)
    viewer.close()
    viewer.close()
    for act in (
        lambda: viewer.update(arm.neutral()),
        lambda: viewer.show(arm),
        lambda: viewer.follow(None),
        lambda: viewer.screenshot(),
        lambda: viewer.export(tmp_path / "page.html"),
        lambda: viewer.slider("gain", 0.0, 1.0),
        lambda: viewer.button("press", lambda: None),
        lambda: viewer.text("here", (0.0, 0.0, 0.0)),
        lambda: viewer.on_key("k", lambda: None),
    ):
        with pytest.raises(ArgumentError, match=f"{viewer.url} is closed"):
            act()
    assert not list(tmp_path.iterdir())


def test_notes_that_are_alike_are_one(tmp_path: Path) -> None:
    links = [
        f'<link name="l{k}"><visual><geometry><mesh filename="package://none/{k}.stl"/></geometry></visual>'
        f'<collision><geometry><mesh filename="package://none/{k}.stl"/></geometry></collision></link>'
        for k in range(4)
    ]
    joints = [
        f'<joint name="j{k}" type="fixed"><parent link="l{k - 1}"/><child link="l{k}"/></joint>'
        for k in range(1, 4)
    ]
    path = tmp_path / "robot.urdf"
    path.write_text(f'<robot name="r">{"".join(links + joints)}</robot>')
    with view(dynx.load(path)) as viewer:
        assert viewer.notes == (
            "shapes of 4 links (l0, l1, l2, ...) are not drawn: package 'none' was not found",
        )
        viewer.view.robot.show(visuals=True, collisions=True)
        assert viewer.notes[0].startswith("shapes of 4 links (l0, l1, l2, ...)")


@needs_examples
def test_reduced_meshes_are_told() -> None:
    model = dynx.load("ur5")
    with model.view(whole_meshes=False) as viewer:
        assert any("of its meshes" in note and "whole_meshes=True" in note for note in viewer.notes)
    with model.view(whole_meshes=True) as viewer:
        assert viewer.notes == ()


def test_a_part_that_is_followed_must_exist(arm: Model) -> None:
    with view(arm) as viewer:
        name = arm.links[-1].name
        viewer.follow(name)
        viewer.follow(name, first_person=True)
        viewer.follow(None)
        with pytest.raises(ArgumentError, match="no part 'nothing'"):
            viewer.follow("nothing")


@needs_examples
def test_an_exported_rollout_is_small_and_names_no_server(tmp_path: Path) -> None:
    arm = dynx.load("ur5")
    motion = dynx.trajectory.cycloidal(np.zeros(6), [-1.5, -1.0, 1.0, -1.5, -1.5, 1.5], duration=10.0)
    controller = dynx.control.ComputedTorque(arm, kp=100.0, kd=20.0)
    rollout = dynx.simulate(arm, controller, motion, dt=2e-3)
    path = tmp_path / "run.html"
    with rollout.view() as viewer:
        viewer.export(path)
    text = path.read_text()
    assert len(text) < LARGEST_PAGE
    assert 'src="http' not in text
    assert 'href="http' not in text


def test_an_export_needs_a_name_of_a_page(arm: Model, tmp_path: Path) -> None:
    with view(arm) as viewer:
        with pytest.raises(ArgumentError, match=r"\.html"):
            viewer.export(tmp_path / "run.jpg")
        with pytest.raises(ArgumentError, match="cannot be written"):
            viewer.export(tmp_path / "nowhere" / "run.html")
    with (
        World(read_scene("stack")) as world,
        world.view() as viewer,
        pytest.raises(ArgumentError, match="live"),
    ):
        viewer.export(tmp_path / "run.html")


def test_meshes_that_are_missing_are_told_and_the_rest_is_shown(tmp_path: Path) -> None:
    path = tmp_path / "robot.urdf"
    path.write_text(
        '<robot name="r"><link name="a"><visual><geometry><mesh filename="none.stl"/></geometry></visual>'
        '</link><link name="b"><visual><geometry><sphere radius="0.1"/></geometry></visual></link>'
        '<joint name="j" type="revolute"><parent link="a"/><child link="b"/><axis xyz="0 0 1"/>'
        '<limit lower="-1" upper="1" effort="1" velocity="1"/></joint></robot>'
    )
    with view(dynx.load(path)) as viewer:
        assert len(viewer.notes) == 1
        assert "none.stl" in viewer.notes[0]
        assert viewer.view.robot.visuals["b"]


def test_pictures_and_films_are_drawn_without_a_browser(arm: Model, tmp_path: Path) -> None:
    image = pytest.importorskip("PIL.Image")
    scene = read_scene("stack")
    with World(scene) as world, world.view() as viewer:
        viewer.export(tmp_path / "world.png")
        with pytest.raises(ArgumentError, match=r"written as|\.png"):
            viewer.export(tmp_path / "world.gif")
    with image.open(tmp_path / "world.png") as picture:
        assert picture.size == (960, 720)
        assert len(picture.getcolors(1_000_000)) > 10
    model = dynx.load("panda" if EXAMPLES_INSTALLED else "six_axis_arm")
    rollout = dynx.simulate(model, duration=0.4)
    drawn: list[int] = []
    with rollout.view() as viewer:
        viewer.export(tmp_path / "run.gif", drawn.append)
    with image.open(tmp_path / "run.gif") as film:
        assert film.n_frames == 5
        assert drawn == [1, 2, 3, 4, 5]
        assert film.info["duration"] == 1e3 * 0.4 / 5
    with model.view() as viewer:
        viewer.export(tmp_path / "robot.png")
    assert (tmp_path / "robot.png").stat().st_size > 1000


def test_a_film_has_the_pictures_a_second_that_are_wanted(tmp_path: Path) -> None:
    image = pytest.importorskip("PIL.Image")
    with dynx.simulate("six_axis_arm", duration=0.4).view() as viewer:
        viewer.export(tmp_path / "run.gif", size=(60, 40), fps=25)
        for name, fps in (
            ("a.gif", 0.0),
            ("a.gif", 101.0),
            ("a.gif", "25"),
            ("a.png", 25.0),
            ("a.html", 25.0),
        ):
            with pytest.raises(ArgumentError, match="fps is"):
                viewer.export(tmp_path / name, fps=fps)
    with image.open(tmp_path / "run.gif") as film:
        assert film.n_frames == 10
        assert film.info["duration"] == 40


def test_a_picture_leaves_out_what_cannot_be_read(tmp_path: Path) -> None:
    """A page leaves out such shapes; a picture once refused a robot for a collision shape."""
    text = """<robot name="r">
      <link name="seen"><visual><geometry><box size="1 1 1"/></geometry></visual>
        <collision><geometry><cylinder radius="1" length="0"/></geometry></collision></link>
      <link name="lost"><collision><geometry><mesh filename="package://none/a.stl"/></geometry></collision></link>
      <joint name="j" type="fixed"><parent link="seen"/><child link="lost"/></joint></robot>"""
    with view(dynx.load(text)) as viewer:
        viewer.export(tmp_path / "robot.png")
        assert any("link 'lost' is not read" in note for note in viewer.notes)
    assert (tmp_path / "robot.png").stat().st_size > 1000


def test_two_rollouts_are_compared_by_their_names(arm: Model) -> None:
    rollout = dynx.simulate(arm, duration=0.1)
    with view((rollout, rollout), names=("a", "b")) as viewer:
        assert [motion.name for motion in viewer.view.motions] == ["a", "b"]
    with pytest.raises(ArgumentError, match=r"Viewer\(\(a, b\)\)"):
        rollout.view(compare=rollout)


def test_keys_of_the_page_are_not_taken(arm: Model) -> None:
    with dynx.simulate(arm, duration=0.1).view() as viewer:
        with pytest.raises(ArgumentError, match="key 'p' is that of the page: play or pause"):
            viewer.on_key("p", print)
        viewer.on_key("o", print)
        viewer.show(arm)
        viewer.on_key("p", print)
    with World(read_scene("slope")) as world:
        with world.view(steps=False) as viewer:
            viewer.on_key("p", print)
        with world.view() as viewer, pytest.raises(ArgumentError, match="key 'P'"):
            viewer.on_key("P", print)


@needs_examples
def test_notes_on_a_motion_name_the_robot_once() -> None:
    rollout = dynx.simulate("ur5", duration=0.1)
    with rollout.view(whole_meshes=False) as viewer:
        (note,) = viewer.notes
        assert note.startswith("ur5 is drawn with ")


SAMPLE = ("double_pendulum", "hyq", "tiago", "icub_reduced")


@pytest.mark.long_cases
@needs_examples
@pytest.mark.parametrize("base", ["fixed", "floating"])
@pytest.mark.parametrize("name", SAMPLE)
def test_real_robots_open_with_everything_switched_on(name: str, base: Base) -> None:
    model = dynx.load(name, base=base)
    with view(model) as viewer:
        for kind in viewer.view._marks.kinds:
            viewer.view._marks.show(kind, True)
        viewer.view.robot.show(visuals=True, collisions=True)
        viewer.view._torques.shown = viewer.view._ellipsoid.shown = True
        q = model.random(0)
        viewer.view.put(q)
        assert np.array_equal(viewer.view.q, q)


def test_a_joint_with_equal_limits_has_a_slider_of_few_digits() -> None:
    text = (
        '<robot name="r"><link name="a"/><link name="b"/><joint name="j" type="revolute"><parent link="a"/>'
        '<child link="b"/><axis xyz="0 0 1"/><limit lower="0.3" upper="0.3" effort="1" velocity="1"/></joint>'
        "</robot>"
    )
    with view(dynx.load(text)) as viewer:
        (slider,) = viewer.view._sliders._handles
        assert slider.disabled
        assert (slider.min, slider.value, slider.max) == (17.19, 17.19, 17.19)
        assert viewer.view.q == [0.3]
        viewer.view.put([0.5])
        assert (slider.min, slider.value, slider.max) == (17.19, 28.65, 28.65)


def test_the_handle_has_what_its_target_moves() -> None:
    with view(dynx.load("six_axis_arm")) as viewer:
        handle = viewer.view._handle
        node = handle._node
        expected = {None: (False, False), "rotation": (False, True), "position": (True, False)}
        for free, (no_arrows, no_rings) in expected.items():
            handle.free = free
            assert node.disable_axes == node.disable_sliders == no_arrows
            assert node.disable_rotations == no_rings


def test_all_curves_of_a_rollout_have_the_axis_of_the_whole_motion() -> None:
    arm = dynx.load("six_axis_arm")
    motion = dynx.trajectory.cycloidal(np.zeros(arm.nq), np.full(arm.nq, 1e-3), duration=0.001)
    rollout = dynx.simulate(arm, dynx.control.ComputedTorque(arm, kp=100.0, kd=20.0), motion)
    assert len(rollout.t) == 2  # There is one torque.
    with rollout.view() as viewer:
        ranges = [curves._plot.scales["x"]["range"] for curves in viewer.view._curves]
        assert ranges == [(0.0, 0.001)] * 3


def test_a_program_that_closes_no_view_ends_without_a_word() -> None:
    program = "import dynx; view = dynx.load('pendulum').view()"
    run = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert (run.stdout, run.stderr) == ("", "")
