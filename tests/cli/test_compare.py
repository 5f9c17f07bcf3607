"""`dynx compare`: verdict, causes, exit codes, logs, and the document."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner, Result
from rich.console import Console

import dynx
from dynx import control
from dynx.cli.compare import document, show, verdict
from dynx.cli.shell.main import cli
from dynx.sim import Payload, compare, simulate

ARM = dynx.load("so101")
GOAL = np.full(6, 0.1)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with two rollouts that part for a payload, and a log of the second."""
    folder = tmp_path_factory.mktemp("rollouts")
    law = control.ComputedTorque(ARM, kp=100.0, kd=20.0)
    options: dict[str, Any] = {"q0": np.zeros(6), "plant": "compiled", "duration": 0.1, "dt": 2e-3}
    simulate(ARM, law, GOAL, **options).save(folder / "a.npz")
    loaded = simulate(ARM, law, GOAL, payload=Payload("gripper_link", 0.2), **options)
    loaded.save(folder / "b.npz")
    loaded.save(folder / "log.csv")
    return folder


def run(*arguments: object) -> Result:
    return CliRunner().invoke(cli, ["compare", *map(str, arguments)])


def test_a_cause_is_shown_with_its_proof(folder: Path) -> None:
    result = run(folder / "a.npz", folder / "b.npz")
    assert result.exit_code == 1
    lines = result.output.splitlines()
    assert lines[0].endswith("b.npz separate: 1 cause, proved")
    assert any(line.split()[0] == "payload" and line.endswith("cause") for line in lines if line.strip())
    assert "a rerun of A differs from A by 0; A with all changes differs from B by 0" in lines[-1]


def test_the_document(folder: Path) -> None:
    result = run(folder / "a.npz", folder / "b.npz", "--json", "-")
    assert result.exit_code == 1
    found = json.loads(result.stdout)
    assert (found["alike"], found["proved"]) == (False, True)
    assert [each["name"] for each in found["causes"]] == ["payload"]
    assert found["causes"][0]["alone"] == pytest.approx(found["largest"], rel=1e-6)
    listed = json.loads(run(folder / "a.npz", folder / "b.npz", "--list-only", "--json", "-").stdout)
    assert listed["causes"][0]["alone"] is None
    assert listed["largest"] == found["largest"]


def test_a_rollout_is_like_itself_and_like_its_log(folder: Path) -> None:
    for other in ("b.npz", "log.csv"):
        result = run(folder / "b.npz", folder / other)
        assert result.exit_code == 0
        assert "are alike: 0 rad or m apart in 0.1 s" in result.output
    assert run(folder / "log.csv", folder / "a.npz").exit_code == 1
    assert run(folder / "log.csv", folder / "a.npz", "--tolerance", "10").exit_code == 0
    assert run(folder / "log.csv", folder / "log.csv", "--robot", "so101", "--quiet").output == ""


def test_unusable_input(folder: Path) -> None:
    for arguments, said in (
        ((folder / "a.npz", folder / "none.npz"), "none.npz"),
        ((folder / "log.csv", folder / "log.csv"), "a .csv file does not have its robot: name it by --robot"),
        ((folder / "log.csv", folder / "log.csv", "--robot", "ur5"), "no column 'q:shoulder_pan_joint'"),
        ((folder / "a.npz", folder / "b.npz", "--robot", "so101"), "--robot is the robot of a .csv file"),
        ((folder / "a.npz", folder / "none.csv"), "cannot be read as a table: No such file or directory"),
    ):
        result = run(*arguments)
        assert result.exit_code == 2
        assert said in result.output


def test_verdicts_without_a_proof(folder: Path) -> None:
    ours, theirs = (dynx.Rollout.load(folder / name) for name in ("a.npz", "b.npz"))
    listed = document(compare(ours, theirs, rerun=False), "a", "b")
    assert verdict(listed) == "a and b separate; their differences were not simulated"
    log = dynx.Rollout.load(folder / "log.csv", ARM)
    assert verdict(document(compare(ours, log), "a", "b")) == "a and b separate: no cause is known"


def test_a_verdict_says_which_effects_are_not_known(folder: Path) -> None:
    ours, theirs = (dynx.Rollout.load(folder / name) for name in ("a.npz", "b.npz"))
    report: dict[str, Any] = {**document(compare(ours, theirs), "a", "b")}
    (payload,) = report["causes"]
    small = {**payload, "alone": 1e-12, "without": 1e-12, "acts": False}
    unknown = {**small, "without": None}
    for causes, said in (
        ([payload, small], "a and b separate: 1 cause, proved"),
        ([small, small], "a and b separate: all their differences together, proved"),
        ([payload, unknown], "a and b separate: 1 cause, proved; the effect of 1 difference is not known"),
    ):
        assert verdict({**report, "causes": causes}) == said
    part = {**report, "proved": False}
    assert verdict({**part, "causes": [payload]}) == "a and b separate: 1 cause, not proved"
    assert verdict({**part, "causes": [small]}) == "a and b separate: no cause is known"
    console = Console(record=True, width=200)
    show(console, {**report, "causes": [payload, small, unknown]})
    words = [line.rstrip() for line in console.export_text().splitlines() if line.startswith(" payload")]
    assert [line.split("   ")[-1].strip() for line in words] == ["cause", "no effect", "not known"]


def test_the_duration_is_that_of_the_common_time(folder: Path) -> None:
    ours, theirs = (dynx.Rollout.load(folder / name) for name in ("a.npz", "b.npz"))
    later = [replace(each, t=each.t + 5.0, scenario=None) for each in (ours, theirs)]
    assert document(compare(*later), "a", "b")["duration"] == pytest.approx(0.1, abs=1e-12)
