"""DX216: what engines make of a range of which one end is not written, and of the mended one."""

from __future__ import annotations

import math

import pytest

from dynx.doctor.examination import temporary_document
from dynx.engines.silence import silence
from dynx.loaded import installed_engines, load_as, loader_class
from dynx.rules import Case, find_rule
from tests.rules.documents import case_of, joint, link
from tests.rules.trap_cases import changed_lines, mended, only, trap

NONE = (-math.inf, math.inf)

Range = tuple[float, float]

# What is written of the range -> what each engine holds.
HELD: dict[str, dict[str, Range]] = {
    'lower="-1.5"': {
        "pinocchio": (-1.5, 0.0),
        "pybullet": (-1.5, -1.0),
        "mujoco": NONE,
        "drake": (-1.5, math.inf),
    },
    'lower="-0.5"': {
        "pinocchio": (-0.5, 0.0),
        "pybullet": NONE,
        "mujoco": NONE,
        "drake": (-0.5, math.inf),
    },
    'upper="1.5"': {
        "pinocchio": (0.0, 1.5),
        "pybullet": (0.0, 1.5),
        "mujoco": NONE,
        "drake": (-math.inf, 1.5),
    },
    'lower="-1.5" upper="0"': dict.fromkeys(("pinocchio", "pybullet", "mujoco", "drake"), (-1.5, 0.0)),
}


def arm(written_ends: str, type: str = "revolute") -> Case:
    """Return one joint with such a limit."""
    limit = f'<limit {written_ends} effort="1" velocity="1"/>'
    return case_of(link("base"), link("arm"), joint("elbow", "base", "arm", type=type, limit=limit))


@pytest.mark.parametrize("engine", installed_engines())
@pytest.mark.parametrize("type", ["revolute", "prismatic"])
@pytest.mark.parametrize("ends", HELD)
def test_the_range_that_an_engine_holds(ends: str, type: str, engine: str) -> None:
    case = arm(ends, type)
    with temporary_document(case.source) as path, silence(), load_as(engine, path, case.model) as robot:
        held = robot.describe().joints["elbow"].limits
    assert held == HELD[ends][engine], loader_class(engine).engine_version()


@pytest.mark.parametrize("mend", [False, True])
def test_pybullet_stops_a_joint_on_its_way_up_until_the_file_is_mended(mend: bool) -> None:
    p = pytest.importorskip("pybullet")
    case = trap("DX216")
    if mend:
        case = mended("DX216", case)[1].case
    client = p.connect(p.DIRECT)
    try:
        with temporary_document(case.source) as path, silence():
            body = p.loadURDF(str(path), useFixedBase=True, physicsClientId=client)
        names = [
            p.getJointInfo(body, k, physicsClientId=client)[1] for k in range(p.getNumJoints(body, client))
        ]
        elbow = names.index(b"elbow")
        for k in range(len(names)):
            p.setJointMotorControl2(body, k, p.VELOCITY_CONTROL, force=0, physicsClientId=client)
        p.resetJointState(body, elbow, -0.5, 1.0, physicsClientId=client)
        for _ in range(48):
            p.stepSimulation(physicsClientId=client)
        moved = p.getJointState(body, elbow, physicsClientId=client)[0] + 0.5
    finally:
        p.disconnect(client)
    # A fifth of a second at 1 rad/s, of which nothing without an upper limit.
    assert (moved > 0.15) == mend
    assert mend or moved < 0.01


@pytest.mark.parametrize("type", ["revolute", "prismatic"])
@pytest.mark.parametrize("ends", ['lower="-1"', 'lower="-1.0000001"', 'lower=" -300"'])
def test_the_end_that_urdf_has_is_written_and_the_robot_stays(ends: str, type: str) -> None:
    case = arm(ends, type)
    found, remedy = mended("DX216", case)
    assert only(found).joint == "elbow"
    assert remedy.case.model == case.model
    limits = remedy.case.model.joint("elbow").limits
    assert (limits.lower, limits.upper) == (case.model.joint("elbow").limits.lower, 0.0)


@pytest.mark.parametrize(
    ("ends", "type"),
    [
        ('lower="-0.999"', "revolute"),
        ('upper="2"', "revolute"),
        ('lower="-2" upper="-1"', "revolute"),
        ("", "prismatic"),
        ('lower="-2"', "continuous"),
    ],
)
def test_a_range_that_no_motion_shows_is_no_matter(ends: str, type: str) -> None:
    assert find_rule("DX216").detect(arm(ends, type)) == []


def test_one_line_of_the_trap_is_changed() -> None:
    case = trap("DX216")
    assert changed_lines(case, mended("DX216", case)[1].case) == [
        '<limit lower="-1.5" effort="30" velocity="5"/>'
    ]
