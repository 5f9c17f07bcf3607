"""Runs of pytest with one module of dynx changed, each forked from a process with loaded imports.

``python -m tests.mutation.warm`` imports what dynx and its tests need from elsewhere, but nothing of dynx,
and then serves requests: a line of JSON on stdin (see `Runner.run`), a line of JSON ``[exit code, output]``
on stdout. The imports take most of the time of a short test, so this is several times as fast as a new
interpreter for each change. Where there is no fork, `Runner` starts one.
"""

from __future__ import annotations

import contextlib
import gc
import json
import os
import shutil
import signal
import subprocess
import sys
import tempfile
from dataclasses import asdict, dataclass
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from types import TracebackType
from typing import Any

ROOT = Path(__file__).resolve().parents[2]
TIMEOUT = 300
"""Largest processor time of the tests of one request [s]."""
WALL_PER_CPU = 10
"""Largest ratio of wall time to processor time of a run, on a machine with other programs."""
TIMED_OUT = (-27, -14)
"""Exit codes of a run that took too long: the negative numbers of SIGPROF and SIGALRM."""

PRELOADED = (
    *("pytest", "numpy", "scipy.spatial.transform", "scipy.linalg.lapack", "mpmath"),
    *("hypothesis", "hypothesis.strategies", "hypothesis.extra.numpy"),
    *("pinocchio", "mujoco", "pydrake.multibody.parsing"),
)
OPTIONS = (
    *("-x", "-q", "-p", "tests.mutation.plant", "-p", "no:xdist", "-p", "no:benchmark"),
    # Modules imported before cannot have their assertions rewritten; none of them has any.
    *("-W", "ignore::pytest.PytestAssertRewriteWarning"),
)


@dataclass(frozen=True)
class Change:
    """Source to import in place of that of a module."""

    module: str
    source: str


class Runner:
    """Context that runs tests with modules changed."""

    def __init__(self) -> None:
        self._server: subprocess.Popen[str] | None = None

    def __enter__(self) -> Runner:
        if hasattr(os, "fork"):
            self._server = self._start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if self._server is not None:
            self._server.communicate()

    def run(self, tests: list[str], change: Change | None = None, timeout: int = TIMEOUT) -> tuple[int, str]:
        """Run tests up to the first failure, for at most `timeout` [s] of processor time.

        Return the exit code of pytest (1: a test failed; or one of `TIMED_OUT`) and its output.
        """
        change_given = None if change is None else asdict(change)
        line = json.dumps({"tests": tests, "timeout": timeout, "change": change_given}) + "\n"
        if self._server is None:
            return json.loads(self._start().communicate(line)[0])  # type: ignore[no-any-return]
        assert self._server.stdin is not None
        assert self._server.stdout is not None
        self._server.stdin.write(line)
        self._server.stdin.flush()
        reply = self._server.stdout.readline()
        if not reply:
            raise EOFError("the warm process has ended")
        code, output = json.loads(reply)
        return code, output

    def interrupt(self) -> None:
        """End the run in progress in another thread, which then raises EOFError."""
        if self._server is not None:
            self._server.send_signal(signal.SIGINT)

    @staticmethod
    def _start() -> subprocess.Popen[str]:
        return subprocess.Popen(
            [sys.executable, "-m", "tests.mutation.warm"],
            cwd=ROOT,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )


def serve() -> None:
    """Serve requests until stdin ends; without fork a single one."""
    for name in PRELOADED:
        if find_spec(name.partition(".")[0]) is not None:
            import_module(name)
    assert not any(name == "dynx" or name.startswith("dynx.") for name in sys.modules)
    # pytest collects garbage at its end; modules imported by now are never any, so the collector skips them.
    gc.freeze()
    replies = os.fdopen(os.dup(1), "w")
    with tempfile.TemporaryDirectory() as folder:
        if sys.dont_write_bytecode:
            # Later runs read the bytecode that one run writes, which halves the time of most. A changed
            # module never writes any (`tests.mutation.plant`).
            sys.pycache_prefix, sys.dont_write_bytecode = folder, False
        # Processes that the tests start import the changed module too: Python runs a module of this name.
        shutil.copy(Path(__file__).with_name("plant.py"), Path(folder, "sitecustomize.py"))
        for line in sys.stdin:
            request = json.loads(line)
            if request["change"] is not None:
                request["change"] = write_change(Path(folder, "change.json"), request["change"])
            with tempfile.TemporaryFile() as output:
                run = run_in_child if hasattr(os, "fork") else run_here
                code = run(request, output.fileno())
                output.seek(0)
                print(json.dumps([code, output.read().decode(errors="replace")]), file=replies, flush=True)


def write_change(path: Path, change: dict[str, str]) -> str:
    path.write_text(json.dumps(change), encoding="utf-8")
    return str(path)


def run_in_child(request: dict[str, Any], output: int) -> int:
    """Run the tests in a forked process that writes to the file descriptor `output`; return its exit code."""
    child = os.fork()
    if child == 0:
        code = 3
        try:
            os.setpgid(0, 0)
            code = run_here(request, output)
        finally:
            os._exit(code)
    try:
        _, status = os.waitpid(child, 0)
    finally:
        # Ends the child if this process is interrupted, and processes that the tests have left.
        with contextlib.suppress(ProcessLookupError, PermissionError):
            os.killpg(child, signal.SIGKILL)
    return os.waitstatus_to_exitcode(status)


def run_here(request: dict[str, Any], output: int) -> int:
    """Run the tests in this process, writing to the file descriptor `output`; return pytest's exit code."""
    if hasattr(signal, "setitimer"):
        # A change may be one that never ends; the timers end the process, which is then no failed test.
        signal.setitimer(signal.ITIMER_PROF, request["timeout"])
        signal.setitimer(signal.ITIMER_REAL, request["timeout"] * WALL_PER_CPU)
    nothing = os.open(os.devnull, os.O_RDONLY)
    os.dup2(nothing, 0)
    os.dup2(output, 1)
    os.dup2(output, 2)
    os.environ["HYPOTHESIS_PROFILE"] = "mutation"
    if request["change"] is not None:
        os.environ["DYNX_PLANT"] = request["change"]
        others = filter(None, [os.environ.get("PYTHONPATH")])
        os.environ["PYTHONPATH"] = os.pathsep.join([str(Path(request["change"]).parent), *others])
        # Kernels are compiled anew: those in the cache are from the source on the disk.
        os.environ["DYNX_CACHE"] = "0"
    import pytest

    code = int(pytest.main([*OPTIONS, *request["tests"]]))
    sys.stdout.flush()
    sys.stderr.flush()
    return code


if __name__ == "__main__":
    serve()
