"""Simulators that the benchmarks of simulation check and time."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass

from dynx.bench.timing import Call


@dataclass(frozen=True)
class Check:
    """The largest error of some kind, and its bound."""

    what: str
    error: float
    allowed: float

    @property
    def right(self) -> bool:
        """Whether the error is within its bound."""
        return self.error <= self.allowed

    def __str__(self) -> str:
        return f"{self.what} is {self.error:.2g}, allowed {self.allowed:.2g}"


class Simulator(ABC):
    """An implementation of simulation, prepared once and called repeatedly.

    `threads` is the number of threads it uses, `steps` that of the steps of a call in all rollouts together.
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
        """Simulate once, and return the errors."""

    def start(self) -> Call | None:
        """A call with a single step, to measure the cost of starting; None where there is none."""
        return None

    def close(self) -> None:  # most hold no resources
        """Release resources."""
        return

    def __str__(self) -> str:
        return f"{self.name}, threads {self.threads}"


def assert_right(simulator: Simulator) -> None:
    """Fail where a result is wrong."""
    for check in simulator.checks():
        assert check.right, f"{simulator}: {check}"
