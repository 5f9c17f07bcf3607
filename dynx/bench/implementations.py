"""Ways to do a work: a name, and how it is made ready to be called again and again."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Literal

from dynx.bench.cases import Batch, Work
from dynx.bench.timing import Call
from dynx.spatial.scalar import Floats

Role = Literal["backend", "peer"]


@dataclass(frozen=True)
class Prepared:
    """A way made ready for one batch.

    `call()` does the whole batch and returns the answers (n, ...). `baseline`, where there is one, is
    what every call does besides the work that is to be measured: its time is taken away.
    """

    call: Call
    baseline: Call | None = None

    @property
    def calls(self) -> list[Call]:
        """What is to be timed: the call, and its baseline if it has one."""
        return [self.call] if self.baseline is None else [self.call, self.baseline]


class Way(ABC):
    """One way to do a work: a backend of dynx, or a peer beside it.

    `threads` is how many it uses. `whole` says that it takes a batch in one call of compiled code;
    others are called once for each sample, or need much memory, and may be timed at fewer samples.
    """

    name: str
    role: Role
    version: str
    threads: int
    whole: bool

    def does(self, work: Work) -> bool:
        """Whether it is a way to do this work at all."""
        return True

    @abstractmethod
    def prepare(self, work: Work, batch: Batch, out: Floats) -> Prepared:
        """Ready for `work` on the samples of `batch`; `out` (n, ...) may take the answers.

        Raises an error of `dynx.errors` where it cannot do this.
        """

    def samples(self, batch: Batch) -> Batch:
        """The samples in the coordinates of this way; a way that has others says how it converts them."""
        return batch

    def close(self) -> None:  # most hold nothing
        """Release what is held."""
        return
