"""The recipe "add an option of a simulation": its field and the code in which it acts, in a copy of dynx."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

REPOSITORY = Path(__file__).parents[2]

FIELD = """
    gravity_scale: float = option(
        1.0, "Factor for gravity on the plant, unknown to the controller", group=ERRORS
    )
"""
ACTS = """
        moved = moved.with_gravity([scenario.gravity_scale * g for g in moved.gravity])
"""

SCRIPT = """
import inspect, json, runpy, sys
import dynx
from click.testing import CliRunner
from dynx.cli.commands.sim import sim

docs = sys.argv[1]
arm = dynx.load("pendulum")
scenario = dynx.Scenario(arm, q0=[1.0], duration=0.1, plant="compiled", gravity_scale=0.5)
halved = dynx.load("pendulum").with_gravity([0.0, 0.0, -9.81 / 2])
document = json.loads(scenario.to_json())
older = {name: value for name, value in document.items() if name != "gravity_scale"}
command = "pendulum --controller none --q0 1 --duration 0.1 --plant compiled --json --gravity-scale 0.5"
run = json.loads(CliRunner().invoke(sim, command.split()).stdout)
described = inspect.getdoc(dynx.simulate).splitlines()
schema = runpy.run_path(docs + "/write_schemas.py")["schemas"]()["scenario"]["$defs"]["ScenarioDocument"]
errors = []
for wrong in ({"gravity_scale": "half"}, {"gravity_scle": 0.5}):
    try:
        dynx.simulate(arm, duration=0.1, **wrong)
    except dynx.errors.DynxError as error:
        errors.append(str(error))
print(json.dumps({
    "files": dynx.__file__,
    "signatures": [
        str(inspect.signature(each).parameters["gravity_scale"])
        for each in (dynx.simulate, dynx.simulate_batch, dynx.Scenario)
    ],
    "docstring": [line.strip() for line in described if "gravity_scale" in line],
    "errors": errors,
    "acts": dynx.simulate(scenario).q.tolist()
    == dynx.simulate(halved, q0=[1.0], duration=0.1, plant="compiled").q.tolist(),
    "command": run["final"]["q"] == dynx.simulate(scenario).q[-1].tolist(),
    "help": " ".join(CliRunner().invoke(sim, ["--help"]).stdout.split()),
    "document": document["gravity_scale"],
    "read": dynx.Scenario.from_dict(document) == scenario,
    "older": dynx.Scenario.from_dict(older).gravity_scale,
    "schema": schema["properties"]["gravity_scale"],
    "table": runpy.run_path(docs + "/write_options.py")["table"](),
}))
"""


def edit(path: Path, after: str, text: str) -> None:
    """Insert a text after the one line of a file that begins with `after`."""
    lines = path.read_text(encoding="utf-8").splitlines(keepends=True)
    (place,) = [k for k, line in enumerate(lines) if line.strip().startswith(after)]
    path.unlink()
    path.write_text("".join([*lines[: place + 1], text.lstrip("\n"), *lines[place + 1 :]]), encoding="utf-8")


@pytest.fixture(scope="module")
def found(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """Return what a copy of dynx with a new option has of it; all files but the two edited ones are links."""
    root = tmp_path_factory.mktemp("copy")
    edited = ("dynx/sim/scenario/options.py", "dynx/sim/setup.py")
    for folder, names, files in os.walk(REPOSITORY / "dynx"):
        names[:] = [name for name in names if name != "__pycache__"]
        copy = root / Path(folder).relative_to(REPOSITORY)
        copy.mkdir()
        for file in files:
            (copy / file).symlink_to(Path(folder) / file)
    (root / "models").symlink_to(REPOSITORY / "models")
    edit(root / edited[0], "_: KW_ONLY", FIELD)
    edit(root / edited[1], "moved = plant_model(", ACTS)
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(root), *filter(None, sys.path)])}
    done = subprocess.run(
        [sys.executable, "-c", SCRIPT, str(REPOSITORY / "docs")],
        env=environment,
        cwd=root,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    result: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    assert Path(result["files"]).is_relative_to(root), "the copy was imported"
    return result


def test_the_signatures_have_it(found: dict[str, Any]) -> None:
    assert found["signatures"] == ["gravity_scale: 'float' = 1.0"] * 3
    assert found["docstring"] == [
        "- `gravity_scale`: Factor for gravity on the plant, unknown to the controller (default: 1)"
    ]
    wrong_type, wrong_name = found["errors"]
    assert wrong_type == "gravity_scale is 'half'; wanted a number"
    assert "did you mean 'gravity_scale'" in wrong_name


def test_it_acts_from_python_and_from_the_command_line(found: dict[str, Any]) -> None:
    assert found["acts"]
    assert found["command"]
    assert (
        "--gravity-scale NUMBER Factor for gravity on the plant, unknown to the controller (default: 1)."
        in found["help"]
    )


def test_documents_their_schema_and_the_docs_have_it(found: dict[str, Any]) -> None:
    assert found["document"] == 0.5
    assert found["read"]
    assert found["older"] == 1.0
    assert found["schema"] == {"type": ["number", "null"]}
    meaning = "Factor for gravity on the plant, unknown to the controller"
    assert f"| `gravity_scale` | {meaning} |  | a number | 1 |  |" in found["table"]
