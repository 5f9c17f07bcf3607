"""Group states of SRDF as named configurations: what Pinocchio reads of the same files, and faults."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import dynx
from dynx.errors import DescriptionError, RobotNotFoundError
from dynx.model import Model
from tests.conftest import needs_examples

ARM = """<robot name="arm"><link name="base"/><link name="a"/><link name="b"/>
  <joint name="i" type="revolute"><parent link="base"/><child link="a"/><limit lower="-1" upper="1"/></joint>
  <joint name="j" type="continuous"><parent link="a"/><child link="b"/></joint></robot>"""
SRDF = """<?xml version="1.0"?>
<robot name="arm">
  <group name="all"><joint name="i"/></group>
  <virtual_joint name="root_joint" type="floating" parent_frame="world" child_link="base"/>
  <group_state name="home" group="all"><joint name="i" value="0.5"/><joint name="j" value="-2"/></group_state>
  <group_state name="up" group="all"><joint name="root_joint" value="1 2 3 0 0 1 0"/></group_state>
  <group_state name="rest" group="all"><joint name="j" value="1"/></group_state>
  <group_state name="rest" group="wrist"><joint name="j" value="2"/></group_state>
  <disable_collisions link1="base" link2="a" reason="Adjacent"/>
</robot>"""


def arm(text: str = SRDF, base: dynx.model.tree.Base = "fixed") -> Model:
    return dynx.load(ARM, base=base).with_group_states(text)


def test_group_states_are_configurations(tmp_path: Path) -> None:
    model = arm(base="floating")
    assert list(model.configurations) == ["home", "up", "all/rest", "wrist/rest"]
    assert model.configurations["home"].tolist() == [0.0] * 6 + [1.0, 0.5, -2.0]
    assert model.configurations["up"].tolist() == [1.0, 2.0, 3.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]
    assert model.configurations["wrist/rest"][-1] == 2.0
    notes = "\n".join(map(str, model.notes))
    assert "not read of SRDF: <virtual_joint>, <disable_collisions>" in notes
    path = tmp_path / "arm.srdf"
    path.write_text(SRDF)
    assert dynx.load(ARM).with_group_states(path).configurations["home"].tolist() == [0.5, -2.0]
    assert "states joints that arm has not: 'root_joint'" in "\n".join(map(str, arm().notes))
    assert np.array_equal(model.integrate("home", np.zeros(8)), model.configurations["home"])
    assert dynx.load(arm().to_mjcf()).configurations["home"].tolist() == [0.5, -2.0]


@pytest.mark.parametrize(
    ("old", "new", "message", "line"),
    [
        ('value="0.5"', 'value="0.5 1"', "has 2 values of joint 'i'; wanted 1", 5),
        ('value="0.5"', 'value="up"', "value", 5),
        ('value="0.5"', "", "value", 5),
        ('name="home"', "", "a group state has no name", 5),
        ('group="wrist"', "", "group", 8),
        ('"1 2 3 0 0 1 0"', '"1 2 3 0 0 1 1"', "quaternion", 6),
        ('group="wrist"', 'group="all"', "exists already", 8),
    ],
)
def test_faults_are_errors_with_the_line(old: str, new: str, message: str, line: int) -> None:
    with pytest.raises(DescriptionError, match=message) as caught:
        arm(SRDF.replace(old, new), "floating")
    assert caught.value.line == line


def test_other_files_are_refused(tmp_path: Path) -> None:
    with pytest.raises(DescriptionError, match="root element is <mujoco>"):
        arm("<mujoco/>")
    with pytest.raises(RobotNotFoundError):
        dynx.load(ARM).with_group_states(tmp_path / "no.srdf")


@needs_examples
@pytest.mark.parametrize("name", ["anymal", "solo12", "talos_full", "romeo", "b1"])
def test_pinocchio_reads_the_same_configurations(name: str) -> None:
    pinocchio = pytest.importorskip("pinocchio")
    try:
        model = dynx.load(name, base="floating")
    except RobotNotFoundError:
        pytest.skip(f"no robot {name}")
    folder = Path(model.source).parents[1] / "srdf"
    found = 0
    for path in sorted(folder.glob("*.srdf")):
        theirs = pinocchio.buildModelFromUrdf(model.source, pinocchio.JointModelFreeFlyer())
        pinocchio.loadReferenceConfigurations(theirs, str(path), False)
        try:
            ours = model.with_group_states(path)
        except DescriptionError:
            continue
        order = model.order_of("pinocchio")
        for entry in theirs.referenceConfigurations:
            state, want = entry.key(), np.array(entry.data())
            if state in ours.configurations:
                assert np.allclose(order.from_dynx(ours.configurations[state]), want, rtol=0.0, atol=1e-12)
                found += 1
    assert found
