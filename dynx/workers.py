"""Worker processes for tasks that may crash or hang, so that only one task fails and not the whole run.

Engines are foreign code that can end the process or never return while they hold the interpreter lock. So
each task runs in a child process, which is reused until it ends; only the task that ended it fails. One
thread waits for each child, which is portable and leaves the main thread free for Ctrl-C. Children run in
their own session and do not receive Ctrl-C; they end with the process that started them, however that ends
(on Windows when their task is done).
"""

from __future__ import annotations

import os
import pickle
import queue
import signal
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Any, Literal

from dynx.errors import DynxError, EngineError, traceback_wanted

WINDOWS_EXCEPTION = 0xC0000000
"""Smallest exit code of a process that an exception of Windows ended, such as an access violation."""

MAX_START_TIME = 120.0
"""Time limit of the start of a process and of the imports of its target [s], unless that of a task is longer.

It is not part of the first task's time: imports of engines take seconds on a busy machine."""

MAX_SIGNAL_DELAY = 0.5
"""Longest time [s] for which a signal to the waiting process can go unnoticed."""

FailureKind = Literal["crash", "timeout", "defect"]

_START = (
    "import sys; lifeline = int(sys.argv[1]); sys.path[:] = sys.argv[2:]; "
    "from dynx.workers import serve; serve(lifeline)"
)

_NO_LIFELINE = -1
"""In place of a pipe where a child inherits none, as on Windows."""


class Lifeline:
    """A pipe by which a child process learns that this one has ended, however it ended.

    Start the child with `pass_fds` and the number `inherited`, let it call `end_with_parent`, and call
    `release` once it has started, `close` once it has ended.
    """

    def __init__(self) -> None:
        self.inherited, self._held = (_NO_LIFELINE, _NO_LIFELINE) if os.name == "nt" else os.pipe()

    @property
    def pass_fds(self) -> tuple[int, ...]:
        """The files that the child inherits."""
        return () if self.inherited == _NO_LIFELINE else (self.inherited,)

    def release(self) -> None:
        """Close the end that the child has inherited."""
        if self.inherited != _NO_LIFELINE:
            os.close(self.inherited)
            self.inherited = _NO_LIFELINE

    def close(self) -> None:
        """Close both ends: the child ends, if it has not."""
        self.release()
        if self._held != _NO_LIFELINE:
            os.close(self._held)
            self._held = _NO_LIFELINE


class EngineCrash(EngineError):
    """An engine ended the process it ran in."""


class EngineTimeout(EngineError):
    """An engine took longer than the time limit of its task."""


class InternalError(DynxError):
    """A defect of dynx: code in a worker process raised an exception that is no `DynxError`."""


_ERRORS = {"crash": EngineCrash, "timeout": EngineTimeout, "defect": InternalError}


@dataclass(frozen=True)
class WorkerFailure:
    """Reason why a task has no value: its process died, took too long, or raised (a defect of dynx)."""

    kind: FailureKind
    message: str

    @property
    def error(self) -> DynxError:
        """The failure as an exception."""
        return _ERRORS[self.kind](self.message)


@dataclass(frozen=True)
class WorkerResult:
    """The outcome of task number `index`: its `value`, or its `failure`."""

    index: int
    value: Any = None
    failure: WorkerFailure | None = None


