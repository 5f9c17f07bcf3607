"""Documents of scenes: values of wrong types, and robots that are read as they were written."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dynx.errors import ArgumentError
from dynx.files.documents import convert_document
from dynx.model import Model, Pose
from dynx.model.elements import Vector
from dynx.model.geometry import Box, Collision, Geometry, LinkGeometry
from dynx.testing.strategies import models
from dynx.testing.strategies.geometry import origins, vectors
from dynx.world import Scene, SceneRobot, read_scene
from dynx.world.scene.documents import SceneDocument, scene_document, scene_from_document

BODY: dict[str, Any] = {"name": "cube", "shape": {"box": [1, 1, 1]}}
ROBOT: dict[str, Any] = {"name": "arm", "robot": "planar_2r"}

WRONG: dict[str, tuple[dict[str, Any], str]] = {
    "text for a list": ({"bodies": "x"}, "bodies is 'x'; wanted a list of tables"),
    "text for a number": (
        {"bodies": [{**BODY, "mass": "heavy"}]},
        "bodies[0], 'cube': mass is 'heavy'; wanted a number",
    ),
    "text in a vector": (
        {"bodies": [{**BODY, "pose": [0, "a", 0]}]},
        "bodies[0], 'cube': pose[1] is 'a'; wanted a number",
    ),
    "number for a list": (
        {"bodies": [{"name": "ball", "shape": {"box": 1.0}}]},
        "bodies[0], 'ball': shape.box is 1.0; wanted a list of numbers",
    ),
    "number for a name": ({"bodies": [{**BODY, "name": 5}]}, "bodies[0].name is 5; wanted a text"),
    "misspelled choice": (
        {"constraints": [{"kind": "wled", "a": "cube", "b": "world"}]},
        "constraints[0].kind is 'wled'; wanted 'weld' or 'point'; did you mean 'weld'?",
    ),
    "unknown motor": (
        {"robots": [{**ROBOT, "motors": [{"kind": "servo"}]}]},
        "motors[0].kind is 'servo'; wanted 'position', 'velocity', 'pd' or 'torque'",
    ),
    "missing key": ({"bodies": [{"shape": {"sphere": 1}}]}, "bodies[0] lacks name; wanted a text"),
    "one of two forms": (
        {"robots": [{**ROBOT, "q": "zero"}]},
        "robots[0], 'arm': q is 'zero'; wanted a list of numbers or a table of numbers",
    ),
    "number for a truth value": (
        {"robots": [{**ROBOT, "self_collision": 1}]},
        "robots[0], 'arm': self_collision is 1; wanted true or false",
    ),
    "truth value for a number": ({"bodies": [{**BODY, "mass": True}]}, "mass is true; wanted a number"),
    "list for a table": ({"bodies": [{**BODY, "shape": [1]}]}, "shape is the list [1]; wanted a table with"),
    "number too large": ({"gravity": [0, 0, 10**400]}, "gravity[2] is a number of too many digits"),
    "text for a group": ({"groups": {"tools": "cube"}}, "groups.tools is 'cube'; wanted a list of texts"),
    "pair of one": ({"bodies": [BODY], "ignored": [["cube"]]}, "wanted two names"),
    "unknown key": (
        {"bodies": [{**BODY, "materials": {}}]},
        "bodies[0], 'cube' has no key 'materials'; did you mean 'material'?",
    ),
    "unknown key far from all": (
        {"constraints": [{"zzz": 1}]},
        "has no key 'zzz'; 9 are known, such as kind, a",
    ),
    "other version": ({"schema": "dynx.scene/2"}, "schema is 'dynx.scene/2'; wanted schema = 'dynx.scene/1'"),
}


@pytest.mark.parametrize("fault", WRONG)
def test_a_wrong_type_is_named_with_its_place_and_what_is_valid(fault: str, tmp_path: Path) -> None:
    document, message = WRONG[fault]
    path = tmp_path / "scene.json"
    path.write_text(json.dumps({"schema": "dynx.scene/1", **document}))
    with pytest.raises(ArgumentError) as raised:
        read_scene(path)
    assert message in str(raised.value)
    assert str(raised.value).startswith(str(path))
    for word in ("Expected", "`", "array", "object", "enum"):
        assert word not in str(raised.value)


def test_every_type_of_a_document_is_checked_before_it_is_converted() -> None:
    """Each value of the document replaced by each wrong one is refused in words of the checks."""
    whole: dict[str, Any] = {
        "schema": "dynx.scene/1",
        "gravity": [0.0, 0.0, -9.81],
        "bodies": [{**BODY, "mass": 1.0, "inertia": [[1.0, 0.0, 0.0]] * 3, "material": {"friction": 0.5}}],
        "robots": [{**ROBOT, "lock": {"a": 0.0}, "motors": [{"kind": "pd", "kp": [1.0]}]}],
        "constraints": [{"kind": "weld", "a": "cube", "b": "world", "pose": [0.0]}],
        "ignored": [["cube", "arm"]],
        "groups": {"g": ["cube"]},
    }
    wrong: list[Any] = ["?", 3, 1.5, True, None, [], {}, [[]], [{}], {"x": 1}, [None]]
    text = json.dumps(whole)
    for place in list(places(whole)):
        for value in wrong:
            document = json.loads(text)
            at = document
            for key in place[:-1]:
                at = at[key]
            at[place[-1]] = value
            message = message_of(document)
            assert "Expected" not in message, (place, value)
            assert "Invalid" not in message, (place, value)


def message_of(document: object) -> str:
    """Return the message with which a document is refused; empty for one that is not."""
    try:
        convert_document(document, SceneDocument)
    except ArgumentError as error:
        return str(error)
    return ""


def places(part: Any, at: tuple[Any, ...] = ()) -> Any:
    for key, each in part.items() if isinstance(part, dict) else enumerate(part):
        yield (*at, key)
        if isinstance(each, dict | list):
            yield from places(each, (*at, key))


@given(
    model=models(),
    gravity=vectors(12.0),
    placement=origins(),
    shape=st.sampled_from([None, Box((0.1, 0.2, 0.3))]),
)
def test_a_robot_of_a_scene_is_read_as_it_was_written(
    model: Model, gravity: Vector, placement: Pose, shape: Box | None
) -> None:
    """Its gravity, base and added frames too, which URDF does not have."""
    model = model.with_gravity(gravity)
    model = model.with_frame("one more frame", model.links[-1].name, placement)
    if shape is not None:
        shapes = {model.links[-1].name: LinkGeometry(collisions=(Collision(shape),))}
        model = replace(model, geometry=Geometry(shapes).for_links(link.name for link in model.links))
    scene = Scene("s", robots=(SceneRobot("robot", model),))
    document = json.loads(json.dumps(scene_document(scene)))
    again = scene_from_document(document).robots[0].model
    assert again == model
    assert again.geometry.links == model.geometry.links


def test_the_base_of_a_robot_of_a_scene_is_that_of_its_file(tmp_path: Path) -> None:
    text = '<mujoco><worldbody><body name="b"><freejoint/><geom size="0.1"/></body></worldbody></mujoco>'
    (tmp_path / "free.xml").write_text(text)
    (tmp_path / "s.toml").write_text(
        'schema = "dynx.scene/1"\nname = "s"\n[[robots]]\nname = "r"\nrobot = "free.xml"\n'
    )
    assert read_scene(tmp_path / "s.toml").robots[0].model.floating
