"""Documents of scenarios that an earlier dynx wrote are read, and simulate to the same numbers.

`scenarios_before_options.json.gz` was written when each function repeated the list of options: one
document for every controller, kind of reference and field, and the last q, v and torque of its rollout.
"""

from __future__ import annotations

import gzip
import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dynx.backends import installed_backends
from dynx.errors import ArgumentError
from dynx.model import JointDynamics
from dynx.model.elements import Limits
from dynx.model.library import example_roots
from dynx.model.loading import load
from dynx.sim import Scenario, ScenePlant, simulate
from dynx.sim.scenario.options import FORMER_NAMES, OPTIONS, Kind, Parts, PlantKind
from dynx.sim.scenario.scenario import FIRST_SCHEMA, SCHEMA

FILE = Path(__file__).with_name("scenarios_before_options.json.gz")
ROBOTS = next(iter(example_roots()), Path("absent"))
TEXT = gzip.decompress(FILE.read_bytes()).decode().replace("{example-robot-data}", ROBOTS.parent.as_posix())
SAVED: dict[str, Any] = json.loads(TEXT)
ADDED: dict[str, Any] = {"sensors": [], "joint_springs": True}
"""Options that were added since, with their defaults."""


def document_of(name: str) -> Any:
    """Return a document; skip the test where the engine of its controller is not installed."""
    document = SAVED["documents"][name]
    if "'pinocchio'" in repr(document) and "pinocchio" not in installed_backends():
        pytest.skip("needs Pinocchio")
    return document


@pytest.mark.parametrize("name", SAVED["documents"])
def test_a_saved_document_is_read_and_written_alike(name: str) -> None:
    """Classes may have got another name since; numbers and text are the same."""
    document = document_of(name)
    scenario = Scenario.from_dict(document)
    written = json.loads(scenario.to_json())
    assert Scenario.from_dict(written) == scenario
    document = {FORMER_NAMES.get(key, key): each for key, each in document.items()} | {"schema": SCHEMA}
    assert written.keys() == document.keys() | ADDED.keys()
    assert {key: written[key] for key in ADDED} == ADDED
    if isinstance(document["plant"], dict):
        # The stops were an option of the plant.
        document["joint_limits"] = document["plant"]["fields"]["joint_limits"]
        assert "joint_limits" not in written["plant"]["fields"]
    objects = {"controller", "reference", *(each for each in OPTIONS if has_objects(OPTIONS[each].kind))}
    assert [key for key in document if key not in objects and written[key] != document[key]] == []


def has_objects(kind: Kind) -> bool:
    """Check whether values of a kind of options can be objects of classes."""
    return isinstance(kind, Parts | PlantKind)


@pytest.mark.parametrize("name", SAVED["ends"])
def test_a_saved_scenario_ends_where_it_did(name: str) -> None:
    scenario = Scenario.from_dict(document_of(name))
    engine = scenario.plant.engine if isinstance(scenario.plant, ScenePlant) else scenario.plant
    if engine not in installed_backends():
        pytest.skip(f"{engine} is not installed")
    if isinstance(scenario.plant, ScenePlant) and not ROBOTS.exists():
        pytest.skip("needs the meshes of example-robot-data")
    rollout = simulate(scenario)
    for ours, saved in zip((rollout.q, rollout.v, rollout.tau), SAVED["ends"][name], strict=True):
        size = max(1.0, float(np.max(np.abs(saved), initial=0.0)))
        np.testing.assert_allclose(ours[-1], saved, rtol=0.0, atol=1e-12 * size)