class Workers:
    """Up to `size` processes that compute ``target(task)`` for each task.

    `target` is a module-level function; tasks and values are pickled. `timeout` [s] is the time limit of one
    task, None for no limit. Use it as a context: leaving it ends the processes, which one call of `run` keeps
    for the next.
    """

    def __init__(self, target: Callable[[Any], Any], size: int, timeout: float | None = None) -> None:
        self._target = target
        self._size = size
        self._timeout = timeout
        self._lock = threading.Lock()
        self._closed = False
        self._alive: set[_Worker] = set()
        self._idle: list[_Worker] = []
        self._threads: list[threading.Thread] = []

    def __enter__(self) -> Workers:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def run(self, tasks: Sequence[Any]) -> Iterator[WorkerResult]:
        """Yield the outcome of every task, in the order of completion."""
        waiting: queue.SimpleQueue[tuple[int, Any]] = queue.SimpleQueue()
        for numbered in enumerate(tasks):
            waiting.put(numbered)
        outcomes: queue.SimpleQueue[WorkerResult] = queue.SimpleQueue()
        threads = [
            threading.Thread(target=self._drive, args=(waiting, outcomes), daemon=True)
            for _ in range(min(self._size, len(tasks)))
        ]
        self._threads += threads
        for thread in threads:
            thread.start()
        for _ in tasks:
            yield _next(outcomes)
        # Their workers are then idle, and the next call takes them.
        for thread in threads:
            thread.join()

    def close(self) -> None:
        """End every process, also during a task."""
        with self._lock:
            self._closed = True
            for worker in self._alive:
                worker.kill()
        for thread in self._threads:
            thread.join()
        for worker in self._idle:
            worker.end()
        self._idle.clear()

    def _drive(
        self, waiting: queue.SimpleQueue[tuple[int, Any]], outcomes: queue.SimpleQueue[WorkerResult]
    ) -> None:
        worker: _Worker | None = None
        try:
            while not self._closed:
                try:
                    index, task = waiting.get_nowait()
                except queue.Empty:
                    worker = self._keep(worker)
                    return
                if worker is not None and worker.ended:
                    self._forget(worker)
                    worker = None
                worker = worker or self._start()
                if worker is None:
                    return
                reply = worker.compute(task, self._timeout)
                if isinstance(reply, WorkerFailure):
                    outcomes.put(WorkerResult(index, failure=reply))
                else:
                    outcomes.put(WorkerResult(index, value=reply[0]))
        finally:
            if worker is not None:
                self._forget(worker)

    def _start(self) -> _Worker | None:
        with self._lock:
            if self._closed:
                return None
            if self._idle:
                return self._idle.pop()
            worker = _Worker(self._target)
            self._alive.add(worker)
            return worker

    def _keep(self, worker: _Worker | None) -> _Worker | None:
        """Keep a worker for the next call of `run`; return one that cannot be kept."""
        if worker is None or worker.ended:
            return worker
        with self._lock:
            if self._closed:
                return worker
            self._idle.append(worker)
        return None

    def _forget(self, worker: _Worker) -> None:
        worker.end()
        with self._lock:
            self._alive.discard(worker)


def _next(outcomes: queue.SimpleQueue[WorkerResult]) -> WorkerResult:
    """Wait for an outcome, and for Ctrl-C.

    A wait without a limit does not notice a signal that arrives as it begins, or that another thread
    receives.
    """
    while True:
        with suppress(queue.Empty):
            return outcomes.get(timeout=MAX_SIGNAL_DELAY)


