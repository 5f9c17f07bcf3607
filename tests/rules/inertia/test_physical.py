"""Faults of tensors, and the nearest tensor that a body can have."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dynx.model.elements import Inertial, Pose
from dynx.rules.inertia import (
    ACCEPTED_MOMENT,
    CentralInertia,
    _listed,
    fault_beyond_rounding,
    is_borderline,
    nearest_moments,
    with_raised_moments,
)
from dynx.testing.strategies import inertials

EPS = float(np.finfo(float).eps)
triples = st.tuples(*[st.floats(-2.0, 2.0)] * 3).map(np.array)
G = np.ones((3, 3)) - np.eye(3)


@given(triples)
def test_the_nearest_moments_are_the_projection_on_the_cone_of_bodies(wanted: np.ndarray) -> None:
    """y is the projection of x on a cone if y is in it, x - y is in the polar cone, and they are orthogonal
    (Moreau's decomposition); the cone is spanned by the columns of G."""
    nearest = np.asarray(nearest_moments(wanted), dtype=float)
    rounding = 32 * EPS * max(float(np.max(np.abs(wanted))), 1e-300)
    second_moments = np.linalg.solve(G, nearest)
    assert np.all(second_moments >= -rounding)
    assert np.all(G.T @ (wanted - nearest) <= rounding)
    assert abs(nearest @ (wanted - nearest)) <= rounding * float(np.max(np.abs(wanted)))


@given(inertials("solid").map(lambda inertial: inertial or Inertial()))
def test_a_solid_body_has_no_fault_and_is_its_own_nearest(inertial: Inertial) -> None:
    assert fault_beyond_rounding(inertial) is None
    assert not is_borderline(inertial, root=False, on_fixed_joint=False)
    moments = CentralInertia.of(inertial).moments()
    rounding = 16 * EPS * float(moments[2])
    np.testing.assert_allclose(nearest_moments(moments), moments, rtol=0, atol=rounding)


@pytest.mark.parametrize(
    ("moments", "fault"),
    [
        ((0.1, 0.2, 0.31), "triangle"),
        ((0.1, 0.2, 0.3), None),
        ((0.001, 0.009, 0.01), None),
        ((0.1, 0.1, -0.01), "negative"),
        ((1e-20, 1e-20, -1e-20), None),
        ((0.0, 0.0, 0.0), None),
    ],
)
def test_only_what_is_more_than_rounding_is_a_fault(
    moments: tuple[float, float, float], fault: str | None
) -> None:
    x, y, z = moments
    assert fault_beyond_rounding(Inertial(1.0, ixx=x, iyy=y, izz=z)) == fault
    assert fault_beyond_rounding(Inertial(1.0, ixx=z, iyy=x, izz=y)) == fault


def test_all_entries_alike_break_the_triangle_and_are_not_negative() -> None:
    assert fault_beyond_rounding(Inertial(1.0, Pose(), 1e-6, 1e-6, 1e-6, 1e-6, 1e-6, 1e-6)) == "triangle"


@given(inertials("physical").map(lambda inertial: inertial or Inertial()))
def test_what_was_lifted_is_off_the_edge_and_less_than_can_be_seen_away(inertial: Inertial) -> None:
    if not is_borderline(inertial, root=False, on_fixed_joint=False):
        return
    raised = with_raised_moments(inertial)
    assert not is_borderline(raised, root=False, on_fixed_joint=False)
    size = float(np.max(np.diagonal(CentralInertia.of(inertial).about_origin())))
    assert 0.0 < raised.ixx - inertial.ixx <= 64 * EPS * max(size, float(np.max(np.abs(inertial.tensor))))


def test_a_floor_is_kept() -> None:
    rod = Inertial(1.0, ixx=0.1, iyy=0.1)
    raised = with_raised_moments(rod, ACCEPTED_MOMENT)
    assert raised.izz >= ACCEPTED_MOMENT
    assert raised.ixx - raised.iyy == 0.0


@given(st.integers(1, 30))
def test_names_that_are_not_listed_are_counted(count: int) -> None:
    names = [f"link_{k}" for k in range(count)]
    shown, _, more = _listed(names).partition(" and ")
    listed = shown.split(", ")
    assert listed == names[: len(listed)]
    assert len(listed) + int(more.removesuffix(" more") or 0) == count
