"""Ideas implemented in one place: docs/architecture.md names the module of each; no other module has it."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]

IDEAS = {
    "random numbers": r"random\.(Philox|SeedSequence)\(",
    "noise of measurements": r"^class Noise\b",
    "lights, sky and ground of pictures": r"^class Scenery\b",
    "recorded motion": r"^class Record\b",
    "snapshot": r"^class Snapshot\b",
    "distance of two motions": r"^class Separation\b",
    "errors of a sensor": r"^class SensorErrors\b",
    "samples of a sensor": r"^def read_sensor\b",
    "external force": r"def share\(self, t: float",
    "impulses of contacts, limits and constraints in one step": r"^class ConstraintSets\b",
    "joint friction": r"^class FrictionLaw\b",
    "a step of a robot by a backend": r"^class RobotStep\b",
    "parameters in which the robots of a batch differ": r"^class Parameters\b|^def plant_model\b",
    "steps that are too long for springs, gains and friction": r"SEMI_IMPLICIT = StabilityBounds\b",
    "styles and texts of curves": r"\"-\.\", \":\"|replace\(\"\\$\"",
    "play and pause of pages": r"\"play or pause\"",
    "joint wrenches": r"^def joint_wrenches\b",
    "external torque from a motion": r"^class MomentumObserver\b",
    "acceleration from two states": r"^class MeanAcceleration\b",
    "contact forces, as means over a time interval": r"^class ContactInterval\b",
    "a scene in MuJoCo": r"^class MjcfDocument\b",
    "a document in MJCF": r"\bElement\(\"mujoco\"",
    "types of arguments": r"^def checks_types\b",
    "reports in SARIF": r"sarif-2\.1\.0",
    "reports in JUnit XML": r"\"testsuites\"",
    "accepted differences": r"^class BaselineDocument\b",
}
"""Text that only the module of an idea contains, by the name of the idea."""


def test_the_table_names_each_idea() -> None:
    assert set(_table()) == set(IDEAS)


@pytest.mark.parametrize("idea", IDEAS)
def test_an_idea_stands_in_one_module(idea: str) -> None:
    pattern = re.compile(IDEAS[idea], re.MULTILINE)
    found = [path for path in (ROOT / "dynx").rglob("*.py") if pattern.search(path.read_text("utf-8"))]
    assert [path.relative_to(ROOT / "dynx").as_posix() for path in found] == [_table()[idea]]


def _table() -> dict[str, str]:
    """Return the module of each idea in the table of docs/architecture.md."""
    text = (
        (ROOT / "docs/architecture.md").read_text("utf-8").partition("## Ideas implemented in one place")[2]
    )
    rows = re.findall(r"^\| ([^|`]+) \| `([\w/]+\.py)` \|", text.partition("\n## ")[0], re.MULTILINE)
    return dict(rows)
