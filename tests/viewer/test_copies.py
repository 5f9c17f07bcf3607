"""Many robots with one description: drawn with the calls of one, moved by one message, and told apart."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import dynx
from dynx.errors import ArgumentError
from dynx.spatial.scalar import Floats
from dynx.viewer import Viewer
from dynx.viewer.drawn_robot import MIN_COPIES
from dynx.world import Scene, SceneRobot, World
from tests.viewer.conftest import OpenPage, connected, pixel_of, until
from tests.viewer.test_pose_channel import messages

STATE = "window.__viserMutable?.scene?.__r3f?.root?.getState?.()"
CALLS = f"{STATE}.gl.info.render.calls"
INSTANCES = """(names) => {
  const page = window.__viserMutable, world = page?.nodeRefFromName[""];
  if (!world) return null;
  const found = [];
  for (const name of names) {
    let meshes = [];
    page.nodeRefFromName[name]?.traverse((each) => { if (each.instancesCount) meshes.push(each); });
    if (meshes.length !== 1) return null;
    const [mesh] = meshes, matrix = mesh.matrixWorld.clone();
    found.push([mesh.instancesCount, ...mesh.getMatrixAt(mesh.instancesCount - 1, matrix).elements]);
  }
  return found;
}"""
"""Number of copies that each node shows, and the pose of the last one, column by column."""


def configurations(name: str, count: int, seed: int = 0) -> Any:
    model = dynx.load(name)
    return model, model.random(np.random.default_rng(seed), count)


def last_copy_is_placed(page: Any, viewer: Viewer) -> bool:
    """Check whether the last copy of each link is where the viewer has it."""
    drawn = viewer.view.drawn
    shapes = {node.name: part for part, nodes in drawn.visuals.items() for node in nodes}
    found = page.evaluate(INSTANCES, list(shapes))
    if found is None:
        return False
    count = len(viewer.view.q)
    T = np.array(found)[:, 1:].reshape(-1, 4, 4).swapaxes(1, 2)
    wanted = [drawn.pose(part) for part in shapes.values()]
    return all(row[0] == count for row in found) and np.allclose(T, wanted, atol=1e-5)


@pytest.mark.parametrize(("name", "count"), [("ur5", 100), ("a1", 30)])
def test_robots_are_drawn_with_the_calls_of_one_and_moved_by_one_message(
    open_page: OpenPage, name: str, count: int
) -> None:
    model, q = configurations(name, count)
    with dynx.viewer.view(model, q=q, spacing=1.5, whole_meshes=False) as viewer:
        shapes = {node.name for nodes in viewer.view.visuals.values() for node in nodes}
        with dynx.viewer.view(model, whole_meshes=False) as single:
            assert len(shapes) == sum(map(len, single.view.visuals.values()))
        opened = open_page(viewer.url, (600, 200))
        until(lambda: last_copy_is_placed(opened.page, viewer), "the copies")
        before = messages(viewer)
        viewer.update(configurations(name, count, 1)[1])
        assert messages(viewer) == before + 1
        until(lambda: last_copy_is_placed(opened.page, viewer), "the copies of the next configurations")
        # The ground and the background are two more.
        until(lambda: 0 < opened.page.evaluate(CALLS) <= len(shapes) + 2, "the drawing calls of one robot")
        assert not opened.errors


ROBOT = (
    "<robot name='r'><link name='base'><visual><geometry><box size='0.3 0.3 0.3'/></geometry>"
    "<material name='m'><color rgba='0.1 0.7 0.1 1'/></material></visual>"
    "<collision><geometry><box size='0.2 0.2 0.2'/></geometry></collision></link>"
    "<link name='arm'><inertial><mass value='1'/><inertia ixx='1' iyy='1' izz='1' ixy='0' ixz='0' iyz='0'/>"
    "</inertial></link><joint name='j' type='prismatic'><parent link='base'/><child link='arm'/>"
    "<axis xyz='0 0 1'/><limit lower='-1' upper='1' effort='1' velocity='1'/></joint></robot>"
)


def greens(viewer: Viewer) -> Any:
    picture = viewer.screenshot((600, 400)).astype(int)
    return picture[..., 1] > picture[..., [0, 2]].max(axis=2) + 30


def hovers(page: Any, client: Any, point: Floats, part: str) -> bool:
    """Move the pointer to a point (3,) in the world and check whether the page says that it is over a part:
    it says so only while the pointer moves, once all is drawn."""
    x, y = pixel_of(client, point)
    page.mouse.move(x - 1, y)
    page.mouse.move(x, y)
    page.wait_for_timeout(200.0)
    shown = page.evaluate("document.getElementById('dynx-hovered')?.textContent")
    return bool(shown == part)


def test_copies_are_clicked_hidden_seen_through_and_followed_one_by_one(open_page: OpenPage) -> None:
    model = dynx.load(ROBOT)
    q = np.zeros((9, 1))
    with dynx.viewer.view(model, q=q, spacing=1.0) as viewer:
        opened = open_page(viewer.url, (1000, 500))
        (client,) = connected(viewer)
        clicked: list[str] = []
        viewer.on_part_clicked(lambda part, origin, direction: clicked.append(part))
        until(lambda: greens(viewer).sum() > 1000, "the boxes")
        for number in (0, 5):
            top = viewer.view.drawn.pose(f"r {number}/base")[:3, 3] + [0.0, 0.0, 0.15]
            until(partial(hovers, opened.page, client, top, f"r {number}/base"), "the part under the pointer")
            opened.page.mouse.click(*pixel_of(client, top))
            until(partial(clicked.__contains__, f"r {number}/base"), "the click")
        assert clicked == ["r 0/base", "r 5/base"]
        assert viewer.view.names.shown == "r 5/base"
        viewer.view.names.show(None)
        whole = greens(viewer).sum()
        viewer.set_visible("r 4", False)
        until(lambda: 0.8 * whole < greens(viewer).sum() < 0.95 * whole, "eight boxes")
        viewer.set_visible("r 4")
        viewer.set_opacity(0.0, "r 4/base")
        until(lambda: 0.8 * whole < greens(viewer).sum() < 0.95 * whole, "a box that is seen through")
        viewer.set_opacity(1.0)
        until(lambda: greens(viewer).sum() > 0.98 * whole, "nine boxes")
        place = viewer.camera.pose.matrix[:3, 3]
        viewer.follow("r 7/arm")
        q[7] = 0.5
        viewer.update(q)
        until(
            lambda: np.allclose(viewer.camera.pose.matrix[:3, 3] - place, [0.0, 0.0, 0.5], atol=1e-3),
            "the camera above",
        )
        viewer.set_shown("collision shapes")
        until(lambda: greens(viewer).sum() == 0, "collision shapes instead of green boxes")
        assert not opened.errors


INERTIAL = "<inertial><mass value='1'/><inertia ixx='1' iyy='1' izz='1' ixy='0' ixz='0' iyz='0'/></inertial>"
LIMIT = "<limit lower='-9' upper='9' effort='1000' velocity='100'/>"
CART = (
    f"<robot name='r'><link name='rail'/><link name='bridge'>{INERTIAL}</link>"
    f"<link name='box'>{INERTIAL}<visual><geometry><box size='0.3 0.3 0.3'/></geometry></visual></link>"
    "<joint name='y' type='prismatic'><parent link='rail'/><child link='bridge'/><axis xyz='0 1 0'/>"
    f"{LIMIT}</joint><joint name='x' type='prismatic'><parent link='bridge'/><child link='box'/>"
    f"<axis xyz='1 0 0'/>{LIMIT}</joint></robot>"
)


def test_the_pointer_drags_one_of_the_copies_of_a_world(open_page: OpenPage) -> None:
    model, dragged = dynx.load(CART), 5
    robots = [SceneRobot(f"c{k}", model, q=(float(k), 0.0)) for k in range(MIN_COPIES)]
    with World(Scene("carts", robots=robots)) as world, world.view() as viewer:
        assert viewer.view.drawn.copies
        opened = open_page(viewer.url, (1000, 500))
        (client,) = connected(viewer)
        mouse, part = opened.page.mouse, f"c{dragged}/box"
        top = viewer.view.drawn.pose(part)[:3, 3] + [0.0, 0.0, 0.15]
        until(partial(hovers, opened.page, client, top, part), "the part under the pointer")
        x, y = pixel_of(client, top)
        mouse.down()
        steps = iter(range(10_000))

        def follows() -> bool:
            # The page takes a press for a drag once the pointer moves; pixels to the right are along x and y.
            mouse.move(x + 40.0 + next(steps) % 2, y)
            viewer.view.step(10)
            return bool(world.state.robots[f"c{dragged}"].q[1] > 0.05)

        until(follows, "the cart that follows the pointer")
        others = [world.state.robots[f"c{k}"].q[1] for k in range(MIN_COPIES) if k != dragged]
        assert np.abs(others).max() < 1e-6
        mouse.up()
        until(lambda: not viewer.view._spring.pulls, "the end of the drag")
        assert not opened.errors


def shows_a_dark_box(viewer: Viewer) -> bool:
    return bool(viewer.screenshot((300, 200))[100, 150].max() < 120)


def test_copies_have_the_colours_of_a_single_robot(open_page: OpenPage) -> None:
    model = dynx.load(ROBOT.replace("0.1 0.7 0.1", "0.08 0.15 0.05"))
    pictures = []
    # The robots that are not seen lie inside of the one that is seen.
    for q in (np.zeros(1), np.zeros((MIN_COPIES, 1))):
        with dynx.viewer.view(model, q=q, whole_meshes=False) as viewer:
            open_page(viewer.url, (600, 400))
            connected(viewer)
            until(partial(shows_a_dark_box, viewer), "the box")
            pictures.append(viewer.screenshot((300, 200)).astype(int)[90:110, 140:160])
    assert np.abs(pictures[0] - pictures[1]).max() <= 1


def test_batches_play_and_robots_of_a_world_are_copies(tmp_path: Path) -> None:
    model = dynx.load(ROBOT)
    q0 = np.linspace(-0.2, 0.2, MIN_COPIES)[:, None]
    controller = dynx.control.PD(model, kp=20.0, kd=5.0)
    rest = model.neutral()
    rollouts = dynx.simulate_batch(model, controller, rest, q0=q0, duration=0.5, dt=0.01, record_every=1)
    with rollouts.view(spacing=2.0) as viewer:
        view = viewer.view
        assert [copies.names for copies in view.drawn.copies] == [
            tuple(f"{model.name} {k}" for k in range(MIN_COPIES))
        ]
        view.go_to(view.duration)
        x = [view.drawn.pose(f"{model.name} {k}/{model.root}")[0, 3] for k in range(3)]
        assert np.diff(x) == pytest.approx([2.0, 2.0])
        viewer.export(tmp_path / "batch.png", size=(80, 60))
        viewer.export(tmp_path / "batch.html")
    assert f"{model.name} 7/" in (tmp_path / "batch.html").read_text(encoding="utf-8")
    scene = Scene("many", robots=[SceneRobot(f"c{k}", model) for k in range(MIN_COPIES)])
    with World(scene) as world, world.view(steps=False) as viewer:
        assert not viewer.view.drawn.robots
        world.step(10)
        viewer.update()
        last = f"c{MIN_COPIES - 1}"
        assert viewer.view.drawn.pose(f"{last}/{model.root}") == pytest.approx(np.eye(4))


def test_what_copies_cannot_show_is_refused_or_noted() -> None:
    model = dynx.load(ROBOT)
    q = np.zeros((MIN_COPIES, 1))
    with dynx.viewer.view(model, q=q) as viewer:
        for wrong, message in ((q[:3], "3 rows; wanted 8"), (q[0], "a row for each robot")):
            with pytest.raises(ArgumentError, match=message):
                viewer.update(wrong)
        with pytest.raises(ArgumentError, match="no part 'r 8'"):
            viewer.set_visible("r 8")
        with pytest.raises(ArgumentError, match="no part 'r 8'"):
            viewer.follow("r 8")
    for options, message in (
        ({"q": q, "spacing": -1.0}, "spacing is '-1.0'; wanted 0 or a positive length"),
        ({"q": q, "engine": "mujoco"}, "no option 'engine' of copies of a robot"),
        ({"spacing": 1.0}, "no option 'spacing' of a robot"),
        ({"q": np.zeros((0, 1))}, "a row for each robot"),
    ):
        with pytest.raises(ArgumentError, match=message):
            dynx.viewer.view(model, **options)
    bare = ROBOT.replace("<visual>", "<!--").replace("</visual>", "-->")
    bare = bare.replace("<collision>", "<!--").replace("</collision>", "-->")
    with dynx.viewer.view(dynx.load(bare), q=q) as viewer:
        # Lines are not copied.
        assert len(viewer.view.drawn.robots) == len(q)
    cart = dynx.load("cart_pole")
    controller = dynx.control.PD(cart, kp=[10.0, 0.0], kd=[1.0, 0.0])
    unrecorded = dynx.simulate_batch(cart, controller, cart.neutral(), rollouts=8, duration=0.1, dt=0.01)
    with pytest.raises(ArgumentError, match="record_every=k"):
        unrecorded.view()
