"""A body of MJCF without an inertia where a setting says that geoms have none."""

from __future__ import annotations

import pytest

from dynx.model.xml.source import XmlSource
from dynx.rules import Case, find_rule
from tests.rules.trap_cases import mended, only

TEXT = """<mujoco model="arm">
  <compiler inertiafromgeom="SETTING"/>
  <worldbody><body name="mast">GEOM<body name="arm"><joint axis="0 1 0"/>
  <inertial pos="0 0 0.1" mass="1" diaginertia="0.1 0.1 0.1"/><geom size="0.1"/></body></body></worldbody>
</mujoco>"""


def case_of(setting: str, geom: str = "") -> Case:
    return Case(XmlSource(TEXT.replace("SETTING", setting).replace("GEOM", geom)))


def test_the_setting_becomes_the_default_which_changes_no_inertia() -> None:
    case = case_of("false")
    found, remedy = mended("DX626", case)
    assert only(found).line == 2
    assert "mast" in only(found).message
    assert remedy.case.source.text == case.source.text.replace('"false"', '"auto"')
    assert remedy.case.model.links == case.model.links


@pytest.mark.parametrize(("setting", "geom"), [("auto", ""), ("true", ""), ("false", '<geom size="0.2"/>')])
def test_a_setting_with_an_effect_stays(setting: str, geom: str) -> None:
    assert not find_rule("DX626").detect(case_of(setting, geom))
