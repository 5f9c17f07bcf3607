"""Implementations of benchmark cases: a backend of dynx, or another library beside it."""

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

    `call()` does the whole batch and returns the results (n, ...). `baseline`, where there is one, is
    what every call does besides the case that is to be measured: its time is taken away.
    """

    call: Call
    baseline: Call | None = None

    @property
    def calls(self) -> list[Call]:
        """Calls to time: the call itself, and its baseline if it has one."""
        return [self.call] if self.baseline is None else [self.call, self.baseline]


class Implementation(ABC):
    """An implementation of quantities that can be timed.

    `threads` is how many it uses. `whole` says that it takes a batch in one call of compiled code;
    others are called once for each sample, or need much memory, and may be timed at fewer samples.
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

        Raises an error of `dynx.errors` where it cannot do this.
        """

    def samples(self, batch: Batch) -> Batch:
        """Return the samples in the coordinates of this implementation."""
        return batch

    def close(self) -> None:  # most hold nothing
        """Release what is held."""
        return
