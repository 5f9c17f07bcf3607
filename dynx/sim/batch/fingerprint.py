"""What an object of dynx holds, to the last bit, as something to look up by.

To trace a step takes longer than many a simulation. A kernel is found again by all that its step is made of,
not by the objects, which somebody may have changed in the meantime.
"""

from __future__ import annotations

from collections.abc import Hashable, Mapping
from typing import Any

import numpy as np

from dynx.control.single_sample import SingleSample
from dynx.model import Model

KNOWN = ("dynx.control.", "dynx.sim.")
"""Where the classes are whose code reads nothing but their attributes."""


def content_of(thing: Any) -> Hashable:
    """Equal for two things exactly if no code can tell them apart, but for the engine that a law asks.

    Raises TypeError for what is not known to be told by its attributes: a law of somebody's own may read
    anything.
    """
    kind = type(thing)
    if thing is None or kind in (bool, int, str, Model):
        return kind, thing
    if kind is float:
        return kind, thing.hex()
    if isinstance(thing, np.ndarray) and thing.dtype != object:
        return kind, thing.dtype.str, thing.shape, thing.tobytes()
    if kind is slice:
        return kind, thing.start, thing.stop, thing.step
    if isinstance(thing, tuple | list):
        return kind, tuple(content_of(entry) for entry in thing)
    if isinstance(thing, Mapping):
        return kind, tuple((content_of(key), content_of(value)) for key, value in thing.items())
    if kind is SingleSample:
        return kind, content_of(thing.backend.model)
    if kind.__module__.startswith(KNOWN):
        return kind, content_of(vars(thing))
    raise TypeError(f"what a {kind.__name__} holds is not known")
