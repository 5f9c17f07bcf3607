"""`dynx sim --tutorial`: table, document, plot, exit codes, interruption."""

from __future__ import annotations

import json
import signal
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner, Result

from dynx.backends import installed_backends
from dynx.cli.commands.sim import sim as command
from dynx.cli.shell.main import cli
from dynx.cli.sim import run as sim_run
from dynx.engines.pybullet.backend import PyBulletBackend
from dynx.errors import ArgumentError, NotInstalledError
from dynx.sim.tutorial import MODES, Row, Tutorial
from tests.oracles.closed_form import MODELS
from tests.sim.bars import TRACKING

QUICK = ["--duration", "1.2", "--dt", "0.004"]
"""Options of a short run, with the largest step at which every controller holds the arm."""


def tutorial(*arguments: str) -> Result:
    return CliRunner().invoke(cli, ["sim", "--tutorial", *arguments])


def document(*arguments: str, code: int = 0) -> dict[str, Any]:
    """Return the document that ``--json`` writes."""
    result = tutorial(*arguments, "--json")
    assert result.exit_code == code, result.output
    made: dict[str, Any] = json.loads(result.stdout)
    return made


def test_the_help_of_tutorial_lists_its_options() -> None:
    assert {str(param.name) for param in command.params} >= sim_run.TUTORIAL_OPTIONS
    help_text = {param.name: param for param in command.params}["tutorial"].to_info_dict()["help"]
    for param in command.params:
        if param.name in sim_run.TUTORIAL_OPTIONS - {"tutorial", "robot"}:
            assert param.opts[0] in help_text


@pytest.mark.skipif("pybullet" not in installed_backends(), reason="PyBullet is not installed")
def test_the_whole_tutorial() -> None:
    made = document()
    assert (made["schema"], made["robot"], made["duration"], made["dt"]) == (1, "ur5", 2.0, 1e-3)
    assert made["gravity"] == [0.0, 0.0, -9.8]
    assert made["to"] == [-1.5, -1.0, 1.0, -1.57, -1.57, -1.57]
    assert [mode["mode"] for mode in made["modes"]] == list(MODES)
    assert made["not_done"] == []
    modes = {mode["mode"]: mode["plants"] for mode in made["modes"]}
    for plant in ("pybullet", "pinocchio"):
        entry = modes["computed-torque"][plant]
        assert entry["max_error"] <= TRACKING
        assert max(entry["joint_max_errors"]) == entry["max_error"] > entry["rms_error"] > 0.0
        assert (entry["steps"], entry["problem"]) == (2000, None)
    motor = modes["position-motor"]
    assert motor["pybullet"]["max_error"] < TRACKING
    assert (motor["pinocchio"]["max_error"], motor["pinocchio"]["steps"]) == (None, 0)
    assert motor["pinocchio"]["problem"] == "a motor inside PyBullet"


def test_the_table_has_one_line_for_each_mode_with_its_description() -> None:
    result = tutorial(*QUICK)
    assert result.exit_code == 0
    assert result.stderr == ""
    made = document(*QUICK)
    lines = {line.split()[0]: line for line in result.stdout.splitlines() if line.startswith(" ")}
    for mode in made["modes"]:
        line = lines[mode["mode"]]
        assert line.rstrip().endswith(mode["what"])
        largest = mode["plants"]["pinocchio"]["max_error"]
        assert ("-" if largest is None else f"{largest:.1e}") in line.split()
    assert "position-motor, velocity-motor, pd-motor on dynx: a motor inside PyBullet" in result.stdout
    assert "PyBullet: its own stepper, dynx: semi-implicit Euler over pinocchio" in result.stdout


def test_numbers_stay_whole_on_a_narrow_terminal(monkeypatch: pytest.MonkeyPatch) -> None:
    full = tutorial(*QUICK).stdout
    monkeypatch.setenv("COLUMNS", "60")
    narrow = tutorial(*QUICK).stdout
    expected = {word for word in full.split() if not word.startswith("─")}
    assert expected <= {*narrow.split()}


def test_without_pybullet_the_table_states_that_it_is_missing(monkeypatch: pytest.MonkeyPatch) -> None:
    def missing() -> None:
        raise NotInstalledError("PyBullet is missing")

    monkeypatch.setattr(PyBulletBackend, "require_engine", missing)
    result = tutorial(*QUICK)
    assert result.exit_code == 0
    assert result.stdout.count("on PyBullet: PyBullet is missing") == 1


