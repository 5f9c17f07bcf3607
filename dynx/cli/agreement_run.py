"""Measuring the agreement of many robots in worker processes, with progress on a terminal."""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING

from dynx.cli.agreement_task import AgreementTask, Entry, counts, failed, measure
from dynx.cli.workers import Workers

if TYPE_CHECKING:
    from collections.abc import Callable


class Run:
    """The robots of one command, and the entries that are there so far."""

    def __init__(self, tasks: Sequence[AgreementTask]) -> None:
        self.tasks = list(tasks)
        self.seconds = 0.0
        self._entries: dict[int, Entry] = {}

    @property
    def entries(self) -> list[Entry]:
        """The entries that are there, in the order of the robots."""
        return [self._entries[index] for index in sorted(self._entries)]

    @property
    def not_done(self) -> list[str]:
        """The robots that have no entry."""
        return [task.robot for index, task in enumerate(self.tasks) if index not in self._entries]

    def record(self, index: int, entry: Entry) -> None:
        """Take the entry of robot number `index`."""
        self._entries[index] = entry

    def measure(
        self,
        jobs: int,
        timeout: float | None,
        *,
        show_progress: bool,
        target: Callable[[AgreementTask], Entry] = measure,
    ) -> None:
        """Measure the robots that have no entry yet, `jobs` at a time.

        KeyboardInterrupt leaves with the entries that are there by then.
        """
        started = time.perf_counter()
        pending = [index for index in range(len(self.tasks)) if index not in self._entries]
        try:
            with Workers(target, jobs, timeout) as workers, self._progress(show_progress) as advance:
                for outcome in workers.run([self.tasks[index] for index in pending]):
                    index = pending[outcome.index]
                    entry = outcome.value
                    if outcome.failure is not None:
                        entry = failed(self.tasks[index], outcome.failure)
                    self.record(index, entry)
                    advance()
        finally:
            self.seconds = time.perf_counter() - started

    @contextmanager
    def _progress(self, wanted: bool) -> Iterator[Callable[[], None]]:
        """A bar on standard error while the run lasts, on a terminal only; yields its update."""
        if not wanted or not sys.stderr.isatty():
            yield lambda: None
            return
        from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

        from dynx.cli.terminal import console

        columns = (
            TextColumn("{task.description}", markup=False),
            BarColumn(),
            MofNCompleteColumn(),
            TimeElapsedColumn(),
        )
        screen = console(err=True)
        screen.soft_wrap = False  # a bar that ran over the line could not be drawn again in place
        with Progress(*columns, console=screen, transient=True) as progress:
            bar = progress.add_task("comparing", total=len(self.tasks), completed=len(self._entries))

            def advance() -> None:
                count = counts(self.entries)
                said = ", ".join(f"{count[word]} {word}" for word in ("differ", "refused") if count[word])
                progress.update(bar, completed=len(self._entries), description=said or "comparing")

            yield advance


def processors() -> int:
    """How many processors this process may use."""
    try:
        return len(os.sched_getaffinity(0))
    except AttributeError:  # not on this system
        return os.cpu_count() or 1
