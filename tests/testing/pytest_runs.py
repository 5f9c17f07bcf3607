"""Runs of pytest as users run it: in a directory of theirs, in a process of its own.

`run_forked` forks that process from one that has imported what a run needs, which takes most of the
time of a short run; `run_started` starts an interpreter, for what is about imports or about processes.
Where there is no fork, both start one.
"""

from __future__ import annotations

import multiprocessing
import os
import re
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from importlib.metadata import entry_points
from multiprocessing.context import ForkServerContext, SpawnContext
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
TIMEOUT = 300
"""Longest run [s]."""

OPTIONS = ("-p", "no:cacheprovider")
IMPORTED_BEFORE = (
    *("pytest", "hypothesis", "xdist", "numpy", "pinocchio"),
    *("dynx.testing.plugin", "dynx.testing.agreement_class", "dynx.testing.robot_checks"),
    *("dynx.testing.robot_checks", "dynx.engines.pinocchio.backend", "dynx.engines.pinocchio.as_loaded"),
)
# Assertions of what was imported before cannot be rewritten; none of it has any.
NOT_REWRITTEN = ("-W", "ignore::pytest.PytestAssertRewriteWarning")


@dataclass(frozen=True)
class PytestRun:
    """The exit code of a run of pytest, and its output."""

    code: int
    stdout: str
    stderr: str

    @property
    def outcome(self) -> dict[str, int]:
        """Read the number of tests passed, failed, ... from the last line."""
        last = self.stdout.strip().splitlines()[-1]
        return {
            word: int(number) for number, word in re.findall(r"(\d+) (passed|failed|skipped|error)", last)
        }

    @property
    def output(self) -> str:
        """Exit code and all output, for the message of an assertion."""
        return f"exit code {self.code}\n{self.stdout}{self.stderr}"


def python_path(site: Path) -> list[str]:
    """Return the import path with dynx and its plugin, and `site`, a folder for further packages."""
    if any(point.name == "dynx" for point in entry_points(group="pytest11")):
        return [str(ROOT)]
    # A source tree that was never installed has no entry points.
    information = site / "dynx_plugin-0.dist-info"
    information.mkdir(parents=True)
    (information / "METADATA").write_text("Metadata-Version: 2.1\nName: dynx-plugin\nVersion: 0\n")
    (information / "entry_points.txt").write_text("[pytest11]\ndynx = dynx.testing.plugin\n")
    return [str(ROOT), str(site)]


def run_started(arguments: tuple[str, ...], folder: Path, path: list[str]) -> PytestRun:
    """Run ``python -m pytest`` in `folder`, in a new interpreter."""
    inherited = {name: value for name, value in os.environ.items() if not name.startswith("PYTEST")}
    done = subprocess.run(
        [sys.executable, "-m", "pytest", *OPTIONS, *arguments],
        cwd=folder,
        env={**inherited, "PYTHONPATH": os.pathsep.join(path)},
        capture_output=True,
        text=True,
        timeout=TIMEOUT,
        check=False,
    )
    return PytestRun(done.returncode, done.stdout, done.stderr)


def run_forked(arguments: tuple[str, ...], folder: Path, path: list[str]) -> PytestRun:
    """Run in a process forked from a warm one."""
    with tempfile.TemporaryDirectory() as kept:
        stdout, stderr = Path(kept) / "stdout", Path(kept) / "stderr"
        stdout.touch()
        stderr.touch()
        child = _warm().Process(target=_run_here, args=(arguments, folder, path, stdout, stderr))
        child.start()
        child.join(TIMEOUT)
        if child.exitcode is None:
            child.kill()
            child.join()
        code = child.exitcode
        child.close()
        assert code is not None
        return PytestRun(code, stdout.read_text(encoding="utf-8"), stderr.read_text(encoding="utf-8"))


def _warm() -> ForkServerContext | SpawnContext:
    if "forkserver" not in multiprocessing.get_all_start_methods():
        return multiprocessing.get_context("spawn")
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(list(IMPORTED_BEFORE))
    return context


def _run_here(arguments: tuple[str, ...], folder: Path, path: list[str], stdout: Path, stderr: Path) -> None:
    """Run pytest in this process, which writes to those files, and end the process."""
    for number, file in ((1, stdout), (2, stderr)):
        os.dup2(os.open(file, os.O_WRONLY), number)
    for name in [name for name in os.environ if name.startswith("PYTEST")]:
        del os.environ[name]
    os.chdir(folder)
    sys.path[:0] = [str(folder), *path]
    code = pytest.main([*OPTIONS, *NOT_REWRITTEN, *arguments])
    sys.stdout.flush()
    sys.stderr.flush()
    raise SystemExit(int(code))
