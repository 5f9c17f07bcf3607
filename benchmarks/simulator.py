"""What is timed in the benchmarks of simulation: something that takes steps, and is right."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass

from dynx.bench.timing import Call


@dataclass(frozen=True)
class Check:
    """The largest error found of some kind, and what it may be."""

    what: str
    error: float
    allowed: float

    @property
    def right(self) -> bool:
        """Whether it may be timed."""
        return self.error <= self.allowed

    def __str__(self) -> str:
        return f"{self.what} is {self.error:.2g}, allowed {self.allowed:.2g}"


class Simulator(ABC):
    """A way to simulate, made ready once and called again and again.

    `threads` is how many it uses, `steps` how many a call takes in all rollouts together.
    """

    name: str
    threads: int = 1
    rollouts: int = 1
    steps: int

    @abstractmethod
    def call(self) -> object:
        """Simulate once; what is timed."""

    @abstractmethod
    def checks(self) -> Sequence[Check]:
        """Simulate once, and say how right that was."""

    def start(self) -> Call | None:
        """The same with a single step: what a call costs before the first one. None where that is nothing."""
        return None

    def close(self) -> None:  # most hold nothing
        """Release what is held."""
        return

    def __str__(self) -> str:
        return f"{self.name}, threads {self.threads}"


def assert_right(simulator: Simulator) -> None:
    """Fail where an answer is wrong."""
    for check in simulator.checks():
        assert check.right, f"{simulator}: {check}"