def test_another_robot_and_motion() -> None:
    path = str(MODELS / "double_pendulum.urdf")
    made = document(path, "--to", "0.5,-0.3", "--from", "0.1,0", "--gravity", "0,0,0", *QUICK)
    assert (made["from"], made["to"], made["gravity"]) == ([0.1, 0.0], [0.5, -0.3], [0.0, 0.0, 0.0])
    modes = {mode["mode"]: mode["plants"]["pinocchio"] for mode in made["modes"]}
    # Without weight there is nothing to compensate.
    assert modes["gravity-pd"]["max_error"] == pytest.approx(modes["pd"]["max_error"])


def test_a_mode_that_diverges_is_exit_code_1() -> None:
    # Stops would bound the motion; this robot has none.
    arguments = [str(MODELS / "double_pendulum.urdf"), "--to", "0.5,-0.3", "--dt", "0.2", "--duration", "20"]
    result = tutorial(*arguments)
    assert result.exit_code == 1
    assert "dynx: error: computed-torque on pinocchio: the simulation diverged in step " in result.stderr
    made = document(*arguments, code=1)
    entry = {mode["mode"]: mode["plants"] for mode in made["modes"]}["computed-torque"]["pinocchio"]
    assert entry["max_error"] is None
    assert 0 < entry["steps"] < 100
    assert "diverged" in entry["problem"]


def test_a_plot_is_drawn(tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    target = tmp_path / "errors.svg"
    assert tutorial(*QUICK, "--plot", str(target)).exit_code == 0
    assert b"<svg" in target.read_bytes()


def test_a_plot_that_cannot_be_written_loses_no_table(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("matplotlib")

    def full(*_: object) -> None:
        raise ArgumentError("errors.png cannot be written: no space left")

    monkeypatch.setattr("dynx.cli.sim.tutorial.plot_rows", full)
    result = tutorial(*QUICK, "--plot", str(tmp_path / "errors.png"))
    assert result.exit_code == 2
    assert "computed-torque " in result.stdout
    assert result.stderr.endswith("errors.png cannot be written: no space left\n")


@pytest.mark.parametrize(
    ("arguments", "clue"),
    [
        (["--controller", "pd"], "--controller has no effect with --tutorial"),
        (["--base", "floating"], "--base has no effect with --tutorial"),
        (["--kp", "1"], "--kp has no effect with --tutorial"),
        (["--plant", "pinocchio"], "--plant has no effect with --tutorial"),
        (["--save", "x.npz"], "--save has no effect with --tutorial"),
        (["panda"], "6 coordinates and panda has 8"),
        (["nosuch"], "no robot 'nosuch'"),
        (["--to", "0,0,0"], "--to has 3 numbers"),
        (["--to", "nan"], "not finite"),
        (["--duration", "0.2"], "velocity of"),
        (["--dt", "0"], "dt is '0.0'"),
        (["--backend", "nosuch"], "no backend 'nosuch'"),
        (["--plot", "/nosuch/x.png"], "/nosuch"),
    ],
)
def test_arguments_that_cannot_be_used(arguments: list[str], clue: str) -> None:
    result = tutorial(*arguments)
    assert result.exit_code == 2
    assert clue in result.stderr
    assert result.stdout == ""
    assert result.stderr.count("\n") == 1


def test_an_interrupted_run_shows_the_modes_that_are_done(monkeypatch: pytest.MonkeyPatch) -> None:
    all_rows = Tutorial.rows

    def impatient(self: Tutorial) -> Iterator[Row]:
        for number, row in enumerate(all_rows(self)):
            if number == 5:
                signal.raise_signal(signal.SIGINT)
            yield row

    monkeypatch.setattr(Tutorial, "rows", impatient)
    result = tutorial(*QUICK)
    assert result.exit_code == 130
    assert f"interrupted: {len(MODES) - 5} controllers not done" in result.stderr
    assert f"{len(MODES) - 5} controllers not done" in result.stdout
    made = document(*QUICK, code=130)
    assert [mode["mode"] for mode in made["modes"]] + made["not_done"] == list(MODES)
    assert len(made["modes"]) == 5
