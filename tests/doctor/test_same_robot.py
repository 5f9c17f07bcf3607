"""A mended file describes the robot of the file: its coordinates, its mass and what engines read in it."""

from __future__ import annotations

from dataclasses import replace
from itertools import product
from pathlib import Path

import pytest

from dynx import diagnose, load
from dynx.cli.doctor.files import write_mended
from dynx.doctor.diagnosis import open_case
from dynx.doctor.mending import Mending, level_of, mend, reading_change
from dynx.errors import ArgumentError
from dynx.loaded import loader_class
from dynx.model.tree import Base
from dynx.model.xml.source import XmlSource
from dynx.rules import Case, Remedy, find_rule
from tests.rules.documents import case_of, joint, link

BASES: tuple[Base, ...] = ("fixed", "floating")


def floating_robot(root: str, child: str, legs: int) -> str:
    """Write a robot on a floating joint below an empty root, with legs of one joint each."""
    parts = [
        f'<link name="{root}"/>',
        link(child, mass="5", moments=(0.1, 0.2, 0.25)),
        joint("free", root, child, type="floating"),
    ]
    for k in range(legs):
        parts += [link(f"leg{k}", mass="1", moments=(0.02, 0.02, 0.01)), joint(f"hip{k}", child, f"leg{k}")]
    return f'<robot name="r">{"".join(parts)}</robot>'


@pytest.mark.parametrize(("root", "legs", "base"), [*product(("world", "base_link"), (0, 1, 2), BASES)])
def test_a_floating_joint_at_the_root_leaves_the_coordinates_and_the_mass(
    root: str, legs: int, base: Base
) -> None:
    text = floating_robot(root, "trunk", legs)
    report = diagnose(text, base=base, counterexamples=False)
    before, after = (load(each, base=base) for each in (text, report.mended or text))
    assert before.nv == after.nv == legs + 6 * (base == "floating")
    assert report.withheld is None
    masses = [sum(each.inertial.mass for each in one.links if each.inertial) for one in (before, after)]
    assert masses[0] == pytest.approx(masses[1], abs=1e-12)
    assert report.explained


@pytest.mark.parametrize("base", BASES)
def test_a_robot_that_floats_by_its_file_is_not_fixed_at_a_lower_level(base: Base) -> None:
    case = Case(XmlSource(floating_robot("world", "trunk", 1)), base)
    rule = find_rule("DX211")
    remedy = rule.remedy(case, rule.detect(case))
    assert remedy is not None
    assert level_of(rule, case, remedy) == "physics"
    report = diagnose(case.source.text, base=base, level="rounding", counterexamples=False)
    assert 'type="floating"' in (report.mended or case.source.text)


def changed_robots() -> dict[str, tuple[str, str]]:
    """Write pairs of robots that are not the same, with the part of the sentence about it."""
    base, arm = link("base", mass="2", moments=(1, 1, 1)), link("arm", mass="1", moments=(0.1, 0.1, 0.1))
    one = joint("j", "base", "arm")
    parts = [base, arm, one]
    return {
        "coordinates": ("".join([base, arm, joint("j", "base", "arm", type="fixed")]), "0 coordinates"),
        "mass": ("".join(parts).replace('"2"', '"2.1"'), "3.1 kg instead of 3 kg"),
        "inertia": ("".join(parts).replace('ixx="0.1"', 'ixx="0.11"'), "equations of motion"),
    }


@pytest.mark.parametrize("kind", changed_robots())
def test_another_robot_is_named_and_not_written(kind: str, tmp_path: Path) -> None:
    parts = (
        link("base", mass="2", moments=(1, 1, 1)),
        link("arm", mass="1", moments=(0.1, 0.1, 0.1)),
        joint("j", "base", "arm"),
    )
    case = case_of(*parts)
    other, sentence = changed_robots()[kind]
    mended = case.with_source(XmlSource(f'<robot name="r">{other}</robot>'))
    change = reading_change(case, Mending(mended, ((find_rule("DX105"), Remedy(mended, "")),)))
    assert change is not None
    assert sentence in change
    report = replace(diagnose(case.source.text, counterexamples=False), withheld=change)
    with pytest.raises(ArgumentError, match="not written"):
        write_mended(str(tmp_path / "r.urdf"), report, over_input=False)
    assert not (tmp_path / "r.urdf").exists()


