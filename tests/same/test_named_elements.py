"""The element that is named is the one that differs, also where other sets of elements explain as much.

Robots are random trees in which fixed joints carry links with mass. Each difference is planted at random,
and the robot is written anew: in another format, with tensors in other axes, with other frames.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import HealthCheck, assume, given, settings
from hypothesis import strategies as st

import dynx
from dynx.model import Model
from dynx.model.elements import Inertial, Joint, JointType, Limits, Link, Pose
from dynx.same import SameReport, same_robot
from dynx.spatial.se3 import homogeneous, inverse
from tests.same.planted import with_joint
from tests.same.rewrites import (
    inertial_of,
    random_rotation,
    rebuilt,
    with_flipped_axes,
    with_moved_frames,
    with_turned_inertias,
)

QUICK = settings(
    max_examples=8, deadline=None, suppress_health_check=[HealthCheck.too_slow, HealthCheck.filter_too_much]
)
SEEDS = st.integers(0, 10_000)
SIZES = st.floats(-6.0, -0.5).map(lambda exponent: 10.0**exponent)


def random_inertial(rng: np.random.Generator) -> Inertial:
    """Return the inertia of six random points."""
    points, masses = rng.uniform(-0.2, 0.2, (6, 3)), rng.uniform(0.1, 1.0, 6)
    center = masses @ points / masses.sum()
    off = points - center
    tensor = np.einsum("k,kl,kl,ij->ij", masses, off, off, np.eye(3))
    tensor -= np.einsum("k,ki,kj->ij", masses, off, off)
    x, y, z = center.tolist()
    return inertial_of(float(masses.sum()), Pose((x, y, z)), tensor)


def random_tree(rng: np.random.Generator, floating: bool) -> Model:
    """Return a tree of 5 to 9 links; about a third of the joints are fixed."""
    links = [Link("link_0", random_inertial(rng))]
    joints = []
    for k in range(1, int(rng.integers(5, 10))):
        kinds: tuple[JointType, ...] = ("revolute", "revolute", "prismatic", "fixed", "fixed")
        kind = kinds[int(rng.integers(5))]
        axis = rng.standard_normal(3)
        x, y, z = (axis / np.linalg.norm(axis)).tolist()
        T = homogeneous(random_rotation(rng), rng.uniform(-0.4, 0.4, 3))
        parent = f"link_{rng.integers(max(0, k - 3), k)}"
        limits = Limits(-1.0, 1.0, 5.0, 9.0)
        joints.append(Joint(f"joint_{k}", kind, parent, f"link_{k}", Pose.from_matrix(T), (x, y, z), limits))
        links.append(Link(f"link_{k}", random_inertial(rng)))
    return Model.build("tree", links, joints, base="floating" if floating else "fixed")


def picked(model: Model, rng: np.random.Generator, wanted: Callable[[Joint], bool]) -> Joint:
    found = [joint for joint in model.joints if wanted(joint)]
    assume(bool(found))
    return found[int(rng.integers(len(found)))]


def names(report: SameReport) -> list[tuple[str, str | None, str]]:
    return [(each.part, each.ours, each.theirs) for each in report.differences]


def carriers(model: Model) -> set[str]:
    """Return the links that the base carries, whose inertias are not all seen on a fixed base."""
    found = {model.root}
    for joint in model.joints:
        if joint.parent in found and not joint.moves:
            found.add(joint.child)
    return found


def above(model: Model, joint: Joint) -> list[Joint]:
    """Return the joints between a joint and the base."""
    by_child = {each.child: each for each in model.joints}
    found = []
    link = joint.parent
    while link in by_child:
        found.append(by_child[link])
        link = by_child[link].parent
    return found


def moved(joint: Joint, shift: np.ndarray) -> Joint:
    T = joint.origin.matrix.copy()
    T[:3, 3] += shift
    return replace(joint, origin=Pose.from_matrix(T))


@QUICK
@given(SEEDS, SIZES, st.sampled_from(["urdf", "mjcf", "turned"]), st.booleans())
def test_a_misplaced_fixed_joint_is_named_where_the_text_is_written_anew(
    seed: int, size: float, written: str, floating: bool
) -> None:
    rng = np.random.default_rng(seed)
    model = random_tree(rng, floating)
    on_base = carriers(model)
    joint = picked(model, rng, lambda each: not each.moves and (floating or each.child not in on_base))
    # Below slides alone, nothing but mass is seen.
    assume(floating or any(each.type == "revolute" for each in above(model, joint)))
    direction = rng.standard_normal(3)
    other = with_joint(model, moved(joint, size * direction / np.linalg.norm(direction)))
    text = other.to_mjcf() if written == "mjcf" else other.to_urdf()
    if written == "turned":
        text = with_turned_inertias(other, rng).to_urdf()
    report = same_robot(model, dynx.load(text, base=None if written == "mjcf" else other.base))
    assert names(report) == [("origin", joint.name, joint.name)]
    assert report.attributes == ()


@settings(QUICK, max_examples=2)
@given(SEEDS, SIZES, st.booleans())
def test_a_misplaced_fixed_joint_is_one_element_where_frames_are_moved(
    seed: int, size: float, floating: bool
) -> None:
    rng = np.random.default_rng(seed)
    model = random_tree(rng, floating)
    on_base = carriers(model)
    # A slide says nothing of places.
    carrying = {joint.parent for joint in model.joints if joint.type == "revolute"}
    joint = picked(
        model, rng, lambda each: not each.moves and each.child in carrying and each.child not in on_base
    )
    direction = rng.standard_normal(3)
    other = with_joint(model, moved(joint, size * direction / np.linalg.norm(direction)))
    other = with_moved_frames(with_flipped_axes(other, rng), rng)
    report = same_robot(model, other)
    # Where frames are turned, another joint may explain as much.
    assert [part for part, *_ in names(report)] == ["origin"]
    assert report.mended is not None
    assert same_robot(model, report.mended).same


@settings(QUICK, max_examples=3)
@given(SEEDS, SIZES, st.booleans())
def test_a_fixed_joint_moved_along_the_axis_of_its_body_is_one_element_where_frames_are_moved(
    seed: int, size: float, floating: bool
) -> None:
    rng = np.random.default_rng(seed)
    model = random_tree(rng, floating)
    turning = {each.child: each for each in model.joints if each.type == "revolute"}
    # A slide says nothing of places.
    carrying = {joint.parent for joint in turning.values()}
    joint = picked(
        model, rng, lambda each: not each.moves and each.parent in turning and each.child in carrying
    )
    # The axis of the body stays where it is, whichever side of the joint is taken to be misplaced.
    other = with_joint(model, moved(joint, size * np.array(turning[joint.parent].axis)))
    report = same_robot(model, with_moved_frames(other, rng))
    assert [part for part, *_ in names(report)] == ["origin"]
    assert report.mended is not None
    assert same_robot(model, report.mended).same


@QUICK
@given(SEEDS, SIZES, st.booleans())
def test_a_joint_moved_along_its_axis_is_one_element_for_all_links_that_it_carries(
    seed: int, size: float, floating: bool
) -> None:
    rng = np.random.default_rng(seed)
    model = random_tree(rng, floating)
    holding = {joint.parent for joint in model.joints if not joint.moves}
    joint = picked(model, rng, lambda each: each.type == "revolute" and each.child in holding)
    along = size * (joint.origin.matrix[:3, :3] @ np.array(joint.axis))
    other = with_turned_inertias(with_joint(model, moved(joint, along)), rng)
    report = same_robot(model, other)
    assert names(report) == [("origin", joint.name, joint.name)]


@QUICK
@given(SEEDS, st.booleans(), st.booleans())
def test_a_joint_on_another_parent_is_named(seed: int, floating: bool, move_frames: bool) -> None:
    rng = np.random.default_rng(seed)
    model = random_tree(rng, floating)
    below: dict[str, set[str]] = {}
    for each in reversed(model.joints):
        below[each.child] = {each.child}.union(
            *(below[other.child] for other in model.joints if other.parent == each.child)
        )
    frames = {model.root: np.eye(4)}
    bodies = {model.root: model.root}
    for each in model.joints:
        frames[each.child] = frames[each.parent] @ each.origin.matrix
        bodies[each.child] = each.child if each.moves else bodies[each.parent]

    def parents(each: Joint) -> list[str]:
        own = bodies[each.parent]
        return [name for name in bodies if name not in below[each.child] and bodies[name] != own]

    joint = picked(model, rng, lambda each: each.moves and bool(parents(each)))
    free = parents(joint)
    parent = free[int(rng.integers(len(free)))]
    place = Pose.from_matrix(inverse(frames[parent]) @ frames[joint.child])
    changed = replace(joint, parent=parent, origin=place)
    other = rebuilt(
        model, model.links, [changed if each.name == joint.name else each for each in model.joints]
    )
    if move_frames:
        other = with_moved_frames(with_flipped_axes(other, rng), rng)
    report = same_robot(model, other)
    assert [(each.kind, each.ours, each.theirs) for each in report.unmatched] == [
        ("moved", joint.name, joint.name)
    ]
    assert report.differences == ()


@QUICK
@given(SEEDS, st.booleans(), st.booleans())
def test_a_joint_that_is_fixed_in_mjcf_is_named_by_its_link(seed: int, floating: bool, swap: bool) -> None:
    rng = np.random.default_rng(seed)
    model = random_tree(rng, floating)
    joint = picked(model, rng, lambda each: each.moves)
    assume(sum(each.moves for each in model.joints) > 1)
    text = with_joint(model, replace(joint, type="fixed")).to_mjcf()
    # The name of a fixed joint stands in an extension that no one else writes.
    other = dynx.load("\n".join(line for line in text.splitlines() if "dynx:fixed" not in line))
    pair = (other, model) if swap else (model, other)
    report = same_robot(*pair)
    wanted = ("type", joint.name, f"{joint.child}_fixed")
    assert names(report) == [(wanted[0], wanted[2], wanted[1]) if swap else wanted]
    assert report.attributes == ()


@pytest.mark.parametrize("seed", range(3))
def test_a_misplaced_joint_of_a_base_of_two_links_is_named_where_frames_are_moved(seed: int) -> None:
    arm = dynx.load("six_axis_arm", base="floating")
    box = Link("box", Inertial(2.0, Pose((0.1, 0.02, 0.03)), 0.02, 0.001, 0.0, 0.03, 0.002, 0.04))
    held = Joint("to_box", "fixed", arm.root, "box", Pose((0.2, -0.1, 0.05), (0.3, 0.2, 0.1)))
    robot = rebuilt(arm, [*arm.links, box], [*arm.joints, held])
    joint = next(joint for joint in robot.joints if joint.moves)
    x, y, z = joint.origin.xyz
    placed = replace(joint, origin=Pose((x, y + 2e-4, z), joint.origin.rpy))
    other = rebuilt(robot, robot.links, [placed if each is joint else each for each in robot.joints])
    report = same_robot(robot, with_moved_frames(other, np.random.default_rng(seed)))
    assert [(each.theirs, each.part) for each in report.differences] == [(joint.name, "origin")]


@pytest.mark.parametrize("angle", [1e-7, 5e-6, 1e-3])
def test_wheels_on_one_line_are_matched_by_name_below_a_misplaced_joint(angle: float) -> None:
    """Each of the two would do for the other, and then fewer joints are written as their counterparts."""
    tensor = np.diag([0.02, 0.04, 0.02])
    links = [Link("ground"), Link("base", inertial_of(5.0, Pose((0.1, 0.0, 0.2)), 10.0 * tensor))]
    joints = [Joint("to_base", "fixed", "ground", "base", Pose((0.0, 0.0, 0.1)))]
    for name, place, axis in (
        ("left", (0.0, 0.2, 0.0), (0.0, 1.0, 0.0)),
        ("right", (0.0, -0.2, 0.0), (0.0, 1.0, 0.0)),
        ("lift", (0.1, 0.0, 0.5), (0.0, 0.0, 1.0)),
    ):
        links.append(Link(name, inertial_of(1.0, Pose(), tensor)))
        kind: JointType = "prismatic" if name == "lift" else "revolute"
        joints.append(
            Joint(f"{name}_joint", kind, "base", name, Pose(place), axis, Limits(-1.0, 1.0, 1.0, 1.0))
        )
    links.append(Link("arm", inertial_of(1.0, Pose((0.1, 0.2, 0.3)), tensor)))
    joints.append(Joint("arm_joint", "revolute", "lift", "arm", Pose(), (1.0, 0.0, 0.0), joints[-1].limits))
    robot = Model.build("wheels", links, joints)
    other = with_joint(robot, replace(joints[0], origin=Pose((0.0, 0.0, 0.1), (angle, 0.0, 0.0))))
    report = same_robot(robot, other, tolerance=1e-10)
    assert names(report) == [("origin", "to_base", "to_base")]
    assert report.attributes == ()


def pendulum_text(T: np.ndarray, shift: float) -> str:
    """Return a pendulum on a floating base with its frame moved by T (4, 4), and the joint by `shift`."""
    back = inverse(T)

    def origin(x: float, y: float, z: float, frame: np.ndarray = back) -> str:
        given = Pose.from_matrix(frame @ homogeneous(np.eye(3), np.array([x, y, z])))
        xyz, rpy = (" ".join(map(repr, each)) for each in (given.xyz, given.rpy))
        return f'<origin xyz="{xyz}" rpy="{rpy}"/>'

    inertia = (
        '<mass value="2"/><inertia ixx="0.02" iyy="0.03" izz="0.04" ixy="0.001" ixz="0.002" iyz="0.003"/>'
    )
    return f"""<robot name="pendulum">
        <link name="base"><inertial>{origin(0.05, 0.02, 0.01)}{inertia}</inertial>
        <collision>{origin(0.1, 0.0, 0.0)}<geometry><box size="0.3 0.2 0.1"/></geometry></collision></link>
        <link name="bar"><inertial>{origin(0.01, 0.0, 0.2, np.eye(4))}{inertia}</inertial></link>
        <joint name="pivot" type="continuous"><parent link="base"/><child link="bar"/>
        {origin(0.3, 0.0, 0.1 + shift)}<axis xyz="0 1 0"/></joint></robot>"""


@pytest.mark.parametrize("shift", [1e-6, 1e-3])
def test_the_joint_is_misplaced_and_not_the_inertia_where_the_shapes_say_so(shift: float) -> None:
    """Without the shape, the base may as well have another centre of mass and another frame."""
    T = homogeneous(random_rotation(np.random.default_rng(1)), np.array([0.1, -0.2, 0.3]))
    texts = pendulum_text(np.eye(4), 0.0), pendulum_text(T, shift)
    report = same_robot(*texts, base="floating")
    assert names(report) == [("origin", "pivot", "pivot")]
    assert report.attributes == ()
