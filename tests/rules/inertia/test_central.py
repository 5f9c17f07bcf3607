"""Lumping and turning inertia in extended precision, against the lumping of `dynx.spatial.inertia`."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from dynx.model.elements import Inertial, Pose
from dynx.model.mechanism import pose_arrays
from dynx.rules.inertia import CentralInertia
from dynx.spatial.inertia import RigidInertia, inertia_about_origin
from dynx.spatial.scalar import Array, Floats, longdouble
from dynx.spatial.so3 import rotation_from_rpy
from dynx.testing.strategies import inertials, poses

EPS = float(np.finfo(float).eps)
solids = inertials("solid")
bodies = inertials("any").map(lambda inertial: inertial or Inertial())


def about_origin(inertial: Inertial) -> RigidInertia:
    R, p = pose_arrays(inertial.origin, longdouble)
    return inertia_about_origin(longdouble(inertial.mass), p, R, longdouble(inertial.tensor))


def size_of(*tensors: Array) -> float:
    return max(float(np.max(np.abs(tensor))) for tensor in tensors)


@given(bodies, bodies, poses())
def test_two_bodies_make_one(first: Inertial, second: Inertial, T: Floats) -> None:
    R, p = longdouble(T[:3, :3]), longdouble(T[:3, 3])
    lump = CentralInertia.of(first) + CentralInertia.of(second).transform(R, p)
    parts = about_origin(first), about_origin(second).transform(R, p)
    together = parts[0] + parts[1]
    # A product of three rotations of float64 entries; R is one to rounding only.
    bound = 64 * EPS * max(size_of(parts[0].rotational_inertia, parts[1].rotational_inertia), 1e-300)
    assert float(lump.mass) == float(together.mass)
    np.testing.assert_allclose(lump.about_origin(), together.rotational_inertia, rtol=0, atol=bound)
    if lump.mass > 0:
        np.testing.assert_allclose(lump.mass * lump.center, together.first_moment, rtol=0, atol=64 * EPS * 10)


@given(bodies)
def test_principal_form_is_the_same_tensor_to_rounding(inertial: Inertial) -> None:
    body = CentralInertia.of(inertial)
    written = body.inertial(inertial.origin.rpy)
    assert (written.ixy, written.ixz, written.iyz) == (0.0, 0.0, 0.0)
    assert written.mass == inertial.mass
    assert written.origin.xyz == inertial.origin.xyz
    # Three moments and three angles, each rounded once to float64; an angle of pi has an ulp of 2 eps.
    bound = 8 * EPS * size_of(body.tensor)
    np.testing.assert_allclose(CentralInertia.of(written).tensor, body.tensor, rtol=0, atol=bound)


@given(bodies)
def test_aligned_form_is_the_same_tensor_to_rounding(inertial: Inertial) -> None:
    body = CentralInertia.of(inertial)
    written = body.aligned()
    assert written.origin.rpy == (0.0, 0.0, 0.0)
    bound = 2 * EPS * size_of(body.tensor)
    np.testing.assert_allclose(CentralInertia.of(written).tensor, body.tensor, rtol=0, atol=bound)


def test_axes_keep_their_places_where_nothing_has_to_turn() -> None:
    inertial = Inertial(2.0, Pose((0.1, 0.0, 0.0)), ixx=0.3, iyy=0.1, izz=0.25)
    assert CentralInertia.of(inertial).inertial() == inertial


@given(st.tuples(*[st.floats(-3.1, 3.1)] * 3), st.permutations([0.1, 0.15, 0.2]))
def test_the_axes_nearest_to_the_attitude_of_a_body_are_its_own(
    rpy: tuple[float, float, float], moments: list[float]
) -> None:
    x, y, z = moments
    body = CentralInertia.of(Inertial(2.0, Pose((0.1, 0.0, 0.0), rpy), ixx=x, iyy=y, izz=z))
    found, axes = body.principal(rpy)
    np.testing.assert_allclose(found, moments, rtol=4 * EPS)
    # The gaps between the moments are a quarter of the largest, so that rounding turns no axis by more.
    np.testing.assert_allclose(axes, rotation_from_rpy(longdouble(rpy)), rtol=0, atol=8 * EPS)


@given(solids)
def test_moments_come_in_order(inertial: Inertial) -> None:
    small, middle, large = CentralInertia.of(inertial).moments()
    assert small <= middle <= large
    trace = inertial.ixx + inertial.iyy + inertial.izz
    assert abs(float(small + middle + large) - trace) <= 4 * EPS * trace
