"""Options of functions: a misspelt name, a former one or that of another library raises an error with the
right one.

Public names of a package answer by themselves (`explained`, which `dynx.registry.moved_names` calls); a
decorator is for former names, and for methods that are doors to a function.
"""

from __future__ import annotations

import inspect
import sys
from abc import ABCMeta
from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import is_dataclass
from difflib import get_close_matches
from functools import wraps
from importlib import import_module
from types import FunctionType, MappingProxyType
from typing import Any, TypeVar, cast, overload

from dynx.errors import ArgumentError, UnknownNameError, escaped, nearest, shown

F = TypeVar("F", bound=Callable[..., Any])
C = TypeVar("C", bound=type)


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


def explained(public: Any) -> Any:
    """Return a public function or class, so that a keyword that it does not have raises UnknownNameError.

    A class is changed in place: its constructor, and its methods that have options. Of a class that is an
    interface, or that implements one, only the constructor is: dynx calls the methods of controllers,
    backends and trajectories in loops, where a wrapper would cost. So would that of the constructor of a
    result, a dataclass without options, and of a named tuple. A function is replaced in its own module, too,
    where pickle looks for it.
    """
    if not getattr(public, "__module__", "").startswith("dynx"):
        return public
    if isinstance(public, type):
        if not issubclass(public, tuple | BaseException):
            _explain_class(public)
        return public
    if not isinstance(public, FunctionType) or hasattr(public, ANSWERS):
        return public
    name: str = public.__name__
    home = vars(sys.modules[public.__module__])
    if getattr(home.get(name), "__wrapped__", None) is public:
        return home[name]  # another package has it, too
    answering = _checked(public, name, {})
    if home.get(name) is public:
        home[name] = answering
    return answering


ANSWERS = "__answers_options__"
"""Attribute of functions that answer mistaken keywords by themselves."""


def _explain_class(cls: type) -> None:
    for each in cls.__mro__:
        if not each.__module__.startswith("dynx") or vars(each).get("_explains_options"):
            continue
        each._explains_options = True  # type: ignore[attr-defined]
        for name, member in list(vars(each).items()):
            function = getattr(member, "__func__", member)
            answering = method_of(each, name, function)
            if answering is not function:
                kind = type(member)
                setattr(each, name, answering if kind is FunctionType else kind(answering))


def method_of(cls: type, name: str, function: F) -> F:
    """Return the method `name` of a public class, so that it answers mistaken keywords if it has to."""
    if not isinstance(function, FunctionType) or hasattr(function, ANSWERS):
        return function
    if name == "__init__":
        wanted = not is_dataclass(cls) or _has_options(function)
    else:
        wanted = not name.startswith("_") and not isinstance(cls, ABCMeta) and _has_options(function)
    return _checked(function, cls.__name__ if name == "__init__" else name, {}) if wanted else function


def _has_options(function: FunctionType) -> bool:
    return bool(function.__defaults__ or function.__kwdefaults__)


def right_name(wrong: str, known: Iterable[str], renamed: Mapping[str, str] = MappingProxyType({})) -> str:
    """Make the clause of an error that names the present name of a former one, or that of what other
    libraries call so, or else the nearest."""
    if wrong in renamed:
        return f"; it is now {renamed[wrong]}"
    names = list(known)
    # Found by name, like the names of engines in `dynx.registry`: the tables lie in a room above.
    clause: str | None = import_module("dynx.engine_names").keyword_of_dynx(wrong, names)
    return nearest(wrong, names) if clause is None else clause


def _is_meant(wrong: str, known: Iterable[str]) -> bool:
    """Check whether one of the `known` names is near to `wrong`, or what other libraries call so."""
    names = list(known)
    other = import_module("dynx.engine_names").parameter_of(wrong, names)
    return other is not None or bool(get_close_matches(wrong.lower(), names))


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
    parameters = inspect.signature(function).parameters.values()
    known = [
        each.name
        for each in parameters
        if each.name not in ("self", "cls") and each.kind in (each.POSITIONAL_OR_KEYWORD, each.KEYWORD_ONLY)
    ]
    for each in options:
        if each not in known:
            raise UnknownNameError(f"{name} has no option {shown(each)}{right_name(each, known, renamed)}")


def _checked(function: F, name: str, renamed: Mapping[str, str]) -> F:
    """Return the function with a check of names after a failure, so that a call of microseconds is not
    delayed."""

    @wraps(function)
    def checked(*arguments: Any, **options: Any) -> Any:
        try:
            return function(*arguments, **options)
        except TypeError:
            answer(name, function, arguments, options, renamed)
            raise

    setattr(checked, ANSWERS, True)
    return cast(F, checked)


def answer(
    name: str,
    function: Callable[..., Any],
    given: Collection[Any],
    options: Mapping[str, Any],
    renamed: Mapping[str, str] = MappingProxyType({}),
) -> None:
    """Raise the error for a call of `function` that raised TypeError because of a keyword that it does not
    have, or of one without a default that it did not get; return if the call fits its signature."""
    parameters = inspect.signature(function).parameters.values()
    places = [each for each in parameters if each.kind in (each.POSITIONAL_ONLY, each.POSITIONAL_OR_KEYWORD)]
    if any(each.kind is each.VAR_KEYWORD for each in parameters):
        # Other keywords are passed on; one may be meant for an argument that is missing.
        missing = [
            each.name
            for k, each in enumerate(places)
            if k >= len(given) and each.default is each.empty and each.name not in options
        ]
        known = {each.name for each in parameters}
        options = {
            name: value for name, value in options.items() if name in known or _is_meant(name, missing)
        }
    refuse_options(name, options, function, renamed)
    for each in parameters:
        if each.kind is each.KEYWORD_ONLY and each.default is each.empty and each.name not in options:
            raise ArgumentError(f"{name} needs {each.name}=..., which has no default") from None
