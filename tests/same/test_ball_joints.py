"""Ball joints in `same_robot`: frames and zero poses are free, centres and what the joints carry are not."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import dynx
from dynx.model import Model
from dynx.model.elements import JointDynamics, Limits, Pose
from dynx.same import SameReport, same_robot
from dynx.spatial.se3 import homogeneous
from dynx.spatial.so3 import quat_product, rotation_from_quat
from dynx.testing.strategies import models
from tests.same.rewrites import (
    inertial_of,
    merged,
    pose,
    random_rotation,
    rebuilt,
    with_flipped_axes,
    with_merged_links,
    with_moved_frames,
    with_other_names,
    with_other_order,
    with_split_links,
    with_turned_inertias,
)
from tests.same.test_same_robot import SLOW

Rewrite = Callable[[Model, np.random.Generator], Model]


def with_turned_zero_poses(model: Model, rng: np.random.Generator) -> Model:
    """Turn the zero pose of every ball joint."""
    joints = [
        replace(joint, origin=pose(joint.origin.matrix @ homogeneous(random_rotation(rng), np.zeros(3))))
        if joint.type == "ball"
        else joint
        for joint in model.joints
    ]
    return rebuilt(model, model.links, joints)


def with_exchanged_masses(model: Model, rng: np.random.Generator) -> Model:
    """Move a mass at the centre of each ball joint from the child to the parent."""
    links = {link.name: link for link in model.links}
    for joint in model.joints:
        child, parent = links[joint.child], links[joint.parent]
        if joint.type != "ball" or child.inertial is None or parent.inertial is None:
            continue
        if min(child.inertial.mass, parent.inertial.mass) <= 0.0:
            continue
        mass = 0.3 * child.inertial.mass
        links[child.name] = replace(
            child, inertial=merged(child.inertial, inertial_of(-mass, Pose(), np.zeros((3, 3))))
        )
        point = inertial_of(mass, Pose(joint.origin.xyz), np.zeros((3, 3)))
        links[parent.name] = replace(parent, inertial=merged(parent.inertial, point))
    return rebuilt(model, list(links.values()), model.joints)


REWRITES: dict[str, Rewrite] = {
    "frames moved": with_moved_frames,
    "zero poses turned": with_turned_zero_poses,
    "frames moved and zero poses turned": lambda model, rng: with_moved_frames(
        with_turned_zero_poses(model, rng), rng
    ),
    "axes reversed": with_flipped_axes,
    "inertias in other axes": with_turned_inertias,
    "masses exchanged": with_exchanged_masses,
    "frames moved and masses exchanged": lambda model, rng: with_moved_frames(
        with_exchanged_masses(model, rng), rng
    ),
    "links split": with_split_links,
    "links merged": lambda model, _: with_merged_links(model),
    "another order and frames": lambda model, rng: with_moved_frames(with_other_order(model, rng), rng),
    "other names": lambda model, _: with_other_names(model),
    "MJCF": lambda model, _: dynx.load(model.to_mjcf(), base=model.base),
    "SDF": lambda model, _: dynx.load(model.to_sdf(), base=model.base),
}


def robots() -> st.SearchStrategy[Model]:
    """Draw robots with ball joints."""
    kinds = ("ball", "revolute", "prismatic", "fixed")
    drawn = models(max_links=6, joint_types=kinds, mimics=False, locks=False)
    # Rewrites keep no place of the base.
    return drawn.map(lambda model: replace(model, base_pose=Pose()))


def torques(model: Model, other: Model, report: SameReport, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Return torques of two robots with a fixed base at random states, in the coordinates of the first."""
    rng = np.random.default_rng(seed)
    theirs_q = other.random(rng, 3)
    q = np.zeros((3, model.nq))
    v, a = rng.uniform(-1.0, 1.0, (2, 3, model.nv))
    maps = np.zeros((other.nv, model.nv))
    for row in report.coordinates:
        i, j = row.first_index, row.second_index
        k, m = row.first_velocity_index, row.second_velocity_index
        if row.before is None or row.after is None:
            q[:, i] = row.sign * theirs_q[:, j]
            maps[m, k] = row.sign
        else:
            turned = quat_product(np.array(row.before), theirs_q[:, j : j + 4])
            q[:, i : i + 4] = quat_product(turned, np.array(row.after))
            maps[m : m + 3, k : k + 3] = rotation_from_quat(np.array(row.after))
    theirs_v, theirs_a = v @ maps.T, a @ maps.T
    own = dynx.backend("reference", model).inverse_dynamics(q, v, a)
    return own, dynx.backend("reference", other).inverse_dynamics(theirs_q, theirs_v, theirs_a) @ maps


@SLOW
@given(rewrite=st.sampled_from(sorted(REWRITES)), model=robots(), seed=st.integers(0, 1000))
def test_a_rewritten_robot_is_the_same(rewrite: str, model: Model, seed: int) -> None:
    other = REWRITES[rewrite](model, np.random.default_rng(seed))
    report = same_robot(model, other)
    assert report.same, (report.differences, report.unmatched)
    assert report.bounds is not None
    if not model.floating:
        own, back = torques(model, other, report, seed)
        assert back == pytest.approx(own, rel=1e-8, abs=1e-8 * float(np.max(np.abs(own), initial=1.0)))


