"""Ball joints: closed forms, identities of random robots, and the 50-digit referee."""

from __future__ import annotations

from typing import Literal

import mpmath
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dynx.agreement.compared_quantities import compared_quantities
from dynx.agreement.comparison import BackendResults, compare
from dynx.agreement.identities import check_identities
from dynx.agreement.magnitudes import Magnitudes
from dynx.agreement.referee import Referee
from dynx.agreement.sampling import draw_samples
from dynx.backends import backend
from dynx.model import Inertial, Joint, Link, Model, Pose
from dynx.rbd.derivatives import inverse_dynamics_derivatives
from dynx.rbd.rnea import inverse_dynamics
from dynx.spatial.manifold import displace
from dynx.spatial.scalar import Array, sqrt
from dynx.spatial.so3 import rotation_from_quat
from dynx.testing.strategies import models
from tests.error_bounds import ErrorBounds, samples_at
from tests.examples import PROFILE
from tests.rbd.exact import IDENTITY_TOLERANCE, STEP, distance, exact_mechanism, exactly, fifty_digits

KINDS = ("ball", "revolute", "prismatic", "continuous", "fixed")
BODY = Inertial(1.5, Pose((0.1, -0.2, 0.3), (0.3, -0.2, 0.5)), 0.04, 0.004, -0.003, 0.05, 0.002, 0.03)

Base = Literal["fixed", "floating"]
each_base = pytest.mark.parametrize("base", ["fixed", "floating"])


def ball_robots(base: Literal["fixed", "floating", "either"] = "either") -> st.SearchStrategy[Model]:
    """Draw a robot whose mass matrix is regular, most often with ball joints."""
    return models(base=base, joint_types=KINDS, mimics=False, locks=False, solvable=True)


def test_body_on_a_ball_joint_at_its_centre_of_mass_obeys_euler() -> None:
    inertial = Inertial(2.0, ixx=0.3, ixy=0.02, ixz=-0.01, iyy=0.4, iyz=0.03, izz=0.5)
    joint = Joint("ball", "ball", "base", "top", Pose((0.1, 0.2, 0.3), (0.4, 0.5, 0.6)))
    model = Model.build("top", [Link("base"), Link("top", inertial)], [joint])
    rng = np.random.default_rng(0)
    q, (v, a) = model.random(rng), rng.uniform(-2.0, 2.0, (2, 3))
    wanted = inertial.tensor @ a + np.cross(v, inertial.tensor @ v)
    bounds = ErrorBounds(samples_at(model, q, v, a))
    with backend("reference", model) as engine:
        bounds.check("inverse_dynamics", engine.inverse_dynamics(q, v, a), wanted)
        bounds.check("mass_matrix", engine.mass_matrix(q), inertial.tensor)


def test_three_slides_and_a_ball_joint_are_a_floating_base() -> None:
    """The linear velocity of a floating base is in its own axes, that of the slides in the world's."""
    arm = [
        Joint("hinge", "revolute", "trunk", "arm", Pose((0.2, 0.1, 0.0), (0.3, 0.2, 0.1)), (0.0, 0.6, 0.8))
    ]
    bodies = [Link("trunk", BODY), Link("arm", BODY)]
    free = Model.build("free", bodies, arm, base="floating")
    slides = [
        Joint(f"slide{k}", "prismatic", ("world", "a", "b")[k], ("a", "b", "c")[k], axis=axis)
        for k, axis in enumerate([(1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)])
    ]
    links = [Link("world"), Link("a"), Link("b"), Link("c"), *bodies]
    held = Model.build("held", links, [*slides, Joint("ball", "ball", "c", "trunk"), *arm])
    assert (held.nq, held.nv) == (free.nq, free.nv)
    rng = np.random.default_rng(0)
    q, (v, a) = free.random(rng), rng.uniform(-2.0, 2.0, (2, free.nv))
    R = rotation_from_quat(q[3:7])
    to_world = np.eye(free.nv)
    to_world[:3, :3] = R
    v_held, a_held = to_world @ v, to_world @ a
    a_held[:3] += R @ np.cross(v[3:6], v[:3])
    bounds = ErrorBounds(samples_at(free, q, v, a))
    with backend("reference", free) as one, backend("reference", held) as other:
        tau = to_world.T @ other.inverse_dynamics(q, v_held, a_held)
        bounds.check("inverse_dynamics", tau, one.inverse_dynamics(q, v, a))
        M = to_world.T @ other.mass_matrix(q) @ to_world
        bounds.check("mass_matrix", M, one.mass_matrix(q))
        for frame in ("trunk", "arm"):
            J = other.jacobian(q, frame) @ to_world
            bounds.check("jacobian", J, one.jacobian(q, frame))
            bounds.check(
                "forward_kinematics", other.forward_kinematics(q, frame), one.forward_kinematics(q, frame)
            )


