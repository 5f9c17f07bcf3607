"""Runs tests with a fault planted, each run in a process of its own, forked from a warm one.

``python -m tests.faults.warm`` imports what dynx and its tests need from elsewhere, but nothing of
dynx, and then answers requests: a line of JSON ``[fault, test, ...]`` on stdin, a line of JSON
``[exit code, output]`` on stdout. The imports take most of the time of a short test, so this is
several times as fast as a new interpreter for each fault. Where there is no fork, `Runner` starts one.
"""

from __future__ import annotations

import gc
import json
import os
import signal
import subprocess
import sys
import tempfile
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from types import TracebackType

ROOT = Path(__file__).resolve().parents[2]
TIMEOUT = 300
"""Longest run of the tests of one request [s]."""

IMPORTED_BEFORE = (
    *("pytest", "numpy", "scipy.spatial.transform", "scipy.linalg.lapack", "mpmath"),
    *("hypothesis", "hypothesis.strategies", "hypothesis.extra.numpy"),
    *("pinocchio", "mujoco", "pydrake.multibody.parsing"),
)
OPTIONS = (
    *("-x", "-q", "-p", "tests.faults.plant", "-p", "no:xdist", "-p", "no:benchmark"),
    # What was imported before cannot have its assertions rewritten; none of it has any.
    *("-W", "ignore::pytest.PytestAssertRewriteWarning"),
)


def environment(fault: str) -> dict[str, str]:
    """What is set in the process that runs tests with the fault of that name; "" plants none.

    With a fault kernels are compiled anew: those in the cache are from the source on the disk.
    """
    cache = "0" if fault else os.environ.get("DYNX_CACHE", "")
    return {"DYNX_FAULT": fault, "HYPOTHESIS_PROFILE": "faults", "DYNX_CACHE": cache}


class Runner:
    """Runs tests with faults planted; use it in a with block."""

    def __init__(self) -> None:
        self._warm: subprocess.Popen[str] | None = None

    def __enter__(self) -> Runner:
        if hasattr(os, "fork"):
            self._warm = subprocess.Popen(
                [sys.executable, "-m", "tests.faults.warm"],
                cwd=ROOT,
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                text=True,
            )
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if self._warm is not None:
            self._warm.communicate()

    def run(self, tests: list[str], fault: str) -> tuple[int, str]:
        """The exit code of pytest (1: tests ran and one failed) and what it said."""
        if self._warm is None:
            done = subprocess.run(
                [sys.executable, "-m", "pytest", *OPTIONS, *tests],
                cwd=ROOT,
                env={**os.environ, **environment(fault)},
                capture_output=True,
                text=True,
                timeout=TIMEOUT,
                check=False,
            )
            return done.returncode, done.stdout + done.stderr
        assert self._warm.stdin is not None
        assert self._warm.stdout is not None
        self._warm.stdin.write(json.dumps([fault, *tests]) + "\n")
        self._warm.stdin.flush()
        code, output = json.loads(self._warm.stdout.readline())
        return code, output


def serve() -> None:
    """Answer requests until stdin ends."""
    for name in IMPORTED_BEFORE:
        if find_spec(name.partition(".")[0]) is not None:
            import_module(name)
    assert not any(name == "dynx" or name.startswith("dynx.") for name in sys.modules)
    # pytest collects garbage at its end; what is imported by now never is any, and is not to be looked at.
    gc.freeze()
    with tempfile.TemporaryDirectory() as compiled:
        if sys.dont_write_bytecode:
            # What one run compiles, and pytest rewrites, the next ones read: half the time of most. A
            # planted fault is never among it (`tests.faults.plant`).
            sys.pycache_prefix, sys.dont_write_bytecode = compiled, False
        for line in sys.stdin:
            fault, *tests = json.loads(line)
            code, said = in_a_child(tests, fault)
            print(json.dumps([code, said]), flush=True)


def in_a_child(tests: list[str], fault: str) -> tuple[int, str]:
    """The exit code of a forked process that runs the tests, and what it wrote."""
    with tempfile.TemporaryFile() as output:
        child = os.fork()
        if child == 0:
            run_here(tests, fault, output.fileno())
        _, status = os.waitpid(child, 0)
        output.seek(0)
        return os.waitstatus_to_exitcode(status), output.read().decode(errors="replace")


def run_here(tests: list[str], fault: str, output: int) -> None:
    """Run the tests in this process, writing to the file descriptor `output`, and end the process."""
    code = 3
    # A fault may be one that never ends; the alarm ends the process, which is then no test failure.
    signal.alarm(TIMEOUT)
    try:
        nothing = os.open(os.devnull, os.O_RDONLY)
        os.dup2(nothing, 0)
        os.dup2(output, 1)
        os.dup2(output, 2)
        os.environ.update(environment(fault))
        import pytest

        code = int(pytest.main([*OPTIONS, *tests]))
    finally:
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(code)


if __name__ == "__main__":
    serve()
