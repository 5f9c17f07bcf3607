"""DX520 to DX522: lengths in millimetres, twins that differ, inertias scaled up; no alarm on real robots."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dynx.doctor.mending import readable
from dynx.model.library import find, robots
from dynx.model.xml.source import XmlSource
from dynx.rules import Case, find_rule
from tests.rules.documents import case_of, joint, link, visual
from tests.rules.trap_cases import TRAPS

MILLIMETRES, TWINS, SCALED = find_rule("DX520"), find_rule("DX521"), find_rule("DX522")

REAL = sorted(entry.name for entry in robots() if entry.source == "example-robot-data")

DIFFERENT_TWINS = {
    *("alex_nub_hands", "alex_psyonic_hands", "alex_sake_hands", "icub", "icub_reduced"),
    *("romeo", "romeo_laas_small", "romeo_small"),
}
"""Robots of example-robot-data whose right side has another mass or other moments than their left."""


def arm(unit: float, mass: float, lengths: tuple[float, ...] = (0.1, 0.4, 0.02)) -> Case:
    """Make an arm with joints at these distances [m] in a unit [1/m]."""
    parts = [link(f"link{k}", mass=mass) for k in range(len(lengths) + 1)]
    for k, length in enumerate(lengths):
        parts.append(joint(f"joint{k}", f"link{k}", f"link{k + 1}", f'<origin xyz="0 {length * unit} 0"/>'))
    return case_of(*parts)


@pytest.mark.parametrize(
    ("unit", "mass", "found"),
    [
        (1000.0, 1.0, ["joint1"]),
        (1000.0, 50.0, ["joint1"]),
        (1.0, 1.0, []),
        (1.0, 1e-9, []),
        (1000.0, 0.0, ["joint1"]),
        # A crane of 130 t with joints 10, 40 and 2 m apart, and its kinematics alone.
        (100.0, 32_500.0, []),
        (100.0, 0.0, []),
    ],
)
def test_lengths_in_millimetres(unit: float, mass: float, found: list[str]) -> None:
    assert [each.joint for each in MILLIMETRES.detect(arm(unit, mass))] == found


def test_one_joint_or_joints_at_one_point_have_no_unit() -> None:
    assert MILLIMETRES.detect(arm(1000.0, 1.0, (0.4,))) == []
    assert MILLIMETRES.detect(arm(1000.0, 1.0, (0.0, 0.0, 0.0))) == []


SIZES = [(1000.0, True), (1.0, False)]


@pytest.mark.parametrize(("unit", "found"), SIZES)
@pytest.mark.parametrize("mass", [0.5, 0.0])
@pytest.mark.parametrize("offset", [0.3, 0.0])
def test_a_robot_with_one_joint_distance_or_none_is_judged_by_its_shapes(
    unit: float, found: bool, mass: float, offset: float
) -> None:
    box = visual(f'<box size="{0.1 * unit} {0.05 * unit} {0.2 * unit}"/>')
    links = [link(name, box, mass=mass) for name in ("base", "wheel")]
    one = joint("axle", "base", "wheel", f'<origin xyz="{offset * unit} 0 0"/>')
    place = [(None, "axle") if offset else ("base", None)] if found else []
    assert [(each.link, each.joint) for each in MILLIMETRES.detect(case_of(*links, one))] == place


@pytest.mark.parametrize(("unit", "found"), SIZES)
def test_a_robot_without_shapes_is_judged_by_its_centres_of_mass(unit: float, found: bool) -> None:
    links = [link(name, mass=0.5, center=(0.0, 0.0, 0.08 * unit)) for name in ("base", "table")]
    detections = MILLIMETRES.detect(case_of(*links, joint("axle", "base", "table")))
    assert bool(detections) == found
    for each in detections:
        assert each.message == "centres of mass are 80 m from their joints in the median; the robot has 1 kg"


@pytest.mark.parametrize("mass", [20.0, 0.0])
def test_meshes_count_with_their_scale(tmp_path: Path, mass: float) -> None:
    points = "v 0 0 0\nv 100 0 0\nv 0 60 0\nv 0 0 80\nf 1 2 3\nf 1 2 4\n"
    (tmp_path / "part.obj").write_text(points)
    for scale, found in (("", True), (' scale="0.001 0.001 0.001"', False)):
        shape = visual(f'<mesh filename="part.obj"{scale}/>')
        links = [link(name, shape, mass=mass / 2.0) for name in ("base", "wheel")]
        path = tmp_path / "robot.urdf"
        case = case_of(*links, joint("axle", "base", "wheel"), source=path)
        path.write_bytes(case.source.data)
        assert bool(MILLIMETRES.detect(case)) == found


def test_a_length_in_metres_speaks_against_millimetres() -> None:
    large = visual('<box size="100 50 200"/>')
    near = joint("axle", "base", "wheel", '<origin xyz="0.3 0 0"/>')
    assert MILLIMETRES.detect(case_of(link("base", large), link("wheel", large), near)) == []
    center = link("wheel", large, center=(0.0, 0.0, 0.1))
    assert MILLIMETRES.detect(case_of(link("base", large), center, joint("axle", "base", "wheel"))) == []


def test_a_hall_with_a_light_door_and_an_object_without_joints_are_not_reported() -> None:
    hall, door = visual('<box size="20 30 8"/>'), visual('<box size="1 0.05 2"/>')
    hinge = joint("hinge", "hall", "door", '<origin xyz="10 15 0"/>')
    assert MILLIMETRES.detect(case_of(link("hall", hall), link("door", door), hinge)) == []
    assert MILLIMETRES.detect(case_of(link("cup", visual('<box size="80 80 100"/>')))) == []


def test_the_furthest_joint_is_named_with_its_line() -> None:
    (found,) = MILLIMETRES.detect(arm(1000.0, 2.0))
    assert found.line == 7
    assert found.message == (
        "3 joints are 100 m from their parents in the median, and this one 400 m; the robot has 8 kg"
    )


def pair(left: str, right: str, one: str, other: str, places: tuple[str, str] = ("0 1 0", "0 -1 0")) -> Case:
    """Make a robot with these two links on joints at these places."""
    joints = [
        joint(f"joint of {name}", "torso", name, f'<origin xyz="{place}"/>')
        for name, place in zip((left, right), places, strict=True)
    ]
    return case_of(link("torso"), one, other, *joints)


NAMES = [
    *(("left_arm", "right_arm"), ("LArm", "RArm"), ("arm_L_2", "arm_R_2"), ("FL_calf", "FR_calf")),
    *(("RL_calf", "RR_calf"), ("front_leftR", "front_rightL"), ("leg_l_hip_r", "leg_r_hip_r")),
]


@pytest.mark.parametrize(("left", "right"), NAMES)
def test_twins_are_known_by_their_names(left: str, right: str) -> None:
    case = pair(left, right, link(left, mass=1.0), link(right, mass=1.2))
    (found,) = TWINS.detect(case)
    assert (found.link, found.line) == (left, 3)
    assert found.message == f"the mass is 1 kg, and 1.2 kg on its twin {right} (line 4)"


@pytest.mark.parametrize(
    ("left", "right"), [("arm", "leg"), ("lever", "rever"), ("arm1", "arm2"), ("upper", "lower")]
)
def test_other_names_are_no_twins(left: str, right: str) -> None:
    assert TWINS.detect(pair(left, right, link(left, mass=1.0), link(right, mass=2.0))) == []


@pytest.mark.parametrize("places", [("0 1 0", "0 -1.1 0"), ("0 1 0", "0 0 0")])
def test_links_in_other_places_are_no_twins(places: tuple[str, str]) -> None:
    one, other = link("left", mass=1.0), link("right", mass=2.0)
    assert TWINS.detect(pair("left", "right", one, other, places)) == []


def test_equal_bodies_at_unequal_distances_differ() -> None:
    one, other = link("left", mass=1.0), link("right", mass=1.0)
    (found,) = TWINS.detect(pair("left", "right", one, other, ("0 0.2 0", "0 -0.25 0")))
    assert (found.link, found.line) == ("left", 5)
    assert found.message == "the joint is 0.2 m from its parent, and 0.25 m on its twin right (line 6)"


def test_equal_bodies_below_twins_at_unequal_distances_differ() -> None:
    arms = [link(name) for name in ("torso", "left_arm", "right_arm", "left_hand", "right_hand")]
    shoulders = [joint(f"{side}_shoulder", "torso", f"{side}_arm") for side in ("left", "right")]
    wrists = [
        joint(f"{side}_wrist", f"{side}_arm", f"{side}_hand", f'<origin xyz="{x} 0 0"/>')
        for side, x in (("left", 0.3), ("right", 0.31))
    ]
    (found,) = TWINS.detect(case_of(*arms, *shoulders, *wrists))
    assert found.link == "left_hand"


@pytest.mark.parametrize(
    ("places", "kind", "mass"),
    [
        (("0 0.2 0", "0 -0.2005 0"), "revolute", 1.0),  # half a millimetre
        (("0 0.2 0", "0 -0.25 0"), "fixed", 1.0),  # a pair of cameras need not be mirrored
        (("0 0.2 0", "0 -0.25 0"), "prismatic", 1.0),  # the zero of a slide may be anywhere along it
        (("0 0.2 0", "0 -0.25 0"), "revolute", 1.02),  # another part
    ],
)
def test_small_shifts_other_joints_and_other_parts_are_no_unequal_twins(
    places: tuple[str, str], kind: str, mass: float
) -> None:
    links = [link("torso"), link("left"), link("right", mass=mass)]
    joints = [
        joint(f"joint of {name}", "torso", name, f'<origin xyz="{place}"/>', type=kind)
        for name, place in zip(("left", "right"), places, strict=True)
    ]
    assert TWINS.detect(case_of(*links, *joints)) == []


numbers = st.floats(-0.3, 0.3)


@given(st.tuples(numbers, numbers, numbers), st.permutations([0, 1, 2]), st.sampled_from([1, -1]))
def test_a_reflected_or_turned_twin_is_no_difference(
    center: tuple[float, ...], order: list[int], sign: int
) -> None:
    moments = np.array([0.01, 0.02, 0.025])
    x, y, z = center
    one = link("left", center=(x, y, z), moments=(0.01, 0.02, 0.025))
    a, b, c = (float(value) for value in np.array(center)[order])
    i, j, k = (float(value) for value in moments[order])
    other = link("right", center=(a, sign * b, c), moments=(i, j, k))
    assert TWINS.detect(pair("left", "right", one, other)) == []


@pytest.mark.parametrize(
    ("change", "part"),
    [
        ({"mass": 1.12}, "the mass is 1 kg, and 1.12 kg"),
        ({"moments": (0.01, 0.02, 0.022)}, "the principal moments are 0.01, 0.02, 0.025 kg m^2, and"),
        ({"center": (0.1, 0.0, 0.02)}, "the centre of mass is 0.224 m from the joint, and 0.102 m"),
    ],
)
def test_what_differs_is_named(change: dict[str, object], part: str) -> None:
    usual: dict[str, object] = {"mass": 1.0, "moments": (0.01, 0.02, 0.025), "center": (0.1, 0.0, 0.2)}
    one = link("left", **usual)  # type: ignore[arg-type]
    other = link("right", **(usual | change))  # type: ignore[arg-type]
    (found,) = TWINS.detect(pair("left", "right", one, other))
    assert found.message.startswith(part)


BOX, CYLINDER = '<box size="0.1 0.2 0.3"/>', '<cylinder radius="0.05" length="0.3"/>'
PER_MASS = {
    BOX: np.array([0.2**2 + 0.3**2, 0.1**2 + 0.3**2, 0.1**2 + 0.2**2]) / 12.0,
    CYLINDER: np.array([0.05**2 / 4 + 0.3**2 / 12, 0.05**2 / 4 + 0.3**2 / 12, 0.05**2 / 2]),
}


def solid(name: str, shape: str, factor: float, mass: float) -> str:
    """Write a link with a multiple of the moments of its shape."""
    x, y, z = (float(value) for value in PER_MASS[shape] * mass * factor)
    return link(name, visual(shape), mass=mass, moments=(x, y, z))


@pytest.mark.parametrize(
    ("factors", "found"),
    [
        ((10.0, 10.0), ["a", "b"]),
        ((2.0, 2.02), ["a", "b"]),
        ((1.0, 1.0), []),
        ((10.0, 20.0), []),
        ((0.1, 0.1), []),
    ],
)
def test_one_factor_on_shapes_of_other_sides(factors: tuple[float, float], found: list[str]) -> None:
    one, other = solid("a", BOX, factors[0], 2.0), solid("b", CYLINDER, factors[1], 0.3)
    assert [each.link for each in SCALED.detect(case_of(one, other, joint("j", "a", "b")))] == found


@pytest.mark.parametrize(
    "shape", ['<sphere radius="0.1"/>', '<box size="0.1 0.1 0.1"/>', '<mesh filename="gone.stl"/>']
)
def test_shapes_with_one_ratio_and_copies_of_a_part_are_no_evidence(shape: str) -> None:
    ball = link("b", visual(shape), mass=1.0, moments=(0.04, 0.04, 0.04))
    assert SCALED.detect(case_of(solid("a", BOX, 10.0, 2.0), ball, joint("j", "a", "b"))) == []
    copies = [solid(name, BOX, 10.0, 2.0) for name in ("a", "b")]
    assert SCALED.detect(case_of(*copies, joint("j", "a", "b"))) == []


@pytest.mark.parametrize("name", REAL)
def test_real_robots(name: str) -> None:
    path = find(name)
    case = readable(Case(XmlSource(path.read_bytes(), str(path)))).case
    if not case.readable:
        pytest.skip("dynx refuses it")
    assert MILLIMETRES.detect(case) == SCALED.detect(case) == []
    assert bool(TWINS.detect(case)) == (path.stem in DIFFERENT_TWINS)


@pytest.mark.parametrize("rule", [MILLIMETRES, TWINS, SCALED], ids=lambda rule: rule.id)
def test_the_other_traps_have_none_of_them(rule: object) -> None:
    for path in TRAPS.glob("*.urdf"):
        case = readable(Case(XmlSource(path.read_bytes(), str(path)))).case
        if case.readable:
            assert bool(rule.detect(case)) == (path.stem == rule.trap().removesuffix(".urdf")), path  # type: ignore[attr-defined]
