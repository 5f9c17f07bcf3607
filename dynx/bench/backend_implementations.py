"""Implementations by the backends of dynx, called as users call them."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from typing import Any

from dynx.backends.base import Backend
from dynx.backends.quantities import QUANTITIES
from dynx.backends.registry import backend, backend_class
from dynx.bench.cases import Batch, BenchmarkCase
from dynx.bench.implementations import Implementation, PreparedCall, Role
from dynx.model import Model
from dynx.spatial.scalar import Floats


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
