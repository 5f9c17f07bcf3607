"""Numbers of MJCF that commas separate: what is found, what is written, and what engines make of them."""

from __future__ import annotations

import re

import pytest
from hypothesis import given
from hypothesis import strategies as st

import dynx
from dynx.errors import DescriptionError
from dynx.loaded import installed_engines
from dynx.model.xml.source import XmlSource
from dynx.rules import Case, find_rule
from dynx.rules.numbers_in_text import decimal, separated_by_blanks
from tests.rules.trap_cases import mended, only

ARM = """<mujoco model="arm">
  <worldbody>
    <body name="upper" pos="0 0 0">
      <joint name="shoulder" type="hinge" axis="0 1 0"/>
      <inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>
      <site name="1,2" pos="0 0 0" size="0.005"/>
      <body name="lower" pos="0.5 0.25 0.25">
        <joint name="elbow" type="hinge" axis="0 1 0"/>
        <inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>
      </body>
    </body>
  </worldbody>
  <custom><text name="note" data="1, 2"/></custom>
</mujoco>"""
UNREAD = ARM.replace('size="0.005"', 'size="0.005, 0.005, 0.005"')
READ = ARM.replace("0.5 0.25 0.25", "0.5, 0.25, 0.25")


@pytest.mark.parametrize(
    ("text", "meant"),
    [
        ("0.5, 0.25, 1", "0.5 0.25 1"),
        ("1 , 2 ,3", "1 2 3"),
        ("1,2,3", "1 2 3"),
        ("0.5,0.25", "0.5 0.25"),
        ("1;2", "1 2"),
        ("1e-3, 2", "1e-3 2"),
        ("0,5", None),
        ("0,5 0,25 1", None),
        ("0,5; 0,25", None),
        ("0,5;0,25", None),
        ("1,250.5", None),
        (",", None),
    ],
)
def test_numbers_with_commas_are_separated_where_that_is_clear(text: str, meant: str | None) -> None:
    assert separated_by_blanks(text) == meant


numbers = st.floats(-1e3, 1e3).map(decimal)


@given(st.lists(numbers, min_size=2, max_size=6), st.sampled_from([", ", " , ", ",\t", "; "]))
def test_any_numbers_with_a_comma_and_a_blank_keep_their_digits(words: list[str], between: str) -> None:
    assert separated_by_blanks(between.join(words)) == " ".join(words)


def test_names_and_text_are_no_numbers() -> None:
    assert not find_rule("DX402").detect(Case(XmlSource(ARM)))


def test_an_attribute_that_dynx_does_not_read_has_a_note() -> None:
    assert not [each for each in dynx.load(ARM).notes if "comma" in each.message]
    (note,) = (each for each in dynx.load(UNREAD).notes if "comma" in each.message)
    assert note.message == "size of <site> is '0.005, 0.005, 0.005'; MuJoCo refuses commas"
    assert note.line == 6


def test_an_attribute_that_dynx_reads_is_refused() -> None:
    with pytest.raises(DescriptionError, match="numbers are separated by white space"):
        dynx.load(READ)


@pytest.mark.parametrize("text", [READ, UNREAD])
def test_the_remedy_writes_blanks(text: str) -> None:
    case = Case(XmlSource(text))
    found, remedy = mended("DX402", case)
    assert "between the numbers" in only(found).message
    assert remedy.case.readable
    assert remedy.case.source.text == re.sub(r"(?<=[0-9]), (?=0)", " ", text)
    assert not remedy.changes_physics


def test_decimal_commas_are_found_and_left() -> None:
    case = Case(XmlSource(ARM.replace("0.5 0.25 0.25", "0,5 0,25 0,25")))
    rule = find_rule("DX402")
    found = list(rule.detect(case))
    assert (
        only(found).message
        == "pos of <body> is '0,5 0,25 0,25', with commas or semicolons that may be decimal points"
    )
    assert rule.remedy(case, found) is None


@pytest.mark.parametrize("text", [READ, UNREAD], ids=["read", "unread"])
def test_mujoco_refuses_commas_and_the_doctor_explains_it(text: str) -> None:
    pytest.importorskip("mujoco")
    report = dynx.diagnose(text, engines=["mujoco"], samples=1)
    assert report.explained, report.unexplained
    cause = next(each for each in report.differences if each.rule == "DX402")
    assert cause.proved


@pytest.mark.parametrize("engine", ["pinocchio", "pybullet", "drake"])
def test_other_engines(engine: str) -> None:
    """The rule says of each engine how it reads commas after numbers of MJCF."""
    if engine not in installed_engines():
        pytest.skip(f"needs {engine}")
    report = dynx.diagnose(READ, engines=[engine], samples=1)
    assert report.explained, report.unexplained
    causes = {each.rule for each in report.differences if engine in each.engines}
    assert ("DX402" in causes) == (engine != "pybullet")
