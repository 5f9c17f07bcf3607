"""A live world in the viewer: stepped, pulled, pushed, and its errors."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import dynx
from dynx.errors import ArgumentError, DynxError
from dynx.model import Pose
from dynx.viewer.world_view import _NO_PART_CHOSEN, Pull
from dynx.world import ExternalForce, Scene, SceneRobot, World, box, ground, read_scene
from tests.viewer.conftest import until


def test_a_world_is_stepped_in_its_own_time() -> None:
    with World(read_scene("stack")) as world, world.view(play=True) as viewer:
        until(lambda: world.time > 0.1, "the world to move")
        viewer.view.pause()
        viewer.view.reset()
        assert world.time == 0.0


def test_a_spring_pulls_a_body_to_its_handle() -> None:
    scene = read_scene("slope")
    body = next(each for each in scene.bodies if not each.fixed)
    with World(scene) as world, world.view() as viewer:
        before = world.state.bodies[body.name].position.copy()
        viewer.view._spring.hold(world, body.name)
        viewer.view._spring._node.position = before + np.array([0.0, 0.0, 1.0])
        viewer.view.step(300)
        assert world.state.bodies[body.name].position[2] > before[2] + 0.1


def test_the_pointer_drags_a_part_by_the_point_taken() -> None:
    scene = read_scene("slope")
    body = next(each for each in scene.bodies if not each.fixed)
    with World(scene) as world, world.view() as viewer:
        before = world.state.bodies[body.name].T_world_body
        taken = before[:3, 3] + before[:3, :3] @ np.array([0.05, 0.0, 0.05])
        viewer.view._spring.pull(Pull(body.name, taken, taken + np.array([0.0, 0.0, 1.0])))
        viewer.view.step(1)
        (wrench,) = viewer.view._spring.forces(world)
        assert np.allclose(wrench.point, [0.05, 0.0, 0.05], atol=1e-12)
        viewer.view.step(300)
        lifted = world.state.bodies[body.name].position[2]
        assert lifted > before[2, 3] + 0.1
        viewer.view._spring.pull(None)
        viewer.view.step(600)
        assert not viewer.view._spring.pulls
        assert world.state.bodies[body.name].position[2] < lifted


def test_joints_and_contacts_are_marked_in_a_world_that_is_replaced_too() -> None:
    robot = dynx.load("six_axis_arm")
    cube = box("cube", (0.2, 0.2, 0.2), mass=1.0, pose=Pose((1.0, 0.0, 0.1)))
    scene = Scene("two", robots=(SceneRobot("a", robot), SceneRobot("b", robot)), bodies=(ground(), cube))
    with World(scene) as world, World(scene) as second, world.view(steps=False) as viewer:
        world.step(50)
        second.step(50)
        handles = viewer.page.scene._handle_from_node_name

        def marks(end: str) -> list[str]:
            return [path for path, node in handles.items() if path.endswith(end) and node.visible]

        assert not marks("/joint_axis")
        viewer.view._marks.show("joint axes", True)
        count = 2 * sum(joint.moves for joint in robot.joints)
        assert len(marks("/joint_axis")) == count
        viewer.view._arrows.points_shown = True
        viewer.view.draw()
        (points,) = (handles[path] for path in marks("/contact_points"))
        assert np.allclose(points.points, [c.point for c in world.contacts()], atol=1e-5)
        assert viewer.view.replace(second)
        assert len(marks("/joint_axis")) == count
        viewer.view._marks.show("joint axes", False)
        assert not marks("/joint_axis")
        viewer.view._arrows.points_shown = False
        viewer.view.draw()
        assert not marks("/contact_points")


def test_a_push_gives_a_body_its_impulse_once() -> None:
    scene = read_scene("slope")
    body = next(body for body in scene.bodies if not body.fixed)
    with World(scene) as world, World(scene) as alone, world.view() as viewer:
        viewer.view.push(body.name, (0.0, 0.5, 0.0))
        viewer.view.step(4)
        alone.step(1, forces=[ExternalForce(body.name, np.array([0.0, 0.5, 0.0, 0.0, 0.0, 0.0]) / world.dt)])
        alone.step(3)
        pushed, expected = world.state.bodies[body.name], alone.state.bodies[body.name]
        assert np.allclose(pushed.twist, expected.twist, rtol=0.0, atol=1e-12)
        assert np.allclose(pushed.position, expected.position, rtol=0.0, atol=1e-12)
        with pytest.raises(ArgumentError, match=f"no part .*{body.name}"):
            viewer.view.push(f"{body.name}s", (0.0, 0.5, 0.0))
        with pytest.raises(DynxError, match="impulse"):
            viewer.view.push(body.name, (0.0, np.nan, 0.0))


def test_a_reset_leaves_no_push_and_no_velocity_of_the_spring() -> None:
    scene = read_scene("slope")
    body = next(each for each in scene.bodies if not each.fixed)
    with World(scene) as world, world.view() as viewer:
        held = world.state.bodies[body.name].position.copy()
        viewer.view._pull.value = True
        viewer.view._part.value = body.name
        until(lambda: viewer.view._spring.pulls, "the spring")
        viewer.view._spring._node.position = held + np.array([0.0, 0.0, 1.0])
        viewer.view.step(300)
        assert world.state.bodies[body.name].position[2] > held[2] + 0.1
        viewer.view.push(body.name, (0.0, 0.5, 0.0))
        viewer.view.reset()
        assert not viewer.view._pushes
        # The handle is on the part again, which rests: the spring does not pull.
        (wrench,) = viewer.view._spring.forces(world)
        assert np.abs(wrench.wrench).max() < 1e-9


def test_a_lower_speed_does_not_stop_a_world() -> None:
    with World(read_scene("slope")) as world, world.view() as viewer:
        viewer.view._factor.value = 2.0
        viewer.view.play()
        until(lambda: world.time > 2.0, "two seconds")
        before = world.time
        viewer.view._factor.value = 0.5
        time.sleep(0.5)
        assert world.time > before


def test_the_request_for_a_part_to_push_goes_when_one_is_chosen() -> None:
    with World(read_scene("slope")) as world, world.view() as viewer:
        viewer.view._report(_NO_PART_CHOSEN)
        viewer.view._part.value = viewer.view._part.options[1]
        until(lambda: not viewer.view._message.visible, "the end of the request")
        viewer.view._report("an error")
        viewer.view._part.value = viewer.view._part.options[0]
        time.sleep(0.2)
        assert viewer.view._message.value == "an error"


def test_an_empty_scene_and_one_that_never_moves_are_shown(tmp_path: Path) -> None:
    table = box("table", (1.0, 1.0, 0.4))
    for scene, follows in ((Scene("empty"), None), (Scene("fixed", bodies=(ground(), table)), "table")):
        with World(scene) as world, world.view() as viewer:
            viewer.view.step(3)
            viewer.view.camera._mode.value = "moves with"
            viewer.follow(follows)
            with pytest.raises(ArgumentError, match="no part 'tabel'"):
                viewer.follow("tabel")
            # The camera is outside of all shapes.
            assert np.linalg.norm(viewer.page.server.initial_camera.position) > 0.4
            viewer.export(tmp_path / "world.png")


def test_errors_of_the_loads_are_shown_and_end_the_motion() -> None:
    def failing(world: World) -> dict[str, Any]:
        raise ValueError("no load")

    for loads, message in ((failing, "ValueError: no load"), (lambda world: {"force": 1.0}, "'force'")):
        with World(read_scene("slope")) as world, world.view(loads=loads, play=True) as viewer:
            until(lambda: message in viewer.view._message.value, message)  # noqa: B023
            assert not viewer.view.playing
            assert world.time == 0.0
    with World(read_scene("slope")) as world, pytest.raises(ArgumentError, match="wanted a function"):
        world.view(loads=3)


def test_a_world_that_diverges_is_paused_and_goes_on_after_a_reset() -> None:
    scene = read_scene("slope")
    body = next(each for each in scene.bodies if not each.fixed)
    with World(scene) as world, world.view() as viewer:
        viewer.view.push(body.name, (1e12, 0.0, 0.0))
        viewer.view.play()
        until(lambda: "diverged" in viewer.view._message.value, "the error of the world that diverged")
        until(lambda: not viewer.view.playing, "the pause")
        assert viewer.view._clock.value == f"{world.time:.3f} s"
        viewer.view.reset()
        assert not viewer.view._message.value
        viewer.view.play()
        until(lambda: world.time > 0.05, "the world to move again")


def test_a_world_that_was_closed_is_told() -> None:
    world = World(read_scene("slope"))
    with world.view(play=True) as viewer:
        until(lambda: world.time > 0.0, "the world to move")
        world.close()
        until(lambda: "closed" in viewer.view._message.value, "the end of the world")
