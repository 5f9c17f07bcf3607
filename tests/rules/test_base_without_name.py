"""A floating base of MJCF without a name."""

from __future__ import annotations

import pytest

from dynx.model.xml.source import XmlSource
from dynx.rules import Case, find_rule
from tests.rules.trap_cases import mended, only

TEXT = """<mujoco model="box"><worldbody>
  BEFORE
  <body pos="0 0 1">JOINT<geom type="box" size="0.1 0.2 0.3"/><body/></body>
</worldbody></mujoco>"""


def test_the_base_gets_the_name_that_dynx_gives_it() -> None:
    case = Case(XmlSource(TEXT.replace("BEFORE", "").replace("JOINT", "<freejoint/>")), "floating")
    found, remedy = mended("DX625", case)
    assert only(found).line == 3
    assert only(found).link == case.model.root == remedy.case.model.root == "body_1"
    assert remedy.case.source.text == case.source.text.replace(
        '<body pos="0 0 1">', '<body pos="0 0 1" name="body_1">'
    )
    assert not remedy.changes_physics


@pytest.mark.parametrize("joint", ["", '<joint axis="0 1 0"/>'])
def test_a_base_that_is_fixed_is_found_without_a_name(joint: str) -> None:
    case = Case(XmlSource(TEXT.replace("BEFORE", "").replace("JOINT", joint)))
    assert not find_rule("DX625").detect(case)
