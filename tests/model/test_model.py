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

from dynx.errors import ArgumentError, UnknownNameError
from dynx.model import Inertial, Joint, Limits, Link, Model, Pose
from dynx.model.loading import load
from dynx.model.model import refuse_other_than_model
from dynx.testing.strategies import models

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
