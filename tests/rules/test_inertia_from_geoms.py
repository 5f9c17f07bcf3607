"""Bodies of MJCF whose inertia follows from geoms: what Pinocchio leaves out, and what PyBullet misplaces."""

from __future__ import annotations

import numpy as np
import pytest

import dynx
from dynx.doctor.diagnosis import compare_as_loaded
from dynx.loaded import installed_engines
from dynx.model.xml.source import XmlSource
from dynx.rules import Case, find_rule
from tests.rules.trap_cases import mended, only

ARM = """<mujoco model="arm">
  <default><default class="drawn"><geom contype="0" conaffinity="0"/></default></default>
  <worldbody>
    <body name="upper">
      <joint name="shoulder" type="hinge" axis="0 1 0"/>
      <inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>
      <body name="lower" pos="0 0 1">
        <joint name="elbow" type="hinge" axis="0 1 0"/>
        GEOMS
      </body>
    </body>
  </worldbody>
</mujoco>"""


def arm(geoms: str) -> Case:
    return Case(XmlSource(ARM.replace("GEOMS", geoms)))


@pytest.mark.parametrize(
    ("geom", "found"),
    [
        ('<geom size="0.1" contype="0" conaffinity="0"/>', True),
        ('<geom size="0.1" class="drawn" mass="2"/>', True),
        ('<geom size="0.1" class="drawn" mass="0"/>', False),
        ('<geom size="0.1" class="drawn" density="0"/>', False),
        ('<geom size="0.1" class="drawn" density="0" mass="1"/>', True),
        ('<geom size="0.1" contype="0"/>', False),
        ('<geom size="0.1" conaffinity="0"/>', False),
        ('<geom size="1 1 1" class="drawn" type="plane"/>', False),
        ('<geom size="0.1" class="drawn"/><inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>', False),
    ],
)
def test_the_mass_of_a_geom_without_contacts(geom: str, found: bool) -> None:
    assert bool(find_rule("DX621").detect(arm(geom))) == found


def test_pinocchio_reads_the_inertia_that_is_written() -> None:
    if "pinocchio" not in installed_engines():
        pytest.skip("needs Pinocchio")
    case = arm('<geom size="0.1" class="drawn" mass="2"/>')
    after = mended("DX621", case)[1].case
    np.testing.assert_allclose(
        after.model.inertial("lower").link_tensor, case.model.inertial("lower").link_tensor, rtol=1e-14
    )
    reports = [
        compare_as_loaded(each.source.text, engines=["pinocchio"], samples=1) for each in (case, after)
    ]
    assert [report.alike for report in reports] == [False, True]


def test_several_geoms_are_counted() -> None:
    case = arm('<geom size="0.1" class="drawn"/><geom size="0.2"/><geom size="0.3" class="drawn"/>')
    found = only(list(find_rule("DX621").detect(case)))
    assert found.message == "2 geoms of the body touch nothing, and have a mass"
    assert found.link == "lower"


CAPSULE = '<geom type="capsule" size="0.1" fromto="0 0 0 0 0 0.4"/>'
TILTED = '<geom type="capsule" size="0.1" fromto="0 0 0 0 0.2 0.4"/>'
BOX = '<geom type="box" size="0.1 0.1 0.2" pos="0 0 0.2"/>'


@pytest.mark.parametrize(
    ("geoms", "message"),
    [
        ('<geom size="0.1"/>', None),
        (CAPSULE, None),
        (BOX + CAPSULE, None),
        (BOX, "the centre of mass of the body follows from geoms"),
        (CAPSULE + BOX, "the centre of mass of the body follows from geoms"),
        (TILTED, "the principal axes of the body follow from geoms"),
        (
            TILTED + '<geom size="0.1"/>',
            "the centre of mass and the principal axes of the body follow from geoms",
        ),
        (BOX + '<inertial pos="0 0 1" mass="1" diaginertia="1 1 1"/>', None),
    ],
)
def test_the_centre_of_mass_from_geoms(geoms: str, message: str | None) -> None:
    """Where nothing is found, PyBullet holds the centre of mass and the axes that dynx computes."""
    case = arm(geoms)
    found = list(find_rule("DX622").detect(case))
    assert [each.message for each in found] == ([] if message is None else [message])
    if message is not None:
        mended("DX622", case)


@pytest.mark.parametrize(
    ("geom", "message"),
    [
        ('<geom type="box" size="0.1" fromto="0 0 0 0 0 0.4"/>', "a geom is a box between two points"),
        (
            '<geom type="ellipsoid" size="0.1" fromto="0 0 0 0 0 0.4"/>',
            "a geom is an ellipsoid between two points",
        ),
        ('<geom type="box" size="0.1" fromto="0 0 0 0 0 0.4" mass="0"/>' + CAPSULE, None),
        (CAPSULE, None),
        (BOX, None),
    ],
)
def test_a_box_between_points(geom: str, message: str | None) -> None:
    case = arm(geom)
    assert [each.message for each in find_rule("DX624").detect(case)] == (
        [] if message is None else [message]
    )
    if message is not None:
        mended("DX624", case)


def test_geoms_that_overrule_inertials_are_left() -> None:
    text = ARM.replace("GEOMS", BOX).replace("<default>", '<compiler inertiafromgeom="true"/><default>', 1)
    for rule in ("DX621", "DX622", "DX624"):
        assert not find_rule(rule).detect(Case(XmlSource(text)))


def test_a_humanoid_is_explained() -> None:
    """Limbs between two points, joints drawn by spheres without contacts, and a head on the trunk."""
    if not {"pinocchio", "pybullet"} <= set(installed_engines()):
        pytest.skip("needs Pinocchio and PyBullet")
    geoms = TILTED + '<geom size="0.1" class="drawn" mass="2"/>' + BOX
    report = dynx.diagnose(ARM.replace("GEOMS", geoms), engines=["pinocchio", "pybullet"], samples=2)
    assert report.explained, report.unexplained
    effects = {(each.rule, engine) for each in report.differences for engine in each.engines}
    assert effects == {("DX610", "pybullet"), ("DX621", "pinocchio"), ("DX622", "pybullet")}
