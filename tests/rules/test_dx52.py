"""DX520 to DX522: lengths in millimetres, twins that differ, inertias scaled up; no alarm on real robots."""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dynx.doctor.mending import readable
from dynx.model.library import find, robots
from dynx.model.xml.source import XmlSource
from dynx.rules import Case, Detection, find_rule
from dynx.spatial.scalar import Floats
from dynx.spatial.so3 import quat_exp, rotation_from_quat, rpy_from_rotation
from tests.rules.documents import case_of, joint, link, visual
from tests.rules.trap_cases import TRAPS

MILLIMETRES, TWINS, SCALED = find_rule("DX520"), find_rule("DX521"), find_rule("DX522")

REAL = sorted(entry.name for entry in robots() if entry.source == "example-robot-data")

DIFFERENT_TWINS = {
    *("alex_nub_hands", "alex_psyonic_hands", "alex_sake_hands", "icub", "icub_reduced"),
    *("romeo", "romeo_laas_small", "romeo_small"),
    # Limits.
    *("human", "simple_humanoid", "simple_humanoid_classical"),
    # Products of inertia.
    *("talos_reduced", "talos_reduced_box", "talos_reduced_corrected", "tiago_dual"),
}
"""Robots of example-robot-data whose right side has other masses, tensors or limits than their left."""


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


REFLECTION = np.diag([1.0, -1.0, 1.0])
"""Reflection at the plane between the sides of these robots, y = 0 in the torso."""


@dataclass(frozen=True)
class Side:
    """One side in the axes of the torso: place, axis and limits of the joint; centre of mass from there."""

    place: Floats
    axis: Floats
    center: Floats
    tensor: Floats
    range: tuple[float, float] = (-0.3, 0.8)
    most: tuple[float, float] = (10.0, 5.0)
    """Limits of effort and velocity."""

    def reflected(self, sense: float, type: str = "revolute") -> Side:
        """Return the other side; `sense` is the sign of its positions in a reflected posture."""
        # A rotation about an axis is reflected into one about the reflected axis in the other sense.
        sign = sense if type == "prismatic" else -sense
        low, high = sorted(sense * end for end in self.range)
        return Side(
            REFLECTION @ self.place,
            sign * REFLECTION @ self.axis,
            REFLECTION @ self.center,
            REFLECTION @ self.tensor @ REFLECTION,
            (low, high),
            self.most,
        )


LEG = Side(
    np.array([0.1, 0.2, -0.1]),
    np.array([1.0, 0.0, 0.0]),
    np.array([0.04, 0.05, -0.1]),
    np.array([[0.03, 0.002, 0.003], [0.002, 0.03, 0.004], [0.003, 0.004, 0.012]]),
)


def numbers_of(values: Floats) -> str:
    return " ".join(repr(float(value)) for value in values)


def side_of_robot(name: str, side: Side, frames: tuple[Floats, Floats], type: str = "revolute") -> list[str]:
    """Write a link and its joint; `frames` (3, 3) turn the link's frame and the axes of its tensor."""
    R_torso_link, R_link_axes = frames
    to_axes = (R_torso_link @ R_link_axes).T
    tensor = to_axes @ side.tensor @ to_axes.T
    (xx, xy, xz), (_, yy, yz), (*_, zz) = tensor.tolist()
    origin = (
        f'xyz="{numbers_of(R_torso_link.T @ side.center)}" rpy="{numbers_of(rpy_from_rotation(R_link_axes))}"'
    )
    effort, velocity = side.most
    return [
        f'<link name="{name}"><inertial><origin {origin}/><mass value="2"/><inertia ixx="{xx!r}" '
        f'ixy="{xy!r}" ixz="{xz!r}" iyy="{yy!r}" iyz="{yz!r}" izz="{zz!r}"/></inertial></link>',
        f'<joint name="{name}_joint" type="{type}"><origin xyz="{numbers_of(side.place)}" '
        f'rpy="{numbers_of(rpy_from_rotation(R_torso_link))}"/><parent link="torso"/><child link="{name}"/>'
        f'<axis xyz="{numbers_of(R_torso_link.T @ side.axis)}"/><limit lower="{side.range[0]!r}" '
        f'upper="{side.range[1]!r}" effort="{effort!r}" velocity="{velocity!r}"/></joint>',
    ]


STRAIGHT = np.eye(3), np.eye(3)


def two_sides(
    left: Side,
    right: Side,
    frames: tuple[tuple[Floats, Floats], tuple[Floats, Floats]] = (STRAIGHT, STRAIGHT),
    type: str = "revolute",
) -> list[Detection]:
    """Detect what differs on a robot with these legs."""
    parts = [
        *side_of_robot("left_leg", left, frames[0], type),
        *side_of_robot("right_leg", right, frames[1], type),
    ]
    return list(TWINS.detect(case_of(link("torso"), *parts)))


