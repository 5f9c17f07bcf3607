"""Robots, backends and states for the tests of the compiled backend."""

from __future__ import annotations

from typing import Any

import numpy as np

from dynx.backends import backend
from dynx.compiled.backend import CompiledBackend
from dynx.model import Model
from dynx.spatial.scalar import Floats
from tests.backends.robots import mixed_robot

ROBOTS = {
    "fixed": mixed_robot(),
    "floating": mixed_robot("floating"),
    "mimic": mixed_robot(mimic=True),
    "floating mimic": mixed_robot("floating", mimic=True),
}

TIP = "tip"


def made(model: Model, **options: Any) -> CompiledBackend:
    """Return the backend, as its own class."""
    engine = backend("compiled", model, **options)
    assert isinstance(engine, CompiledBackend)
    return engine


def state(model: Model, size: tuple[int, ...] = ()) -> tuple[Floats, Floats, Floats]:
    """Return q, v and a with the given leading axes, always the same."""
    rng = np.random.default_rng(3)
    q = model.random(rng, size)
    v, a = rng.standard_normal((2, *size, model.nv))
    return q, v, a
