"""JSON documents: built from typed classes, read into them strictly, and described by JSON Schema.

Each document has one class that declares its keys and types. A number that is not finite is written as null,
because JSON cannot express it; so every number in a schema may be null. No other module uses msgspec.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from typing import Any, TypeVar

from dynx.errors import ArgumentError
from dynx.files.document_checks import check_document

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
        return msgspec.convert(json.loads(text), document_class)
    except msgspec.ValidationError as error:
        raise ArgumentError(str(error)) from None
    except (ValueError, RecursionError) as error:
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
    """Allow null for every number, forbid keys that are not listed, and remove Python's default values."""
    if isinstance(part, list):
        return [_strict_schema(each, omits_defaults) for each in part]
    if not isinstance(part, dict):
        return part
    part = {key: _strict_schema(each, omits_defaults) for key, each in part.items() if key != "default"}
    if part.get("type") == "number":
        part["type"] = ["number", "null"]
    if "properties" in part and part.get("type") == "object":
        part["additionalProperties"] = False
        part["required"] = part.get("required", []) if omits_defaults else list(part["properties"])
    return part
