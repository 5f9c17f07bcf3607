"""DX117: the thresholds below which MuJoCo drops an inertial frame, measured, and predicted by the rule."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import pytest

from dynx.agreement.tolerances import BAR
from dynx.doctor import diagnose
from dynx.rules import Case, find_rule
from tests.rules.documents import case_of, joint, link
from tests.rules.trap_cases import mended

mujoco = pytest.importorskip("mujoco")

NONE, SAME_FRAME, SAME_ROTATION = 0, 1, 3
RULE = find_rule("DX117")


def rotor(xyz: str = "0 0 0", rpy: str = "0 0 0", moments: str = "3 2 1.5", ixy: str = "0") -> Case:
    """Make the case of an arm with one inertial."""
    ixx, iyy, izz = moments.split()
    arm = (
        f'<link name="arm"><inertial><origin xyz="{xyz}" rpy="{rpy}"/><mass value="2"/>'
        f'<inertia ixx="{ixx}" ixy="{ixy}" ixz="0" iyy="{iyy}" iyz="0" izz="{izz}"/></inertial></link>'
    )
    return case_of(link("base"), arm, joint("elbow", "base", "arm"))


def mark(case: Case, folder: Path) -> int:
    """Return MuJoCo's mark of the last body: which parts of its inertial frame it does not use."""
    path = folder / "robot.urdf"
    path.write_text(case.source.text)
    return int(mujoco.MjModel.from_xml_path(str(path)).body_sameframe[-1])


@pytest.mark.parametrize(
    ("xyz", "rpy", "expected"),
    [
        ("9.999e-7 -9.999e-7 9.999e-7", "0 0 0", SAME_FRAME),
        ("1e-6 0 0", "0 0 0", SAME_ROTATION),
        ("0 0 -1e-6", "0 0 0", SAME_ROTATION),
        ("5e-7 0 0", "1.999e-6 -1.999e-6 0", SAME_FRAME),
        ("5e-7 0 0", "2.001e-6 0 0", NONE),
        ("5e-7 0 0", "0 0 -2.001e-6", NONE),
        ("0.3 0 0", "0 1.999e-6 0", SAME_ROTATION),
        ("0.3 0 0", "0 2.001e-6 0", NONE),
    ],
)
def test_thresholds(xyz: str, rpy: str, expected: int, tmp_path: Path) -> None:
    case = rotor(xyz, rpy)
    assert mark(case, tmp_path) == expected
    drops_center = expected == SAME_FRAME and xyz != "0 0 0"
    drops_axes = expected != NONE and rpy != "0 0 0"
    message = " ".join(each.message for each in RULE.detect(case))
    assert ("centre of mass" in message) == drops_center
    assert ("principal axes" in message) == drops_axes


@pytest.mark.parametrize(
    ("moments", "rpy", "ixy", "dropped"),
    [
        ("3 2 1.5", f"0 0 {math.pi}", "0", True),
        ("2 3 1.5", f"0 0 {math.pi / 2}", "0", True),
        ("2 3 1.5", "0 0 0", "0", False),
        ("1.5 2 3", "0 0 0", "0", False),
        ("2 2 2", "0.3 0.2 0.1", "0", True),
        ("2 2 1", "0 0 0", "1e-9", False),
        ("3 2 1.5", "0 0 0", "1e-3", False),
        ("3 2 1.5", "0 0 0", "1e-7", True),
    ],
)
def test_mujoco_orders_the_axes_itself(
    moments: str, rpy: str, ixy: str, dropped: bool, tmp_path: Path
) -> None:
    case = rotor("7e-7 0 0", rpy, moments, ixy)
    assert (mark(case, tmp_path) == SAME_FRAME) == dropped
    assert bool(RULE.detect(case)) == dropped


def merged(offset: float) -> Case:
    """Make a robot whose arm and its counterweight balance but for `offset` [m]."""
    arm = link("arm", mass=1.0, moments=(0.3, 0.2, 0.1), center=(0.0, 0.0, 0.2))
    weight = link("weight", mass=1.0, moments=(0.3, 0.2, 0.1), center=(2 * offset, 0.0, -0.2))
    fixed = joint("holder", "arm", "weight", type="fixed")
    return case_of(link("base"), arm, weight, joint("elbow", "base", "arm"), fixed, base="fixed")


@pytest.mark.parametrize(("offset", "dropped"), [(1e-7, True), (1e-5, False), (0.0, False)])
def test_rigidly_connected_links_count_together(offset: float, dropped: bool, tmp_path: Path) -> None:
    case = merged(offset)
    assert (mark(case, tmp_path) == SAME_FRAME) == (abs(offset) < 1e-6)
    assert [each.link for each in RULE.detect(case)] == ["arm"] * dropped
    if not dropped:
        return
    zero = replace(case, choices={"DX117": "zero"})
    _, remedy = mended("DX117", zero)
    assert remedy.changes_physics
    inertial = remedy.case.model.inertial("arm")
    assert inertial.origin.xyz == (0.0, 0.0, 0.0)
    assert inertial.mass == pytest.approx(2.0)
    assert inertial.ixx == pytest.approx(0.68)


@pytest.mark.parametrize("choice", ["call", "zero"])
@pytest.mark.parametrize("base", ["fixed", "floating"])
def test_both_remedies_are_proved(choice: str, base: str) -> None:
    text = rotor("7e-7 0 3e-7", "1e-6 0 0").source.text
    report = diagnose(text, base=base, engines=["mujoco"], choose={"DX117": choice})  # type: ignore[arg-type]
    assert [(each.rule, each.proved) for each in report.differences] == [("DX117", True)]
    assert report.residual <= BAR
    assert bool(report.calls) == (choice == "call")
    assert (report.mended is None) == (choice == "call")


def test_a_single_floating_body_gets_zero_because_the_call_does_not_help() -> None:
    text = case_of(link("ball", center=(7e-7, 0.0, 0.0)), base="floating").source.text
    report = diagnose(text, base="floating", engines=["mujoco"])
    assert [(each.rule, each.proved) for each in report.differences] == [("DX117", True)]
    assert report.residual <= BAR
    assert not report.calls
