"""Options of functions: a misspelt or former name raises an error with the right one, and a dataclass can
declare the arguments of a function."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterable, Mapping
from dataclasses import fields
from functools import wraps
from types import MappingProxyType
from typing import Any, ParamSpec, TypeVar, cast, overload

from dynx.errors import ArgumentError, UnknownNameError, escaped, nearest, shown

F = TypeVar("F", bound=Callable[..., Any])
C = TypeVar("C", bound=type)
P = ParamSpec("P")
A = TypeVar("A")
R = TypeVar("R")


@overload
def checks_option_names(function: F, /) -> F: ...
@overload
def checks_option_names(**renamed: str) -> Callable[[F], F]: ...
def checks_option_names(function: Any = None, /, **renamed: str) -> Any:
    """Decorate a function so that a keyword that it does not have raises UnknownNameError, and
    one that it needs and does not get ArgumentError, not TypeError.

    `renamed` has the present names of former keywords: ``@checks_option_names(wrenches="forces")``.
    """
    if function is None:
        return lambda decorated: _checked(decorated, decorated.__name__, renamed)
    return _checked(function, function.__name__, renamed)


def checks_field_names(**renamed: str) -> Callable[[C], C]:
    """Decorate a dataclass so that a field that it does not have raises UnknownNameError, not TypeError.

    `renamed` has the present names of former fields.
    """

    def decorate(cls: C) -> C:
        cls.__init__ = _checked(cls.__init__, cls.__name__, renamed)  # type: ignore[misc]
        return cls

    return decorate


def right_name(wrong: str, known: Iterable[str], renamed: Mapping[str, str]) -> str:
    """Make the clause of an error that names the present name of a former one, or else the nearest."""
    return f"; it is now {renamed[wrong]}" if wrong in renamed else nearest(wrong, known)


def as_object(given: object, kind: str, fields: Iterable[str] = ()) -> str:
    """Make the clause of an error about a mapping that is given for objects of the class `kind`: a mapping of
    its `fields` as such an object, else its first entry."""
    if not isinstance(given, Mapping) or not given:
        return ""
    written = {
        name: shown(value) if isinstance(value, str) else escaped(value) for name, value in given.items()
    }
    if {*given} <= {*fields}:
        return f", such as {kind}({', '.join(f'{name}={value}' for name, value in written.items())})"
    name, value = next(iter(written.items()))
    return f", such as {kind}({shown(name)}, {value})"


def refuse_options(
    name: str, options: Iterable[str], function: Callable[..., Any], renamed: Mapping[str, str]
) -> None:
    """Raise UnknownNameError for the first of `options` that is no parameter of `function`."""
    known = [
        each.name
        for each in inspect.signature(function).parameters.values()
        if each.name != "self" and each.kind is not each.VAR_KEYWORD
    ]
    for each in options:
        if each not in known:
            raise UnknownNameError(f"{name} has no option {shown(each)}{right_name(each, known, renamed)}")


def check_arguments(
    name: str,
    signature: inspect.Signature,
    given: Iterable[Any],
    options: Mapping[str, Any],
    elsewhere: Mapping[str, str] = MappingProxyType({}),
    renamed: Mapping[str, str] = MappingProxyType({}),
) -> None:
    """Raise UnknownNameError for a keyword of `options` that the signature of the function `name` does not
    have, TypeError for other arguments that do not fit it.

    `elsewhere` has the option for each name under which other functions have it, `renamed` the present names
    of former keywords.
    """
    for each in options:
        if each not in signature.parameters:
            near = right_name(each, signature.parameters, renamed)
            clause = f"; here it is {elsewhere[each]}" if each in elsewhere else near
            raise UnknownNameError(f"{name} has no option {shown(each)}{clause}")
    try:
        signature.bind(*given, **options)
    except TypeError as error:
        raise TypeError(f"{name}: {error}") from None


def takes(
    arguments: Callable[P, A], renamed: Mapping[str, str] = MappingProxyType({}), **elsewhere: str
) -> Callable[[Callable[[A], R]], Callable[P, R]]:
    """Decorate a function of one object, so that it has the signature of the dataclass `arguments`.

    `renamed` has the present names of former keywords, `elsewhere` the option for each name under which other
    functions have it.

    Type checkers and `help` see the fields as arguments. A keyword that is no field raises UnknownNameError,
    other arguments that do not fit TypeError. The docstring gets a line for each field that `option`
    declares (`dynx.sim.scenario.options`).
    """

    def decorate(function: Callable[[A], R]) -> Callable[P, R]:
        name = function.__name__
        signature = inspect.signature(arguments)

        @wraps(function)
        def called(*given: P.args, **options: P.kwargs) -> R:
            check_arguments(name, signature, given, options, elsewhere, renamed)
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


def _checked(function: F, name: str, renamed: Mapping[str, str]) -> F:
    needed = [
        each.name
        for each in inspect.signature(function).parameters.values()
        if each.kind is each.KEYWORD_ONLY and each.default is each.empty
    ]

    @wraps(function)
    def checked(*arguments: Any, **options: Any) -> Any:
        try:
            return function(*arguments, **options)
        except TypeError:
            # Names are checked only after a failure, so that a call of microseconds is not delayed.
            refuse_options(name, options, function, renamed)
            for each in needed:
                if each not in options:
                    raise ArgumentError(f"{name} needs {each}=..., which has no default") from None
            raise

    return cast(F, checked)