def random_rotation(rng: np.random.Generator) -> Floats:
    return np.asarray(rotation_from_quat(quat_exp(rng.uniform(-3.0, 3.0, 3))))


def random_side(rng: np.random.Generator) -> Side:
    """Draw a side with a centre of mass off its axis, and products of inertia that count."""
    place, axis, center = rng.uniform(-0.3, 0.3, (3, 3))
    place[1] = rng.uniform(0.05, 0.3)
    axis /= np.linalg.norm(axis)
    center += np.sign(center) * 0.03
    R = random_rotation(rng)
    low, high = np.sort(rng.uniform(-2.0, 2.0, 2)).tolist()
    return Side(place, axis, center, R @ np.diag([0.01, 0.02, 0.026]) @ R.T, (low, high))


@given(st.integers(0, 2**32 - 1), st.sampled_from([1.0, -1.0]), st.sampled_from(["revolute", "prismatic"]))
def test_reflected_sides_are_alike_in_any_frames(seed: int, sense: float, type: str) -> None:
    rng = np.random.default_rng(seed)
    left = random_side(rng)
    frames = tuple((random_rotation(rng), random_rotation(rng)) for _ in range(2))
    assert two_sides(left, left.reflected(sense, type), frames, type) == []  # type: ignore[arg-type]


@given(st.integers(0, 2**32 - 1), st.sampled_from([(0, 1), (0, 2), (1, 2)]))
def test_a_product_that_lost_its_sign_is_found_in_any_frames(seed: int, entry: tuple[int, int]) -> None:
    rng = np.random.default_rng(seed)
    left = replace(LEG, place=rng.uniform(0.05, 0.3, 3))
    right = left.reflected(1.0)
    tensor = right.tensor.copy()
    tensor[entry] *= -1.0
    tensor[entry[::-1]] *= -1.0
    frames = tuple((random_rotation(rng), random_rotation(rng)) for _ in range(2))
    (found,) = two_sides(left, replace(right, tensor=tensor), frames)  # type: ignore[arg-type]
    assert found.link == "left_leg"
    assert found.message.startswith(
        "the products of inertia xy, xz, yz in the axes of the root are, reflected, "
    )


def test_products_that_were_copied_are_named_with_both_lines() -> None:
    (found,) = two_sides(LEG, replace(LEG.reflected(1.0), tensor=LEG.tensor))
    assert (found.link, found.line) == ("left_leg", 3)
    assert found.message == (
        "the products of inertia xy, xz, yz in the axes of the root are, reflected, -0.002, 0.003, -0.004 "
        "kg m^2, and 0.002, 0.003, 0.004 kg m^2 on its twin right_leg (line 5)"
    )


def test_a_centre_that_lost_its_sign_is_named_where_the_products_are_reflections() -> None:
    (found,) = two_sides(LEG, replace(LEG.reflected(1.0), center=LEG.center))
    assert found.link == "left_leg"
    assert found.message == (
        "the centre of mass is 0.04, -0.05, -0.1 m from the joint in the axes of the root, reflected, "
        "and 0.04, 0.05, -0.1 m on its twin right_leg (line 5)"
    )


@pytest.mark.parametrize(
    ("center", "turn"),
    [
        # One part on both sides, and that part turned by half a turn about each axis.
        ((0.03, 0.04, -0.2), (1.0, 1.0, 1.0)),
        ((0.03, 0.04, -0.2), (-1.0, -1.0, 1.0)),
        ((0.03, 0.04, -0.2), (1.0, -1.0, -1.0)),
        # No centre of mass shows how the part is turned.
        ((0.0, 0.0, -0.2), (-1.0, -1.0, 1.0)),
    ],
)
def test_one_part_on_both_sides_is_no_difference(center: tuple[float, ...], turn: tuple[float, ...]) -> None:
    left, turned = replace(LEG, center=np.array(center)), np.diag(turn)
    part = replace(left.reflected(1.0), center=turned @ left.center, tensor=turned @ left.tensor @ turned)
    assert two_sides(left, part) == []


def test_without_anything_off_the_axis_no_signs_are_compared() -> None:
    left = replace(LEG, center=np.array([0.1, 0.0, 0.0]))
    right = left.reflected(-1.0)
    swapped = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
    turned = replace(right, tensor=swapped @ right.tensor @ swapped.T, range=(-0.1, 1.0))
    assert two_sides(left, turned) == []


