"""URDF text in untidy spellings still says exactly what the model says."""

from __future__ import annotations

from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dynx.errors import ArgumentError, DTypeError
from dynx.model import Joint, Link, Model
from dynx.model.loading import load
from dynx.testing.strategies import models, urdf_text
from dynx.testing.strategies.urdf_text import SPELLINGS
from tests.testing.occurrence import assert_occurs, simplest

ARM = Model.build("arm", [Link("a"), Link("b")], [Joint("turn", "revolute", "a", "b")])


@given(st.data())
def test_text_reads_back_as_the_model(data: st.DataObject) -> None:
    model = data.draw(models(from_urdf=True))
    text = data.draw(urdf_text(model))
    assert load(text, base=model.base) == model
    assert load(text.encode(), base=model.base) == model


@given(urdf_text())
def test_text_of_a_random_model(text: str) -> None:
    model = load(text)
    assert load(model.to_urdf()) == model


SIGNS = {
    "declaration": "<?xml",
    "byte_order_mark": "\ufeff",
    "windows_line_ends": "\r\n",
    "comments": "<!--",
    "unknown_tags": "<transmission",
    "undeclared_prefixes": "<drake:",
    "namespaces": "xmlns:",
    "unknown_attributes": "ignored",
    "single_quotes": "'",
    "character_references": "&#",
    "open_and_close": "></link>",
    "missing_meshes": "package://",
}


@pytest.mark.parametrize("habit", SIGNS)
def test_every_habit_occurs(habit: str) -> None:
    assert habit in SPELLINGS
    assert_occurs(urdf_text(ARM), lambda text: SIGNS[habit] in text)


def test_shrinks_to_the_tidy_spelling() -> None:
    assert simplest(urdf_text(ARM), lambda text: True) == (
        '<robot name="arm">\n'
        '  <link name="a"/>\n'
        '  <link name="b"/>\n'
        '  <joint name="turn" type="revolute">\n'
        '    <parent link="a"/>\n'
        '    <child link="b"/>\n'
        '    <limit lower="-1.7976931348623157e+308" upper="1.7976931348623157e+308"/>\n'
        "  </joint>\n"
        "</robot>\n"
    )


def test_models_that_text_cannot_say() -> None:
    with pytest.raises(ArgumentError, match="frames besides its links"):
        urdf_text(ARM.with_frame("tip", "b"))
    with pytest.raises(ArgumentError, match="turn of arm is locked"):
        urdf_text(load(ARM, lock={"turn": 0.5}))
    name: Any = "ur5"
    with pytest.raises(DTypeError, match="wanted a dynx Model"):
        urdf_text(name)
