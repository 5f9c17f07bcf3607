"""Names of keyword arguments: a misspelt one raises an error with the nearest name."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from functools import wraps
from typing import Any, TypeVar, cast

from dynx.errors import ArgumentError, UnknownNameError, nearest, shown

F = TypeVar("F", bound=Callable[..., Any])
C = TypeVar("C", bound=type)


def checks_option_names(function: F) -> F:
    """Decorate a function so that a keyword that it does not have raises UnknownNameError, and
    one that it needs and does not get ArgumentError, not TypeError."""
    return _checked(function, function.__name__)


def checks_field_names(cls: C) -> C:
    """Decorate a dataclass so that a field that it does not have raises UnknownNameError, not TypeError."""
    cls.__init__ = _checked(cls.__init__, cls.__name__)  # type: ignore[misc]  # of the class, not an instance
    return cls


def _checked(function: F, name: str) -> F:
    parameters = [each for each in inspect.signature(function).parameters if each != "self"]
    known = frozenset(parameters)
    needed = [
        each.name
        for each in inspect.signature(function).parameters.values()
        if each.kind is each.KEYWORD_ONLY and each.default is each.empty
    ]

    @wraps(function)
    def checked(*arguments: Any, **options: Any) -> Any:
        if not options.keys() <= known:
            wrong = next(each for each in options if each not in known)
            raise UnknownNameError(f"{name} has no option {shown(wrong)}{nearest(wrong, parameters)}")
        for each in needed:
            if each not in options:
                raise ArgumentError(f"{name} needs {each}=..., which has no default")
        return function(*arguments, **options)

    return cast(F, checked)
