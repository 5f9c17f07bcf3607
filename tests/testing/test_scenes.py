"""Random scenes are valid, of every sort, without parts that overlap, and shrink to simple ones."""

from __future__ import annotations

import contextlib
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, Phase, given, settings

from dynx.errors import ArgumentError, DTypeError, DynxError, UnknownNameError
from dynx.model.geometry import Box, Capsule, Cylinder, HeightField, Mesh, Plane, Sphere
from dynx.model.geometry.solids import Shape
from dynx.testing.strategies import materials, scenes, shapes
from dynx.world import Material, PointToPoint, Scene, Weld, World, read_scene, write_scene
from dynx.world.boxes import shape_box
from tests.testing.occurrence import assert_occurs, simplest


@settings(max_examples=10)
@given(scenes(max_robots=2))
def test_nothing_touches_at_the_start(scene: Scene) -> None:
    with World(scene, "mujoco") as world:
        assert all(contact.distance > -1e-9 for contact in world.contacts())
        moving = [*scene.robots, *(body for body in scene.bodies if not body.fixed)]
        assert len(world.state.robots) == len(scene.robots)
        assert len(moving) <= 2 + 4


@settings(max_examples=10)
@given(scenes())
def test_constraints_hold_at_the_start(scene: Scene) -> None:
    poses = {body.name: body.pose.matrix for body in scene.bodies} | {"world": np.eye(4)}
    for each in scene.constraints:
        if isinstance(each, PointToPoint) and {each.a, each.b} <= poses.keys():
            on_a = poses[each.a] @ [*each.point_a, 1.0]
            assert np.allclose(on_a, poses[each.b] @ [*each.point_b, 1.0], atol=1e-12)


@settings(max_examples=10, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(scene=scenes(max_robots=0))
def test_a_scene_has_a_file(tmp_path: Path, scene: Scene) -> None:
    write_scene(scene, tmp_path / "scene.json")
    again = read_scene(tmp_path / "scene.json")
    assert [body.name for body in again.bodies] == [body.name for body in scene.bodies]


@given(materials())
def test_materials(material: Material) -> None:
    assert 0.0 <= material.restitution <= 1.0
    assert 0.0 <= material.friction <= 1.5


def _has_shape(kind: type, scene: Scene) -> bool:
    return any(isinstance(each.shape, kind) for body in scene.bodies for each in body.shapes)


SORTS: dict[str, Callable[[Scene], bool]] = {
    **{
        kind.__name__: partial(_has_shape, kind)
        for kind in (Box, Sphere, Cylinder, Capsule, Plane, HeightField)
    },
    "no ground": lambda scene: all(body.name != "ground" for body in scene.bodies),
    "slope": lambda scene: any(body.name == "ground" and any(body.pose.rpy) for body in scene.bodies),
    "several shapes": lambda scene: any(len(body.shapes) > 1 for body in scene.bodies),
    "fixed body": lambda scene: any(body.fixed and body.name != "ground" for body in scene.bodies),
    "centre of mass": lambda scene: any(body.center_of_mass is not None for body in scene.bodies),
    "twist": lambda scene: any(any(body.twist) for body in scene.bodies),
    "no gravity": lambda scene: scene.gravity == (0.0, 0.0, 0.0),
    "floating robot": lambda scene: any(robot.model.floating for robot in scene.robots),
    "fixed robot": lambda scene: any(not robot.model.floating for robot in scene.robots),
    "robot with shapes": lambda scene: any(
        robot.model.geometry.collisions(link.name) for robot in scene.robots for link in robot.model.links
    ),
    "moving robot": lambda scene: any(any(robot.v or ()) for robot in scene.robots),
    "weld": lambda scene: any(isinstance(each, Weld) for each in scene.constraints),
    "ball joint": lambda scene: any(isinstance(each, PointToPoint) for each in scene.constraints),
    "joined to the world": lambda scene: any(each.b == "world" for each in scene.constraints),
    "joined to a link": lambda scene: any("/" in each.b for each in scene.constraints),
    "ignored": lambda scene: bool(scene.ignored),
    "restitution": lambda scene: any(body.material.restitution == 1.0 for body in scene.bodies),
    "no friction": lambda scene: any(body.material.friction == 0.0 for body in scene.bodies),
}


def test_every_sort_occurs() -> None:
    missing = set(SORTS)

    class AllFound(Exception):
        pass

    @settings(max_examples=250, phases=[Phase.generate], database=None, derandomize=True)
    @given(scenes())
    def note(scene: Scene) -> None:
        missing.difference_update([name for name in missing if SORTS[name](scene)])
        if not missing:
            raise AllFound

    with contextlib.suppress(AllFound):
        note()
    for name in missing:
        assert_occurs(scenes(), SORTS[name])


@given(shapes())
def test_shapes_are_from_5_to_50_cm_across(shape: Shape) -> None:
    lower, upper = shape_box(shape, np.eye(4))
    size = upper - lower
    # The length of a capsule is that between the centres of its halves.
    most = 1.0 if isinstance(shape, Capsule) else 0.5
    assert (size >= 0.05 - 1e-9).all()
    assert (size <= most + 1e-9).all()


def test_meshes_that_are_given_occur() -> None:
    mesh = Mesh("cube.stl")
    assert_occurs(shapes([mesh]), lambda shape: shape == mesh)


def test_what_was_asked_for() -> None:
    quiet = scenes(
        max_robots=0, ground="plane", moving=False, constraints=False, filters=False, fixed_bodies=False
    )

    @settings(max_examples=10)
    @given(quiet)
    def check(scene: Scene) -> None:
        assert (scene.robots, scene.constraints, scene.ignored) == ((), (), ())
        ground, *bodies = scene.bodies
        assert isinstance(ground.shapes[0].shape, Plane)
        assert not any(ground.pose.rpy)
        assert all(not body.fixed and not any(body.twist) for body in bodies)

    check()


def test_it_shrinks_to_a_ball_above_a_plane() -> None:
    scene = simplest(scenes(), lambda scene: True)
    ground, ball = scene.bodies
    assert isinstance(ground.shapes[0].shape, Plane)
    assert ball.shapes[0].shape == Sphere(0.1)
    assert ball.mass == 1.0
    assert not any(ball.twist)
    assert ball.material == Material()
    assert (scene.robots, scene.constraints) == ((), ())
    assert scene.gravity == (0.0, 0.0, -9.81)


@pytest.mark.parametrize(
    ("arguments", "error", "says"),
    [
        ({"max_bodies": 0}, ArgumentError, "max_bodies is 0; wanted 1 to 20"),
        ({"max_bodies": 2.0}, DTypeError, "max_bodies"),
        ({"max_robots": -1}, ArgumentError, "max_robots is -1; wanted 0 to 20"),
        ({"ground": "plan"}, UnknownNameError, "did you mean 'plane'"),
        ({"moving": 1}, DTypeError, "moving"),
        ({"meshes": ["cube.stl"]}, ArgumentError, "wanted Mesh"),
    ],
)
def test_arguments_that_cannot_be(arguments: dict[str, Any], error: type[DynxError], says: str) -> None:
    with pytest.raises(error, match=says):
        scenes(**arguments)
