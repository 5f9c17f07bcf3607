"""`same_robot`: rewrites that keep a robot are the same, planted differences are found and named."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import dynx
from dynx.model import Model
from dynx.model.elements import Inertial, Joint, JointType, Limits, Link, Mimic, Pose
from dynx.model.library import find
from dynx.same import SameReport, same_robot
from dynx.testing import assert_same_robot
from dynx.testing.strategies import models
from tests.same.planted import Planted, moved_origin, other_mass, plantings, with_inertial, with_joint
from tests.same.rewrites import (
    merged,
    rebuilt,
    with_flipped_axes,
    with_merged_links,
    with_moved_frames,
    with_other_joint_attributes,
    with_other_names,
    with_other_order,
    with_split_links,
    with_turned_inertias,
)

Rewrite = Callable[[Model, np.random.Generator], Model]

REWRITES: dict[str, Rewrite] = {
    "frames moved": with_moved_frames,
    "frames moved slightly": lambda model, rng: with_moved_frames(model, rng, 1e-3, 0.05),
    "axes reversed": with_flipped_axes,
    "inertias in other axes": with_turned_inertias,
    "links split": with_split_links,
    "links merged": lambda model, _: with_merged_links(model),
    "another order": with_other_order,
    "other names": lambda model, _: with_other_names(model),
    "other limits and friction": lambda model, _: with_other_joint_attributes(model),
    "URDF text": lambda model, _: dynx.load(model.to_urdf(), base=model.base),
}
ROBOTS = ("ur5", "panda", "solo12", "double_pendulum", "simple_humanoid")
SLOW = settings(deadline=None, suppress_health_check=[HealthCheck.too_slow])


def torques(model: Model, report: SameReport | None, seed: int) -> np.ndarray:
    """Return torques at random states of the first robot, in its coordinates; `report` maps them to those of
    another robot with a fixed base."""
    rng = np.random.default_rng(seed)
    n = len(model.joint_names)
    q, v, a = rng.uniform(-1.0, 1.0, (3, 4, n))
    engine = dynx.backend("reference", model)
    if report is None:
        return engine.inverse_dynamics(q, v, a)
    other = [np.empty_like(each) for each in (q, v, a)]
    for row in report.coordinates:
        for to, given_values in zip(other, (q, v, a), strict=True):
            to[:, row.second_index] = row.sign * given_values[:, row.first_index]
    tau = engine.inverse_dynamics(*other)
    back = np.empty_like(tau)
    for row in report.coordinates:
        back[:, row.first_index] = row.sign * tau[:, row.second_index]
    return back


@pytest.mark.parametrize("rewrite", REWRITES)
@SLOW
@given(model=models(max_links=6), seed=st.integers(0, 1000))
def test_a_rewritten_robot_is_the_same(rewrite: str, model: Model, seed: int) -> None:
    other = REWRITES[rewrite](model, np.random.default_rng(seed))
    report = same_robot(model, other)
    assert report.same, (report.differences, report.unmatched)
    assert report.bounds is not None


@pytest.mark.parametrize("base", ["fixed", "floating"])
@pytest.mark.parametrize("robot", ROBOTS)
def test_a_public_robot_rewritten_in_every_way_is_the_same(robot: str, base: str) -> None:
    model = dynx.load(robot, base=base)  # type: ignore[arg-type]
    rng = np.random.default_rng(3)
    other = with_split_links(with_other_order(model, rng), rng)
    other = with_moved_frames(with_flipped_axes(other, rng), rng)
    report = same_robot(model, other)
    assert report.same, (report.differences, report.unmatched)
    assert len(report.coordinates) == len(model.joint_names)
    assert {each.kind for each in report.freedoms} >= {"frame", "links"}
    if base == "fixed":
        tau, back = torques(model, None, 0), torques(other, report, 0)
        assert back == pytest.approx(tau, rel=1e-9, abs=1e-9 * float(np.max(np.abs(tau))))


@pytest.mark.parametrize("robot", ["g1", "talos", "ur5"])
def test_frames_that_are_turned_slightly_are_no_difference(robot: str) -> None:
    """Nearly the same as they are, and the same in the turned frames alone: of a floating base too."""
    model = dynx.load(robot, base="fixed" if robot == "ur5" else "floating")
    rng = np.random.default_rng(5)
    report = same_robot(model, with_moved_frames(model, rng, 1e-3, 0.05))
    assert report.same, (report.differences, report.unmatched)
    other = moved_origin(model, model.joint(model.joint_names[2]), 1e-6, 1.0, rng)
    report = same_robot(model, with_moved_frames(other.model, rng, 1e-3, 0.05))
    assert [(each.part, each.theirs) for each in report.differences] == [("origin", other.name)]


@pytest.mark.parametrize("seed", range(3))
def test_a_floating_base_of_nearly_equal_moments_may_have_any_frame(seed: int) -> None:
    base = Link("a", Inertial(2.0, Pose(), 0.1, 0.0, 0.0, 0.101, 0.0, 0.102))
    child = Link("b", Inertial(1.0, Pose((0.1, 0.2, 0.3)), 0.1, 0.01, 0.02, 0.2, 0.03, 0.25))
    joints = [Joint("j", "continuous", "a", "b", Pose((0.2, 0.1, 0.05)), axis=(0.0, 0.0, 1.0))]
    model = dynx.Model.build("r", [base, child], joints, base="floating")
    assert same_robot(model, with_moved_frames(model, np.random.default_rng(seed), 0.01)).same


def test_a_moment_below_a_slide_on_a_link_without_mass_is_seen() -> None:
    """The turning joint above sees it, with the scale of the body that has it."""
    links = [
        Link("a"),
        Link("b", Inertial()),
        Link("c", Inertial(4.0, Pose((0.1, 0.2, 0.3)), 0.1, 0.01, 0.02, 0.2, 0.03, 0.25)),
    ]
    joints = [
        Joint(
            "turn", "revolute", "a", "b", Pose((0.1, 0.0, 0.2)), axis=(0.6, 0.0, 0.8), limits=Limits(-1, 1)
        ),
        Joint(
            "slide", "prismatic", "b", "c", Pose((0.5, 0.2, 0.0)), axis=(0.0, 1.0, 0.0), limits=Limits(-1, 1)
        ),
    ]
    model = dynx.Model.build("r", links, joints)
    inertial = links[2].inertial
    assert inertial is not None
    for size in (1e-8, 1e-7, 1e-3):
        other = with_inertial(model, "c", replace(inertial, izz=inertial.izz * (1.0 + size)))
        report = same_robot(model, other, tolerance=1e-10)
        assert [(each.part, each.theirs) for each in report.differences] == [("inertial", "c")]


def test_names_are_matched_by_structure() -> None:
    model = dynx.load("panda")
    report = same_robot(model, with_other_names(model))
    assert report.same
    assert [(each.ours, each.theirs) for each in report.coordinates] == [
        (name, f"j_{name}") for name in model.joint_names
    ]
    assert {each.kind for each in report.attributes if each.tag == "joint"} == {"name"}


@pytest.mark.parametrize("robot", ["ur5", "solo12", "panda"])
@pytest.mark.parametrize("exponent", [-8, -6, -4, -2, -0.3])
def test_a_planted_difference_is_found_at_its_element(robot: str, exponent: float) -> None:
    model = dynx.load(robot)
    rng = np.random.default_rng(int(-10 * exponent))
    for planted in plantings(model, 10.0**exponent, rng):
        report = same_robot(model, planted.model)
        assert_found(model, planted, report)


def assert_found(model: Model, planted: Planted, report: SameReport) -> None:
    if report.same:
        assert_without_effect(model, planted, report)
        return
    assert [(each.part, each.theirs) for each in report.differences] == [(planted.part, planted.name)]
    assert report.not_mended is None
    assert report.mended is not None
    assert same_robot(model, report.mended).same
    effect = report.differences[0].effect
    assert effect is not None
    assert max(effect.position, effect.rotation, effect.mass_matrix, effect.torque) > 0.0


def assert_without_effect(model: Model, planted: Planted, report: SameReport) -> None:
    """Check by torques at random states that a difference is not seen."""
    assert planted.part == "inertial"
    assert [each.theirs for each in report.freedoms if each.kind == "inertia"] == [planted.name]
    tau, back = torques(model, None, 1), torques(planted.model, report, 1)
    assert back == pytest.approx(tau, rel=0.0, abs=1e-9 * float(np.max(np.abs(tau))))


def test_a_difference_planted_into_a_rewritten_robot_needs_one_element() -> None:
    """Where frames are turned, one of several elements may be replaced: it is one, and mends the robot."""
    model = dynx.load("ur5")
    rng = np.random.default_rng(5)
    rewritten = with_moved_frames(with_flipped_axes(model, rng), rng)
    for planted in plantings(rewritten, 1e-5, rng):
        report = same_robot(model, planted.model)
        if report.same:
            assert planted.part == "inertial"
            continue
        assert len(report.differences) == 1
        assert report.mended is not None
        assert same_robot(model, report.mended).same


def test_two_planted_differences_are_two_elements() -> None:
    model = dynx.load("ur5")
    joint = model.joint("elbow_joint")
    moved = with_joint(model, replace(joint, origin=Pose((0.0, -0.11, 0.425), joint.origin.rpy)))
    other = other_mass(moved, "wrist_2_link", 0.1).model
    report = same_robot(model, other)
    assert {(each.part, each.theirs) for each in report.differences} == {
        ("origin", "elbow_joint"),
        ("inertial", "wrist_2_link"),
    }
    assert report.not_mended is None


def test_a_misplaced_fixed_joint_is_one_element_for_all_that_it_carries() -> None:
    model = dynx.load("panda")
    hand = model.joint("panda_hand_joint")
    other = with_joint(model, replace(hand, origin=Pose((0.0, 0.01, 0.0), hand.origin.rpy)))
    report = same_robot(model, other)
    assert [(each.part, each.theirs) for each in report.differences] == [("origin", "panda_hand_joint")]


def test_inertia_that_no_state_shows_is_no_difference() -> None:
    """The base of a fixed arm; mass moved from a link to its parent along the joint axis between them."""
    model = dynx.load("ur5")
    base = other_mass(model, "base_link", 1.0).model
    report = same_robot(model, base)
    assert report.same
    assert [(each.kind, each.theirs) for each in report.freedoms] == [("inertia", "base_link")]
    # A point mass on the axis of the elbow belongs to either link.
    arm = two_links(0.3)
    moved = with_inertial(arm, "lower", point_added(arm.inertial("lower"), -0.2, (0.0, 0.0, 0.4)))
    moved = with_inertial(moved, "upper", point_added(arm.inertial("upper"), 0.2, (0.5, 0.0, 0.4)))
    report = same_robot(arm, moved)
    assert report.same, report.differences
    assert {each.theirs for each in report.freedoms if each.kind == "inertia"} == {"upper", "lower"}
    # The same mass beside the axis is seen.
    beside = with_inertial(arm, "lower", point_added(arm.inertial("lower"), -0.2, (0.1, 0.0, 0.4)))
    beside = with_inertial(beside, "upper", point_added(arm.inertial("upper"), 0.2, (0.6, 0.0, 0.4)))
    assert not same_robot(arm, beside).same


@SLOW
@given(
    st.sampled_from(["continuous", "prismatic"]),
    st.integers(1, 3),
    st.floats(-0.2, 0.5),
    st.integers(0, 10**6),
)
def test_inertia_exchanged_on_a_floating_robot_whose_frames_are_moved_is_no_difference(
    kind: JointType, count: int, mass: float, seed: int
) -> None:
    """A joint says where its axis is; of the turn about it only what is seen of the inertia does."""
    rng = np.random.default_rng(seed)
    names = [f"link_{k}" for k in range(count + 1)]
    axes = [rng.standard_normal(3) for _ in range(count)]
    places = [Pose(tuple(rng.uniform(-0.3, 0.3, 3)), tuple(rng.uniform(-1.0, 1.0, 3))) for _ in axes]
    links = [Link(name, random_body(rng)) for name in names]
    joints = [
        Joint(f"joint_{k}", kind, names[k], names[k + 1], places[k], tuple(axis / np.linalg.norm(axis)))
        for k, axis in enumerate(axes)
    ]
    model = Model.build("chain", links, joints, base="floating")
    exchanged = model
    for joint in model.joints:
        if kind == "prismatic":
            # A tensor may belong to either body: it never turns against the other.
            upper = lower = Inertial(0.0, ixx=mass * 0.01, iyy=mass * 0.02, izz=mass * 0.015)
            upper = replace(upper, origin=Pose(rpy=joint.origin.rpy))
        else:
            on_axis = np.array(joint.axis) * rng.uniform(-0.3, 0.3)
            lower = Inertial(mass, Pose(tuple(on_axis)))
            upper = Inertial(mass, Pose(tuple((joint.origin.matrix @ [*on_axis, 1.0])[:3])))
        other = Inertial(-lower.mass, lower.origin, -lower.ixx, iyy=-lower.iyy, izz=-lower.izz)
        for link, part in ((joint.parent, upper), (joint.child, other)):
            exchanged = with_inertial(exchanged, link, merged(exchanged.inertial(link), part))
    report = same_robot(model, with_moved_frames(exchanged, rng))
    assert report.same, report.differences


def random_body(rng: np.random.Generator) -> Inertial:
    """Return the inertial of four random points of mass, in other axes."""
    points = rng.uniform(-0.3, 0.3, (4, 3))
    masses = rng.uniform(0.5, 1.0, 4)
    body = Inertial(masses[0], Pose(tuple(points[0])))
    for mass, point in zip(masses[1:], points[1:], strict=True):
        body = point_added(body, float(mass), tuple(point))
    return body


def two_links(tilt: float) -> Model:
    """Return an arm of two links, whose first joint leans against gravity."""
    body = Inertial(1.0, Pose((0.2, 0.05, 0.1)), 0.02, 0.001, 0.002, 0.03, 0.003, 0.04)
    links = [Link("world"), Link("upper", body), Link("lower", body)]
    joints = [
        Joint(
            "shoulder",
            "continuous",
            "world",
            "upper",
            Pose(rpy=(tilt, 0.0, 0.0)),
            (0.0, 1.0, 0.0),
        ),
        Joint("elbow", "continuous", "upper", "lower", Pose((0.5, 0.0, 0.0)), (0.0, 0.0, 1.0)),
    ]
    return Model.build("arm", links, joints)


def point_added(inertial: Inertial, mass: float, at: tuple[float, float, float]) -> Inertial:
    """Return an inertial with a point mass more."""
    return merged(inertial, Inertial(mass, Pose(at)))


def test_coordinates_of_reversed_and_reordered_joints() -> None:
    model = dynx.load("solo12", base="floating")
    rng = np.random.default_rng(0)
    other = with_flipped_axes(with_other_order(model, rng), rng)
    report = same_robot(model, other)
    assert report.same
    assert {each.sign for each in report.coordinates} == {1, -1}
    for row in report.coordinates:
        assert model.joint_names[row.first_index - 7] == row.ours
        assert other.joint_names[row.second_index - 7] == row.theirs
    assert report.T_first_second == pytest.approx(np.eye(4))


def test_a_base_frame_that_is_turned_is_stated() -> None:
    model = dynx.load("solo12", base="floating")
    report = same_robot(model, with_moved_frames(model, np.random.default_rng(2)))
    assert report.same
    assert report.T_first_second is not None
    assert np.max(np.abs(report.T_first_second - np.eye(4))) > 0.1


@pytest.mark.parametrize("seed", range(4))
def test_the_frame_of_a_floating_base_without_mass_may_be_anywhere(seed: int) -> None:
    links = [Link("base"), Link("upper"), Link("lower")]
    joints = [
        Joint("first", "continuous", "base", "upper", axis=(0.0, 0.0, 1.0)),
        Joint("second", "continuous", "upper", "lower", axis=(0.0, 0.0, 1.0)),
    ]
    model = Model.build("massless", links, joints, base="floating")
    assert same_robot(model, with_moved_frames(model, np.random.default_rng(seed))).same


def test_joints_of_another_type_are_elements() -> None:
    model = dynx.load("ur5")
    other = with_joint(model, replace(model.joint("wrist_2_joint"), type="fixed"))
    report = same_robot(model, other)
    assert [(each.part, each.theirs) for each in report.differences] == [("type", "wrist_2_joint")]
    assert report.not_mended is None
    assert not same_robot(other, model).same


def test_joints_without_counterpart_are_named() -> None:
    report = same_robot("g1", "g1_with_hands")
    assert not report.same
    assert len([each for each in report.unmatched if each.kind == "extra"]) == 6
    assert report.mended is None
    assert report.not_mended is not None
    moved = dynx.load("double_pendulum")
    assert not same_robot("ur5", moved).same


def test_a_mimic_joint_that_follows_otherwise_is_an_element() -> None:
    model = dynx.load("panda")
    joint = model.joint("panda_finger_joint2")
    assert joint.mimic is not None
    report = same_robot(model, with_joint(model, replace(joint, mimic=Mimic(joint.mimic.joint, 0.5))))
    assert [(each.part, each.theirs) for each in report.differences] == [("mimic", joint.name)]
    assert report.not_mended is None


def test_limits_and_joint_dynamics_stand_apart() -> None:
    model = dynx.load("ur5")
    report = same_robot(model, with_other_joint_attributes(model))
    assert report.same
    kinds = {each.kind for each in report.attributes if each.tag == "joint"}
    assert {"lower limit", "upper limit", "velocity limit", "damping", "friction", "armature"} <= kinds


def test_limits_of_a_reversed_axis_are_the_same() -> None:
    model = dynx.load("ur5")
    report = same_robot(model, with_flipped_axes(model, np.random.default_rng(0)))
    assert [each for each in report.attributes if each.tag == "joint"] == []


def test_shapes_and_frames_stand_apart() -> None:
    text = dynx.load("six_axis_arm").to_urdf(geometry=True)
    report = same_robot(text, text.replace("<box size=", "<box size=") + "<!-- -->")
    assert report.same
    model = dynx.load("ur5")
    tool = model.joint("wrist_3_link-tool0_fixed_joint")
    moved = with_joint(model, replace(tool, origin=Pose((0.0, 0.1, 0.0), tool.origin.rpy)))
    report = same_robot(model, moved)
    assert report.same
    assert [each.theirs for each in report.attributes if each.kind == "frame"] == ["tool0"]


def test_the_frame_of_a_link_with_mass_is_a_freedom_and_of_a_place_a_difference() -> None:
    model = dynx.load("six_axis_arm")
    holder = model.links[-1].name
    T = Pose((0.1, 0.2, 0.3), (0.4, 0.5, 0.6))
    held = Inertial(2.0, Pose((0.01, 0.02, 0.03)), 0.1, 0.0, 0.0, 0.2, 0.0, 0.25)
    links = (*model.links, Link("held", held), Link("place", None))

    def of(origin: Pose, center: Pose, place: Pose) -> Model:
        joints = (
            *model.joints,
            Joint("holds", "fixed", holder, "held", origin),
            Joint("places", "fixed", holder, "place", place),
        )
        changed = [
            replace(each, inertial=replace(held, origin=center)) for each in links if each.name == "held"
        ]
        return Model.build("robot", [*links[:-2], *changed, links[-1]], joints)

    first = of(T, held.origin, T)
    turned = of(Pose(), Pose.from_matrix(T.matrix @ held.origin.matrix), T)
    report = same_robot(first, turned)
    assert report.same
    assert report.attributes == ()
    assert [each.theirs for each in report.freedoms if each.kind == "frame"] == ["held"]
    # The frame of a place is one, also where the body it is on is described in another frame.
    report = same_robot(first, with_moved_frames(of(T, held.origin, Pose()), np.random.default_rng(3)))
    assert report.same
    assert "place" in [each.theirs for each in report.attributes if each.kind == "frame"]


@pytest.mark.parametrize("kind", ["visual", "collision"])
def test_the_frame_of_a_link_without_mass_is_a_freedom_where_its_shapes_stay(kind: str) -> None:
    text = f"""<robot name="r"><link name="rail"/>
        <link name="cart"><inertial><mass value="1"/>
        <inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link>
        <link name="sign"><{kind}><origin xyz="AT 0 0"/>
        <geometry><sphere radius="0.1"/></geometry></{kind}></link>
        <joint name="slide" type="prismatic"><parent link="rail"/><child link="cart"/>
        <limit lower="-1" upper="1" effort="1" velocity="1"/></joint>
        <joint name="held" type="fixed"><parent link="cart"/><child link="sign"/>
        <origin xyz="FROM 0 0"/></joint></robot>"""

    def robot(held: float, shape: float) -> str:
        return text.replace("FROM", repr(held)).replace("AT", repr(shape))

    report = same_robot(robot(0.5, 0.0), robot(0.25, 0.25))
    assert report.same
    assert report.attributes == ()
    assert [(each.kind, each.theirs) for each in report.freedoms] == [("frame", "sign")]


def test_another_name_of_a_link_that_a_fixed_joint_holds_is_listed() -> None:
    text = Path(find("allegro_left_hand")).read_text(encoding="utf-8")
    report = same_robot(text, text.replace('"link_15.0_tip"', '"thumb"'))
    assert report.same
    assert [(each.kind, each.ours, each.theirs) for each in report.attributes] == [
        ("name", "link_15.0_tip", "thumb")
    ]


@pytest.mark.parametrize("name", ["rail", "camera"])
def test_another_name_of_a_link_without_mass_is_listed_where_it_has_shapes(name: str) -> None:
    text = """<robot name="r">
        <link name="rail"><visual><geometry><box size="1 0.1 0.1"/></geometry></visual></link>
        <link name="cart"><inertial><mass value="1"/>
        <inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link>
        <link name="camera"><collision><geometry><sphere radius="0.02"/></geometry></collision></link>
        <joint name="slide" type="prismatic"><parent link="rail"/><child link="cart"/>
        <limit lower="-1" upper="1" effort="1" velocity="1"/></joint>
        <joint name="held" type="fixed"><parent link="cart"/><child link="camera"/></joint></robot>"""
    report = same_robot(text, text.replace(f'"{name}"', '"other"'))
    assert report.same
    assert [(each.kind, each.ours, each.theirs) for each in report.attributes] == [("name", name, "other")]


@pytest.mark.parametrize("size", [1e-9, 1e-6, 0.1])
def test_sizes_and_places_of_shapes_are_compared_to_the_tolerance(size: float) -> None:
    text = """<robot name="r"><link name="a"/><link name="b"><inertial><mass value="1"/>
        <inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial>
        <collision><origin xyz="0.25 0 0"/><geometry><box size="0.3 0.2 0.1"/></geometry></collision></link>
        <joint name="j" type="revolute"><parent link="a"/><child link="b"/><origin xyz="0 0 0.5"/>
        <limit lower="-1" upper="1" effort="1" velocity="1"/></joint></robot>"""
    for old, new in (("0.3 0.2", f"{0.3 * (1.0 + size)!r} 0.2"), ("0.25 0 0", f"{0.25 + size!r} 0 0")):
        report = same_robot(text, text.replace(old, new), tolerance=size / 10.0)
        assert report.same
        assert [each.kind for each in report.attributes] == ["collision shapes"]
        assert report.attributes[0].first != report.attributes[0].second
        assert same_robot(text, text.replace(old, new), tolerance=min(size * 10.0, 0.9)).attributes == ()


@pytest.mark.parametrize("seed", range(3))
def test_a_misplaced_joint_near_a_base_whose_frame_is_moved_is_one_element(seed: int) -> None:
    # All below it fits a wrong frame of the base; fewer elements differ in the right one nevertheless.
    model = dynx.load("panda", base="floating")
    joint = model.joint("panda_joint3")
    x, y, z = joint.origin.xyz
    changed = with_joint(model, replace(joint, origin=Pose((x + 0.057, y, z), joint.origin.rpy)))
    report = same_robot(model, with_moved_frames(changed, np.random.default_rng(seed)))
    assert [(each.theirs, each.part) for each in report.differences] == [("panda_joint3", "origin")]


def test_what_is_not_read_is_said_not_to_be_compared() -> None:
    model = dynx.load("planar_2r")
    sensors = '<sensor><user dim="1"/></sensor></mujoco>'
    report = same_robot(model, model.to_mjcf().replace("</mujoco>", sensors))
    assert report.same
    (note,) = [each for each in report.notes if "<sensor>" in each]
    assert note.endswith("it is not compared")


def test_limits_that_limit_nothing_are_the_same() -> None:
    text = """<robot name="r"><link name="a"/><link name="b"/>
        <joint name="j" type="revolute"><parent link="a"/><child link="b"/>
        <limit lower="-1e16" upper="1e16" effort="1" velocity="1"/></joint></robot>"""
    assert same_robot(text, text.replace('"revolute"', '"continuous"')).attributes == ()
    assert len(same_robot(text, text.replace('upper="1e16"', 'upper="1e15"')).attributes) == 1


def test_the_base_of_a_urdf_file_is_that_of_the_other_description() -> None:
    model = dynx.load("solo12", base="floating")
    report = same_robot("solo12", model)
    assert report.same
    assert report.notes
    other = same_robot(model.with_base("fixed"), model)
    assert [each.kind for each in other.unmatched] == ["base"]
    assert other.verdict.endswith("one base is fixed, the other floating")
    assert "counterpart" not in f"{other.verdict} {other.not_mended}"
    assert "with_base('fixed')" in other.unmatched[0].message
    assert same_robot(model.with_base("fixed"), model.with_base("fixed")).same


def test_gravity_and_the_pose_of_the_base_stand_apart() -> None:
    model = dynx.load("ur5")
    other = model.with_gravity((0.0, 0.0, -1.62)).with_base_pose(Pose((0.0, 0.0, 1.0)))
    report = same_robot(model, other)
    assert report.same
    assert {each.kind for each in report.attributes if each.tag == "robot"} == {"gravity", "base pose"}


def test_a_long_chain() -> None:
    count = 250
    body = Inertial(1.0, Pose((0.05, 0.01, 0.02)), 0.02, 0.0, 0.0, 0.03, 0.0, 0.04)
    links = [Link(f"l{k}", body) for k in range(count)]
    joints = [
        Joint(f"j{k}", "continuous", f"l{k}", f"l{k + 1}", Pose((0.1, 0.0, 0.0)), (0.0, 0.0, 1.0))
        for k in range(count - 1)
    ]
    model = Model.build("chain", links, joints)
    assert same_robot(model, rebuilt(model, links, joints)).same


@pytest.mark.parametrize(
    "tolerance", [-1e-9, 1.0, float("nan"), float("inf"), "x", None, True, [1e-9], 10**400]
)
def test_invalid_tolerances_are_refused(tolerance: Any) -> None:
    with pytest.raises(dynx.errors.ArgumentError, match="tolerance"):
        same_robot("ur5", "ur5", tolerance=tolerance)
    with pytest.raises(dynx.errors.ArgumentError, match="tolerance"):
        assert_same_robot("ur5", "ur5", tolerance=tolerance)


def test_unusable_descriptions_raise_the_errors_of_load() -> None:
    with pytest.raises(dynx.errors.RobotNotFoundError):
        same_robot("ur5", "./none.urdf")
    with pytest.raises(dynx.errors.DescriptionError):
        same_robot("<robot name='r'><link name='a'/><link name='b'/></robot>", "ur5")
    with pytest.raises(dynx.errors.ArgumentError):
        same_robot("ur5", 3)  # type: ignore[arg-type]


@pytest.mark.parametrize("swapped", [False, True])
def test_shapes_are_named_by_the_link_that_has_them(swapped: bool) -> None:
    text = """<robot name="r"><link name="base"/>
      <link name="plate"><visual><geometry><box size="0.1 0.2 0.3"/></geometry></visual></link>
      <joint name="f" type="fixed"><parent link="base"/><child link="plate"/></joint>
      <link name="tip"><inertial><mass value="1"/>
        <inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial></link>
      <joint name="j" type="continuous"><parent link="plate"/><child link="tip"/><axis xyz="0 1 0"/></joint>
      </robot>"""
    for other in (text.replace("0.2 0.3", "0.2 0.4"), text.replace('<box size="0.1 0.2 0.3"/>', "<box/>")):
        pair = (other, text) if swapped else (text, other)
        (found,) = same_robot(*pair).attributes
        assert (found.kind, found.ours, found.theirs) == ("visual shapes", "plate", "plate")
        assert (found.first_line, found.second_line) == (2, 2)


BALL = (
    '<inertial><origin xyz="{}"/><mass value="{}"/>'
    '<inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial>'
)
ROD = BALL.replace('izz="0.1"', 'izz="0.02"')
SLIDES = {
    "no mass": ("", "", ("prismatic",)),
    "no mass, two slides": ("", "", ("prismatic", "prismatic")),
    "no mass, slide and hinge": ("", "", ("prismatic", "revolute")),
    "two balls": (BALL.format("0 0 0", 1), BALL.format("0 0 0", 2), ("prismatic",)),
    "two balls beside their frames": (BALL.format("0.1 0 0.2", 1), BALL.format("0 0.1 0", 2), ("prismatic",)),
    "rod and ball": (ROD.format("0 0 0", 1), BALL.format("0 0 0", 2), ("prismatic",)),
    "ball, two slides": (BALL.format("0.1 0 0", 1), BALL.format("0 0 0.1", 2), ("prismatic", "prismatic")),
    "ball, slide and hinge": (
        BALL.format("0.1 0 0", 1),
        BALL.format("0 0 0.1", 2),
        ("prismatic", "revolute"),
    ),
}


@pytest.mark.parametrize("rewrite", ["frames moved", "other names"])
@pytest.mark.parametrize("case", SLIDES)
def test_slides_determine_the_frame_of_a_symmetric_floating_base(case: str, rewrite: str) -> None:
    base, child, types = SLIDES[case]
    parts = [
        f'<link name="b{k}">{child}</link>'
        f'<joint name="j{k}" type="{kind}"><parent link="a"/><child link="b{k}"/>'
        f'<origin xyz="0.1 {0.2 + k} 0.3" rpy="0.3 0.1 0.2"/><axis xyz="{axis}"/>'
        '<limit lower="-1" upper="1" effort="1" velocity="1"/></joint>'
        for k, (kind, axis) in enumerate(zip(types, ("0 1 0", "0.6 0 0.8"), strict=False))
    ]
    model = dynx.load(
        f'<robot name="r"><link name="a">{base}</link>{"".join(parts)}</robot>', base="floating"
    )
    for seed in range(4):
        rng = np.random.default_rng(seed)
        moved = with_moved_frames(model, rng)
        other = moved if rewrite == "frames moved" else REWRITES[rewrite](moved, rng)
        assert dynx.same_robot(model, other).same
