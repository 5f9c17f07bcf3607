"""Faults of visuals for which an engine refuses the file reach the engines, and are found at their line."""

from __future__ import annotations

import pytest

from dynx.doctor import diagnose
from dynx.doctor.examination import without_meshes
from dynx.loaded import installed_engines
from dynx.model.xml.source import XmlSource
from dynx.rules import Case, find_rule

ARM = """<robot name="arm">
  <link name="base"/>
  <link name="tool">
    <inertial>
      <mass value="2"/>
      <inertia ixx="0.1" ixy="0" ixz="0" iyy="0.2" iyz="0" izz="0.15"/>
    </inertial>
    <visual>
      VISUAL
    </visual>
  </link>
  <joint name="elbow" type="continuous">
    <parent link="base"/>
    <child link="tool"/>
    <axis xyz="1 0 0"/>
  </joint>
</robot>
"""

BOX = '<geometry><box size="1 1 1"/></geometry>'
MESH = '<geometry><mesh filename="package://nowhere/a.stl"/></geometry>'

REFUSED = {
    "<geometry><box/></geometry>": "pybullet",
    '<geometry><sphere radii="1"/></geometry>': "pybullet",
    '<geometry><cylinder radius="1"/></geometry>': "pybullet",
    '<geometry><capsule length="1"/></geometry>': "pybullet",
    "<geometry><mesh/></geometry>": "pybullet",
    '<geometry><mesh filename=""/></geometry>': "pybullet",
    f'{BOX}<material><color rgba="1 0 0 1"/></material>': "pybullet",
    f'{BOX}<material name="x"><color/></material>': "mujoco",
    f'{MESH}<material name="x"><color rgba="red"/></material>': "mujoco",
    f'{BOX}<material name="x"><color rgba="1 0 0"/></material>': "mujoco",
}
LOADED = [
    BOX,
    MESH,
    '<geometry><box size=""/></geometry>',
    f'{BOX}<material name=""><color rgba="1 0 0 1"/></material>',
    '<geometry><box size="1 1 1"/><sphere/></geometry>',
    f'{BOX}<material name="nosuch"/>',
]


def arm(visual: str) -> str:
    """Return the robot with a visual."""
    return ARM.replace("VISUAL", visual)


@pytest.mark.parametrize("visual", REFUSED)
def test_a_visual_for_which_an_engine_refuses_the_file_is_found_and_mended(visual: str) -> None:
    engine = REFUSED[visual]
    if engine not in installed_engines():
        pytest.skip(f"{engine} is not installed")
    report = diagnose(arm(visual), engines=["pinocchio", engine], samples=1)
    [finding] = [each for each in report.findings if each.rule == "DX428"]
    assert (finding.link, finding.line, finding.engines, finding.proved) == ("tool", 9, (engine,), True)
    assert [each.refused is None for each in report.engines] == [True, False]
    assert report.explained
    assert report.mended is not None
    assert diagnose(report.mended, engines=["pinocchio", engine], samples=1).alike
    kept = diagnose(arm(visual), engines=["pinocchio", engine], samples=1, choose={"DX428": "keep"})
    assert kept.mended is None


@pytest.mark.parametrize("visual", LOADED)
def test_what_every_engine_loads_is_not_reported(visual: str) -> None:
    source = XmlSource(arm(visual))
    assert not find_rule("DX428").detect(Case(source))
    assert "<visual" not in without_meshes(source).text


def test_a_visual_is_left_without_the_file_that_its_mesh_names() -> None:
    text = without_meshes(XmlSource(arm(f"{MESH}<material><color/></material>"))).text
    assert "<material><color/></material>" in text
    assert "nowhere" not in text
