"""`dynx bench`: table, document, exit codes, interruption. No test depends on measured times."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import time
from io import StringIO
from typing import Any

import pytest
from click.testing import CliRunner, Result
from rich.console import Console

import dynx
from dynx.backends.quantities import QUANTITIES
from dynx.bench.cases import BenchmarkCase
from dynx.bench.implementations import Implementation
from dynx.bench.machine import Peak
from dynx.bench.report import BenchWay, document
from dynx.bench.session import BATCHES, QUICK_REPETITIONS, REPETITIONS
from dynx.cli.bench import run_bench, show
from dynx.cli.shell.main import cli
from tests.bench.implementations import Failing, Scaled, session_of

QUICK = ["--quick", "--quantity", "inverse_dynamics", "--batch", "16", "--backends", "reference"]


@pytest.fixture(autouse=True)
def _known_machine(monkeypatch: pytest.MonkeyPatch) -> None:
    """Replace the measurement of the machine, which takes a second."""
    peak = Peak(1, 10e9, 20e9)
    monkeypatch.setattr(
        "dynx.bench.session.Session.measure_machine", lambda self, n: self.peaks.update({n: peak})
    )


def bench(*arguments: str) -> Result:
    return CliRunner().invoke(cli, ["bench", *arguments])


def test_the_options_are_those_of_the_library() -> None:
    text = " ".join(bench("--help").output.split())
    one, few, many = BATCHES
    assert f"(default: {one}, {few} and {many})" in text
    assert f"{QUICK_REPETITIONS} repetitions instead of {REPETITIONS}" in text


def test_a_wrong_quantity_lists_those_of_the_library() -> None:
    result = bench("double_pendulum", "--quantity", "curvature")
    assert result.exit_code == 2
    assert f"known: {', '.join(QUANTITIES).replace('_', '-')} " in result.stderr


def test_a_table_for_each_case() -> None:
    result = bench("planar_2r", *QUICK, "--batch", "1")
    assert result.exit_code == 0
    assert result.stderr == ""
    assert "planar_2r, fixed base, nq 2, nv 2, frame tip, 5 repetitions" in result.stdout
    assert "inverse dynamics, batch 16, 1 thread" in result.stdout
    assert "inverse dynamics, one sample, 1 thread" in result.stdout
    for name in ("reference", "pinocchio C++ batch", "pinocchio binding"):
        assert name in result.stdout
    assert "10 GB/s" in result.stdout
    assert "40 GFLOP/s" in result.stdout


def test_json_has_the_document_alone() -> None:
    result = bench("planar_2r", *QUICK, "--base", "fixed", "--seed", "7", "--threads", "1", "--json")
    assert result.exit_code == 0
    made: dict[str, Any] = json.loads(result.stdout)
    assert (made["robot"], made["seed"], made["repetitions"]) == ("planar_2r", 7, QUICK_REPETITIONS)
    (case,) = made["results"]
    assert (case["quantity"], case["batch"], case["threads"]) == ("inverse_dynamics", 16, 1)
    assert [implementation["way"] for implementation in case["ways"]] == [
        "reference",
        "pinocchio C++ batch",
        "pinocchio binding",
    ]
    for implementation in case["ways"]:
        assert implementation["error"] <= implementation["tolerance"]
        assert implementation["ns"] > 0.0
        assert set(implementation["ratios"]) == {"pinocchio C++ batch", "pinocchio binding"}
    assert made["not_done"] == []


@pytest.mark.parametrize(
    ("arguments", "clue"),
    [
        (["nosuchrobot"], "nosuchrobot"),
        (["double_pendulum", "--quantity", "speed"], "--quantity"),
        (["double_pendulum", "--batch", "0"], "--batch"),
        (["double_pendulum", "--batch", "many"], "--batch"),
        (["double_pendulum", "--batch", str(10**9)], "GB"),
        (["double_pendulum", "--threads", "0"], "--threads"),
        (["double_pendulum", "--backends", "nosuch"], "nosuch"),
        (["double_pendulum", "--frame", "nosuch"], "nosuch"),
        (["double_pendulum", "--base", "flying"], "--base"),
        (["double_pendulum", "--lock", "elbow"], "joint=value"),
        (["double_pendulum", "extra"], "extra"),
        ([], "ROBOT"),
    ],
)
def test_arguments_that_cannot_be_used(arguments: list[str], clue: str) -> None:
    result = bench(*arguments)
    assert result.exit_code == 2
    assert clue in result.stderr
    assert result.stdout == ""
    assert result.stderr.startswith("dynx: error: ")
    assert result.stderr.count("\n") == 1


def run_session(*implementations: Implementation) -> tuple[int, str]:
    """Return the exit code and the table of a session of these implementations."""
    model = dynx.load("double_pendulum")
    with session_of([*implementations], model, (BenchmarkCase("mass_matrix", 4),), repetitions=1) as session:
        session.measure_machine(1)
        code = run_bench(session, json_path=None)
        out = StringIO()
        found = [session.measure(case) for case in session.plan.cases]
        show(Console(file=out, width=10_000), document(session, found, "a processor"))
    return code, out.getvalue()


def test_a_wrong_result_is_reported_with_exit_code_1(capsys: pytest.CaptureFixture[str]) -> None:
    code, table = run_session(Scaled("right"), Scaled("wrong", 1.5))
    assert code == 1
    err = capsys.readouterr().err
    assert err.startswith("dynx: error: wrong, mass matrix: wrong result, not timed: error ")
    assert err.count("\n") == 1
    assert "wrong: wrong result, not timed" in table


def test_an_engine_without_the_quantity_is_no_failure(
    capsys: pytest.CaptureFixture[str],
) -> None:
    code, table = run_session(Failing("one"), Scaled("right"), Failing("other"))
    assert code == 0
    assert capsys.readouterr().err == ""
    assert "one, other: no such luck\n" in table


def test_the_fastest_is_shown_first_and_what_was_not_timed_last() -> None:
    model = dynx.load("double_pendulum")
    case = BenchmarkCase("mass_matrix", 4)
    with session_of([], model, (case,)) as session:
        made = document(session, [], "a processor")
    implementations = [
        implementation("slow", 900.0),
        implementation("not timed", None),
        implementation("fast", 9.0),
    ]
    made["results"] = [{"quantity": "mass_matrix", "batch": 4, "threads": 1, "ways": implementations}]
    out = StringIO()
    show(Console(file=out, width=10_000), made)
    text = out.getvalue()
    assert text.index(" fast ") < text.index(" slow ") < text.index(" not timed ")
    assert "1 case not done" in text


@pytest.mark.parametrize(("load", "reported"), [(None, False), (0.2, False), (3.14, True)])
def test_a_busy_machine_is_reported(load: float | None, reported: bool) -> None:
    model = dynx.load("double_pendulum")
    with session_of([], model, (BenchmarkCase("mass_matrix", 4),)) as session:
        made = document(session, [], "a processor")
    out = StringIO()
    show(Console(file=out, width=10_000), {**made, "load": load})
    assert ("load 3.1 before the run" in out.getvalue()) == reported


def implementation(name: str, ns: float | None) -> BenchWay:
    """Return the entry of an implementation."""
    quartiles = None if ns is None else [ns, ns]
    return {
        "way": name,
        "role": "backend",
        "version": "",
        "threads": 1,
        "samples": 4,
        "error": None,
        "tolerance": None,
        "problem": None,
        "ns": ns,
        "ns_quartiles": quartiles,
        "ratios": {},
        "roofline": None,
    }


@pytest.mark.skipif(sys.platform == "win32", reason="no SIGINT to a child")
def test_an_interrupted_run_shows_what_is_measured() -> None:
    batches = [word for n in range(2, 400) for word in ("--batch", str(n))]
    command = [sys.executable, "-m", "dynx", "bench", "double_pendulum", "--backends", "reference", "--json"]
    for patience in (6.0, 24.0):
        process = subprocess.Popen(
            [*command, *batches], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
        )
        time.sleep(patience)
        process.send_signal(signal.SIGINT)
        out, err = process.communicate(timeout=60.0)
        assert process.returncode == 130
        assert "Traceback" not in err
        assert "not done" in err
        made = json.loads(out)
        assert len(made["results"]) + len(made["not_done"]) == 5 * 398
        if made["results"]:
            break
    assert made["results"]
    assert made["not_done"]
