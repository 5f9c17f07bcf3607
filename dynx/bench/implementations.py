"""Implementations of benchmark cases, by a backend of dynx or by another library."""

from __future__ import annotations

import inspect
from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal

from dynx.backends.base import Backend
from dynx.backends.quantities import QUANTITIES
from dynx.backends.registry import backend, backend_class
from dynx.bench.cases import Batch, BenchmarkCase
from dynx.bench.timing import Call
from dynx.model import Model
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


# Implementations by the backends of dynx, called as users call them.


class BackendImplementation(Implementation):
    """Implementation by a backend of dynx, including its checks of arguments."""

    role: Role = "backend"

    def __init__(self, engine: Backend, *, threads: int = 1, whole: bool = False) -> None:
        self.name = engine.name
        self.version = engine.engine_version
        self.threads = threads
        self.whole = whole
        self._engine = engine

    def prepare(self, case: BenchmarkCase, batch: Batch, out: Floats) -> PreparedCall:
        """Return the call; the backend writes into `out` where its method takes that option."""
        method: Callable[..., Floats] = getattr(self._engine, case.quantity)
        arguments: list[Any] = list(batch.arguments(case.quantity))
        frame = [batch.frame] if QUANTITIES[case.quantity].of_frame else []
        if case.batch == 1:
            sample = [each[0] for each in arguments]
            return PreparedCall(lambda: method(*sample, *frame))
        if "out" in inspect.signature(method).parameters:
            return PreparedCall(lambda: method(*arguments, *frame, out=out))
        return PreparedCall(lambda: method(*arguments, *frame))

    def close(self) -> None:
        self._engine.close()


def backend_implementation(model: Model, name: str, threads: int) -> BackendImplementation:
    """Return the backend of that name; one that takes `threads` evaluates a batch in one compiled call."""
    if "threads" not in inspect.signature(backend_class(name)).parameters:
        return BackendImplementation(backend(name, model))
    return BackendImplementation(backend(name, model, threads=threads), threads=threads, whole=True)
