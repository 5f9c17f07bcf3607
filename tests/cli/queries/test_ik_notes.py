"""Status, proof and notes of `dynx ik`."""

from __future__ import annotations

import json

import pytest
from click.testing import CliRunner

from dynx.cli.shell.main import cli
from tests.cli.queries.test_evaluate import document
from tests.oracles.closed_form import MODELS


def test_ik_states_status_message_and_proof() -> None:
    options = ["ur5", "--frame", "tool0", "--backend", "reference"]
    found = document("ik", *options, "--to-pose", "0.4,0.2,0.3,0,0,0")
    assert (found["status"], found["proof"], found["note"]) == ("REACHED", "", "")
    assert found["message"].startswith("reached, ")
    far = CliRunner().invoke(cli, ["ik", *options, "--to-pose", "9,0,0", "--json", "-"])
    result = json.loads(far.stdout)
    assert far.exit_code == 1
    assert result["status"] == "UNREACHABLE"
    assert "the chain reaches at most" in result["proof"]
    assert result["message"].endswith(result["proof"])
    printed = CliRunner().invoke(cli, ["ik", *options, "--to-pose", "9,0,0"]).stdout
    assert f"out of reach: {result['proof']}" in " ".join(printed.split())


@pytest.mark.parametrize("extra", [["--all-solutions"], ["--free", "position"], []])
def test_angles_beyond_a_full_turn_are_noted(extra: list[str]) -> None:
    """Angles in degrees are read as radians, with a note."""
    options = ["ik", "ur5", "--backend", "reference", "--frame", "tool0", *extra, "--to-pose"]
    hint = "-90 degrees would be -1.5708"
    noted = CliRunner().invoke(cli, [*options, "0.4,0.2,0.3,-90,0,0"])
    assert hint in " ".join(noted.stdout.split())
    assert hint not in " ".join(CliRunner().invoke(cli, [*options, "0.4,0.2,0.3,-6,0,0"]).stdout.split())
    if "--free" in extra:
        assert hint in " ".join(CliRunner().invoke(cli, [*options, "0,0,-90"]).stdout.split())


@pytest.mark.parametrize(
    ("robot", "given", "frame", "remedy"),
    [
        ("panda", [], "panda_hand_tcp", "panda_joint7=0.5"),
        ("panda", ["--given", "panda_joint7=0.5"], "panda_hand_tcp", "panda_joint7=0.5"),
        ("z1", [], "gripperStator", None),
    ],
)
def test_a_frame_before_the_gripper_is_suggested(
    robot: str, given: list[str], frame: str, remedy: str | None
) -> None:
    """The frame that is suggested has a closed form."""
    options = ["ik", robot, "--backend", "reference", "--all-solutions", "--to-pose", "0.4,0,0.4,3,0,0"]
    refused = CliRunner().invoke(cli, [*options, *given])
    assert refused.exit_code == 2
    assert "was chosen by default; there is a closed form with --frame " + frame in refused.stderr
    more = [] if remedy is None else ["--given", remedy]
    assert CliRunner().invoke(cli, [*options, "--frame", frame, *more]).exit_code in (0, 1)
    named = CliRunner().invoke(cli, [*options, "--frame", "world" if robot == "z1" else "panda_leftfinger"])
    assert "by default" not in named.stderr


def test_no_other_frame_is_suggested_for_seven_joints_of_an_arm() -> None:
    options = ["--backend", "reference", "--all-solutions", "--to-pose", "0.4,0,0.4,3,0,0"]
    refused = CliRunner().invoke(cli, ["ik", str(MODELS / "seven_axis_arm.urdf"), *options])
    assert refused.exit_code == 2
    assert refused.stderr.rstrip().endswith(" was chosen by default")
