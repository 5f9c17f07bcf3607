"""A worker does not outlive the command that started it, whatever it computes and however that ends."""

from __future__ import annotations

import ctypes
import os
import re
import signal
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest

from dynx.workers import Workers

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="processes are looked up in /proc")

ROOT = Path(__file__).parents[2]

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


KILLING = [signal.SIGTERM, signal.SIGKILL, signal.SIGHUP]
"""What ends a command: a polite kill, a plain one, and a terminal that closes."""


@pytest.mark.parametrize("number", KILLING)
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
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    command = subprocess.Popen([sys.executable, "-c", program], cwd=ROOT, env=environment)
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


def children(process: int) -> list[int]:
    """Return the numbers of the processes that a process started."""
    found = []
    for entry in os.listdir("/proc"):
        if entry.isdigit():
            with suppress(FileNotFoundError, ProcessLookupError):
                fields = Path(f"/proc/{entry}/stat").read_text(encoding="utf-8").rpartition(")")[2].split()
                if int(fields[1]) == process and fields[0] != "Z":
                    found.append(int(entry))
    return found


def staying(process: int) -> list[int]:
    """Return those that last: loading a library may start a program for a moment."""
    found = children(process)
    time.sleep(0.1)
    return [each for each in children(process) if each in found]


ENDLESS = (
    '<robot name="r" xmlns:xacro="http://www.ros.org/wiki/xacro">'
    '<xacro:property name="n" value="${max(range(10**12))}"/><link name="base${n}"/></robot>'
)
"""A file whose expansion counts for hours, in one call that holds the interpreter's lock."""

BODY = '<body pos="0 0 0.1"><joint damping="0.1" armature="0.01"/><geom size="0.05"/>'
CHAIN = f"<mujoco><worldbody>{BODY * 12}{'</body>' * 12}</worldbody></mujoco>"
"""A robot in MJCF whose importers drop something of each joint, so that the doctor is busy for a while."""

COMMANDS: dict[str, list[str]] = {
    "doctor": ["doctor", "ur5", "--jobs", "1"],
    "agree": ["agree", "ur5", "--jobs", "1"],
    "contacts": ["contacts", "--jobs", "1"],
    "importers": ["doctor", "chain.xml", "--jobs", "1"],
    "xacro": ["id", "endless.xacro"],
}
"""A command for each module that starts processes."""


def starters() -> set[str]:
    """Return the modules of dynx that start processes, by their text."""
    return {
        path.relative_to(ROOT).as_posix()
        for path in (ROOT / "dynx").rglob("*.py")
        if re.search(
            r"\b(Workers|Popen|Pool|Process)\(|subprocess\.run\(|os\.fork\(", path.read_text("utf-8")
        )
    }


def test_no_other_module_starts_processes() -> None:
    assert starters() == {
        "dynx/workers.py",
        "dynx/cli/shell/run.py",  # doctor and agree
        "dynx/contacts/run.py",
        "dynx/doctor/examination.py",  # engines that read MJCF or SDF by themselves
        "dynx/model/xacro_reading.py",
    }


@pytest.mark.long_cases
@pytest.mark.parametrize("number", KILLING)
@pytest.mark.parametrize("name", COMMANDS)
def test_no_process_outlives_a_killed_command(name: str, number: signal.Signals, tmp_path: Path) -> None:
    if name == "xacro":
        pytest.importorskip("xacro")
    (tmp_path / "endless.xacro").write_text(ENDLESS, encoding="utf-8")
    (tmp_path / "chain.xml").write_text(CHAIN, encoding="utf-8")
    line = [sys.executable, "-P", "-m", "dynx", *COMMANDS[name]]
    quiet = subprocess.DEVNULL
    command = subprocess.Popen(
        line, cwd=tmp_path, env={**os.environ, "PYTHONPATH": str(ROOT)}, stdout=quiet, stderr=quiet
    )
    started: list[int] = []
    try:
        assert until(lambda: staying(command.pid) or command.poll() is not None)
        started += children(command.pid)
        assert started, "the command ended without a process of its own"
        time.sleep(0.5)  # some of them have begun their work by then
        started += children(command.pid)
        command.send_signal(number)
        command.wait()
        assert until(lambda: not any(map(lives, started)))
    finally:
        command.kill()
        command.wait()
        for process in filter(lives, started):
            os.kill(process, signal.SIGKILL)


def test_closed_workers_leave_no_file_open() -> None:
    def count() -> int:
        return len(os.listdir("/proc/self/fd"))

    before = count()
    for _ in range(3):
        with Workers(os.path.basename, 2) as workers:
            assert sorted(result.value for result in workers.run(["a/b", "c/d"])) == ["b", "d"]
    assert count() == before
