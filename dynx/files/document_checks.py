"""Checks of documents that users write, whose errors name the place, what is there, and what is valid."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import MISSING, fields, is_dataclass
from types import NoneType, UnionType
from typing import Any, Literal, NoReturn, Union, get_args, get_origin, get_type_hints

from dynx.errors import ArgumentError, nearest, shown


def check_document(part: object, kind: Any, place: str = "") -> None:
    """Raise ArgumentError unless a part of a document of text and numbers has the type `kind`.

    Types are dataclasses (tables with their keys), str, bool, float, Literal, list, dict by text, unions of
    them, and Any, which takes every value. An integer is a float too.
    """
    if kind is Any:
        return
    if get_origin(kind) in (Union, UnionType):
        _check_union(part, get_args(kind), place)
    elif is_dataclass(kind):
        _check_table(part, kind, place)
    elif get_origin(kind) is list:
        if not isinstance(part, list | tuple):
            _refuse(part, kind, place)
        for k, each in enumerate(part):
            check_document(each, get_args(kind)[0], f"{place}[{k}]{_name_of(each)}")
    elif get_origin(kind) is dict:
        if not isinstance(part, Mapping):
            _refuse(part, kind, place)
        for key, each in part.items():
            check_document(each, get_args(kind)[1], _inside(place, key))
    elif not _is_scalar(part, kind):
        _refuse(part, kind, place)


def _check_table(part: object, kind: Any, place: str) -> None:
    if not isinstance(part, Mapping):
        _refuse(part, kind, place)
    known = get_type_hints(kind)
    for key, each in part.items():
        if key not in known:
            where = f"{place.removesuffix(':')} has" if place else "there is"
            raise ArgumentError(f"{where} no key {shown(key)}{nearest(str(key), known)}")
        check_document(each, known[key], _inside(place, key))
    for each in fields(kind):
        if each.default is MISSING and each.default_factory is MISSING and each.name not in part:
            where = f"{place.removesuffix(':')} lacks" if place else "the document lacks"
            raise ArgumentError(f"{where} {each.name}; wanted {_described(known[each.name])}")


def _check_union(part: object, kinds: tuple[Any, ...], place: str) -> None:
    """Check the one of several types whose outer form the part has."""
    for kind in kinds:
        outer = get_origin(kind) or kind
        form = Mapping if is_dataclass(kind) or outer is dict else list | tuple if outer is list else None
        if isinstance(part, form) if form is not None else _is_scalar(part, kind):
            check_document(part, kind, place)
            return
    _refuse(part, Union[kinds], place)  # noqa: UP007


def _is_scalar(part: object, kind: Any) -> bool:
    if get_origin(kind) is Literal:
        return any(part == value and type(part) is type(value) for value in get_args(kind))
    if kind is float:
        if isinstance(part, int) and not isinstance(part, bool):
            return abs(part) < 1 << 1023
        return isinstance(part, float)
    return isinstance(part, kind)


def _refuse(part: object, kind: Any, place: str) -> NoReturn:
    hint = nearest(part, _literals(kind)) if isinstance(part, str) else ""
    where = place.removesuffix(":") or "the document"
    raise ArgumentError(f"{where} is {_shown(part)}; wanted {_described(kind)}{hint}")


def _literals(kind: Any) -> Iterable[str]:
    """Return the texts among the values of a type."""
    if get_origin(kind) is Literal:
        return [value for value in get_args(kind) if isinstance(value, str)]
    return [value for each in get_args(kind) for value in _literals(each)]


def _shown(part: object) -> str:
    """Return what a part of a document is, for a message."""
    if isinstance(part, Mapping):
        return "a table"
    if isinstance(part, list | tuple):
        return f"the list {str(part)[:60]}{'...' if len(str(part)) > 60 else ''}"
    if isinstance(part, bool):
        return str(part).lower()
    if isinstance(part, float):
        return repr(part)
    if isinstance(part, int):
        return str(part) if abs(part) < 10**20 else "a number of too many digits"
    return "null" if part is None else shown(part)


def _described(kind: Any) -> str:
    """Return what is valid, for a message."""
    if get_origin(kind) in (Union, UnionType):
        return _either([_described(each) for each in get_args(kind) if each is not NoneType])
    if get_origin(kind) is Literal:
        return _either([_shown(value) for value in get_args(kind)])
    if is_dataclass(kind):
        return f"a table with {', '.join(get_type_hints(kind))}"
    if get_origin(kind) in (list, dict):
        of = {float: "numbers", str: "texts"}.get(get_args(kind)[-1])
        form = "a list" if get_origin(kind) is list else "a table"
        if of is None:
            inner = get_args(kind)[-1]
            of = "tables" if is_dataclass(inner) or get_origin(inner) is dict else "lists of numbers"
            of = "lists of texts" if get_args(inner)[-1:] == (str,) else of
        return f"{form} of {of}"
    return {float: "a number", str: "a text", bool: "true or false", int: "a whole number"}[kind]


def _either(words: list[str]) -> str:
    return " or ".join([", ".join(words[:-1]), words[-1]] if len(words) > 1 else words)


def _name_of(part: object) -> str:
    """Return the name of an entry of a list, by which users find it."""
    name = part.get("name") if isinstance(part, Mapping) else None
    return f", {shown(name)}:" if isinstance(name, str) else ""


def _inside(place: str, key: object) -> str:
    if place.endswith(":"):
        return f"{place} {key}"
    return f"{place}.{key}" if place else str(key)
