"""Victims of attacks: each in a process of its own under strace, or all in one after another.

A process of its own is what a user starts; one for all imports once, so that most attacks take milliseconds.
"""

from __future__ import annotations

import contextlib
import gc
import importlib
import io
import json
import os
import re
import resource
import shutil
import signal
import subprocess
import sys
import time
import traceback
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path
from types import FrameType

from tests.security.attack import (
    MEMORY,
    REPOSITORY,
    TIME,
    Attack,
    Box,
    Outcome,
    contents,
    events_of,
    faults,
    make_box,
)

WATCHED = Path(__file__).parent / "watched"

PATIENCE = 3.0
"""Factor of TIME after which a victim is killed: other programs may run, so TIME is that of the processor."""

TOLERANCE = 1.3
"""Factor of MEMORY above which a victim is killed."""

_TRACED = "trace=execve,execveat,connect,open,openat,openat2,creat"


def environment(folder: Path, log: Path) -> dict[str, str]:
    """Return the environment of a victim, with a temporary folder of its own and a report of events."""
    (folder / "tmp").mkdir(exist_ok=True)
    return {
        **os.environ,
        "PYTHONPATH": os.pathsep.join([str(WATCHED), str(REPOSITORY)]),
        "PYTHONDONTWRITEBYTECODE": "1",
        "TMPDIR": str(folder / "tmp"),
        "HOME": str(folder / "tmp"),
        "MPLBACKEND": "agg",
        "DYNX_CACHE_DIR": os.environ.get("DYNX_CACHE_DIR", str(folder / "tmp" / "cache")),
        "DYNX_ATTACK_LOG": str(log),
        "NO_COLOR": "1",
    }


def attacked_apart(attack: Attack, folder: Path) -> list[str]:
    """Let a victim take up an attack in a process of its own, under strace where it is installed; return
    what is wrong with its end."""
    box = make_box(folder / re.sub(r"\W", "_", attack.key))
    deed = attack.prepare(box)
    before = contents(box.outside)
    program = ["-m", "tests.security.doors", deed.door] if deed.door else ["-m", "dynx"]
    command = [sys.executable, "-P", *program, *deed.words]
    trace = box.root / "strace"
    if shutil.which("strace"):
        command = [
            "strace",
            "-f",
            "--seccomp-bpf",
            "-qq",
            "-s",
            "4096",
            "-e",
            _TRACED,
            "-o",
            str(trace),
            *command,
        ]
    log = box.root / "events"
    with open(box.root / "output", "wb") as output:
        begin, before_it = time.monotonic(), _time_of_children()
        process = subprocess.Popen(
            command,
            cwd=box.here,
            stdin=subprocess.DEVNULL,
            stdout=output,
            stderr=subprocess.STDOUT,
            env=environment(folder, log),
            start_new_session=True,
        )
        memory, killed = 0, False
        while process.poll() is None:
            memory = max(memory, _memory_of_session(process.pid))
            if time.monotonic() - begin > PATIENCE * TIME or memory > TOLERANCE * MEMORY:
                killed = True
                with contextlib.suppress(ProcessLookupError):
                    os.killpg(process.pid, signal.SIGKILL)
            time.sleep(0.03)
        seconds = _time_of_children() - before_it
    text = (box.root / "output").read_text(encoding="utf-8", errors="replace")
    events = events_of(log) + _traced_events(trace, box)
    outcome = Outcome(None if killed else process.returncode, text, seconds, memory, events)
    return faults(attack, box, deed, outcome, before)


def _time_of_children() -> float:
    """Return the time that the processor spent on ended children of this process [s]."""
    return sum(resource.getrusage(resource.RUSAGE_CHILDREN)[:2])


def _memory_of_session(session: int) -> int:
    """Return the memory of the processes of a session [bytes]."""
    total = 0
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit():
            with contextlib.suppress(OSError, ValueError, IndexError):
                after_name = (entry / "stat").read_text().rpartition(")")[2].split()
                if int(after_name[3]) == session:
                    total += int((entry / "statm").read_text().split()[1])
    return total * os.sysconf("SC_PAGE_SIZE")


_CALL = re.compile(
    r'(execve|execveat|open|openat|openat2|creat)\((?:AT_FDCWD, )?"((?:[^"\\]|\\.)*)"(.*)= (\d+)'
)
_CONNECT = re.compile(r'connect\(.*?(?:inet_addr\("|inet_pton\(AF_INET6, ")([^"]+)"')


def _traced_events(trace: Path, box: Box) -> list[tuple[str, str]]:
    """Return what strace saw succeed."""
    if not trace.exists():
        return []
    found = []
    for line in trace.read_text(encoding="utf-8", errors="replace").splitlines():
        call, connect = _CALL.search(line), _CONNECT.search(line)
        if call is not None:
            kind, path = call[1], call[2].encode("latin-1").decode("unicode_escape")
            path = path.encode("latin-1", "replace").decode("utf-8", "replace")
            event = "execve" if kind.startswith("exec") else "open"
            found.append((event, os.path.normpath(os.path.join(box.here, path))))
        if connect is not None:
            found.append(("connect", connect[1]))
    return found


