"""The model as a value: names, sizes, equality, pickling, and the errors of look-ups."""

from __future__ import annotations

import base64
import copy
import dataclasses
import pickle
import zlib
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dynx.errors import ArgumentError, DTypeError, NotFiniteError, ShapeError, UnknownNameError
from dynx.model import Inertial, Joint, Limits, Link, Model, Pose
from dynx.model.documents import robot_document, robot_from_document
from dynx.model.loading import load
from dynx.model.model import refuse_other_than_model
from dynx.testing.strategies import configurations, models
from tests.model.descriptions import joint
from tests.model.placement import frame_poses, total_inertia
from tests.spatial.rounding import assert_same_to_rounding

PICKLED_BEFORE_TREE = (
    "eNp9U82O0zAQLuSnabcrVuLEiQMX9tInQHBBqkBLBU8QOcmkNuvEkeN0k0oIOCx7mVvDlefgBk/BS3DhERinaVq0aHNwPN/M"
    "eL75PP7kfv3ljLoPz5Imr+eZSkDuVvTe2N/2/POHp+jmLIMWHaYz9KTIL0t8eJQAEjLITdmie0HObWuT+AjdiJWUFogctBFM"
    "tkt0KRvaZRXx+32QY0TRcpffw+BVH9cXzVhZLl786Rn6SouVyFsKdN+qEnZV0KmbTbsY9d/tzQ3R1kXT8mkVoSPq+nAiWc0Q"
    "Z63NsdU0x5HNP77NZvBxzzZjly/ov1eCZCCG3mu72/YteiAjdYWuaQrAQMNaycoA+gXTJBt30Iu5kAn3+ZgHXc6ET/lJR9ll"
    "tTio8J/+0JciE11V/6Lb7eTzpLoCvfix78GrioLsoadgDVLFwjSLj4PEkKZKmwGg8gFdM8tEbI8/7Zp62QO7KuOEZYXIVwd1"
    "glSL2AiVH0E0N8xUGgaITvYyIhsvcUIsLiEJmVl2Ml5bPVJRQ4LjlWZry/D29f588u37u9/Xj29wBrXRLEw1jWh5jhM7c2FB"
    "A7KX8q7h4Cd3eS3LXBl7rF+qSsd0e88yyJRunmOwApWB0Q0+OnoKe3DevRKa/UUPWLnwLOzgUOlQA0tAEz+Hz3Bmn81RZGuV"
    "XYuyYpJqT2MlpShJUjJmOzhMWSXNEh8Mvh6hYfT5aVVGVTT/C6BUKCE="
)
"""A pickle of a model as written before `Tree` was split off, compressed, in base 64."""


@given(models())
def test_names_sizes_and_limits_fit_together(model: Model) -> None:
    base_q, base_v = (7, 6) if model.floating else (0, 0)
    assert model.nq == base_q + len(model.joint_names)
    assert model.nv == base_v + len(model.joint_names)
    assert model.lower.shape == model.upper.shape == model.neutral().shape == (model.nq,)
    assert model.velocity_limit.shape == model.effort_limit.shape == (model.nv,)
    assert np.all(model.lower <= model.upper)
    for k, name in enumerate(model.joint_names):
        assert model.coordinate_index(name) == base_v + k
        assert model.joint(name).moves
    for k, name in enumerate(model.frame_names):
        assert model.frame_index(name) == k
    assert model.frame_names[0] == model.root


@given(models())
def test_a_model_is_a_value(model: Model) -> None:
    for twin in (pickle.loads(pickle.dumps(model)), copy.deepcopy(model), dataclasses.replace(model)):
        assert twin == model
        assert hash(twin) == hash(model)
        np.testing.assert_array_equal(twin.random(1), model.random(1))
    anything: Any = model
    with pytest.raises(dataclasses.FrozenInstanceError):
        anything.name = "other"
    assert model != "a model"


@given(models())
def test_any_change_makes_another_model(model: Model) -> None:
    others = [
        dataclasses.replace(model, name=model.name + "x"),
        model.with_gravity((1.0, 2.0, 3.0)),
        model.with_base("fixed" if model.floating else "floating"),
        model.with_frame("one more", model.root),
        dataclasses.replace(model, links=(*model.links[:-1], Link("renamed"))),
    ]
    assert all(other != model for other in others)
    back = others[2].with_base(model.base)
    if not model.floating:
        back = back.with_base_pose(model.base_pose)  # which a floating base has not
    assert others[1].with_gravity(model.gravity) == back == model


