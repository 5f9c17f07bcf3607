"""Every test of the contract runs for every installed backend."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator

import pytest

from dynx.backends import Backend, backend, installed_backends
from dynx.model import Model

Make = Callable[..., Backend]

ALIVE = 8
"""More than any one test has open at a time."""


@pytest.fixture(scope="session", params=installed_backends())
def backend_name(request: pytest.FixtureRequest) -> str:
    """Name of an installed backend."""
    return str(request.param)


@pytest.fixture(scope="module")
def make(backend_name: str) -> Iterator[Make]:
    """Makes that backend for a model. The last few stay open, since an engine may hold 30 MB."""
    made: deque[Backend] = deque()

    def make_one(model: Model, **options: bool) -> Backend:
        made.append(backend(backend_name, model, **options))
        if len(made) > ALIVE:
            made.popleft().close()
        return made[-1]

    yield make_one
    for engine in made:
        engine.close()