def attacked_together(attacks: Sequence[Attack], folder: Path) -> dict[str, list[str]]:
    """Let one process take up attacks one after another; return what is wrong with each end."""
    prepared = []
    for number, attack in enumerate(attacks):
        box = make_box(folder / str(number))
        deed = attack.prepare(box)
        prepared.append((attack, box, deed, contents(box.outside)))
    jobs = [
        {"here": str(box.here), "door": deed.door, "words": list(deed.words)} for _, box, deed, _ in prepared
    ]
    (folder / "jobs").write_text(json.dumps(jobs))
    log, found = folder / "events", dict[str, list[str]]()
    ended = ""
    for number, (attack, box, deed, before) in enumerate(prepared):
        result = box.root / "outcome"
        if not result.exists():
            ended = _process_of_all(folder, log, number)
        if result.exists():
            outcome = Outcome(**json.loads(result.read_text()))
            outcome.events = [(event, what) for event, what in outcome.events]
        else:
            outcome = Outcome(-1, f"the process ended {ended}", 0.0, 0)
        found[attack.key] = faults(attack, box, deed, outcome, before)
    return found


def _process_of_all(folder: Path, log: Path, first: int) -> str:
    """Let a process take up attacks from the first on, until one ends it; return how it ended."""
    run = subprocess.run(
        [sys.executable, "-P", "-m", "tests.security.victims", str(folder / "jobs"), str(log), str(first)],
        env=environment(folder, log),
        cwd=folder,
        capture_output=True,
        text=True,
    )
    return f"with {run.returncode}: {run.stderr[-500:]}"


def main(jobs: str, log: str, first: str) -> None:
    """Take up attacks in this process, from one on."""
    for job in json.loads(Path(jobs).read_text())[int(first) :]:
        here = Path(job["here"])
        os.chdir(here)
        start = os.path.getsize(log)
        outcome = _ended(job["door"], job["words"], here.parent / "output")
        with open(log, "rb") as events:
            events.seek(start)
            outcome.events = [(e, what) for e, what in map(json.loads, events.read().splitlines())]
        (here.parent / "outcome").write_text(json.dumps(asdict(outcome)))


def _ended(door: str, words: list[str], output: Path) -> Outcome:
    gc.collect()
    with contextlib.suppress(OSError):
        Path("/proc/self/clear_refs").write_text("5")
    resting = _high_water()
    begin = time.monotonic()
    code: int | None = 0
    with _redirected(output), _alarm(TIME):
        try:
            if door:
                importlib.import_module("tests.security.doors").run(door, words)
            else:
                importlib.import_module("dynx.cli.shell.main").cli.main(list(words), prog_name="dynx")
        except SystemExit as end:
            code = end.code if isinstance(end.code, int) else 1
        except _TooLong:
            code = None
        except BaseException:
            traceback.print_exc()
            code = 1
    # What was imported before belongs to no attack; a fresh process needs less than 0.5 GB for it.
    used = max(0, _high_water() - resting)
    text = output.read_text(encoding="utf-8", errors="replace")
    return Outcome(code, text, time.monotonic() - begin, used)


def _high_water() -> int:
    """Return the largest memory of this process since it was reset [bytes]."""
    status = Path("/proc/self/status")
    if not status.exists():
        return 0
    return 1024 * int(re.search(r"VmHWM:\s+(\d+)", status.read_text())[1])  # type: ignore[index]


class _TooLong(BaseException):
    """A victim took longer than TIME."""


@contextmanager
def _alarm(seconds: float) -> Iterator[None]:
    def stop(_: int, __: FrameType | None) -> None:
        raise _TooLong

    signal.signal(signal.SIGALRM, stop)
    signal.setitimer(signal.ITIMER_REAL, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)


@contextmanager
def _redirected(path: Path) -> Iterator[None]:
    """Write standard output and standard error, also those of engines, to a file."""
    kept, streams = (os.dup(1), os.dup(2)), (sys.stdout, sys.stderr)
    with open(path, "wb") as file:
        for stream in (1, 2):
            os.dup2(file.fileno(), stream)
        sys.stdout, sys.stderr = (
            io.TextIOWrapper(os.fdopen(os.dup(each), "wb", 0), "utf-8", write_through=True) for each in (1, 2)
        )
        try:
            yield
        finally:
            sys.stdout.close()
            sys.stderr.close()
            sys.stdout, sys.stderr = streams
            for stream, before in zip((1, 2), kept, strict=True):
                os.dup2(before, stream)
                os.close(before)


if __name__ == "__main__":
    main(*sys.argv[1:])
