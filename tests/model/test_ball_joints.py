"""Ball joints of a model: coordinates and their arithmetic, and the refusal by what takes none."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import dynx
from dynx.errors import (
    ArgumentError,
    DescriptionError,
    EngineLimitError,
    ShapeError,
    UnsupportedFeatureError,
)
from dynx.model import Inertial, Joint, JointDynamics, Limits, Link, Mimic, Model
from dynx.model.ball_joints import refuse_ball_joints, refuse_ball_joints_of_backend
from dynx.model.conversion import convert
from dynx.spatial.so3 import quat_log, quat_product
from dynx.testing.strategies import configurations, models, velocities

KINDS = ("ball", "revolute", "prismatic", "fixed")
LINKS = (Link("base"), Link("a", Inertial(1.0)), Link("b", Inertial(1.0)), Link("c", Inertial(1.0)))
HINGE = Joint("hinge", "revolute", "base", "a", limits=Limits(-1.0, 1.0))
BALL = Joint("ball", "ball", "a", "b", limits=Limits(upper=0.5, velocity=2.0, effort=7.0))
SLIDE = Joint("slide", "prismatic", "b", "c")
MODEL = Model.build("arm", LINKS, [HINGE, BALL, SLIDE])


def robots() -> st.SearchStrategy[Model]:
    return models(joint_types=KINDS, mimics=False, locks=False)


def test_coordinates() -> None:
    assert (MODEL.nq, MODEL.nv) == (6, 5)
    assert MODEL.joint_names == ("hinge", "ball", "slide")
    assert MODEL.coordinate_names == ("hinge", "ball.x", "ball.y", "ball.z", "slide")
    assert MODEL.position_names == ("hinge", "ball.qx", "ball.qy", "ball.qz", "ball.qw", "slide")
    assert [MODEL.position_index(name) for name in MODEL.joint_names] == [0, 1, 5]
    assert [MODEL.coordinate_index(name) for name in MODEL.joint_names] == [0, 1, 4]
    assert MODEL.quaternions == (1,)
    assert MODEL.with_base("floating").quaternions == (3, 8)
    assert MODEL.neutral().tolist() == [0.0, 0.0, 0.0, 0.0, 1.0, 0.0]
    assert MODEL.lower[1:5].tolist() == [-np.inf] * 4
    assert MODEL.upper[1:5].tolist() == [np.inf] * 4
    assert MODEL.velocity_limit[1:4].tolist() == [2.0] * 3
    assert MODEL.effort_limit[1:4].tolist() == [7.0] * 3


def test_joint_dynamics_act_about_each_axis() -> None:
    joint = Joint("ball", "ball", "base", "a", dynamics=dynx.model.JointDynamics(0.5, 0.25, 2.0))
    model = Model.build("arm", [LINKS[0], Link("a", Inertial(1.0, ixx=1.0, iyy=1.0, izz=1.0))], [joint])
    q, v, a = model.neutral(), np.array([1.0, -2.0, 0.0]), np.array([3.0, 0.0, 1.0])
    with dynx.backend("reference", model) as engine:
        own = engine.inverse_dynamics(q, v, a, joint_dynamics=True) - engine.inverse_dynamics(q, v, a)
        np.testing.assert_array_equal(own, 2.0 * a + 0.5 * v + 0.25 * np.sign(v))
        np.testing.assert_array_equal(
            engine.mass_matrix(q, joint_dynamics=True) - engine.mass_matrix(q), 2.0 * np.eye(3)
        )


@given(data=st.data())
def test_integrate_and_difference_are_inverse(data: st.DataObject) -> None:
    model = data.draw(robots())
    q0, q1 = data.draw(configurations(model)), data.draw(configurations(model))
    v = model.difference(q0, q1)
    reached = model.integrate(q0, v)
    size = 1.0 + np.max(np.abs([q0, q1]), initial=0.0)
    for first in model.quaternions:
        part = slice(first, first + 4)
        # A quaternion and its negative are the same attitude.
        if reached[part] @ q1[part] < 0.0:
            reached[part] *= -1.0
    assert np.max(np.abs(reached - q1), initial=0.0) <= 32.0 * np.finfo(float).eps * size**2
    batch = model.integrate(np.stack([q0, q1]), v)
    np.testing.assert_allclose(batch[0], model.integrate(q0, v), rtol=0.0, atol=np.finfo(float).eps * size)


@given(data=st.data())
def test_short_rotations_are_about_the_axes_of_the_child(data: st.DataObject) -> None:
    model = Model.build("arm", LINKS[:2], [Joint("ball", "ball", "base", "a")])
    q, v = data.draw(configurations(model)), data.draw(velocities(model, 1.0))
    back = q * [-1.0, -1.0, -1.0, 1.0]
    turned = quat_log(quat_product(back, model.integrate(q, v)))
    assert np.max(np.abs(turned - v)) <= 16.0 * np.finfo(float).eps


@given(data=st.data())
def test_random_and_clip_keep_limits(data: st.DataObject) -> None:
    model = data.draw(robots())
    drawn = model.random(data.draw(st.integers(0, 9)), 4)
    anywhere = data.draw(configurations(model))
    clipped = model.clip(anywhere)
    for q in (*drawn, clipped):
        for joint in model.ball_joints:
            first = model.position_index(joint.name)
            quat = q[first : first + 4]
            assert abs(np.linalg.norm(quat) - 1.0) <= 4.0 * np.finfo(float).eps
            assert np.linalg.norm(quat_log(quat)) <= joint.limits.upper + 1e-7
    np.testing.assert_allclose(model.clip(clipped), clipped, rtol=0.0, atol=1e-7)


def test_sampled_rotations_fill_the_range_uniformly() -> None:
    angles = np.linalg.norm(quat_log(MODEL.random(0, 20_000)[:, 1:5]), axis=-1)
    share = angles - np.sin(angles)
    largest = 0.5 - np.sin(0.5)
    assert abs(np.mean(share / largest) - 0.5) < 0.01


def test_faults_are_refused_by_name() -> None:
    with pytest.raises(ArgumentError, match=r"q\[1:5\] is a quaternion"):
        dynx.backend("reference", MODEL).mass_matrix([0.0, 0.0, 0.0, 0.0, 1.1, 0.0])
    with pytest.raises(ShapeError, match=r"quaternion .* of each ball joint: 'ball'"):
        dynx.backend("reference", MODEL).mass_matrix(np.zeros(5))
    with pytest.raises(UnsupportedFeatureError, match="cannot lock 'ball': it is a ball joint"):
        Model.build("arm", LINKS, [HINGE, BALL, SLIDE], lock={"ball": 0.0})
    follower = Joint("slide", "prismatic", "b", "c", mimic=Mimic("hinge"))
    with pytest.raises(UnsupportedFeatureError, match="'slide' mimics another, and 'ball' is a ball joint"):
        Model.build("arm", LINKS, [HINGE, BALL, follower])
    with pytest.raises(DescriptionError, match="largest angle of ball joint 'ball'"):
        Model.build("arm", LINKS, [HINGE, Joint("ball", "ball", "a", "b", limits=Limits(0.0, -1.0)), SLIDE])
    with pytest.raises(
        UnsupportedFeatureError, match=r"'ball' of arm is a ball joint, which this does not take$"
    ):
        refuse_ball_joints(MODEL, "this")
    with pytest.raises(EngineLimitError, match="the backend 'derived' does not take; the backends 'ref"):
        refuse_ball_joints_of_backend(MODEL, "derived")
    with pytest.raises(UnsupportedFeatureError, match=r"does not take; MJCF and SDF do$"):
        MODEL.to_urdf()


@given(data=st.data())
def test_formats_keep_ball_joints(data: st.DataObject) -> None:
    model = data.draw(robots())
    for form in ("mjcf", "sdf"):
        assert convert(model, form).differences == ()


def test_springs_of_other_joints_take_their_positions_from_q() -> None:
    """A ball joint has one number more in q than in v."""
    hinge = replace(HINGE, dynamics=JointDynamics(stiffness=2.0, spring_reference=0.1))
    slide = replace(SLIDE, dynamics=JointDynamics(stiffness=3.0))
    masses = [Link(name, Inertial(1.0, ixx=0.1, iyy=0.1, izz=0.1)) for name in ("base", "a", "b", "c")]
    model = Model.build("arm", masses, [hinge, BALL, slide])
    engine = dynx.backend("reference", model)
    q, zero = model.random(0), np.zeros(model.nv)
    rigid = engine.inverse_dynamics(q, zero, zero)
    springs = engine.inverse_dynamics(q, zero, zero, joint_dynamics=True) - rigid
    expected = [2.0 * (q[0] - 0.1), 0.0, 0.0, 0.0, 3.0 * q[5]]
    np.testing.assert_allclose(springs, expected, rtol=0.0, atol=1e-12)
    energy = engine.potential_energy(q, joint_dynamics=True) - engine.potential_energy(q)
    assert energy == pytest.approx((q[0] - 0.1) ** 2 + 1.5 * q[5] ** 2, abs=1e-12)


def test_a_ball_joint_has_no_spring() -> None:
    with pytest.raises(UnsupportedFeatureError, match="'ball' has a spring"):
        Model.build("arm", LINKS, [HINGE, replace(BALL, dynamics=JointDynamics(stiffness=1.0)), SLIDE])