def test_a_document_of_the_first_schema_without_joint_dynamics_has_none() -> None:
    """Joints had no damping, friction and armature by default, and later those of the description."""
    pendulum = load("pendulum")
    present = Scenario(pendulum, q0=[1.0], duration=0.1).to_dict()
    former = {name: each for name, each in present.items() if not name.startswith("joint_")}
    first = Scenario.from_dict({**former, "schema": FIRST_SCHEMA})
    assert (first.joint_damping, first.joint_friction, first.joint_armature) == (False, False, False)
    assert Scenario.from_dict({**former, "schema": SCHEMA}).joint_damping is True
    assert Scenario.from_dict({**former, "schema": SCHEMA}).joint_limits is False
    assert Scenario.from_json(first.to_json()) == first
    given = {"damping": True, "friction": 0.2, "armature": {"array": [0.1]}, "position_limits": True}
    told = Scenario.from_dict({**former, **given, "schema": FIRST_SCHEMA})
    assert (told.joint_damping, told.joint_friction, told.joint_limits) == (True, 0.2, True)
    np.testing.assert_array_equal(told.joint_armature, [0.1])


@pytest.mark.parametrize("schema", [FIRST_SCHEMA, SCHEMA])
@pytest.mark.parametrize("name", ["scene", "controller pd", "limits"])
def test_a_document_that_does_not_tell_its_stops_keeps_them(name: str, schema: str) -> None:
    """Joints had none by default; in a scene they had those of the engine, an option of the plant."""
    given = {FORMER_NAMES.get(key, key): each for key, each in document_of(name).items()}
    del given["joint_limits"]
    if schema == FIRST_SCHEMA:
        given = {key: each for key, each in given.items() if not key.startswith("joint_")}
    in_scene = isinstance(given["plant"], dict)
    assert Scenario.from_dict({**given, "schema": schema}).joint_limits is in_scene
    for stops in (True, False) if in_scene else ():
        fields = {**given["plant"]["fields"], "joint_limits": stops}
        own = "position_limits" if schema == FIRST_SCHEMA else "joint_limits"
        former = {**given, "plant": {**given["plant"], "fields": fields}, own: False}
        read = Scenario.from_dict({**former, "schema": schema})
        assert read.joint_limits is stops
        assert Scenario.from_json(read.to_json()) == read


@pytest.mark.parametrize(
    ("schema", "name"), [(FIRST_SCHEMA, "joint_damping"), (SCHEMA, "damping"), ("dynx.scenario/3", "damping")]
)
def test_names_of_another_schema_are_refused(schema: str, name: str) -> None:
    document = {**Scenario(load("pendulum"), duration=0.1).to_dict(), "schema": schema, name: 0.3}
    with pytest.raises(ArgumentError, match=name if schema != "dynx.scenario/3" else "wanted that of a scen"):
        Scenario.from_dict(document)


def test_stops_of_a_robot_without_limits_are_no_difference() -> None:
    """So a record of an earlier version, without stops, is resumed by today's scenario."""
    robot = load("pendulum")
    free = replace(robot, joints=tuple(replace(each, limits=Limits()) for each in robot.joints))
    for model, wanted in ((free, []), (load("ur5"), ["joint_limits"])):
        ours = Scenario(model, duration=0.01)
        theirs = replace(ours, joint_limits=False)
        assert [each.field for each in ours.differences(theirs)] == wanted
        assert [each.field for each in theirs.differences(ours)] == wanted


@pytest.mark.parametrize("name", ["joint_damping", "joint_friction", "joint_armature", "joint_springs"])
def test_joint_dynamics_that_a_description_does_not_have_are_no_difference(name: str) -> None:
    """So a record of an earlier version is resumed by today's scenario of a robot without them."""
    plain, off = load("ur5"), dict[str, Any]({name: False})
    dynamics = JointDynamics(damping=0.1, friction=0.1, armature=0.1, stiffness=0.1)
    has = replace(plain, joints=tuple(replace(each, dynamics=dynamics) for each in plain.joints))
    for robot, wanted in ((plain, []), (has, [name])):
        ours = Scenario(robot, duration=0.01)
        theirs = replace(ours, **off)
        assert [each.field for each in ours.differences(theirs)] == wanted
        assert [each.field for each in theirs.differences(ours)] == wanted
    assert [each.field for each in Scenario(plain).differences(Scenario(has))] == ["model"]
    earlier = simulate(replace(ours, model=plain, **off))
    assert len(simulate(replace(ours, model=plain), resume=earlier.first(5))) == len(earlier)