@pytest.mark.parametrize(
    "change",
    [
        {"axis": np.array([0.96, 0.28, 0.0])},
        {"center": np.array([0.1, 0.05, -0.05])},
    ],
)
def test_twins_that_lie_otherwise_at_zero_are_compared_without_signs(change: dict[str, Floats]) -> None:
    right = replace(LEG.reflected(-1.0), tensor=LEG.tensor, range=(-0.3, 0.8))
    assert len(two_sides(LEG, right)) == 2
    assert two_sides(LEG, replace(right, **change)) == []  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("type", "axis", "sense"),
    [
        ("revolute", (1.0, 0.0, 0.0), -1.0),  # roll
        ("revolute", (0.0, 1.0, 0.0), 1.0),  # pitch
        ("revolute", (0.0, 0.0, 1.0), -1.0),  # yaw
        ("prismatic", (1.0, 0.0, 0.0), 1.0),
        ("prismatic", (0.0, 1.0, 0.0), -1.0),
        ("prismatic", (0.0, 0.0, 1.0), 1.0),
    ],
)
def test_ranges_of_equal_axes_are_reflected(type: str, axis: tuple[float, ...], sense: float) -> None:
    left = replace(LEG, axis=np.array(axis))
    right = left.reflected(sense, type)
    assert np.array_equal(right.axis, left.axis)
    assert two_sides(left, right, type=type) == []
    low, high = (-end for end in reversed(right.range))
    wrong = replace(right, range=(low, high))
    (found,) = two_sides(left, wrong, type=type)
    unit = "rad" if type == "revolute" else "m"
    reflected = " (reflected -0.8 to 0.3)" if sense < 0.0 else ""
    assert (found.joint, found.line) == ("left_leg_joint", 4)
    assert found.message == (
        f"the range is -0.3 to 0.8 {unit}{reflected}, and {low:g} to {high:g} {unit} on its twin "
        "right_leg_joint (line 6)"
    )


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"range": (-0.8, 0.8)}, "the range is 1.1 rad, and 1.6 rad"),
        ({"most": (12.0, 5.0)}, "the effort limit is 10 N m, and 12 N m"),
        ({"most": (10.0, 6.0)}, "the velocity limit is 5 rad/s, and 6 rad/s"),
        (
            {"most": (12.0, 6.0)},
            "the effort limit is 10 N m, and 12 N m; the velocity limit is 5 rad/s, and 6 rad/s",
        ),
    ],
)
@pytest.mark.parametrize("mass", ["2", "0"])
def test_other_limits_are_named(change: dict[str, tuple[float, float]], message: str, mass: str) -> None:
    right = replace(LEG.reflected(-1.0), **change)  # type: ignore[arg-type]
    parts = [*side_of_robot("left_leg", LEG, STRAIGHT), *side_of_robot("right_leg", right, STRAIGHT)]
    if mass == "0":  # links without mass have limits, too
        parts = [re.sub("<inertial>.*</inertial>", "", part) for part in parts]
    (found,) = TWINS.detect(case_of(link("torso"), *parts))
    assert (found.link, found.joint, found.line) == (None, "left_leg_joint", 4)
    assert found.message == f"{message} on its twin right_leg_joint (line 6)"


def test_limits_of_a_joint_that_follows_another_are_not_compared() -> None:
    right = replace(LEG.reflected(-1.0), range=(-1.0, 1.0), most=(20.0, 5.0))
    one, joint_of_one, other, joint_of_other = (
        *side_of_robot("left_leg", LEG, STRAIGHT),
        *side_of_robot("right_leg", right, STRAIGHT),
    )
    assert len(TWINS.detect(case_of(link("torso"), one, joint_of_one, other, joint_of_other))) == 1
    follower = joint_of_other.replace("<axis", '<mimic joint="left_leg_joint" multiplier="-1"/><axis')
    assert TWINS.detect(case_of(link("torso"), one, joint_of_one, other, follower)) == []


def test_small_differences_of_limits_are_none() -> None:
    right = LEG.reflected(-1.0)
    near = replace(right, range=(-0.806, 0.302), most=(10.05, 5.04))
    assert two_sides(LEG, near) == []


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


@pytest.mark.parametrize(("center", "found"), [(-0.7, 0), (0.0, 2)])
def test_twins_about_a_plane_beside_the_frame_of_their_parent(center: float, found: int) -> None:
    """Wheels at y = -0.25 and -1.15 of a body whose frame is the corner of a drawing, or in the body."""
    wheels = [
        (f"{side}_{end}_wheel", x, y) for end, x in (("front", 0.45), ("rear", -0.26)) for side, y in SIDES
    ]
    joints = [joint(f"{name}_joint", "body", name, f'<origin xyz="{x} {y} 0"/>') for name, x, y in wheels]
    links = [link("body", center=(0.0, center, 0.0)), *(link(name) for name, _, _ in wheels)]
    assert len(TWINS.detect(case_of(*links, *joints))) == found


SIDES = (("left", -0.25), ("right", -1.15))
