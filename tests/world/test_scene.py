"""Scenes check their parts, names and filters."""

from __future__ import annotations

import pickle
from pathlib import Path

import pytest

import dynx
from dynx.errors import ArgumentError, DTypeError, UnknownNameError
from dynx.model.geometry import Box, Capsule, Cylinder, Ellipsoid, Mesh, Plane
from dynx.world import (
    Material,
    Scene,
    SceneBody,
    SceneRobot,
    Weld,
    World,
    box,
    capsule,
    cylinder,
    ellipsoid,
    ground,
    mesh,
    sphere,
)


def arm(name: str = "arm", **options: object) -> SceneRobot:
    return SceneRobot(name, dynx.load("planar_3r"), **options)  # type: ignore[arg-type]


def scene(**options: object) -> Scene:
    bodies = (ground(), box("cube", (0.1, 0.1, 0.1), mass=1.0), sphere("ball", 0.1, mass=2.0))
    return Scene("table", **{"robots": (arm(),), "bodies": bodies, **options})  # type: ignore[arg-type]


def test_scenes_compare_hash_and_pickle() -> None:
    again = pickle.loads(pickle.dumps(scene()))
    assert again == scene()
    assert hash(again) == hash(scene())
    assert again != scene(gravity=(0.0, 0.0, 0.0))


def test_parts_are_found_by_name() -> None:
    assert scene().robot("arm").q == (0.0, 0.0, 0.0)
    assert scene().body("cube").mass == 1.0
    with pytest.raises(UnknownNameError, match="did you mean 'cube'"):
        scene().body("cubes")
    with pytest.raises(UnknownNameError, match="did you mean 'arm'"):
        scene().robot("arms")
    link = scene().robot("arm").model.links[-1].name
    with pytest.raises(UnknownNameError, match=f"did you mean 'arm/{link}'"):
        scene().require(link)
    with pytest.raises(DTypeError, match=r"SceneRobot\('robot', model\)"):
        World(scene().robot("arm").model)  # type: ignore[arg-type]


def test_materials_are_those_of_the_link_or_the_robot() -> None:
    rubber = Material(friction=1.2)
    link = dynx.load("planar_3r").links[-1].name
    made = scene(robots=(arm(materials={link: rubber}),))
    assert made.material(f"arm/{link}") == rubber
    assert made.material(f"arm/{made.robot('arm').model.root}") == Material()
    with pytest.raises(UnknownNameError, match="wanted robot/link"):
        made.material("arm")


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"bodies": (ground("a"), ground("a"))}, "two parts of the scene are called 'a'"),
        ({"bodies": (ground("arm"),)}, "two parts of the scene are called 'arm'"),
        ({"ignored": (("cube", "bal"),)}, "did you mean 'ball'"),
        ({"ignored": (("cube",),)}, "wanted two names"),
        ({"groups": {"g": ("cubes",)}}, "did you mean 'cube'"),
        ({"groups": {"cube": ("ball",)}}, "two parts of the scene are called 'cube'"),
        ({"constraints": (Weld("cube", "arm"),)}, "wanted robot/link"),
        ({"constraints": (Weld("world", "ground"),)}, "both fixed"),
        ({"bodies": (Plane(),)}, "wanted SceneBody"),
        ({"gravity": (0.0, 0.0, float("nan"))}, "gravity"),
    ],
)
def test_a_scene_that_contradicts_itself_is_refused(options: dict[str, object], message: str) -> None:
    with pytest.raises(ArgumentError, match=message):
        scene(**options)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"mass": -1.0}, "mass of body 'b' is '-1.0'"),
        ({"mass": float("nan")}, "mass of body 'b' is 'nan'"),
        ({"mass": 1.0, "inertia": [[1, 0, 0], [0, 1, 0], [0, 0, 5]]}, "exceeds the sum"),
        ({"mass": 1.0, "inertia": [[1, 0, 0], [0.5, 1, 0], [0, 0, 1]]}, "not symmetric"),
        ({"inertia": [[1, 0, 0], [0, 1, 0], [0, 0, 1]]}, "a body without mass is fixed"),
        ({"twist": (1, 0, 0, 0, 0, 0)}, "a body without mass is fixed"),
        ({"shapes": Plane(), "mass": 1.0}, "belongs to fixed bodies only"),
        ({"shapes": ()}, "has no shape"),
        ({"shapes": "box"}, "wanted a shape"),
        ({"name": "a/b"}, "without '/'"),
        ({"name": "world"}, "other than 'world'"),
        ({"name": ""}, "is empty"),
    ],
)
def test_a_body_that_cannot_be_is_refused(options: dict[str, object], message: str) -> None:
    with pytest.raises(ArgumentError, match=message):
        SceneBody(**{"name": "b", "shapes": Box((1.0, 1.0, 1.0)), **options})  # type: ignore[arg-type]


def test_what_cannot_move_or_is_joined_does_not_collide() -> None:
    base, first, second, third, *_ = (f"arm/{link.name}" for link in dynx.load("planar_3r").links)
    plain, both = scene(), scene(robots=(arm(self_collision=True),))
    assert not plain.may_collide("ground", base)
    assert plain.may_collide("ground", first)
    assert plain.may_collide("cube", "ball")
    assert not plain.may_collide("cube", "cube")
    assert not plain.may_collide(first, third)
    assert both.may_collide(first, third)
    assert not both.may_collide(first, second)


def test_ignored_pairs_take_robots_and_groups() -> None:
    first = f"arm/{dynx.load('planar_3r').links[1].name}"
    made = scene(ignored=(("arm", "ball"), ("loose", "loose")), groups={"loose": ("cube", "ball")})
    assert not made.may_collide("ball", first)
    assert made.may_collide("cube", first)
    assert not made.may_collide("cube", "ball")
    with pytest.raises(UnknownNameError):
        made.may_collide("cube", "loose")


def test_bodies_of_one_shape_are_made_by_their_names(tmp_path: Path) -> None:
    assert cylinder("c", 0.1, 0.3, mass=1.0).shapes[0].shape == Cylinder(0.1, 0.3)
    assert capsule("c", 0.1, 0.3).shapes[0].shape == Capsule(0.1, 0.3)
    assert ellipsoid("e", (0.1, 0.2, 0.3), mass=2.0).shapes[0].shape == Ellipsoid((0.1, 0.2, 0.3))
    file = str(tmp_path / "thing.stl")
    assert mesh("m", file, (1.0, 1.0, -1.0)).shapes[0].shape == Mesh(file, (1.0, 1.0, -1.0))


def test_the_parts_of_scenes_have_one_door() -> None:
    with pytest.raises(ImportError, match=r"dynx\.world\.scene\.box is now dynx\.world\.box"):
        from dynx.world.scene import box  # type: ignore[attr-defined]  # noqa: F401
