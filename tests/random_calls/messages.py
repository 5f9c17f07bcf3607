"""Checks of what an error says of a call: the argument's name, what was given, and what is valid."""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import suppress
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any

import numpy as np

from dynx.errors import (
    BackendError,
    DynxError,
    EpisodeError,
    ModelError,
    SimulationError,
    SingularMassMatrixError,
    TrajectoryError,
    shown,
)
from tests.random_calls.calls import Call

OF_OTHERS = (
    BackendError,
    EpisodeError,
    ModelError,
    SimulationError,
    SingularMassMatrixError,
    TrajectoryError,
)
"""Errors of an engine, a description, a motion or a run, which no single argument causes."""

OF_THE_OBJECT = re.compile(
    r"^(this (world|environment|viewer|page) |no page is open |no link of robot |method 'engine': <"
    r"|the page )"
)
"""Beginnings of errors of the state of an object, which no argument causes."""

VALID = re.compile(
    r"\b(wanted|known|did you mean|at most|at least|between|only|must|needs?|has no|there (is|are) (no|none)"
    r"|no such|give|such as|of this|not finite|cannot|one of|takes|beyond|above|below|positive|greater|less"
    r"|exceeds|allowed|differs?|use|choose|change|accepted|supported|expected|not callable|are not|without"
    r"|instead|with it|nearest|belongs|larger|smaller|more than|fewer|is a str|(saved|written) as)\b"
)
"""Words by which a message says what is valid."""


def omissions(call: Call, error: DynxError) -> list[str]:
    """Return what the message of an error omits: "name", "given" or "valid"."""
    text = str(error)
    if isinstance(error, OF_OTHERS) or OF_THE_OBJECT.match(text):
        return []
    parameters = inspect.signature(call.function).parameters
    found = []
    # A function of names of others takes the name by which an error calls its argument.
    label = _text(str, call.given.get("name", ""))
    # What is looked up or opened is known by its own name.
    quoted = any(
        _quotes(value, text)
        for each, value in _with_keys(call.given)
        if each in ("name", "path", "folder") or text.startswith("no ")
    )
    named = quoted or text.startswith(f"{label} ") or any(_names(name, text) for name in parameters)
    if parameters and not named:
        found.append("name")
    absent = any(f"{name} is {each.default}" in text for name, each in parameters.items())
    told = absent or "given" in text or any(_shows(value, text) for value in call.given.values())
    if call.given and not told:
        found.append("given")
    if not VALID.search(text):
        found.append("valid")
    return found


def _with_keys(given: dict[str, Any]) -> Iterator[tuple[str, Any]]:
    """Yield arguments by name, and what is in them by the name of the argument."""
    for name, value in given.items():
        yield name, value
        if isinstance(value, Mapping | list | tuple):
            yield from ((name, _text(str, each)) for each in value)


def _quotes(value: Any, text: str) -> bool:
    """Check whether a text has the beginning of a name, or the last part of a path."""
    if not isinstance(value, str | bytes | Path):
        return False
    if isinstance(value, bytes):
        return repr(value)[:25] in text
    # Control characters are escaped.
    written = repr(str(value))[1:-1]
    return (written[:25] if written else "''") in text or (Path(written).name[:25] or "''") in text


def _names(name: str, text: str) -> bool:
    """Check whether a text has the name of an argument, or its words, in the singular or the plural."""
    words = name.strip("_").lower().replace("_", " ")
    stem = re.sub("(ie)?s$", "", words)
    return re.search(rf"\b{re.escape(stem)}(s|es|y|ies)?\b", text.lower().replace("_", " ")) is not None


def _shows(value: Any, text: str) -> bool:
    """Check whether a text has a value, a part of it, its type, its shape or its dtype."""
    return any(each in text for each in _traces(value))


VERBS = ("is", "has", "holds", "yields")
"""Words between the name of an argument and an element of it."""


def _text(write: Callable[[Any], str], value: Any) -> str:
    """Return the text of a value, nothing where its class refuses one."""
    try:
        return write(value)
    except RuntimeError:
        return ""


def _is_not_finite(value: Any) -> bool:
    return isinstance(value, float) and not np.isfinite(value)


def _traces(value: Any) -> Iterator[str]:
    yield type(value).__name__
    if value is None:
        yield from ("None", "nothing", "absent", "lacks", "missing", "without", " no ", "needs")
    if isinstance(value, int) and abs(value) > 10**20:
        yield from ("digits", "1000000", "shape ()")
        return
    if isinstance(value, Iterator):
        # What it yields is known only to who reads it.
        yield from ("'0'", "'a'", " at place ")
        return
    if is_dataclass(value) and not isinstance(value, type):
        yield from (shown(getattr(value, each.name))[:25] for each in fields(value))
    if isinstance(value, Path):
        yield value.name
    if isinstance(value, Mapping):
        yield "lacks"
    for written in (_text(str, value), _text(repr, value)):
        if written:
            # Long ones are shortened, and control characters are escaped.
            yield written[:25].replace("\n", "\\n").rstrip()
            yield repr(written)[1:25]
    if not isinstance(value, np.ndarray):
        with suppress(ValueError, TypeError, OverflowError, RuntimeError):
            yield f"shape {np.asarray(value).shape}"
    if isinstance(value, np.ndarray):
        for each in (*value.ravel()[:9], *(value[:2] if value.ndim else ())):
            yield from (f"{verb} {mark}{each}".replace("\n", "\\n") for verb in VERBS for mark in ("", "'"))
        if value.dtype.kind == "f" and not isinstance(value, np.ma.MaskedArray):
            yield from (f"is {each:.12g}" for each in value.ravel()[:9])
        yield from (str(value[0]), "length 0", "the same") if value.ndim and len(value) else ()
        yield from (str(value.shape), str(value.dtype), f"{value.size} ", "NaN", "nan", "inf")
        yield from (f"{value.ndim} axes", "infinit", "not finite", "empty", "masked")
    if isinstance(value, int | float | np.number) and not isinstance(
        value, np.complexfloating | np.timedelta64
    ):
        yield from (f"{float(value):.12g}", str(float(value)))
    if isinstance(value, (float, np.floating)) and not np.isfinite(value):
        yield from ("NaN", "nan", "inf", "not finite")
    if hasattr(value, "__len__") and not isinstance(value, np.ndarray):
        yield f"{len(value)} "
        if not len(value):
            yield from ("empty", "no ", "nothing", "lacks")
        elif isinstance(value, Iterable) and not isinstance(value, (str, bytes)):
            yield from ("not finite",) if any(map(_is_not_finite, value)) else ()
            for each in value:
                yield from (_text(repr, each)[:25], _text(str, each)[:25], type(each).__name__)
    if isinstance(value, type):
        yield f"class {value.__name__}"
