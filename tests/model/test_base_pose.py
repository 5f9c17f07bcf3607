"""The pose of a fixed base: how it is given, kept and refused."""

from __future__ import annotations

import pickle
from typing import Any

import numpy as np
import pytest
from hypothesis import given

from dynx.errors import ArgumentError, DTypeError, NotFiniteError, ShapeError
from dynx.model import Model, Pose
from dynx.model.documents import robot_document, robot_from_document
from dynx.model.loading import load
from dynx.testing.strategies import models
from tests.model.descriptions import joint

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
        (Pose((0.0, 1.0)), ShapeError, "xyz of base_pose"),  # type: ignore[arg-type]
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


def test_urdf_text_is_that_of_the_robot_at_the_world_frame() -> None:
    model = load(TEXT, base_pose=POSE)
    assert model.to_urdf() == load(TEXT).to_urdf()
    assert load(model.to_urdf(), base_pose=model.base_pose) == model
