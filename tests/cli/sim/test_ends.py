"""End of `dynx sim`: files, exit codes, divergence, interruption, resuming."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

from dynx.errors import ArgumentError
from dynx.sim import Rollout
from tests.cli.sim.command import SHORT, document, sim


@pytest.mark.parametrize("ending", [".npz", ".csv"])
def test_files_that_are_saved(ending: str, tmp_path: Path) -> None:
    target = tmp_path / f"out{ending}"
    assert sim("ur5", *SHORT, "--save", str(target)).exit_code == 0
    assert target.stat().st_size > 1000
    assert [path.name for path in tmp_path.iterdir()] == [target.name]


def test_a_plot_is_drawn(tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    target = tmp_path / "out.png"
    assert sim("ur5", *SHORT, "--plot", str(target)).exit_code == 0
    assert target.read_bytes().startswith(b"\x89PNG")


def test_a_record_is_resumed_to_the_last_bit(tmp_path: Path) -> None:
    whole, part = tmp_path / "whole.npz", tmp_path / "part.npz"
    noisy = ["--noise-v", "1e-3", "--payload", "tool0:1", "--control-dt", "0.002", "--controller", "pid"]
    assert sim("ur5", *SHORT, *noisy, "--save", str(whole)).exit_code == 0
    again = sim("ur5", *SHORT, *noisy, "--resume", str(whole), "--resume-step", "17", "--save", str(part))
    assert again.exit_code == 0
    np.testing.assert_array_equal(Rollout.load(part).q, Rollout.load(whole).q)
    other = sim("ur5", *SHORT, "--resume", str(whole))
    assert other.exit_code == 2
    assert "the rollout to resume" in other.stderr


DIVERGING = ["ur5", "--controller", "none", "--v0", "1e4,1e4,1e4,1e4,1e4,1e4"]


@pytest.mark.parametrize("damage", ["truncated", "compression", "header", "path"])
def test_a_record_that_is_damaged_is_refused(damage: str, tmp_path: Path) -> None:
    record = tmp_path / "out.npz"
    assert sim("ur5", *SHORT, "--save", str(record)).exit_code == 0
    data = record.read_bytes()
    changed = {
        "truncated": data[: len(data) // 2],
        # The method of compression in every header, and the text of an array's header.
        "compression": data.replace(
            b"PK\x01\x02\x2d\x03\x2d\x00\x00\x00\x00\x00", b"PK\x01\x02\x2d\x03\x2d\x00\x00\x00\x63\x00"
        ),
        "header": data.replace(b"'shape': (", b"'shape': ((("),
        "path": data.replace(b"PK", b"Pk"),
    }
    record.write_bytes(changed[damage])
    result = sim("ur5", *SHORT, "--resume", str(record))
    assert result.exit_code == 2
    assert f"{record} cannot be read as a rollout" in result.stderr


def test_a_simulation_that_diverges_keeps_its_record(tmp_path: Path) -> None:
    target = tmp_path / "out.npz"
    result = sim(*DIVERGING, "--save", str(target))
    assert result.exit_code == 1
    assert result.stderr.count("\n") == 1
    assert "diverged in step 3, at 0.003 s" in result.stderr
    assert f"the results so far are in {target}" in result.stderr
    assert "--resume" not in result.stderr
    assert "3 steps of 0.001 s" in result.stdout
    assert len(Rollout.load(target)) == 3
    made = document(*DIVERGING, code=1)
    assert (made["status"], made["steps"], made["steps_asked"]) == ("diverged", 3, 2000)
    error = made["error"]
    assert (error["type"], error["step"], error["time"], len(error["v"])) == ("DivergedError", 3, 0.003, 6)


def test_an_invalid_torque_is_not_reported_as_divergence(monkeypatch: pytest.MonkeyPatch) -> None:
    # No gain below the bound overflows.
    monkeypatch.setattr("dynx.model.numbers.MAX_MAGNITUDE", np.inf)
    made = document("ur5", *SHORT, "--kp", "1e308", "--q0", "1,1,1,1,1,1", code=1)
    assert made["status"] == "control failed"
    assert made["error"]["type"] == "ControlError"
    assert made["steps"] == 0


def test_a_record_that_cannot_be_written_leaves_the_table(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(self: Rollout, path: str) -> None:
        raise ArgumentError(f"{path} cannot be written: no space left")

    monkeypatch.setattr(Rollout, "save", full)
    result = sim("ur5", *SHORT, "--save", str(tmp_path / "out.npz"))
    assert result.exit_code == 2
    assert "largest error" in result.stdout
    assert result.stderr.endswith("cannot be written: no space left\n")


def test_an_output_that_cannot_be_written_does_not_lose_the_others(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    save = Rollout.save
    first, second, third = (str(tmp_path / f"{k}.{suffix}") for k, suffix in enumerate(("npz", "csv", "png")))

    def full(self: Rollout, path: str) -> None:
        if path == first:
            raise ArgumentError(f"{path} cannot be written: no space left")
        save(self, path)

    monkeypatch.setattr(Rollout, "save", full)
    result = sim("ur5", *SHORT, "--save", first, "--save", second, "--plot", third, "--json")
    assert result.exit_code == 2
    assert json.loads(result.stdout)["files"] == [second, third]
    assert {str(path) for path in tmp_path.iterdir()} == {second, third}
    assert result.stderr == f"dynx: error: {first} cannot be written: no space left\n"


def test_a_plot_without_matplotlib_names_the_extra(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    monkeypatch.setitem(sys.modules, "matplotlib.figure", None)
    for arguments in (["ur5", *SHORT], ["--tutorial"]):
        result = sim(*arguments, "--plot", str(tmp_path / "out.png"))
        assert result.exit_code == 2
        assert "pip install 'dynx[plot]'" in result.stderr
        assert result.stdout == ""


@pytest.mark.skipif(sys.platform == "win32", reason="no SIGINT to a child")
@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_an_interrupted_run_keeps_what_is_done(number: int, code: int, tmp_path: Path) -> None:
    target = tmp_path / "out.npz"
    # A slow plant, so that the run is not complete when the signal arrives.
    start = [sys.executable, "-m", "dynx", "sim", "six_axis_arm", "--to", "joint3=1", "--plant", "reference"]
    start += ["--duration", "200", "--save", str(target)]
    for patience in (4.0, 16.0, 64.0):
        process = subprocess.Popen(start, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        time.sleep(patience)
        process.send_signal(number)
        out, err = process.communicate(timeout=60.0)
        if target.exists() and len(Rollout.load(target)):
            break
    assert process.returncode == code
    assert "Traceback" not in err
    assert err.count("\n") == 1
    assert "interrupted after " in err
    assert f"the same command with --resume {target} continues" in err
    assert "largest error" in out
    assert 0 < len(Rollout.load(target)) < 200_000


def test_an_interrupted_run_is_resumed_to_the_last_bit(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    part, rest, whole = (tmp_path / f"{name}.npz" for name in ("part", "rest", "whole"))
    arguments = ["ur5", "--to", "elbow_joint=1", "--noise-q", "1e-5", "--dt", "0.0001"]
    assert sim(*arguments, "--save", str(whole)).exit_code == 0

    @contextmanager
    def impatient(total: int, words: str) -> Iterator[Callable[[int, str], None]]:
        def advance(taken: int, words: str) -> None:
            if 0 < taken < total:
                signal.raise_signal(signal.SIGINT)

        yield advance

    with monkeypatch.context() as patched:
        patched.setattr("dynx.cli.sim.run.progress_bar", impatient)
        interrupted = sim(*arguments, "--save", str(part))
    assert interrupted.exit_code == 130
    assert "interrupted after " in interrupted.stderr
    assert 0 < len(Rollout.load(part)) < 20_000
    assert sim(*arguments, "--resume", str(part), "--save", str(rest)).exit_code == 0
    np.testing.assert_array_equal(Rollout.load(rest).q, Rollout.load(whole).q)
