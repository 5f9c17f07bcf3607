"""`Bounds`: two robots that are the same to a tolerance are no further apart, at any state within limits."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import HealthCheck, assume, given, settings
from hypothesis import strategies as st

import dynx
from dynx.model import Model
from dynx.model.elements import Inertial, Joint, JointType, Limits, Link, Mimic, Pose
from dynx.model.mechanism import ROOT
from dynx.same import same_robot
from dynx.same.decimals import rounded
from dynx.same.elements import analyse
from dynx.same.fit import BodyFit
from dynx.same.skeleton import exact_skeleton, without_standing_mimics
from dynx.spatial.se3 import inverse
from dynx.testing.strategies import models
from dynx.testing.strategies.models import COMMON_JOINT_TYPES
from tests.same.rewrites import rebuilt, with_moved_frames

ROUNDING = 1e-13
"""Error of the backend `reference`, relative to the largest entry of a quantity."""

BODY = Inertial(1.0, Pose((0.05, 0.01, 0.02)), 0.02, 0.0, 0.0, 0.03, 0.0, 0.04)


def perturbed(model: Model, rng: np.random.Generator, size: float) -> Model:
    """Move joints, tilt axes, and scale multipliers and inertias by `size` [m, rad, relative]."""

    def joint(one: Joint) -> Joint:
        x, y, z = (np.array(one.origin.xyz) + rng.uniform(-size, size, 3)).tolist()
        axis = np.array(one.axis) + rng.uniform(-size, size, 3)
        a, b, c = (axis / np.linalg.norm(axis)).tolist()
        mimic = one.mimic
        if mimic is not None:
            factor, offset = rng.uniform(-size, size, 2).tolist()
            mimic = replace(mimic, multiplier=mimic.multiplier * (1.0 + factor), offset=mimic.offset + offset)
        return replace(one, origin=Pose((x, y, z), one.origin.rpy), axis=(a, b, c), mimic=mimic)

    def link(one: Link) -> Link:
        own = one.inertial
        if own is None:
            return one
        factor = 1.0 + float(rng.uniform(-size, size))
        numbers = {
            name: getattr(own, name) * factor for name in ("mass", "ixx", "ixy", "ixz", "iyy", "iyz", "izz")
        }
        return replace(one, inertial=replace(own, **numbers))

    return rebuilt(model, [link(each) for each in model.links], [joint(each) for each in model.joints])


def fitted(first: Model, second: Model, tolerance: float) -> dict[str, BodyFit]:
    """Return the matched bodies by their links, which have the same names in both robots."""
    ours = exact_skeleton(without_standing_mimics(first))
    found = analyse(ours, without_standing_mimics(second), tolerance).fit
    return {ours.joints[each.ours].child: each for each in found.bodies if each.ours != ROOT}


def assert_bounds_hold(first: Model, second: Model, tolerance: float, rng: np.random.Generator) -> None:
    """Check the bounds of two robots with the same coordinates at random states of the first."""
    limits = same_robot(first, second, tolerance=tolerance).bounds
    assert limits is not None
    q = first.random(rng, 8)
    v, a = rng.standard_normal((2, 8, first.nv))
    for each in (v, a):
        each /= np.maximum(np.linalg.norm(each, axis=-1, keepdims=True), 1e-300)
    engines = [dynx.backend("reference", each) for each in (first, second)]
    D = {body: rounded(each.D) for body, each in fitted(first, second, tolerance).items()}
    T, S = (np.stack([each.forward_kinematics(q, link) for link in D] or [np.eye(4)]) for each in engines)
    # Frames are free: that of the first robot stands at the inverse of D in the body of the second.
    S = S @ inverse(np.stack([*D.values()] or [np.eye(4)]))[:, None]
    # The norm is twice the sine of half the angle.
    differences = {
        "position": (np.linalg.norm(T[..., :3, 3] - S[..., :3, 3], axis=-1), T),
        "rotation": (np.linalg.norm(T[..., :3, :3] - S[..., :3, :3], ord=2, axis=(-2, -1)), T[..., :3, :3]),
    }
    for name, quantities in {
        "mass_matrix": [each.mass_matrix(q) for each in engines],
        "torque": [each.inverse_dynamics(q, v, a) for each in engines],
    }.items():
        differences[name] = (np.abs(quantities[0] - quantities[1]), quantities[0])
    for name, (off, scale) in differences.items():
        rounding = ROUNDING * float(np.max(np.abs(scale), initial=0.0))
        assert float(np.max(off, initial=0.0)) <= getattr(limits, name) + rounding, name


@pytest.mark.parametrize("kinds", [COMMON_JOINT_TYPES, ("ball", "revolute", "prismatic", "fixed")])
@settings(deadline=None, suppress_health_check=[HealthCheck.too_slow, HealthCheck.filter_too_much])
@given(data=st.data(), seed=st.integers(0, 1000), size=st.sampled_from((1e-9, 1e-6, 1e-3)))
def test_bounds_hold_at_random_states(
    kinds: tuple[str, ...], data: st.DataObject, seed: int, size: float
) -> None:
    model = data.draw(models(max_links=6, base="fixed", joint_types=kinds)).with_base_pose(Pose())
    rng = np.random.default_rng(seed)
    other, tolerance = perturbed(model, rng, size), 30.0 * size
    report = same_robot(model, other, tolerance=tolerance)
    assume(report.same)
    assume(all(each.sign == 1 and each.first_index == each.second_index for each in report.coordinates))
    assert_bounds_hold(model, other, tolerance, rng)


def test_bounds_hold_where_every_frame_is_moved() -> None:
    model, rng = dynx.load("ur5"), np.random.default_rng(7)
    other = with_moved_frames(model, rng)
    report = same_robot(model, other)
    assert report.bounds is not None
    q = model.random(rng, 20)
    first, second = (dynx.backend("reference", each).mass_matrix(q) for each in (model, other))
    rounding = ROUNDING * float(np.max(np.abs(first)))
    assert float(np.max(np.abs(first - second))) <= report.bounds.mass_matrix + rounding


def follower(kind: JointType, multiplier: float, limits: Limits, driver: Limits) -> Model:
    """Make a robot of a driver about x and a joint along or about z that follows it."""
    links = [Link("base"), *(Link(name, BODY) for name in ("arm", "finger"))]
    joints = [
        Joint("driver", "revolute", "base", "arm", Pose(), (1.0, 0.0, 0.0), driver),
        Joint(
            "finger",
            kind,
            "arm",
            "finger",
            Pose((0.1, 0.0, 0.0)),
            (0.0, 0.0, 1.0),
            limits,
            mimic=Mimic("driver", multiplier, 0.0),
        ),
    ]
    return Model.build("follower", links, joints)


@pytest.mark.parametrize("kind", ["revolute", "prismatic"])
def test_bounds_of_a_mimic_joint_follow_from_the_travel_of_its_driver(kind: JointType) -> None:
    own, driver = Limits(-0.02, 0.02, 1.0, 1.0), Limits(-2.0, 2.0, 1.0, 1.0)
    first, second = (follower(kind, multiplier, own, driver) for multiplier in (0.01, 0.01 + 1e-8))
    rng = np.random.default_rng(3)
    assert_bounds_hold(first, second, 1e-5, rng)
    limits = same_robot(first, second, tolerance=1e-5).bounds
    assert limits is not None
    least = limits.position if kind == "prismatic" else limits.rotation
    assert least >= 2.0 * 0.99e-8


def crane(r: float, mass: float) -> Model:
    """Make a robot with a body on the second of two vertical axes at the distance `r`."""
    links = [Link("base"), Link("arm"), Link("hand", Inertial(mass, ixx=0.1, iyy=0.1, izz=0.1))]
    joints = [
        Joint("turn", "continuous", "base", "arm", Pose(), (0.0, 0.0, 1.0)),
        Joint("wrist", "continuous", "arm", "hand", Pose((r, 0.0, 0.0)), (0.0, 0.0, 1.0)),
    ]
    return Model.build("crane", links, joints)


@pytest.mark.parametrize("length", [10.0, 1e3])
def test_bounds_of_a_long_arm_contain_the_change_of_its_moment_of_inertia(length: float) -> None:
    """The moment of inertia m r^2 about the root changes by 2 m r e where the arm is longer by e."""
    mass, e = 3.0, 1e-7 * length
    limits = same_robot(crane(length, mass), crane(length + e, mass), tolerance=1e-5).bounds
    assert limits is not None
    assert limits.position >= 0.999 * e
    assert limits.mass_matrix >= 0.999 * 2.0 * mass * length * e
    # At 1 rad/s^2 about the root, the moment of inertia is the torque.
    assert limits.torque >= 0.999 * 2.0 * mass * length * e


def test_bounds_are_infinite_where_a_difference_grows_with_an_unlimited_position() -> None:
    own = Limits(-0.02, 0.02, 1.0, 1.0)
    pair = [follower("prismatic", each, own, Limits()) for each in (0.01, 0.01 + 1e-8)]
    limits = same_robot(*pair, tolerance=1e-5).bounds
    assert limits is not None
    assert np.isinf(limits.position)
    assert limits.rotation == 0.0
    same = same_robot(pair[0], pair[0]).bounds
    assert same is not None
    assert (same.position, same.rotation, same.mass_matrix, same.torque) == (0.0, 0.0, 0.0, 0.0)


def test_a_heavier_body_beyond_an_unlimited_slider_has_an_infinite_bound() -> None:
    links = [Link("base"), Link("arm", BODY), Link("slide", BODY)]
    joints = [
        Joint("turn", "continuous", "base", "arm", Pose(), (0.0, 0.0, 1.0)),
        Joint("slide", "prismatic", "arm", "slide", Pose(), (1.0, 0.0, 0.0)),
    ]
    first = Model.build("slider", links, joints)
    heavier = replace(BODY, mass=1.0 + 1e-8)
    second = Model.build("slider", [*links[:2], Link("slide", heavier)], joints)
    limits = same_robot(first, second, tolerance=1e-5).bounds
    assert limits is not None
    assert (limits.position, limits.rotation) == (0.0, 0.0)
    assert np.isinf([limits.mass_matrix, limits.torque]).all()
