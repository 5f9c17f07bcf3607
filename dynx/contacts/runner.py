"""Runs in worker processes, with their progress."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from dynx.contacts.run import Measured, Run, Unmeasured, carry_out
from dynx.workers import Workers


class Runner:
    """Worker processes that carry out runs; leaving the context ends them."""

    def __init__(
        self, jobs: int, timeout: float | None, progress: Callable[[int, int], object] | None
    ) -> None:
        self._workers = Workers(carry_out, jobs, timeout)
        self._progress = progress
        self.done = 0
        """Number of runs that have been carried out."""

    def __enter__(self) -> Runner:
        return self

    def __exit__(self, *_: object) -> None:
        self._workers.close()

    def run(self, runs: Sequence[Run]) -> list[Measured | Unmeasured]:
        """Carry out all runs and return their outcomes in the order of the runs."""
        outcomes: list[Measured | Unmeasured] = [Unmeasured("defect", "not run")] * len(runs)
        total = self.done + len(runs)
        for outcome in self._workers.run(runs):
            if outcome.failure is not None:
                outcomes[outcome.index] = Unmeasured(outcome.failure.kind, outcome.failure.message)
            else:
                outcomes[outcome.index] = outcome.value
            self.done += 1
            if self._progress is not None:
                self._progress(self.done, total)
        return outcomes
