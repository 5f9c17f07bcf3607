"""Documents: what a class declares is what is read, refused with its place, and described by a schema."""

from __future__ import annotations

import json
import math
import re
from dataclasses import dataclass, field
from typing import Any, Literal

import pytest
from hypothesis import given
from hypothesis import strategies as st
from jsonschema import Draft202012Validator

from dynx.errors import ArgumentError
from dynx.files.documents import (
    SCHEMA_DIALECT,
    convert_document,
    json_schema,
    json_text,
    read_document,
    to_json_values,
)


@dataclass(frozen=True)
class Wheel:
    name: str
    radius: float = 0.5
    side: Literal["left", "right", 3] = "left"


@dataclass(frozen=True)
class Cart:
    wheels: list[Wheel]
    title: str | None = None
    loads: dict[str, float] = field(default_factory=dict)
    speeds: list[float] | float = 1.0
    driven: bool = True
    paths: list[list[float]] = field(default_factory=list)
    notes: Any = None


SCHEMA = json_schema(Cart, "Cart", omits_defaults=True)

numbers = st.floats(-10.0, 10.0) | st.integers(-5, 5)
anything = st.one_of(st.none(), st.booleans(), numbers, st.sampled_from(["left", "right", "up", ""]))
parts = st.recursive(
    anything,
    lambda inner: (
        st.lists(inner, max_size=2)
        | st.dictionaries(st.sampled_from(["name", "radius", "side", "x"]), inner, max_size=3)
    ),
    max_leaves=5,
)
wheels = st.fixed_dictionaries(
    {"name": st.sampled_from(["a", "b"])},
    optional={"radius": numbers, "side": st.sampled_from(["left", "right", 3])},
)
carts = st.fixed_dictionaries(
    {"wheels": st.lists(wheels, max_size=2)},
    optional={
        "title": st.none() | st.just("t"),
        "loads": st.dictionaries(st.sampled_from("ab"), numbers, max_size=2),
        "speeds": numbers | st.lists(numbers, max_size=2),
        "driven": st.booleans(),
        "paths": st.lists(st.lists(numbers, max_size=2), max_size=2),
        "notes": parts,
    },
)


def contains_null(part: Any) -> bool:
    """Check for a null: a schema allows it for every number, because it stands for one that is not finite."""
    if isinstance(part, dict):
        return any(map(contains_null, part.values()))
    return any(map(contains_null, part)) if isinstance(part, list) else part is None


@given(carts, st.sampled_from([*Cart.__dataclass_fields__, "wheel"]), parts, st.booleans())
def test_documents_are_converted_where_the_schema_holds(
    document: dict[str, Any], key: str, part: Any, changed: bool
) -> None:
    if changed:
        document = {**document, key: part}
    try:
        cart = convert_document(document, Cart)
    except ArgumentError:
        assert changed
        checked = {name: each for name, each in document.items() if name not in ("title", "notes")}
        if not contains_null(checked):
            assert not Draft202012Validator(SCHEMA).is_valid(document)
        return
    Draft202012Validator(SCHEMA).validate(document)
    written = to_json_values(cart)
    assert written.items() >= {name: each for name, each in document.items() if name != "wheels"}.items()
    assert convert_document(written, Cart) == cart
    assert read_document(json_text(cart), Cart) == cart
    Draft202012Validator(json_schema(Cart, "Cart")).validate(written)


@pytest.mark.parametrize(
    ("document", "message"),
    [
        ([], "the document is the list []; wanted a table with wheels, title, "),
        ({}, "the document lacks wheels; wanted a list of tables"),
        ({"wheels": {}}, "wheels is a table; wanted a list of tables"),
        ({"wheels": [], "titel": "x"}, "there is no key 'titel'; did you mean 'title'?"),
        ({"wheels": [{"radius": 1}]}, "wheels[0] lacks name; wanted a text"),
        ({"wheels": [{"name": "a", "radios": 1}]}, "wheels[0], 'a' has no key 'radios'; did you mean"),
        ({"wheels": [{"name": "a", "radius": "1"}]}, "wheels[0], 'a': radius is '1'; wanted a number"),
        ({"wheels": [{"name": "a", "radius": True}]}, "radius is true; wanted a number"),
        ({"wheels": [{"name": "a", "radius": 1 << 1024}]}, "radius is a number of too many digits"),
        ({"wheels": [{"name": "a", "side": "lift"}]}, "wanted 'left', 'right' or 3; did you mean 'left'"),
        ({"wheels": [{"name": "a", "side": 3.0}]}, "side is 3.0; wanted 'left', 'right' or 3"),
        ({"wheels": [], "loads": [1]}, "loads is the list [1]; wanted a table of numbers"),
        ({"wheels": [], "loads": {"a": None}}, "loads.a is null; wanted a number"),
        ({"wheels": [], "speeds": {}}, "speeds is a table; wanted a list of numbers or a number"),
        ({"wheels": [], "speeds": [1, "x"]}, "speeds[1] is 'x'; wanted a number"),
        ({"wheels": [], "paths": [3]}, "paths[0] is 3; wanted a list of numbers"),
        ({"wheels": [], "paths": 3}, "paths is 3; wanted a list of lists of numbers"),
        ({"wheels": [], "title": 4}, "title is 4; wanted a text"),
        ({"wheels": [], "driven": 1}, "driven is 1; wanted true or false"),
        ({"wheels": list(range(99))}, "wheels[0] is 0; wanted a table with name, radius, side"),
        ({"wheels": [], "driven": list(range(99))}, "driven is the list [0, 1, 2"),
    ],
)  # fmt: skip
def test_a_part_that_does_not_fit_is_named_with_what_is_wanted(document: Any, message: str) -> None:
    with pytest.raises(ArgumentError, match=re.escape(message)) as caught:
        convert_document(document, Cart)
    assert len(str(caught.value)) < 200
    assert str(caught.value).count("did you mean") == message.count("did you mean")


def test_numbers_that_are_not_finite_are_written_as_null() -> None:
    values = {"a": [math.inf, -math.inf, math.nan, 1.5], 2: ("x", True, Wheel("w", math.inf))}
    wheel = {"name": "w", "radius": None, "side": "left"}
    assert to_json_values(values) == {"a": [None, None, None, 1.5], "2": ["x", True, wheel]}
    text = json_text({"name": "ä", **values})
    assert text.isascii()
    assert json.loads(text) == {"name": "ä", **to_json_values(values)}


def test_a_schema_names_its_dialect_and_requires_what_has_no_default() -> None:
    whole = json_schema(Cart, "A cart")
    for schema in (SCHEMA, whole):
        assert schema["$schema"] == SCHEMA_DIALECT
        Draft202012Validator.check_schema(schema)
        assert "default" not in json.dumps(schema)
    assert whole["title"] == "A cart"
    validator = Draft202012Validator(whole)
    assert validator.is_valid(to_json_values(Cart([Wheel("a")])))
    assert not validator.is_valid({"wheels": []})
    assert Draft202012Validator(SCHEMA).is_valid({"wheels": [{"name": "a"}]})


@pytest.mark.parametrize("text", ["{", "[" * 100_000, "nothing"])
def test_text_that_is_not_json_is_refused(text: str) -> None:
    with pytest.raises(ArgumentError, match="not JSON"):
        read_document(text, Cart)


def test_a_document_is_read_with_keys_of_later_versions() -> None:
    assert read_document('{"wheels": [], "added": 1}', Cart) == Cart([])
    with pytest.raises(ArgumentError, match="wheels"):
        read_document('{"wheels": 3}', Cart)
