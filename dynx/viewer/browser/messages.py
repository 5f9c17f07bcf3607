"""Messages of a page to the program: those whose values have the type and the range of what they are for.

viser sets what a message names, so that a value of another type, or a property other than the value, would
break a control for every page. Such messages are dropped.
"""

from __future__ import annotations

import math
import types
from collections.abc import Callable, Mapping
from functools import cache
from typing import Any, Literal, Union, get_args, get_origin, get_type_hints

MAX_TEXT = 100_000
"""Largest length of a text in a message [characters]."""

MAX_NUMBER = 1e12
"""Largest magnitude of a number in a message."""

_DROPPED = ("ShareUrlRequest", "ShareUrlDisconnect")
"""Messages that are never passed on: they publish the page through a server of viser's."""

_UPDATE = "GuiUpdateMessage"
"""Message that changes a control."""


class CheckedMessages:
    """Messages of viser as they are received: valid ones, and None instead of any other."""

    def __init__(self, messages: Any, control: Callable[[str], Any]) -> None:
        """`messages` is viser's class of messages, `control(uuid)` returns a control of the page or None."""
        self._messages = messages
        self._control = control

    def deserialize(self, raw: bytes) -> Any:
        """Return the message of its bytes; None, which nothing handles, for one that is not valid."""
        try:
            message = self._messages.deserialize(raw)
        except Exception:  # anything can be in the bytes
            return None
        kind: Any = type(message)
        if kind.__name__ in _DROPPED:
            return None
        hints = _hints(kind)
        values = {name: getattr(message, name) for name in hints if hasattr(message, name)}
        if not all(fits(value, hints[name]) for name, value in values.items()):
            return None
        if "wxyz" in values and not any(values["wxyz"]):
            return None
        if kind.__name__ == _UPDATE:
            return message if self._is_change_of_value(message) else None
        return message

    def _is_change_of_value(self, message: Any) -> bool:
        """Check that a message gives a control a value that it may have; numbers are clamped to its range."""
        control = self._control(message.uuid)
        if set(message.updates) != {"value"} or control is None:
            return False
        present, props = control.value, getattr(control, "props", None)
        value = message.updates["value"]
        if getattr(props, "disabled", False) or not alike(value, present):
            return False
        options = getattr(props, "options", None)
        if options is not None and value not in options:
            return False
        message.updates["value"] = _clamped(value, getattr(props, "min", None), getattr(props, "max", None))
        return True


def fits(value: object, kind: Any) -> bool:
    """Check a value of a message against the type of its field."""
    if kind is Any:
        return True
    origin, inside = get_origin(kind), get_args(kind)
    if origin in (Union, types.UnionType):
        return any(fits(value, each) for each in inside)
    if origin is Literal:
        return any(type(value) is type(each) and value == each for each in inside)
    if origin is tuple:
        if not isinstance(value, tuple | list):
            return False
        if len(inside) == 2 and inside[1] is Ellipsis:
            return all(fits(each, inside[0]) for each in value)
        return len(value) == len(inside) and all(map(fits, value, inside))
    if origin is dict:
        return isinstance(value, Mapping) and all(isinstance(key, str) for key in value)
    if kind in (int, float):
        return _is_number(value)
    if kind is str:
        return isinstance(value, str) and len(value) <= MAX_TEXT
    return isinstance(value, kind) if isinstance(kind, type) else True


def alike(value: object, present: object) -> bool:
    """Check whether a value has the type of the present one of a control, and its length."""
    if isinstance(present, bool):
        return isinstance(value, bool)
    if isinstance(present, int | float):
        return _is_number(value)
    if isinstance(present, str):
        return isinstance(value, str) and len(value) <= MAX_TEXT
    if isinstance(present, tuple | list) and isinstance(value, tuple | list) and len(value) == len(present):
        return all(alike(each, own) for each, own in zip(value, present, strict=True))
    return False


def _is_number(value: object) -> bool:
    if isinstance(value, bool) or not isinstance(value, int | float):
        return False
    return math.isfinite(value) and abs(value) <= MAX_NUMBER


def _clamped(value: Any, lower: Any, upper: Any) -> Any:
    """Return numbers within the bounds, which may be None."""
    if isinstance(value, bool | str):
        return value
    if isinstance(value, tuple | list):
        lowers = lower if isinstance(lower, tuple | list) else [lower] * len(value)
        uppers = upper if isinstance(upper, tuple | list) else [upper] * len(value)
        return tuple(map(_clamped, value, lowers, uppers))
    least = value if lower is None else max(value, lower)
    return least if upper is None else min(least, upper)


@cache
def _hints(kind: Any) -> dict[str, Any]:
    """Return the types of the fields of a message."""
    return get_type_hints(kind)
