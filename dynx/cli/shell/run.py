"""The robots of one command in worker processes, with progress on a terminal."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Sequence
from typing import Any, Generic, Protocol, TypeVar

from dynx.cli.shell.exits import complain
from dynx.cli.shell.interruption import interruptible
from dynx.cli.shell.progress import progress_bar
from dynx.cli.shell.terminal import counted
from dynx.errors import DynxError, EngineError
from dynx.workers import Failure, Workers


class RobotTask(Protocol):
    """What is to be done with one robot."""

    @property
    def robot(self) -> str:
        """The robot as the user named it."""


Task = TypeVar("Task", bound=RobotTask)
Result = TypeVar("Result")


class EngineCrash(EngineError):
    """An engine ended the process it ran in."""


class EngineTimeout(EngineError):
    """An engine took longer than it was given."""


class InternalError(DynxError):
    """dynx raised what it should not have raised."""


_OF_KIND = {"crash": EngineCrash, "timeout": EngineTimeout, "defect": InternalError}


def error_of(failure: Failure) -> DynxError:
    """The error that says why a worker process gave no answer."""
    return _OF_KIND[failure.kind](failure.message)


class Run(Generic[Task, Result]):
    """The robots of one command, and the results that are there so far.

    ``target(task)`` is done in a worker process; ``failed(task, failure)`` is the result of a task of
    which that process died, and ``progress(results)`` the words beside the bar.
    """

    def __init__(
        self,
        tasks: Sequence[Task],
        target: Callable[[Task], Result],
        failed: Callable[[Task, Failure], Result],
        progress: Callable[[Sequence[Result]], str],
    ) -> None:
        self.tasks = list(tasks)
        self.seconds = 0.0
        self._target = target
        self._failed = failed
        self._words = progress
        self._results: dict[int, Result] = {}

    @property
    def results(self) -> list[Result]:
        """The results that are there, in the order of the robots."""
        return [self._results[index] for index in sorted(self._results)]

    @property
    def done(self) -> list[int]:
        """The numbers of the tasks that have a result: `results` are theirs, in this order."""
        return sorted(self._results)

    @property
    def not_done(self) -> list[str]:
        """The robots of the tasks that have no result."""
        return [task.robot for index, task in enumerate(self.tasks) if index not in self._results]

    def record(self, index: int, result: Result) -> None:
        """Take the result of task number `index`."""
        self._results[index] = result

    def measure(self, jobs: int, timeout: float | None, *, show_progress: bool) -> None:
        """Do the tasks that have no result yet, `jobs` at a time.

        KeyboardInterrupt leaves with the results that are there by then.
        """
        started = time.perf_counter()
        pending = [index for index in range(len(self.tasks)) if index not in self._results]
        bar = progress_bar(len(self.tasks), len(self._results), self._words([]), wanted=show_progress)
        try:
            with Workers(self._target, jobs, timeout) as workers, bar as advance:
                for outcome in workers.run([self.tasks[index] for index in pending]):
                    index = pending[outcome.index]
                    result: Any = outcome.value
                    if outcome.failure is not None:
                        result = self._failed(self.tasks[index], outcome.failure)
                    self.record(index, result)
                    advance(len(self._results), self._words(self.results))
        finally:
            self.seconds = time.perf_counter() - started


def carry_out(
    run: Run[Any, Any], jobs: int | None, timeout: float, quiet: bool, conclude: Callable[[], int]
) -> int:
    """Do a run and ``conclude()`` it, also where Ctrl-C ended it early; the exit code.

    `jobs` None means one per processor, `timeout` 0 none.
    """
    with interruptible() as interruption:
        try:
            run.measure(jobs or processors(), timeout or None, show_progress=not quiet)
        except KeyboardInterrupt:
            complain(f"interrupted: {len(run.not_done)} of {counted(len(run.tasks), 'robot')} not done")
        interruption.finishing = True
        code = conclude()
    return code if interruption.code is None else interruption.code


def processors() -> int:
    """How many processors this process may use."""
    try:
        return len(os.sched_getaffinity(0))
    except AttributeError:  # not on this system
        return os.cpu_count() or 1
