"""A joint at another place is named, and not the inertia that stands at another place with it.

Where the frame of a link is moved too, its inertia is written otherwise, and another inertia of that link
explains the dynamics as well. The shapes of the link say that it is the link which stands elsewhere.
Keyframes say so of a floating base and of a link on a ball joint, and a frame says so of its link.
"""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from dynx.model import Model
from dynx.model.elements import Joint, JointType, Limits, Link, Pose
from dynx.same import same_robot
from dynx.spatial.scalar import Floats
from dynx.spatial.se3 import homogeneous, inverse
from dynx.spatial.so3 import quat_from_rotation, rotation_about, rotation_from_quat
from tests.same.planted import with_inertial, with_joint
from tests.same.rewrites import random_rotation, rebuilt, with_moved_frames
from tests.same.test_named_elements import above, names, picked, random_inertial

QUICK = settings(
    max_examples=6, deadline=None, suppress_health_check=[HealthCheck.too_slow, HealthCheck.filter_too_much]
)
SEEDS = st.integers(0, 10_000)
SIZES = st.floats(-6.0, -1.0).map(lambda exponent: 10.0**exponent)
SIDES = "0.3 0.2 0.1"


def tree(rng: np.random.Generator, floating: bool, balls: bool) -> Model:
    """Return a tree of 5 to 8 links with mass; with `balls` the second link is on a ball joint."""
    links, joints = [Link("link_0", random_inertial(rng))], []
    for k in range(1, int(rng.integers(5, 9))):
        kinds: tuple[JointType, ...] = ("revolute", "prismatic", "fixed", "fixed")
        kind: JointType = "ball" if balls and k == 1 else kinds[int(rng.integers(4))]
        axis = rng.standard_normal(3)
        x, y, z = (axis / np.linalg.norm(axis)).tolist()
        T = homogeneous(random_rotation(rng), rng.uniform(-0.4, 0.4, 3))
        parent = f"link_{rng.integers(max(0, k - 3), k)}"
        limits = Limits() if kind == "ball" else Limits(-1.0, 1.0, 5.0, 9.0)
        joints.append(Joint(f"joint_{k}", kind, parent, f"link_{k}", Pose.from_matrix(T), (x, y, z), limits))
        links.append(Link(f"link_{k}", random_inertial(rng)))
    return Model.build("tree", links, joints, base="floating" if floating else "fixed")


def text_with_boxes(model: Model, before: Model, written: str) -> str:
    """Return the text of a model with other frames, with the box of each link with mass where `before` has
    it."""
    text = {"urdf": model.to_urdf, "mjcf": model.to_mjcf, "sdf": model.to_sdf}[written]()
    for link in (each for each in model.links if each.inertial is not None):
        was, now = before.inertial(link.name).origin.matrix, model.inertial(link.name).origin.matrix
        place = Pose.from_matrix(now @ inverse(was) @ homogeneous(np.eye(3), np.array([0.1, 0.02, 0.03])))
        xyz, rpy = (" ".join(map(repr, each)) for each in (place.xyz, place.rpy))
        quat = " ".join(map(repr, np.roll(quat_from_rotation(place.matrix[:3, :3]), 1).tolist()))
        shape = {
            "urdf": f'<collision><origin xyz="{xyz}" rpy="{rpy}"/>'
            f'<geometry><box size="{SIDES}"/></geometry></collision>',
            "sdf": f'<collision name="box"><pose>{xyz} {rpy}</pose>'
            f"<geometry><box><size>{SIDES}</size></box></geometry></collision>",
            "mjcf": f'<geom type="box" size="0.15 0.1 0.05" mass="0" pos="{xyz}" quat="{quat}"/>',
        }[written]
        tag = "body" if written == "mjcf" else "link"
        text, count = re.subn(rf'(<{tag} name="{link.name}"[^>]*>)', rf"\1{shape}", text)
        assert count == 1
    return text


def moved_or_turned(joint: Joint, size: float, rng: np.random.Generator) -> Joint:
    """Return a joint at another place: one that does not turn its body as it likes may be turned."""
    direction = rng.standard_normal(3)
    direction /= np.linalg.norm(direction)
    off = homogeneous(np.eye(3), size * direction)
    if joint.type != "ball" and rng.random() < 0.5:
        off = Pose((0.0, 0.0, 0.0), (size * direction[0], size * direction[1], size * direction[2])).matrix
    return replace(joint, origin=Pose.from_matrix(joint.origin.matrix @ off))


