"""The backends of dynx as ways: called as a user calls them."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from typing import Any

from dynx.backends.base import Backend
from dynx.backends.registry import backend, backend_class
from dynx.bench.cases import OF_A_FRAME, Batch, Work
from dynx.bench.implementations import Prepared, Role, Way
from dynx.model import Model
from dynx.spatial.scalar import Floats


class BackendWay(Way):
    """A backend, which checks its arguments as it does for a user."""

    role: Role = "backend"

    def __init__(self, engine: Backend, *, threads: int = 1, whole: bool = False) -> None:
        self.name = engine.name
        self.version = engine.engine_version
        self.threads = threads
        self.whole = whole
        self._engine = engine

    def prepare(self, work: Work, batch: Batch, out: Floats) -> Prepared:
        """Ready; the answers go to `out` where the backend can do so."""
        ask: Callable[..., Floats] = getattr(self._engine, work.quantity)
        arguments: list[Any] = list(batch.arguments(work.quantity))
        frame = [batch.frame] if work.quantity in OF_A_FRAME else []
        if work.batch == 1:
            sample = [each[0] for each in arguments]
            return Prepared(lambda: ask(*sample, *frame))
        if "out" in inspect.signature(ask).parameters:
            return Prepared(lambda: ask(*arguments, *frame, out=out))
        return Prepared(lambda: ask(*arguments, *frame))

    def close(self) -> None:
        """Close the backend."""
        self._engine.close()


def backend_way(model: Model, name: str, threads: int) -> BackendWay:
    """The backend of that name, on so many threads if it has any of its own.

    One that has does batches in compiled code.
    """
    if "threads" not in inspect.signature(backend_class(name)).parameters:
        return BackendWay(backend(name, model))
    return BackendWay(backend(name, model, threads=threads), threads=threads, whole=True)
