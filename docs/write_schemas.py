"""Write docs/schemas: the JSON Schema of each document that dynx writes.

    python docs/write_schemas.py

The schemas follow from the classes named here; tests/test_schemas.py holds them current and validates real
documents by them.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from dynx.agreement.report import AgreementDocument
from dynx.bench.report import BenchDocument
from dynx.cli.compare import CompareDocument
from dynx.cli.contacts.run import ContactsDocument
from dynx.cli.convert import ConvertDocument
from dynx.cli.learning.documents import EnvDistanceDocument, PlayDocument, TasksDocument, TrainDocument
from dynx.cli.sim.report import SimDocument
from dynx.cli.sim.tutorial import TutorialDocument
from dynx.cli.world import WorldDocument
from dynx.doctor.report import DoctorDocument
from dynx.files.baseline import BaselineDocument
from dynx.files.documents import json_schema
from dynx.same.report import SameDocument
from dynx.sim.scenario.scenario import ScenarioDocument
from dynx.world.scene.documents import SceneDocument

FOLDER = Path(__file__).with_name("schemas")


def schemas() -> dict[str, dict[str, Any]]:
    """The schema of each document, by the name of its file."""
    return {
        "agree": json_schema(AgreementDocument, "dynx agree --json"),
        "baseline": json_schema(
            BaselineDocument,
            "dynx doctor, dynx same --write-baseline",
            omits_defaults=True,
        ),
        "bench": json_schema(BenchDocument, "dynx bench --json"),
        "compare": json_schema(CompareDocument, "dynx compare --json"),
        "contacts": json_schema(ContactsDocument, "dynx contacts --json"),
        "convert": json_schema(ConvertDocument, "dynx convert --json"),
        "doctor": json_schema(DoctorDocument, "dynx doctor --json"),
        "env-distance": json_schema(EnvDistanceDocument, "dynx env distance --json"),
        "play": json_schema(PlayDocument, "dynx play --json"),
        "same": json_schema(SameDocument, "dynx same --json"),
        "scenario": json_schema(ScenarioDocument, "dynx.Scenario.to_json"),
        "scene": json_schema(SceneDocument, "dynx.world.write_scene", omits_defaults=True),
        "sim": json_schema(SimDocument, "dynx sim --json"),
        "tasks": json_schema(TasksDocument, "dynx env list --json"),
        "train": json_schema(TrainDocument, "dynx train --json"),
        "world": json_schema(WorldDocument, "dynx world --json"),
        "tutorial": json_schema(TutorialDocument, "dynx sim --tutorial --json"),
    }


def text(schema: dict[str, Any]) -> str:
    """The text of a schema's file."""
    return json.dumps(schema, indent=2) + "\n"


if __name__ == "__main__":
    FOLDER.mkdir(exist_ok=True)
    for name, schema in schemas().items():
        (FOLDER / f"{name}.json").write_text(text(schema), encoding="utf-8")