@QUICK
@given(SEEDS, SIZES, st.sampled_from(["urdf", "mjcf", "sdf"]), st.booleans(), st.booleans())
# Links that a slide carries, a base of links alone, and bases with slides and ball joints.
@example(4, 1e-5, "sdf", True, False)
@example(45, 0.014, "urdf", True, False)
@example(83, 0.06, "urdf", True, False)
@example(115, 7e-5, "sdf", True, True)
@example(130, 1e-4, "mjcf", True, False)
@example(193, 0.015, "mjcf", True, False)
def test_a_misplaced_joint_is_named_where_frames_are_moved_and_shapes_move_along(
    seed: int, size: float, written: str, floating: bool, balls: bool
) -> None:
    rng = np.random.default_rng(seed)
    model = tree(rng, floating, balls and written != "urdf")
    # Below slides alone, or at a fixed base, nothing but mass is seen.
    joint = picked(
        model,
        rng,
        lambda each: floating or any(other.type in ("revolute", "ball") for other in above(model, each)),
    )
    other = with_moved_frames(with_joint(model, moved_or_turned(joint, size, rng)), rng)
    base = model.base if written == "urdf" else None
    texts = text_with_boxes(model, model, written), text_with_boxes(other, model, written)
    report = same_robot(*texts, base=base)
    assert names(report) == [("origin", joint.name, joint.name)]
    assert report.attributes == ()
    assert report.mended is not None
    assert same_robot(model, report.mended).same


def chain(rng: np.random.Generator, kinds: tuple[JointType, ...], floating: bool) -> Model:
    """Return a chain of links with mass on joints of some types."""
    links, joints = [Link("link_0", random_inertial(rng))], []
    for k, kind in enumerate(kinds, start=1):
        axis = rng.standard_normal(3)
        x, y, z = (axis / np.linalg.norm(axis)).tolist()
        place = Pose.from_matrix(homogeneous(random_rotation(rng), rng.uniform(-0.4, 0.4, 3)))
        limits = Limits() if kind == "ball" else Limits(-1.0, 1.0, 5.0, 9.0)
        joints.append(Joint(f"joint_{k}", kind, f"link_{k - 1}", f"link_{k}", place, (x, y, z), limits))
        links.append(Link(f"link_{k}", random_inertial(rng)))
    return Model.build("chain", links, joints, base="floating" if floating else "fixed")


def frame_of(model: Model, before: Model, link: str) -> Floats:
    """Return the pose (4, 4) of the frame of a link in the one that it had before, with the same inertia."""
    return before.inertial(link).origin.matrix @ inverse(model.inertial(link).origin.matrix)


def with_keyframe(model: Model, before: Model, q: Floats) -> Model:
    """Return a model with other frames, with the configuration q (nq,) of the model before."""
    q = q.copy()
    if model.floating:
        T = homogeneous(rotation_from_quat(q[3:7]), q[:3]) @ frame_of(model, before, model.root)
        q[:3], q[3:7] = T[:3, 3], quat_from_rotation(T[:3, :3])
    for joint in before.ball_joints:
        R, first = frame_of(model, before, joint.child)[:3, :3], before.position_index(joint.name)
        turned = R.T @ rotation_from_quat(q[first : first + 4]) @ R
        q[first : first + 4] = quat_from_rotation(turned)
    return model.with_configuration("home", q)


@QUICK
@given(SEEDS, SIZES, st.sampled_from(["revolute", "prismatic", "ball"]), st.booleans())
def test_keyframes_tell_that_a_joint_at_a_floating_base_is_misplaced(
    seed: int, size: float, kind: JointType, moved: bool
) -> None:
    rng = np.random.default_rng(seed)
    model = chain(rng, (kind, "revolute", "revolute"), floating=True)
    other = with_joint(model, moved_or_turned(model.joint("joint_1"), size, rng))
    if moved:
        other = with_moved_frames(other, rng)
    q = model.random(rng)
    report = same_robot(with_keyframe(model, model, q).to_mjcf(), with_keyframe(other, model, q).to_mjcf())
    assert names(report) == [("origin", "joint_1", "joint_1")]
    assert report.attributes == ()


