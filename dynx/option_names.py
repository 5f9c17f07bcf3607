"""Options of functions: a misspelt name raises an error with the nearest one, and a dataclass can declare the
arguments of a function."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from dataclasses import fields
from functools import wraps
from typing import Any, ParamSpec, TypeVar, cast

from dynx.errors import ArgumentError, UnknownNameError, nearest, shown

F = TypeVar("F", bound=Callable[..., Any])
C = TypeVar("C", bound=type)
P = ParamSpec("P")
A = TypeVar("A")
R = TypeVar("R")


def checks_option_names(function: F) -> F:
    """Decorate a function so that a keyword that it does not have raises UnknownNameError, and
    one that it needs and does not get ArgumentError, not TypeError."""
    return _checked(function, function.__name__)


def checks_field_names(cls: C) -> C:
    """Decorate a dataclass so that a field that it does not have raises UnknownNameError, not TypeError."""
    cls.__init__ = _checked(cls.__init__, cls.__name__)  # type: ignore[misc]  # of the class, not an instance
    return cls


def takes(arguments: Callable[P, A]) -> Callable[[Callable[[A], R]], Callable[P, R]]:
    """Decorate a function of one object, so that it has the signature of the dataclass `arguments`.

    Type checkers and `help` see the fields as arguments. A keyword that is no field raises UnknownNameError,
    other arguments that do not fit TypeError. The docstring gets a line for each field that `option`
    declares (`dynx.sim.scenario.options`).
    """

    def decorate(function: Callable[[A], R]) -> Callable[P, R]:
        name = function.__name__
        signature = inspect.signature(arguments)
        known = list(signature.parameters)

        @wraps(function)
        def called(*given: P.args, **options: P.kwargs) -> R:
            wrong = next((each for each in options if each not in signature.parameters), None)
            if wrong is not None:
                raise UnknownNameError(f"{name} has no option {shown(wrong)}{nearest(wrong, known)}")
            try:
                signature.bind(*given, **options)
            except TypeError as error:
                raise TypeError(f"{name}: {error}") from None
            return function(arguments(*given, **options))

        lines = [
            f"        {each.name}: {each.metadata['option'].line}"
            for each in fields(cast(Any, arguments))
            if "option" in each.metadata
        ]
        if function.__doc__ and lines:
            called.__doc__ = "\n".join([function.__doc__.rstrip(), "", "    Options:", *lines, "    "])
        returned = inspect.signature(function).return_annotation
        called.__signature__ = signature.replace(return_annotation=returned)  # type: ignore[attr-defined]
        return called

    return decorate


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