@pytest.mark.parametrize(
    ("look_up", "message"),
    [
        (lambda m: m.joint("elbow"), "no joint 'elbow' in ur5; did you mean 'elbow_joint'"),
        (lambda m: m.joint("forearm_link"), "that is a link; the joint that moves it is 'elbow_joint'"),
        (lambda m: m.link("elbow_joint"), "that is a joint; the link it moves is 'forearm_link'"),
        (lambda m: m.frame_index("tool"), "did you mean 'tool0'"),
        (lambda m: m.frame_index("elbow_joint"), "the frame it moves is 'forearm_link'"),
        (lambda m: m.coordinate_index("ee_fixed_joint"), "has no coordinate: it is fixed"),
        (lambda m: m.with_frame("tip", "no_link", Pose()), "no link 'no_link'"),
        (lambda m: m.joint(["elbow_joint"]), "no joint .* a name is a str, not list"),
        (lambda m: m.link(None), "no link 'None'"),
        (lambda m: m.frame_index(3), "no frame '3'"),
    ],
)
def test_errors_for_unknown_names(look_up: object, message: str) -> None:
    assert callable(look_up)
    with pytest.raises(UnknownNameError, match=message):
        look_up(load("ur5"))


def test_names_of_frames_are_unique() -> None:
    with pytest.raises(ArgumentError, match="frame 'tool0' exists already") as caught:
        load("ur5").with_frame("tool0", "tool0")
    assert not isinstance(caught.value, UnknownNameError)


def test_names_are_case_sensitive() -> None:
    with pytest.raises(UnknownNameError, match="did you mean 'tool0'"):
        load("ur5").frame_index("TOOL0")


def test_what_is_no_model_is_refused_with_an_example() -> None:
    with pytest.raises(ArgumentError, match=r"of type str; wanted a Model, such as dynx\.load\('ur5'\)"):
        refuse_other_than_model("ur5")
    with pytest.raises(ArgumentError, match=r"of type float; wanted a Model, such as dynx\.load\(\.\.\.\)"):
        refuse_other_than_model(3.0)


def test_a_notebook_shows_the_joints() -> None:
    model = load("dynx_double_pendulum")
    page = model._repr_html_()
    assert page.count("<tr>") == 1 + model.nv
    assert "<td>shoulder</td>" in page
    assert "fixed base, nq 2, nv 2" in page


def test_a_model_pickled_before_tree_was_split_off_is_read() -> None:
    read = pickle.loads(zlib.decompress(base64.b64decode(PICKLED_BEFORE_TREE)))
    tip = Inertial(1.0, ixx=1.0, iyy=1.0, izz=1.0)
    elbow = Joint("elbow", "revolute", "base", "tip", limits=Limits(-1.0, 1.0))
    assert read == Model.build("arm", [Link("base"), Link("tip", tip)], [elbow])
    assert read.upper.tolist() == [1.0]


@given(st.data())
def test_locking_equals_holding_the_joint(data: st.DataObject) -> None:
    model = data.draw(models(max_links=6, locks=False))
    q = data.draw(configurations(model))
    base = model.nq - len(model.joint_names)
    held = data.draw(st.sets(st.sampled_from(model.joint_names))) if model.joint_names else set()
    values = dict(zip(model.joint_names, q[base:].tolist(), strict=True))
    locked = load(model, lock={name: values[name] for name in held})

    assert locked.joint_names == tuple(name for name in model.joint_names if name not in held)
    assert locked.frame_names == model.frame_names
    q_locked = np.concatenate([q[:base], [values[name] for name in locked.joint_names]])
    size = 4.0 * (1.0 + float(np.max(np.abs(q), initial=0.0)))
    for now, before in zip(frame_poses(locked, q_locked), frame_poses(model, q), strict=True):
        assert_same_to_rounding(now, before, 64 * len(model.links), size=size)
    now_inertia, before_inertia = total_inertia(locked, q_locked), total_inertia(model, q)
    weight = max(1.0, sum(abs(link.inertial.mass) for link in model.links if link.inertial))
    reach = size * len(model.links)
    for field in ("mass", "first_moment", "rotational_inertia"):
        assert_same_to_rounding(
            getattr(now_inertia, field),
            getattr(before_inertia, field),
            128 * len(model.links),
            size=weight * reach**2,
        )


@given(st.data())
def test_locking_in_two_steps_equals_locking_at_once(data: st.DataObject) -> None:
    model = data.draw(models(max_links=5, locks=False))
    lock = dict.fromkeys(model.joint_names, 0.5)
    one_by_one = model
    for name in model.joint_names:
        one_by_one = load(one_by_one, lock={name: 0.5})
    at_once = load(model, lock=lock)
    assert one_by_one == at_once
    assert at_once.joint_names == ()
    assert all(not joint.moves for joint in at_once.joints)