@each_base
@given(data=st.data())
@settings(max_examples=max(8, PROFILE // 4))
def test_identities(base: Base, data: st.DataObject) -> None:
    """M a + bias = tau, J v = d/dt of the pose, the balance of power, and all other identities."""
    model = data.draw(ball_robots(base))
    if not model.nv:
        return
    samples = draw_samples(model, 6, seed=data.draw(st.integers(0, 9)))
    with backend("reference", model) as engine:
        for identity in check_identities("reference", engine, Magnitudes(samples)):
            assert identity.agree, identity


@given(data=st.data())
@settings(max_examples=max(4, PROFILE // 16))
def test_reference_equals_the_referee(data: st.DataObject) -> None:
    model = data.draw(ball_robots())
    samples = draw_samples(model, 2, seed=0)
    sizes, exact = Magnitudes(samples), BackendResults("referee", Referee(model), samples)
    with backend("reference", model) as engine:
        own = BackendResults("reference", engine, samples)
        for quantity in compared_quantities():
            if quantity.refereed:
                found = compare(quantity, own, exact, sizes)
                assert found.agree, found


@each_base
@given(data=st.data())
@settings(max_examples=max(4, PROFILE // 16))
def test_derivatives_in_closed_form_hold_in_50_digits(base: Base, data: st.DataObject) -> None:
    """They are central differences along a rotation in the axes of each child, to 24 digits."""
    model = data.draw(ball_robots(base))
    if not model.nv:
        return
    rng = np.random.default_rng(data.draw(st.integers(0, 9)))
    q, (v, a) = model.random(rng), rng.uniform(-1.0, 1.0, (2, model.nv))

    def on_sphere(q: Array) -> Array:
        q = q.copy()
        for first in model.quaternions:
            quat = q[first : first + 4]
            q[first : first + 4] = quat / sqrt(np.sum(quat * quat))
        return q

    def moved(q: Array, d: Array) -> Array:
        return on_sphere(displace(q, d, floating=model.floating, balls=model.ball_places))

    with fifty_digits():
        exact, h = exact_mechanism(model), mpmath.mpf(10) ** -STEP
        q, v, a = on_sphere(exactly(q)), exactly(v), exactly(a)
        found = inverse_dynamics_derivatives(exact, q, v, a)
        k = data.draw(st.integers(0, model.nv - 1))
        step = exactly(np.eye(model.nv)[k]) * h
        pairs = [
            [inverse_dynamics(exact, moved(q, sign * step), v, a) for sign in (1, -1)],
            [inverse_dynamics(exact, q, v + sign * step, a) for sign in (1, -1)],
            [inverse_dynamics(exact, q, v, a + sign * step) for sign in (1, -1)],
        ]
        for matrix, (plus, minus) in zip(found, pairs, strict=True):
            assert distance(matrix[:, k], (plus - minus) / (2 * h)) <= IDENTITY_TOLERANCE
