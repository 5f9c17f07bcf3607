"""Implementations of benchmark cases, by a backend of dynx or by another library."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Literal

from dynx.bench.cases import Batch, BenchmarkCase
from dynx.bench.timing import Call
from dynx.spatial.scalar import Floats

Role = Literal["backend", "peer"]


@dataclass(frozen=True)
class PreparedCall:
    """A call of one implementation with its arguments prepared.

    `call()` evaluates the whole batch and returns the results (n, ...). `baseline`, if given, does the part
    of each call that shall not be measured; its time is subtracted.
    """

    call: Call
    baseline: Call | None = None

    @property
    def calls(self) -> list[Call]:
        """Calls to time: the call itself, and its baseline if it has one."""
        return [self.call] if self.baseline is None else [self.call, self.baseline]


class Implementation(ABC):
    """An implementation of quantities that can be timed.

    `threads` is the number of threads that it uses. `whole` is true if it evaluates a batch in one call of
    compiled code; others are called once per sample, or need much memory, and may be timed at fewer samples.
    """

    name: str
    role: Role
    version: str
    threads: int
    whole: bool

    def supports(self, case: BenchmarkCase) -> bool:
        """Check whether it implements this case."""
        return True

    @abstractmethod
    def prepare(self, case: BenchmarkCase, batch: Batch, out: Floats) -> PreparedCall:
        """Return the call for `case` on the samples of `batch`; it may write the results into `out` (n, ...).

        Raises an error of `dynx.errors` if that is impossible.
        """

    def samples(self, batch: Batch) -> Batch:
        """Return the samples in the coordinates of this implementation."""
        return batch

    def close(self) -> None:
        """Release resources."""
        return