def test_followers_of_a_locked_joint_are_fixed() -> None:
    model = load("romeo")
    followers = [joint for joint in model.joints if joint.mimic is not None]
    assert followers
    for follower in followers:
        mimic = follower.mimic
        assert mimic is not None
        locked = load("romeo", lock={mimic.joint: 0.25})
        assert locked.joint(follower.name).locked_at == mimic.multiplier * 0.25 + mimic.offset
        assert len(locked.notes) == len(model.notes)


def test_a_follower_may_be_locked_alone() -> None:
    model = load("romeo")
    follower = next(joint for joint in model.joints if joint.mimic is not None)
    locked = load(model, lock={follower.name: 0.125})
    assert locked.joint_names == model.joint_names
    assert (locked.joint(follower.name).locked_at, locked.joint(follower.name).mimic) == (0.125, None)


@pytest.mark.parametrize("name", ["no_such_joint", "ee_fixed_joint", "tool0"])
def test_the_error_names_a_joint_that_cannot_be_locked(name: str) -> None:
    with pytest.raises(UnknownNameError, match=f"cannot lock '{name}'"):
        load("ur5", lock={name: 0.0})


def test_the_error_for_the_coordinate_of_a_locked_joint() -> None:
    model: Model = load("ur5", lock={"elbow_joint": 0.0})
    with pytest.raises(UnknownNameError, match="'elbow_joint' of ur5 has no coordinate: it is locked"):
        model.coordinate_index("elbow_joint")


TEXT = joint()
POSE = Pose((0.1, 0.2, 0.3), (0.4, -0.5, 0.6))


def test_it_is_a_pose_or_a_matrix() -> None:
    assert load(TEXT).base_pose == Pose()
    assert load(TEXT, base_pose=POSE).base_pose == POSE
    by_matrix = load(TEXT, base_pose=POSE.matrix).base_pose
    np.testing.assert_allclose(by_matrix.matrix, POSE.matrix, rtol=0, atol=1e-15)
    whole: Any = Pose((1, 0, 0))
    assert load(TEXT, base_pose=whole).base_pose.xyz == (1.0, 0.0, 0.0)


def test_a_model_keeps_it_unless_another_is_given() -> None:
    model = load(TEXT, base_pose=POSE)
    assert load(model).base_pose == load(model, gravity=(0, 0, 0)).base_pose == POSE
    assert load(model, lock={"j": 0.1}).base_pose == POSE
    assert load(model, base_pose=np.eye(4)) == load(TEXT)
    assert model != load(TEXT)
    assert hash(model) != hash(load(TEXT))
    assert pickle.loads(pickle.dumps(model)) == model


@given(models())
def test_a_document_keeps_what_urdf_text_does_not(model: Model) -> None:
    assert robot_from_document(robot_document(model)) == model


@pytest.mark.parametrize(
    ("pose", "error", "message"),
    [
        ([0.0, 0.0, 1.0], ShapeError, r"base_pose has shape \(3,\); wanted a Pose or a matrix \(4, 4\)"),
        ("up", ArgumentError, "base_pose is 'up'; wanted a Pose or a matrix"),
        (np.diag([1.0, 1.0, -1.0, 1.0]), ArgumentError, "base_pose is not a rigid transform"),
        (Pose((float("nan"), 0.0, 0.0)), NotFiniteError, r"xyz of base_pose\[0\] is nan"),
        (Pose(rpy=(0.0, 0.0, 1e300)), ArgumentError, r"rpy of base_pose\[2\] is 1e\+300"),
        (Pose(("a", "b", "c")), DTypeError, "xyz of base_pose"),  # type: ignore[arg-type]
    ],
)
def test_anything_else_is_refused(pose: Any, error: type[Exception], message: str) -> None:
    with pytest.raises(error, match=message):
        load(TEXT, base_pose=pose)
    with pytest.raises(error, match=message):
        load(TEXT).with_base_pose(pose)


def test_a_floating_base_has_its_pose_in_q() -> None:
    with pytest.raises(ArgumentError, match=r"a floating base has its pose in q: position q\[:3\]"):
        load(TEXT, base="floating", base_pose=POSE)
    with pytest.raises(ArgumentError, match="floating base"):
        load(TEXT, base="floating").with_base_pose(POSE)
    assert load(TEXT, base="floating", base_pose=Pose()).floating
    freed = load(TEXT, base_pose=POSE).with_base("floating")
    assert freed == load(TEXT, base="floating")


def test_urdf_text_states_the_pose_of_the_base_and_an_argument_replaces_it() -> None:
    model = load(TEXT, base_pose=POSE)
    assert load(model.to_urdf()) == model
    assert load(model.to_urdf(), base_pose=Pose()) == load(TEXT)
    assert load(model.to_urdf(), base="floating") == load(TEXT, base="floating")