class _Worker:
    """One child process, and the pipes to it."""

    def __init__(self, target: Callable[[Any], Any]) -> None:
        # Each worker uses one thread for linear algebra, because matrices are small and there are many
        # workers.
        environment = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", **os.environ}
        self._lifeline = Lifeline()
        self._process = subprocess.Popen(
            [sys.executable, "-c", _START, str(self._lifeline.inherited), *sys.path],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            env=environment,
            pass_fds=self._lifeline.pass_fds,
            start_new_session=True,
            creationflags=getattr(subprocess, "CREATE_NEW_PROCESS_GROUP", 0),
        )
        self._lifeline.release()
        self._target = target
        self._has_target = False
        self._expired = False

    @property
    def ended(self) -> bool:
        """True if the process has ended or is being ended."""
        return self._expired or self._process.poll() is not None

    def compute(self, task: Any, timeout: float | None) -> tuple[Any] | WorkerFailure:
        """Return the value of one task in a tuple of one, or the failure."""
        if not self._has_target:
            started = self._exchange(self._target, None if timeout is None else max(timeout, MAX_START_TIME))
            if isinstance(started, WorkerFailure):
                return started
            self._has_target = True
        return self._exchange(task, timeout)

    def _exchange(self, request: Any, timeout: float | None) -> tuple[Any] | WorkerFailure:
        """Send a request and return the reply, which is a failure if it takes more than `timeout` [s]."""
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        timer = None if timeout is None else threading.Timer(timeout, self._expire)
        if timer is not None:
            timer.daemon = True
            timer.start()
        try:
            pickle.dump(request, self._process.stdin)
            self._process.stdin.flush()
            reply: tuple[Any] | WorkerFailure = pickle.load(self._process.stdout)
        except (EOFError, OSError, pickle.UnpicklingError):
            code = self._process.wait()
            if self._expired:
                return WorkerFailure("timeout", f"took more than {timeout:g} s and was ended")
            return WorkerFailure("crash", _describe_exit(code))
        finally:
            if timer is not None:
                timer.cancel()
                timer.join()
        return reply

    def kill(self) -> None:
        """End the process now."""
        self._process.kill()

    def end(self) -> None:
        """End an idle process and close its pipes."""
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._process.kill()
        self._process.wait()
        self._lifeline.close()
        self._process.stdout.close()
        # Closing a pipe flushes it. That fails if the ended process has not read all data, but the pipe is
        # closed.
        try:
            self._process.stdin.close()
        except OSError:
            return

    def _expire(self) -> None:
        self._expired = True
        self.kill()


def serve(lifeline: int = _NO_LIFELINE) -> None:
    """Run in the child: read the target, confirm it, and compute tasks from standard input until it is
    closed. `lifeline` is the pipe whose other end only the parent holds."""
    end_with_parent(lifeline)
    replies = os.fdopen(os.dup(1), "wb")
    _silence()
    requests = sys.stdin.buffer

    def send(reply: tuple[Any] | WorkerFailure) -> None:
        pickle.dump(reply, replies)
        replies.flush()

    target = pickle.load(requests)
    send((None,))
    while True:
        try:
            task = pickle.load(requests)
        except EOFError:
            return
        send(_reply(target, task))


def end_with_parent(lifeline: int) -> None:
    """End this process when its parent has ended. `lifeline` is the number that a `Lifeline` names, in the
    child."""
    if lifeline == _NO_LIFELINE:
        return

    def wait() -> None:
        os.read(lifeline, 1)
        os._exit(1)

    threading.Thread(target=wait, daemon=True).start()
    if sys.platform == "linux":
        import fcntl

        # The thread waits in vain while an engine holds the interpreter's lock. The kernel does not: SIGIO,
        # which it then sends, ends a process that does not handle it.
        signal.signal(signal.SIGIO, signal.SIG_DFL)
        fcntl.fcntl(lifeline, fcntl.F_SETOWN, os.getpid())
        fcntl.fcntl(lifeline, fcntl.F_SETFL, fcntl.fcntl(lifeline, fcntl.F_GETFL) | os.O_ASYNC)


def _reply(target: Callable[[Any], Any], task: Any) -> tuple[Any] | WorkerFailure:
    try:
        return (target(task),)
    except Exception as error:  # Every exception becomes a reply, because it cannot leave the process.
        import traceback

        if traceback_wanted():
            traceback.print_exc()
        return WorkerFailure("defect", f"{type(error).__name__}: {error}")


def _silence() -> None:
    """Discard what engines print, because standard output carries pickles."""
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, 1)
    if not traceback_wanted():
        os.dup2(nowhere, 2)
    os.close(nowhere)


def _describe_exit(code: int) -> str:
    if code >= WINDOWS_EXCEPTION:
        return f"ended its process with the exception {code:#x} of Windows"
    if code < 0:
        try:
            return f"ended its process with {signal.Signals(-code).name}"
        except ValueError:
            return f"ended its process with signal {-code}"
    return f"ended its process with exit code {code}"
