"""Exact content of an object, as a key for comparison and lookup."""

from __future__ import annotations

import sys
from collections.abc import Hashable, Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import Field, fields, is_dataclass
from functools import cached_property
from typing import Any

import numpy as np

from dynx.model import Model

LIBRARIES = frozenset({"dynx", "numpy", "scipy"})
"""Packages, besides the standard library, whose code is known by the name of a class or function."""

_entered: ContextVar[tuple[Any, ...]] = ContextVar("entered", default=())
"""Objects whose content is being read, the outermost first."""


def is_foreign(kind: type) -> bool:
    """Check whether a class belongs neither to dynx nor to one of `LIBRARIES`."""
    return is_foreign_module(kind.__module__)


def is_foreign_module(module: str | None) -> bool:
    """Check whether a module belongs neither to dynx nor to one of `LIBRARIES`."""
    root = (module or "").partition(".")[0]
    return root not in LIBRARIES and root not in sys.stdlib_module_names


@contextmanager
def entered(thing: Any) -> Iterator[int | None]:
    """Note that the content of `thing` is being read; give its place among those where it is already.

    An object that refers to itself would otherwise be read without an end.
    """
    outer = _entered.get()
    place = next((number for number, each in enumerate(outer) if each is thing), None)
    token = _entered.set((*outer, thing))
    try:
        yield place
    finally:
        _entered.reset(token)


def content_of(thing: Any) -> Hashable:
    """Return the key that is equal for two objects if and only if their contents are.

    Raises TypeError for an object that may have more content than is known.
    """
    kind = type(thing)
    if thing is None or kind in (bool, int, str, Model):
        return kind, thing
    if kind is float:
        return kind, thing.hex()
    if isinstance(thing, np.ndarray) and thing.dtype != object:
        return kind, thing.dtype.str, thing.shape, thing.tobytes()
    with entered(thing) as place:
        if place is not None:
            return kind, f"see {place}"
        if isinstance(thing, tuple | list):
            return kind, tuple(content_of(entry) for entry in thing)
        if isinstance(thing, Mapping):
            return kind, tuple((content_of(key), content_of(value)) for key, value in thing.items())
        if hasattr(kind, "content_key"):
            return kind, thing.content_key()
        if is_dataclass(kind):
            values = (getattr(thing, each.name) for each in fields(thing) if each.compare)
            return kind, tuple(map(content_of, values))
    raise TypeError(f"the content of a {kind.__name__} is not known")


def fields_of(thing: Any) -> dict[str, Field[Any]]:
    """Return the dataclass fields by name; those of the base classes if the class is no dataclass."""
    return {each.name: each for each in fields(thing)} if is_dataclass(thing) else {}


def attributes_of(thing: Any) -> dict[str, Any]:
    """Return the fields of a dataclass; for any other object, the attributes that a copy of it gets."""
    kind = type(thing)
    if "__dataclass_fields__" in kind.__dict__:
        return {each.name: getattr(thing, each.name) for each in fields(thing)}
    state = thing.__reduce_ex__(2)[2:3]
    parts = state[0] if state and isinstance(state[0], tuple) else state
    found = {name: value for part in parts if isinstance(part, Mapping) for name, value in part.items()}
    derived = {name for name in found if isinstance(getattr(kind, name, None), cached_property)}
    return {name: value for name, value in found.items() if name not in derived}
