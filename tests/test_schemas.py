"""The published JSON Schemas: current, and kept by the documents that dynx writes."""

from __future__ import annotations

import copy
import json
import runpy
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner
from jsonschema import Draft202012Validator

from dynx import ExternalForce, agree, diagnose, load
from dynx.agreement import refused_report, results_document
from dynx.cli.compare import document as compare_document
from dynx.cli.shell.main import cli
from dynx.control import PD
from dynx.doctor import results_document as doctor_document
from dynx.doctor.formats.baseline import baseline_document
from dynx.errors import DescriptionError
from dynx.files.documents import json_text
from dynx.same import same_robot
from dynx.sim import Noise, Payload, compare, simulate
from dynx.sim.scenario.scenario import Scenario
from dynx.trajectory import cycloidal
from dynx.world import read_scene
from dynx.world.scene.documents import scene_document
from tests.doctor.formats.reports import alike, differing, hostile, refused

DOCS = Path(__file__).parents[1] / "docs"
WRITER = runpy.run_path(str(DOCS / "write_schemas.py"))
SCHEMAS: dict[str, dict[str, Any]] = WRITER["schemas"]()


def errors(name: str, document: object) -> list[str]:
    """List the errors of a validator in a document, as it is written."""
    found = Draft202012Validator(SCHEMAS[name]).iter_errors(json.loads(json_text(document)))
    return [f"{error.json_path}: {error.message[:200]}" for error in found]


def every_key(document: Any, path: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    """Return the path of each key of the objects in a document."""
    items = document.items() if isinstance(document, dict) else []
    here = [(*path, key) for key, _ in items]
    entries = list(items) if here else list(enumerate(document)) if isinstance(document, list) else []
    return here + [found for key, value in entries for found in every_key(value, (*path, key))]


@pytest.mark.parametrize("name", sorted(SCHEMAS))
def test_a_published_schema_is_valid_and_current(name: str) -> None:
    Draft202012Validator.check_schema(SCHEMAS[name])
    published = (DOCS / "schemas" / f"{name}.json").read_text(encoding="utf-8")
    assert published == WRITER["text"](SCHEMAS[name]), "run: python docs/write_schemas.py"


def test_each_published_schema_has_a_document() -> None:
    assert {path.stem for path in (DOCS / "schemas").glob("*.json")} == set(SCHEMAS)


def test_documents_of_agree_keep_their_schema() -> None:
    reports = [
        agree(load("pendulum"), ["reference", "pinocchio"], samples=2),
        refused_report("x", DescriptionError("no XML")),
    ]
    assert errors("agree", results_document(reports)) == []


def test_documents_of_the_doctor_keep_their_schema() -> None:
    found = diagnose(
        DOCS.parent / "models" / "traps" / "dx101_link_without_inertial.urdf",
        samples=2,
        counterexamples=False,
    )
    assert found.findings
    document = doctor_document([found, alike(), differing(), hostile(), refused()], not_done=["later"])
    assert errors("doctor", document) == []


def test_documents_of_same_keep_their_schema() -> None:
    text = load("ur5").to_urdf()
    other = text.replace('mass value="2.275"', 'mass value="2.3"')
    for second in (text, other, "double_pendulum"):
        assert errors("same", same_robot("ur5", second).to_dict()) == []


def test_baselines_keep_their_schema() -> None:
    assert errors("baseline", baseline_document([differing(), hostile()], "")) == []


COMMANDS = [
    ("bench", ["bench", "double_pendulum", "--quick", "--batch", "8", "--threads", "1"], 0),
    ("sim", ["sim", "ur5", "--duration", "0.01", "--payload", "tool0:3", "--noise-q", "1e-4"], 0),
    ("sim", ["sim", "ur5", "--duration", "0.01", "--mass-scale", "forearm_link=2"], 0),
    ("sim", ["sim", "ur5", "--to", "elbow_joint=0.1", "--controller", "operational-space"], 0),
    (
        "sim",
        ["sim", "double_pendulum", "--base", "floating", "--duration", "0.01", "--controller", "none"],
        0,
    ),
    ("sim", ["sim", "ur5", "--duration", "1", "--controller", "pd", "--kp", "1e9", "--kd", "1e6"], 1),
    ("tutorial", ["sim", "--tutorial", "--duration", "1.2", "--dt", "0.004"], 0),
]


@pytest.mark.parametrize(("name", "arguments", "code"), COMMANDS, ids=lambda value: str(value)[:60])
def test_documents_of_commands_keep_their_schema(name: str, arguments: list[str], code: int) -> None:
    result = CliRunner().invoke(cli, [*arguments, "--json"])
    assert result.exit_code == code, result.output
    assert errors(name, json.loads(result.stdout)) == []


def test_comparisons_of_rollouts_keep_their_schema() -> None:
    model = load("double_pendulum")
    rest = np.zeros(model.nv)
    law = PD(model, kp=1.0, kd=0.1)
    runs = [
        simulate(model, law, rest, q0=rest + 0.1, plant="reference", duration=0.01, joint_damping=damping)
        for damping in (0.0, 0.5)
    ]
    for rerun in (True, False):
        comparison = compare(*runs, rerun=rerun)
        assert errors("compare", compare_document(comparison, "a.npz", "b.npz")) == []


def test_documents_of_scenarios_keep_their_schema() -> None:
    model = load("double_pendulum")
    tip = model.links[-1].name
    rest = np.zeros(model.nv)
    scenarios = [
        Scenario(model),
        Scenario(
            model,
            PD(model, kp=1.0, kd=0.1),
            cycloidal(rest, rest + 1.0, duration=1.0),
            q0=rest,
            noise=Noise(q=1e-3),
            joint_damping=True,
            joint_armature=[0.1, 0.2],
            joint_friction=0.5,
            payload=Payload(tip, 2.0),
            mass_scale={tip: 1.1},
            pushes=[ExternalForce(tip, rest.tolist() * 3, start=0.1, duration=0.1)],
        ),
    ]
    for scenario in scenarios:
        assert errors("scenario", json.loads(scenario.to_json())) == []
        assert set(SCHEMAS["scenario"]["$defs"]["ScenarioDocument"]["properties"]) == set(scenario.to_dict())


def test_a_key_too_few_or_too_many_is_an_error_wherever_it_is() -> None:
    document = json.loads(json_text(doctor_document([differing()])))
    # Maps have keys of their own: engines, quantities and joints.
    maps = ("effects", "before", "after", "joints", "file", "engine_value")
    paths = [path for path in every_key(document) if not set(maps).intersection(path[:-1])]
    assert len(paths) > 80
    for *owners, key in paths:
        fewer, more = copy.deepcopy(document), copy.deepcopy(document)
        inner, other = fewer, more
        for owner in owners:
            inner, other = inner[owner], other[owner]
        del inner[key]
        other[f"{key}_"] = None
        assert errors("doctor", fewer)
        assert errors("doctor", more)


def test_documents_of_scenes_and_worlds_keep_their_schema() -> None:
    pytest.importorskip("pybullet")
    assert not errors("scene", scene_document(read_scene("stack")))
    arguments = ["world", "stack", "--engine", "pybullet", "--duration", "0.01", "--json", "-"]
    result = CliRunner().invoke(cli, arguments)
    assert result.exit_code == 0, result.output
    assert not errors("world", json.loads(result.stdout))
