"""`dynx agree`: inputs, document, exit codes, interruption."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner, Result

from dynx.agreement import refused_report, results_document
from dynx.cli.shell.main import cli
from dynx.errors import RobotNotFoundError
from dynx.model.expansion import expand
from tests.conftest import needs_examples

QUICK = ["--backends", "reference", "--samples", "1", "--jobs", "1"]


def agree(*arguments: str) -> Result:
    """Run ``dynx agree`` with one sample of the reference backend."""
    return CliRunner().invoke(cli, ["agree", *arguments, *QUICK])


def test_one_robot_gives_the_full_table() -> None:
    result = agree("ur5")
    assert result.exit_code == 0
    assert "mass matrix" in result.stdout
    assert "reference alone agrees" in result.stdout
    assert "digits or more (except inverse kinematics and numerical derivatives)" in result.stdout
    assert "1 sample," in result.stdout
    assert result.stderr == ""


def test_the_document_has_the_shape_of_the_schema() -> None:
    result = agree("ur5", "nosuchrobot", "--json", "-")
    assert result.exit_code == 2
    made: dict[str, Any] = json.loads(result.stdout)
    assert set(made) == {"schema", "dynx", "results", "summary", "not_done", "left_out"}
    assert made["schema"] == 1
    good, bad = made["results"]
    keys = "robot source base backends nq nv samples seed agree error seconds quantities"
    assert set(keys.split()) <= set(good)
    assert set(good) == set(bad)
    row = {"quantity", "pair", "max_abs_error", "max_rel_error", "tolerance", "agree", "worst_sample"}
    assert row <= set(good["quantities"][0])
    assert good["agree"] is True
    assert good["error"] is None
    assert bad["agree"] is False
    assert bad["error"]["type"] == "RobotNotFoundError"
    assert "2 robots" in result.stderr


def test_the_document_is_a_summary_unless_every_row_is_asked_for() -> None:
    options = ["pendulum", "--samples", "3", "--jobs", "1", "--seed", "1"]
    options += ["--backends", "reference,compiled", "--json", "-"]
    short = CliRunner().invoke(cli, ["agree", *options]).stdout
    whole = CliRunner().invoke(cli, ["agree", *options, "--json-samples"]).stdout
    assert len(short) < 0.2 * len(whole)
    (summary,), (everything,) = (json.loads(text)["results"] for text in (short, whole))
    assert set(summary) == set(everything)
    rows = everything["quantities"]
    assert all("worst_sample" in row for row in rows)
    for row in summary["quantities"]:
        same = [each for each in rows if (each["quantity"], each["pair"]) == (row["quantity"], row["pair"])]
        assert row["max_rel_error"] == max(each["max_rel_error"] for each in same)
    assert {row["quantity"] for row in summary["quantities"]} == {row["quantity"] for row in rows}


def test_a_directory_means_every_urdf_below_it_sorted(tmp_path: Path) -> None:
    (tmp_path / "b").mkdir()
    (tmp_path / "c.urdf").mkdir()
    text = '<robot name="r"><link name="l"/></robot>'
    for name in ("z.urdf", "b/a.URDF", "b/notes.txt"):
        (tmp_path / name).write_text(text)
    target = tmp_path / "out.json"
    assert agree(str(tmp_path), "--json", str(target)).exit_code == 0
    robots = [entry["robot"] for entry in json.loads(target.read_text())["results"]]
    assert robots == [str(tmp_path / "b/a.URDF"), str(tmp_path / "z.urdf")]
    assert not list(tmp_path.glob(".dynx-*"))


BAD_TEXTS = {
    "not XML": "garbage",
    "truncated": '<robot name="r"><link name="l">',
    "entity bomb": '<!DOCTYPE r [<!ENTITY a "aa">]><robot name="r"><link name="l"/></robot>',
    "external entity": '<!DOCTYPE r [<!ENTITY a SYSTEM "/etc/passwd">]><robot name="&a;"/>',
    "two roots": '<robot name="r"><link name="a"/><link name="b"/></robot>',
    "duplicate": '<robot name="r"><link name="a"/><link name="a"/></robot>',
    "cycle": '<robot name="r"><link name="a"/><link name="b"/>'
    '<joint name="i" type="fixed"><parent link="a"/><child link="b"/></joint>'
    '<joint name="j" type="fixed"><parent link="b"/><child link="a"/></joint></robot>',
    "NaN": '<robot name="r"><link name="a"><inertial><mass value="nan"/>'
    '<inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link></robot>',
    "decimal comma": '<robot name="r"><link name="a"><inertial><mass value="2,5"/>'
    '<inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link></robot>',
    "zero axis": '<robot name="r"><link name="a"/><link name="b"/><joint name="j" type="continuous">'
    '<parent link="a"/><child link="b"/><axis xyz="0 0 0"/></joint></robot>',
}


def test_bad_files_are_refused_and_the_others_done(tmp_path: Path) -> None:
    for name, text in BAD_TEXTS.items():
        (tmp_path / f"{name}.urdf").write_text(text)
    os.mkfifo(tmp_path / "fifo.urdf")
    (tmp_path / "good.urdf").write_text('<robot name="r"><link name="l"/></robot>')
    (tmp_path / "empty").mkdir()
    target = tmp_path / "out.json"
    started = time.monotonic()
    result = agree(str(tmp_path), str(tmp_path / "empty"), "nosuch", "ur5", "--json", str(target))
    assert time.monotonic() - started < 60.0
    assert result.exit_code == 2
    assert "Traceback" not in result.output
    done = [line for line in result.stderr.splitlines() if line.startswith("[")]
    complaints = [line for line in result.stderr.splitlines() if line not in done]
    assert all(line.startswith("dynx: error: ") for line in complaints)
    assert "[2/" in done[0]
    assert sum(line.endswith(": agree") for line in done) == 2
    assert len(complaints) == len(BAD_TEXTS) + 3
    made = json.loads(target.read_text())
    assert made["summary"] == {
        "robots": len(complaints) + 2,
        "agree": 2,
        "differ": 0,
        "refused": len(complaints),
        "not_done": 0,
    }
    assert {entry["error"]["type"] for entry in made["results"] if entry["error"]} <= {
        "DescriptionError",
        "UnsupportedFeatureError",
        "RobotNotFoundError",
    }


@pytest.mark.parametrize("name", list(BAD_TEXTS))
def test_every_command_refuses_a_bad_file_in_one_line(name: str, tmp_path: Path) -> None:
    path = tmp_path / "bad.urdf"
    path.write_text(BAD_TEXTS[name])
    for command in (["info"], ["id"], ["fk"], ["ik", "--target", "0,0,0"]):
        result = CliRunner().invoke(cli, [command[0], str(path), *command[1:]])
        assert result.exit_code == 2
        assert result.stdout == ""
        assert result.stderr.startswith("dynx: error: ")
        assert str(path) in result.stderr
        assert result.stderr.count("\n") == 1


@pytest.mark.parametrize(
    ("arguments", "clue"),
    [
        (["ur5", "--backends", "nosuch"], "nosuch"),
        (["ur5", "--backends", ","], "--engine"),
        (["ur5", "--samples", "0"], "--samples"),
        (["ur5", "--base", "flying"], "--base"),
        (["ur5", "--lock", "elbow_joint"], "joint=value"),
        (["ur5", "--lock", "elbow=1"], "elbow_joint"),
        (["ur5", "--json", "/nosuch/folder/x.json"], "/nosuch/folder"),
        (["ur5", "--bogus"], "--bogus"),
        ([], "ROBOT"),
        (["a\0b"], "a"),
        (["x" * 10_000], "10000 characters"),
    ],
)
def test_arguments_that_cannot_be_used(arguments: list[str], clue: str) -> None:
    result = CliRunner().invoke(cli, ["agree", *arguments])
    assert result.exit_code == 2
    assert clue in result.stderr
    assert "Traceback" not in result.output
    assert result.stderr.count("\n") == 1
    assert len(result.stderr) < 1000


@needs_examples
def test_all_is_the_whole_of_example_robot_data() -> None:
    assert len(expand(["all"]).robots) == 69


def test_a_directory_of_xacro_files_says_why_none_is_taken(tmp_path: Path) -> None:
    (tmp_path / "arm.xacro").write_text("<robot/>")
    (found,) = expand([str(tmp_path)]).robots
    assert "has no .urdf file in it or below it; name one of its 1 .xacro files" in str(found.refusal)


@pytest.mark.skipif(sys.platform == "win32", reason="no SIGINT to a child")
def test_an_interrupted_run_writes_what_is_done(tmp_path: Path) -> None:
    target = tmp_path / "out.json"
    command = [sys.executable, "-m", "dynx", "agree", *["six_axis_arm"] * 5000, *QUICK, "--json", str(target)]
    for patience in (4.0, 16.0, 64.0):
        process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        time.sleep(patience)
        process.send_signal(signal.SIGINT)
        out, err = process.communicate(timeout=60.0)
        assert process.returncode == 130
        assert "Traceback" not in err
        assert "of 5000 robots not done" in err
        assert "not done" in out
        made = json.loads(target.read_text())
        assert len(made["results"]) + len(made["not_done"]) == 5000
        if made["results"]:
            break
    assert made["summary"]["agree"] == len(made["results"]) > 0
    assert made["summary"]["not_done"] == len(made["not_done"]) > 0


def test_quiet_prints_nothing() -> None:
    result = agree("ur5", "--quiet")
    assert (result.exit_code, result.output) == (0, "")


def test_numbers_and_words_stay_whole_on_a_narrow_terminal(monkeypatch: pytest.MonkeyPatch) -> None:
    width = 60
    full = agree("ur5").stdout
    monkeypatch.setenv("COLUMNS", str(width))
    narrow = agree("ur5").stdout
    # The last line has the elapsed time; rules are as long as their block.
    expected = {word for word in full.split() if not word.startswith("─")}
    assert expected - {*full.splitlines()[-1].split()} <= {*narrow.split()}
    table = narrow.splitlines()[2:-2]
    assert max(len(line) for line in table if "own result" not in line) <= width


def test_one_robot_is_singular() -> None:
    from io import StringIO

    from rich.console import Console

    from dynx.cli.agree import show_summary

    out = StringIO()
    refused = results_document([refused_report("x", RobotNotFoundError("no x"))])
    show_summary(Console(file=out), refused["summary"], 1.0)
    assert out.getvalue() == "1 robot: 0 agree, 0 differ, 1 refused; took 1.0 s\n"


@pytest.mark.parametrize("quiet", [[], ["--quiet"]])
def test_robots_in_xacro_below_a_directory_are_named(quiet: list[str], tmp_path: Path) -> None:
    robot = tmp_path / "arm.urdf.xacro"
    robot.write_text('<robot name="arm"><link name="base"/></robot>')
    (tmp_path / "arm.urdf").write_text('<robot name="arm"><link name="base"/></robot>')
    target = tmp_path / "out.json"
    result = CliRunner().invoke(cli, ["agree", str(tmp_path), *QUICK, "--json", str(target), *quiet])
    assert result.exit_code == 0
    assert "dynx: note: 1 robot in xacro was not examined" in result.stderr
    assert str(robot) in result.stderr
    assert json.loads(target.read_text())["left_out"] == [str(robot)]


def test_robots_of_other_formats_are_compared(tmp_path: Path) -> None:
    path = tmp_path / "arm.sdf"
    path.write_text(
        '<sdf version="1.9"><model name="arm"><link name="base"/><link name="tip"/>'
        '<joint name="weld" type="fixed"><parent>world</parent><child>base</child></joint>'
        '<joint name="hinge" type="revolute"><parent>base</parent><child>tip</child>'
        "<axis><xyz>0 1 0</xyz></axis></joint></model></sdf>"
    )
    result = agree(str(path))
    assert result.exit_code == 0
    assert "fixed base, nq 1, nv 1" in result.stdout
    refused = agree(str(path), "--base", "floating")
    assert refused.exit_code == 2
    assert "the robot is fixed" in refused.stderr
