"""URDF text in untidy spellings still says exactly what the model says."""

from __future__ import annotations

from typing import Any
from xml.etree import ElementTree

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dynx.errors import ArgumentError, DTypeError
from dynx.model import Inertial, Joint, JointDynamics, Link, Model, Pose
from dynx.model.elements import Mimic
from dynx.model.loading import load
from dynx.testing.strategies import models, urdf_text
from dynx.testing.strategies.urdf_text import SPELLINGS
from dynx.testing.strategies.urdf_text import _text as spelled
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


BODY = Inertial(1.5, Pose((0.25, 0.0, -1.0), (0.0, 0.5, 1e-7)), ixx=0.1, iyy=0.1, izz=0.1)
FULL = Model.build(
    "arm",
    [Link("a"), Link("b", BODY), Link("c", BODY), Link("d")],
    [
        Joint("turn", "continuous", "a", "b", Pose(), (0.0, 1.0, 0.0), dynamics=JointDynamics(0.5, 0.25)),
        Joint("slide", "prismatic", "b", "c", Pose((0.0, 0.0, 1.0)), mimic=Mimic("turn", 2.0, 0.5)),
        Joint("weld", "fixed", "b", "d"),
    ],
)


@pytest.mark.parametrize("habit", SPELLINGS)
def test_every_habit_changes_the_text_and_not_the_robot(habit: str) -> None:
    text = spelled(FULL, {habit})
    assert text != spelled(FULL, set())
    assert load(text) == load(spelled(FULL, set())) == FULL


def test_tags_of_other_programs_hold_links_and_joints_of_their_own() -> None:
    root = ElementTree.fromstring(spelled(FULL, {"unknown_tags"}))
    assert root.find("gazebo/sensor/link[@name='a']") is not None
    assert root.find("transmission/joint[@name='turn']/hardwareInterface") is not None
    assert root.find("transmission/actuator/mechanicalReduction") is not None
    assert root.find("material/color") is not None


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
