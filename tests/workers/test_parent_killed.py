"""A worker does not outlive the command that started it, whatever it computes and however that ends."""

from __future__ import annotations

import ctypes
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest

from dynx.workers import Workers

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="processes are looked up in /proc")

LONG = 120
"""Time that a task takes [s], if nothing ends it."""


def sleep(file: str) -> None:
    """Write the number of this process to a file, and sleep."""
    Path(file).write_text(str(os.getpid()), encoding="utf-8")
    time.sleep(LONG)


def hold_the_lock(file: str) -> None:
    """Sleep as an engine does that holds the interpreter's lock."""
    Path(file).write_text(str(os.getpid()), encoding="utf-8")
    ctypes.PyDLL(None).sleep(LONG)


def lives(process: int) -> bool:
    """Check whether a process has not ended."""
    try:
        state = Path(f"/proc/{process}/stat").read_text(encoding="utf-8").rpartition(")")[2].split()[0]
    except (FileNotFoundError, ProcessLookupError):
        return False
    return state != "Z"


def until(condition: Any, most: float = 30.0) -> bool:
    end = time.monotonic() + most
    while not condition():
        if time.monotonic() > end:
            return False
        time.sleep(0.02)
    return True


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGKILL])
def test_workers_end_with_a_killed_command(number: signal.Signals, tmp_path: Path) -> None:
    files = {name: tmp_path / name for name in ("sleep", "hold_the_lock")}
    program = (
        "import sys, threading\n"
        "from dynx.workers import Workers\n"
        "from tests.workers.test_parent_killed import hold_the_lock, sleep\n"
        "def run(target, file):\n"
        "    with Workers(target, 1) as workers:\n"
        "        list(workers.run([file]))\n"
        f"threading.Thread(target=run, args=(sleep, {str(files['sleep'])!r}), daemon=True).start()\n"
        f"run(hold_the_lock, {str(files['hold_the_lock'])!r})\n"
    )
    root = Path(__file__).parents[2]
    environment = {**os.environ, "PYTHONPATH": str(root)}
    command = subprocess.Popen([sys.executable, "-c", program], cwd=root, env=environment)
    workers: list[int] = []
    try:
        for file in files.values():
            assert until(lambda file=file: file.exists() and file.read_text(encoding="utf-8"))
            workers.append(int(file.read_text(encoding="utf-8")))
        assert all(map(lives, workers))
        command.send_signal(number)
        command.wait()
        assert until(lambda: not any(map(lives, workers)), 10.0)
    finally:
        command.kill()
        for worker in filter(lives, workers):
            os.kill(worker, signal.SIGKILL)


def test_closed_workers_leave_no_file_open() -> None:
    def count() -> int:
        return len(os.listdir("/proc/self/fd"))

    before = count()
    for _ in range(3):
        with Workers(os.path.basename, 2) as workers:
            assert sorted(result.value for result in workers.run(["a/b", "c/d"])) == ["b", "d"]
    assert count() == before
