"""A run over many robots in worker processes, with progress on a terminal."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Generic, Protocol, TypeVar

from dynx.cli.shell.exits import complain, interruptible, remark, short_line
from dynx.cli.shell.output import counted, log, progress_bar
from dynx.errors import DynxError
from dynx.model.expansion import left_out_note
from dynx.simd.machine import core_count
from dynx.workers import Workers


class CommandTask(Protocol):
    """A task for one robot."""

    @property
    def robot(self) -> str:
        """The robot as the user named it."""

    @property
    def base(self) -> str | None:
        """The base of the robot, where it is chosen."""


Task = TypeVar("Task", bound=CommandTask)
Result = TypeVar("Result")


class TaskRun(Generic[Task, Result]):
    """The tasks of one command, one robot each, and the results that exist so far.

    ``target(task)`` runs in a worker process. ``refused(task, error)`` makes the result of a task whose
    process ended without one, and of the tasks numbered in `refusals`, which never start.
    The progress bar counts the results by ``problem(result)``, a word such as ``differ`` or None; without
    any its text is `activity`. Where standard error is no terminal, such as the log of a CI service, each of
    several robots gets a line with ``verdict(result)`` when it is done. `left_out` are the robots found that
    have no task.
    """

    def __init__(
        self,
        tasks: Sequence[Task],
        target: Callable[[Task], Result],
        refused: Callable[[Task, DynxError], Result],
        problem: Callable[[Result], str | None],
        verdict: Callable[[Result], str],
        activity: str,
        refusals: Mapping[int, DynxError] | None = None,
        left_out: Sequence[str] = (),
    ) -> None:
        self.tasks = list(tasks)
        self.left_out = tuple(left_out)
        self.seconds = 0.0
        self._target = target
        self._refused = refused
        self._problem = problem
        self._verdict = verdict
        self._activity = activity
        self._problems: Counter[str] = Counter()
        self._results: dict[int, Result] = {}
        for index, error in (refusals or {}).items():
            self.record(index, refused(self.tasks[index], error))

    @property
    def results(self) -> list[Result]:
        """The results so far, in the order of the tasks."""
        return [self._results[index] for index in self.done]

    @property
    def done(self) -> list[int]:
        """The numbers of the tasks that `results` belong to, in this order."""
        return sorted(self._results)

    @property
    def not_done(self) -> list[str]:
        """The robots of the tasks that have no result."""
        return [task.robot for index, task in enumerate(self.tasks) if index not in self._results]

    def record(self, index: int, result: Result) -> None:
        """Keep the result of task number `index`."""
        self._results[index] = result
        problem = self._problem(result)
        if problem is not None:
            self._problems[problem] += 1

    def measure(self, jobs: int, timeout: float | None, *, show_progress: bool) -> None:
        """Run the tasks that have no result yet, `jobs` at a time, each for at most `timeout` seconds.

        KeyboardInterrupt leaves the results that exist by then.
        """
        started = time.perf_counter()
        pending = [index for index in range(len(self.tasks)) if index not in self._results]
        bar = progress_bar(len(self.tasks), len(self._results), self._status(), enabled=show_progress)
        try:
            with Workers(self._target, jobs, timeout) as workers, bar as advance:
                for outcome in workers.run([self.tasks[index] for index in pending]):
                    index = pending[outcome.index]
                    result: Any = outcome.value
                    if outcome.failure is not None:
                        result = self._refused(self.tasks[index], outcome.failure.error)
                    self.record(index, result)
                    advance(len(self._results), self._status())
                    if show_progress and len(self.tasks) > 1:
                        log(self._line(index))
        finally:
            self.seconds = time.perf_counter() - started

    def _line(self, index: int) -> str:
        """Write a result as one line: how many are done, the robot, and its verdict."""
        total = len(self.tasks)
        task = self.tasks[index]
        base = f", {task.base} base" if len({each.base for each in self.tasks}) > 1 else ""
        count = f"[{len(self._results)}/{total}]"
        return f"{count} {short_line(task.robot)}{base}: {short_line(self._verdict(self._results[index]))}"

    def _status(self) -> str:
        return ", ".join(f"{count} {word}" for word, count in self._problems.items()) or self._activity


def carry_out(
    run: TaskRun[Any, Any], jobs: int | None, timeout: float, quiet: bool, conclude: Callable[[], int]
) -> int:
    """Run the tasks, then call ``conclude()``, also after Ctrl-C; return its exit code.

    `jobs` None means one per processor; `timeout` 0 means no time limit.
    """
    with interruptible() as interruption:
        try:
            run.measure(jobs or core_count(), timeout or None, show_progress=not quiet)
        except KeyboardInterrupt:
            complain(f"interrupted: {len(run.not_done)} of {counted(len(run.tasks), 'robot')} not done")
        interruption.finishing = True
        code = conclude()
        if run.left_out:
            remark(left_out_note(run.left_out))
    return code if interruption.code is None else interruption.code
