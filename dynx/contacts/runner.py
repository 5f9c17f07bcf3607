"""Runs in worker processes, with their progress."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

from dynx.contacts.run import Measured, Run, Unmeasured, carry_out
from dynx.workers import Outcome, Workers


class Runner:
    """Worker processes that carry out runs, or this process where `jobs` is 0; leaving the context ends them.

    With `interruptible`, KeyboardInterrupt ends the runs and is not raised again.
    """

    def __init__(
        self,
        jobs: int,
        timeout: float | None,
        progress: Callable[[int, int], object] | None,
        *,
        interruptible: bool = False,
    ) -> None:
        self._workers = Workers(carry_out, jobs, timeout) if jobs else None
        self._progress = progress
        self._interruptible = interruptible
        self.interrupted = False
        """True once KeyboardInterrupt has ended the runs."""
        self.done = 0
        """Number of runs that have been carried out."""

    def __enter__(self) -> Runner:
        return self

    def __exit__(self, *_: object) -> None:
        if self._workers is not None:
            self._workers.close()

    def run(self, runs: Sequence[Run]) -> list[Measured | Unmeasured | None]:
        """Carry out all runs and return their outcomes in the order of the runs; None for a run left out."""
        outcomes: list[Measured | Unmeasured | None] = [None] * len(runs)
        try:
            if not self.interrupted:
                self._carry_out(runs, outcomes)
        except KeyboardInterrupt:
            if not self._interruptible:
                raise
            self.interrupted = True
        return outcomes

    def _carry_out(self, runs: Sequence[Run], outcomes: list[Measured | Unmeasured | None]) -> None:
        total = self.done + len(runs)
        for outcome in self._outcomes(runs):
            if outcome.failure is not None:
                outcomes[outcome.index] = Unmeasured(outcome.failure.kind, outcome.failure.message)
            else:
                outcomes[outcome.index] = outcome.value
            self.done += 1
            if self._progress is not None:
                self._progress(self.done, total)

    def _outcomes(self, runs: Sequence[Run]) -> Iterator[Outcome]:
        if self._workers is not None:
            return self._workers.run(runs)
        return (Outcome(number, carry_out(run)) for number, run in enumerate(runs))
