"""JSON documents: built from typed classes, read into them strictly, and described by JSON Schema.

Each document has one class that declares its keys and types. A number that is not finite is written as null,
because JSON cannot express it; so every number in a schema may be null. No other module uses msgspec.
"""

from __future__ import annotations

import inspect
import json
import math
from collections.abc import Iterable, Mapping
from dataclasses import MISSING, fields, is_dataclass
from functools import cache
from types import NoneType, UnionType
from typing import Any, Literal, NoReturn, TypeVar, Union, get_args, get_origin, get_type_hints

from dynx.errors import ArgumentError, nearest, shown

MAX_LISTS_AND_TABLES = 5_000_000
"""Largest number of lists and tables in a JSON text: an empty one takes 2 bytes there and 70 in memory."""


def parse_json(text: str | bytes) -> Any:
    """Return the value of a JSON text that anybody may have written.

    Raises ValueError for text that is not JSON, is nested too deeply, or has too many lists and tables.
    """
    if not isinstance(text, str | bytes):
        raise TypeError(f"JSON is text; got {shown(text)}, of type {type(text).__name__}")
    count = (
        text.count("[") + text.count("{") if isinstance(text, str) else text.count(b"[") + text.count(b"{")
    )
    if count > MAX_LISTS_AND_TABLES:
        raise ValueError(f"it has more than {MAX_LISTS_AND_TABLES:,} lists and tables")
    try:
        return json.loads(text)
    except RecursionError:
        raise ValueError("its lists and tables are nested too deeply") from None


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
        (inside,) = get_args(kind)
        if inside is float and set(map(type, part)) <= {float}:
            return  # a field of heights has millions
        for k, each in enumerate(part):
            check_document(each, inside, f"{place}[{k}]{_name_of(each)}")
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
    known = _types_of(kind)
    for key, each in part.items():
        if key not in known:
            where = f"{place.removesuffix(':')} has" if place else "there is"
            raise ArgumentError(f"{where} no key {shown(key)}{nearest(key, known)}")
        check_document(each, known[key], _inside(place, key))
    for each in fields(kind):
        if each.default is MISSING and each.default_factory is MISSING and each.name not in part:
            where = f"{place.removesuffix(':')} lacks" if place else "the document lacks"
            raise ArgumentError(f"{where} {each.name}; wanted {_described(known[each.name])}")


@cache
def _types_of(kind: Any) -> dict[str, Any]:
    """Return the types of the fields of a dataclass."""
    return get_type_hints(kind)


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


SCHEMA_DIALECT = "https://json-schema.org/draft/2020-12/schema"

T = TypeVar("T")


def document_of(document_class: type[Any], source: object) -> dict[str, Any]:
    """Build a document from the attributes of `source` that `document_class` has, checking their types."""
    import msgspec

    document: dict[str, Any] = to_json_values(msgspec.convert(source, document_class, from_attributes=True))
    return document


def to_json_values(value: Any) -> Any:
    """Convert dataclasses, mappings and sequences to dicts and lists, and infinities and NaN to None."""
    if isinstance(value, Mapping):
        return {str(key): to_json_values(each) for key, each in value.items()}
    if isinstance(value, (list, tuple)):
        return [to_json_values(each) for each in value]
    if isinstance(value, float):
        return float(value) if math.isfinite(value) else None
    if is_dataclass(value):
        return {field.name: to_json_values(getattr(value, field.name)) for field in fields(value)}
    return value


def json_text(document: object) -> str:
    """Write a document as indented JSON in ASCII, which every parser reads."""
    return json.dumps(to_json_values(document), indent=2, ensure_ascii=True, allow_nan=False)


def read_document(text: str, document_class: type[T]) -> T:
    """Read JSON into `document_class`; ArgumentError names the key whose value has another type.

    Unknown keys are ignored.
    """
    import msgspec

    try:
        return msgspec.convert(parse_json(text), document_class)
    except msgspec.ValidationError as error:
        raise ArgumentError(str(error)) from None
    except ValueError as error:
        raise ArgumentError(f"not JSON: {error}") from None


def convert_document(document: object, document_class: type[T]) -> T:
    """Convert a document of text and numbers to `document_class`, a dataclass.

    Raises ArgumentError for an unknown key, naming the nearest, and for a value of another type, with the
    place.
    """
    import msgspec

    try:
        check_document(document, document_class)
        return msgspec.convert(document, document_class)
    except msgspec.ValidationError as error:
        raise ArgumentError(str(error).replace("`$.", "`")) from None
    except RecursionError as error:
        raise ArgumentError(f"the document is nested too deeply: {error}") from None


def json_schema(document_class: type[Any], title: str, *, omits_defaults: bool = False) -> dict[str, Any]:
    """Describe the documents of `document_class` by a JSON Schema that allows no other keys.

    Every key is required. With `omits_defaults`, keys that have a default may be absent.
    """
    import msgspec

    schema = _strict_schema(msgspec.json.schema(document_class), omits_defaults)
    return {"$schema": SCHEMA_DIALECT, "title": title, **schema}


def _strict_schema(part: Any, omits_defaults: bool) -> Any:
    """Allow null for every number, forbid keys that are not listed, and remove Python's default values and
    the indentation of docstrings."""
    if isinstance(part, list):
        return [_strict_schema(each, omits_defaults) for each in part]
    if not isinstance(part, dict):
        return part
    # msgspec states the names of keys and dedents docstrings from 0.23 on; a schema is alike by all versions.
    left_out = ("default", "propertyNames")
    part = {key: _strict_schema(each, omits_defaults) for key, each in part.items() if key not in left_out}
    if isinstance(part.get("description"), str):
        part["description"] = inspect.cleandoc(part["description"])
    if part.get("type") == "number":
        part["type"] = ["number", "null"]
    if "properties" in part and part.get("type") == "object":
        part["additionalProperties"] = False
        part["required"] = part.get("required", []) if omits_defaults else list(part["properties"])
    return part