def arm(
    *,
    pos: str = "0 0 -0.3",
    quat: str = "1 0 0 0",
    com: str = "0.1 0.2 0.3",
    joint: str = "",
    inner: str = "",
    kind: str = "ball",
    reach: str = "1",
) -> str:
    """Write a robot with a ball joint between two hinges as MJCF."""
    return f"""<mujoco><compiler angle="radian"/><worldbody>
<body name="a" pos="0 0 1"><inertial pos="0.1 0 0.05" mass="1" diaginertia="0.1 0.2 0.25"/>
<joint name="h" axis="0 1 0"/>
<body name="b" pos="{pos}" quat="{quat}">
<inertial pos="{com}" mass="2" fullinertia="0.11 0.2 0.25 0.01 0.02 0.03"/>
<joint name="s" type="{kind}" damping="0.1" range="0 {reach}" limited="true" {joint}/>
<body name="c" pos="0.1 0.2 0.3"><inertial pos="0.1 0 0.05" mass="1" diaginertia="0.1 0.2 0.25"/>
<joint name="k" axis="1 0 0" {inner}/></body></body></body></worldbody></mujoco>"""


@pytest.mark.parametrize(
    ("changed", "part", "name"),
    [
        ({"pos": "0 0 -0.30001"}, "origin", "s"),
        ({"joint": 'pos="0 0.001 0"'}, "origin", "s"),
        ({"com": "0.1 0.2 0.3001"}, "inertial", "b"),
        ({"inner": 'pos="0 0 0" axis="1 0.001 0"'}, "axis", "k"),
        ({"kind": "hinge"}, "type", "s"),
    ],
)
@pytest.mark.parametrize("turned", [False, True])
def test_a_planted_difference_is_named_and_mended(
    changed: dict[str, str], part: str, name: str, turned: bool
) -> None:
    first = arm()
    second = (
        arm(**changed)
        if "axis" not in changed.get("inner", "")
        else arm().replace('name="k" axis="1 0 0"', 'name="k" axis="1 0.001 0"')
    )
    other = dynx.load(second)
    if turned and part in ("axis", "type"):
        return  # a frame that is moved along a wrong axis does not lie on the right one
    if turned:
        other = with_moved_frames(other, np.random.default_rng(1))
    report = same_robot(first, other if turned else second)
    assert [(each.part, each.theirs) for each in report.differences] == [(part, name)]
    assert not report.unmatched
    assert report.mended is not None
    assert same_robot(first, report.mended).same
    if not turned and part != "type":
        assert report.mended_text is not None
        assert same_robot(first, report.mended_text).same
        assert report.differences[0].effect is not None


def test_freedoms_and_numbers_of_a_ball_joint_are_named() -> None:
    turned = same_robot(arm(), arm(quat="0.8 0.6 0 0"))
    assert turned.same
    assert [each.kind for each in turned.freedoms] == ["zero pose"]
    (limit,) = turned.attributes
    assert (limit.kind, limit.theirs) == ("upper limit", "s")
    assert "zero pose turned by 1.287" in limit.second
    row = turned.coordinates[1]
    assert row.before == pytest.approx((0.6, 0.0, 0.0, 0.8))
    assert row.after == (0.0, 0.0, 0.0, 1.0)
    (wider,) = same_robot(arm(), arm(reach="1.5")).attributes
    assert (wider.kind, wider.first, wider.second) == ("upper limit", "1", "1.5")


def test_friction_acts_about_the_axes_of_the_child() -> None:
    model = dynx.load(arm())
    free, rubbing = Limits(), JointDynamics(0.1, 0.2)
    joints = [
        replace(joint, limits=free, dynamics=rubbing) if joint.type == "ball" else joint
        for joint in model.joints
    ]
    model = rebuilt(model, model.links, joints)
    report = same_robot(model, with_moved_frames(model, np.random.default_rng(0)))
    assert report.same
    (friction,) = report.attributes
    assert (friction.kind, friction.theirs) == ("friction", "s")
    assert "about axes turned by" in friction.second


def test_keyframes_of_ball_joints_are_compared_in_the_coordinates_of_the_first() -> None:
    keyframe = '<keyframe><key name="k" qpos="0.1 {} 0.2"/></keyframe></mujoco>'
    first = arm().replace("</mujoco>", keyframe.format("1 0 0 0"))
    # The zero pose is turned by q0 = (0.8, 0.6, 0, 0), so its inverse is the same attitude.
    second = arm(quat="0.8 0.6 0 0").replace("</mujoco>", keyframe.format("0.8 -0.6 0 0"))
    assert [each.kind for each in same_robot(first, second).attributes] == ["upper limit"]
    other = second.replace("0.8 -0.6 0 0", "0.8 0.6 0 0")
    assert [each.kind for each in same_robot(first, other).attributes] == ["upper limit", "configuration"]