@QUICK
@given(SEEDS, SIZES, st.booleans())
def test_keyframes_tell_that_a_joint_below_a_ball_joint_is_misplaced(
    seed: int, size: float, floating: bool
) -> None:
    rng = np.random.default_rng(seed)
    model = chain(rng, ("revolute", "ball", "revolute", "revolute"), floating)
    joint = model.joint("joint_3")
    # About the centre of the ball joint, as its link may be turned instead.
    direction = rng.standard_normal(3)
    turn = Pose((0.0, 0.0, 0.0), tuple((size * direction / np.linalg.norm(direction)).tolist())).matrix
    misplaced = replace(joint, origin=Pose.from_matrix(turn @ joint.origin.matrix))
    other = with_moved_frames(with_joint(model, misplaced), rng)
    q = model.random(rng)
    report = same_robot(with_keyframe(model, model, q).to_mjcf(), with_keyframe(other, model, q).to_mjcf())
    assert names(report) == [("origin", "joint_3", "joint_3")]
    assert report.attributes == ()


def with_camera(model: Model, before: Model, link: str, T: Floats) -> Model:
    """Return a model with a frame at the pose T (4, 4) in a link whose frame the model before has."""
    place = Pose.from_matrix(inverse(frame_of(model, before, link)) @ T)
    camera = Joint("to_camera", "fixed", link, "camera", place)
    return rebuilt(model, [*model.links, Link("camera")], [*model.joints, camera])


@QUICK
@given(SEEDS, SIZES, st.sampled_from(["revolute", "prismatic"]))
def test_a_frame_tells_that_a_joint_at_a_floating_base_is_misplaced(
    seed: int, size: float, kind: JointType
) -> None:
    rng = np.random.default_rng(seed)
    model = chain(rng, (kind, "revolute", "revolute"), floating=True)
    other = with_moved_frames(with_joint(model, moved_or_turned(model.joint("joint_1"), size, rng)), rng)
    T = homogeneous(random_rotation(rng), rng.uniform(-0.4, 0.4, 3))
    texts = [with_camera(each, model, "link_0", T).to_urdf() for each in (model, other)]
    report = same_robot(*texts, base="floating")
    assert names(report) == [("origin", "joint_1", "joint_1")]
    assert report.attributes == ()


@QUICK
@given(SEEDS, SIZES)
def test_a_frame_tells_that_a_joint_with_a_symmetric_link_is_misplaced(seed: int, size: float) -> None:
    rng = np.random.default_rng(seed)
    model = chain(rng, ("revolute",), floating=False)
    bob = replace(model.inertial("link_1"), ixx=0.1, iyy=0.1, izz=0.1, ixy=0.0, ixz=0.0, iyz=0.0)
    model = with_inertial(model, "link_1", bob)
    joint = model.joint("joint_1")
    turn = homogeneous(rotation_about(np.array(joint.axis), np.asarray(size)), np.zeros(3))
    turned = replace(joint, origin=Pose.from_matrix(joint.origin.matrix @ turn))
    other = with_moved_frames(with_joint(model, turned), rng)
    T = homogeneous(random_rotation(rng), rng.uniform(-0.4, 0.4, 3))
    report = same_robot(*(with_camera(each, model, "link_1", T).to_urdf() for each in (model, other)))
    assert names(report) == [("origin", "joint_1", "joint_1")]
    assert report.attributes == ()


@QUICK
@given(SEEDS, SIZES)
def test_shapes_tell_how_a_link_on_a_slide_and_a_ball_joint_is_turned(seed: int, size: float) -> None:
    rng = np.random.default_rng(seed)
    model = chain(rng, ("revolute", "ball", "prismatic"), floating=True)
    links = [replace(each, inertial=None) if each.name == "link_2" else each for each in model.links]
    model = rebuilt(model, links, model.joints)
    # Where the link is turned by half a turn, its axis is not reversed.
    joint = model.joint("joint_3")
    x, y, z = (-each for each in joint.axis)
    other = with_moved_frames(with_joint(model, replace(joint, axis=(x, y, z))), rng)
    first, second = text_with_boxes(model, model, "mjcf"), text_with_boxes(other, model, "mjcf")
    assert same_robot(first, second).same
    mass = other.inertial("link_3").mass
    report = same_robot(first, second.replace(f'mass="{mass!r}"', f'mass="{(1.0 + size) * mass!r}"'))
    assert names(report) == [("inertial", "link_3", "link_3")]
    assert report.attributes == ()
