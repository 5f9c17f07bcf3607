"""Every test of the contract runs for every installed backend."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import pytest

from dynx.backends import Backend, backend, installed_backends
from dynx.model import Model

Make = Callable[..., Backend]

ALIVE = 8
"""Number of backends that are kept open, more than any one test uses at a time."""


@pytest.fixture(scope="session", params=installed_backends())
def backend_name(request: pytest.FixtureRequest) -> str:
    """Return the name of an installed backend."""
    return str(request.param)


@pytest.fixture(scope="module")
def make(backend_name: str) -> Iterator[Make]:
    """Makes that backend for a model, or hands out again the one that was made for it with the same
    options: evaluating changes nothing (`test_lifecycle`), and to make an engine takes longer than to ask
    it. The last few stay open, since one may hold 30 MB; who closes one makes it by `backend`.
    """
    made: dict[tuple[Any, ...], Backend] = {}

    def make_one(model: Model, **options: bool) -> Backend:
        # The engine keeps its model alive, so that no other can come to have its id.
        recipe = (id(model), *sorted(options.items()))
        # Put back at the end, for it is now the last that was used.
        made[recipe] = made.pop(recipe) if recipe in made else backend(backend_name, model, **options)
        if len(made) > ALIVE:
            made.pop(next(iter(made))).close()
        return made[recipe]

    yield make_one
    for engine in made.values():
        engine.close()