@pytest.mark.parametrize("root", ["world", "base"])
@pytest.mark.parametrize("engine", ["pinocchio", "pybullet", "mujoco", "drake"])
def test_the_printed_call_loads_the_file(root: str, engine: str, tmp_path: Path) -> None:
    loader = loader_class(engine)
    parts = (
        f'<link name="{root}"/>',
        link("arm", mass="1", moments=(0.1, 0.1, 0.1)),
        joint("j", root, "arm"),
    )
    path = tmp_path / "r.urdf"
    path.write_text(f'<robot name="r">{"".join(parts)}</robot>', encoding="utf-8")
    report = diagnose(str(path), engines=[engine], counterexamples=False)
    names = namespace(engine, path, root)
    exec(report.engines[0].call, names)
    assert report.engines[0].call == loader.load_call(False, root)


def namespace(engine: str, path: Path, root: str) -> dict[str, object]:
    """Return the names that the printed calls use."""
    names: dict[str, object] = {"path": str(path), "root_link": root}
    if engine == "drake":
        exec("from pydrake.multibody.plant import MultibodyPlant", names)
        exec("from pydrake.multibody.parsing import Parser", names)
    elif engine == "pybullet":
        exec("import pybullet as p\np.connect(p.DIRECT)", names)
    else:
        exec(f"import {engine}", names)
    return names


UNREADABLE = {
    "mass": ("TODO", "inf", "", "25 g", "1/2"),
    "xyz": ("1/5 0 0", "0 0 pi", "a b c", "inf 0 0"),
    "upper": ("pi/2", "90deg", "1.5*2"),
}


@pytest.mark.parametrize(
    ("name", "written"), [(k, text) for k, texts in UNREADABLE.items() for text in texts]
)
def test_text_that_is_no_number_is_left_and_listed_with_its_line(name: str, written: str) -> None:
    text = f"""<robot name="r">
      <link name="base"/>
      <link name="arm"><inertial>
        <mass value="{written if name == "mass" else "1"}"/>
        <inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial></link>
      <joint name="j" type="revolute"><parent link="base"/><child link="arm"/><axis xyz="0 0 1"/>
        <origin xyz="{written if name == "xyz" else "0 0 0"}"/>
        <limit lower="-1" upper="{written if name == "upper" else "1"}" effort="1" velocity="1"/></joint>
    </robot>"""
    report = diagnose(text, counterexamples=False)
    assert report.status == "refused"
    assert report.mended is None
    line = {"mass": 4, "xyz": 7, "upper": 8}[name]
    assert [(each.rule, each.line) for each in report.findings] == [("DX420", line)]
    assert "left undone" in report.findings[0].message


def test_findings_name_links_and_joints_of_the_file() -> None:
    parts = [
        link("base", mass="1", moments=(0.1, 0.1, 0.1)),
        '<link name="cam%1"/>',
        link("ball", mass="1", moments=(0.1, 0.1, 0.1)),
        joint("look", "base", "cam%1"),
        joint("s", "base", "ball", type="spherical"),
    ]
    case = case_of(*parts)
    for base in BASES:
        report = diagnose(case.source.text, base=base, counterexamples=False)
        assert {each.link for each in report.findings} <= {None, *case.links}
        assert {each.joint for each in report.findings} <= {None, *case.joints}
        assert "cam_1" not in " ".join(each.message for each in report.findings if each.rule != "DX414")


@pytest.mark.parametrize("kind", ["spherical", "planar", "floating"])
def test_a_joint_of_several_freedoms_keeps_its_damping_and_does_not_crash(kind: str) -> None:
    parts = [
        link("base", mass="1", moments=(0.1, 0.1, 0.1)),
        link("ball", mass="1", moments=(0.1, 0.1, 0.1)),
        joint("s", "base", "ball", type=kind).replace("</joint>", '<dynamics damping="0.3"/></joint>'),
    ]
    report = diagnose(case_of(*parts).source.text, counterexamples=False)
    assert report.mended is not None
    joints = load(report.mended).joints
    assert len(joints) == (6 if kind == "floating" else 3)
    assert {each.dynamics.damping for each in joints if each.dynamics} == {0.3}
    assert all(each.dynamics for each in joints)
    assert not any("crash" in str(each.no_results) for each in report.engines)


@pytest.mark.parametrize("fault", ['radius="0.1" length="-0.2"', 'radius="-0.1" length="0.2"'])
def test_a_negative_size_loses_its_sign_and_not_its_shape(fault: str) -> None:
    shape = f"<collision><geometry><cylinder {fault}/></geometry></collision>"
    case = case_of(link("base", mass="1", moments=(0.1, 0.1, 0.1)).replace("</link>", f"{shape}</link>"))
    mended = mend(case).case
    assert 'radius="0.1" length="0.2"' in mended.source.text


def test_a_document_type_without_entities_is_read() -> None:
    text = '<?xml version="1.0"?>\n<!DOCTYPE robot>\n<robot name="r"><link name="a"/></robot>'
    assert open_case(text, "fixed", {}).readable
