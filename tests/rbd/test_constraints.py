"""The constraint solver: closed forms, its conditions on random contacts, 50 digits, lanes of a kernel."""

from __future__ import annotations

import math
from collections.abc import Sequence

import mpmath
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dynx.rbd.constraints import (
    TOLERANCE,
    ConstraintSets,
    Disk,
    Solution,
    rebound,
    residuals,
    scales,
    solve,
    sweep,
)
from dynx.spatial.scalar import Floats
from tests.rbd.exact import exactly, fifty_digits

G_H = 9.81e-3
"""Change of velocity [m/s] by gravity in a step of 1 ms."""

SOLVED = 100.0 * TOLERANCE
"""Largest residual [m/s] of a problem that counts as solved, with the rounding of velocities of some m/s."""

POINT = ConstraintSets(3, (0,), (Disk((1, 2), 0),))
"""A point on a plane: normal, then two tangents."""


def conditions(sets: ConstraintSets, G: Floats, limits: Floats, found: Solution) -> float:
    """Return the largest violation of the conditions by a solution on floats [m/s]."""
    floors = np.zeros(sets.size)
    g = scales(sets, G)
    return float(residuals(sets, g, limits, floors, found.impulses, found.velocities).largest)


def contact_rows(masses: Sequence[float], reach: float) -> tuple[ConstraintSets, Floats, Floats]:
    """Return the sets of cubes of 0.2 m on one another on a plane, J (m, 6 n) and the inverse masses and
    moments of inertia (6 n,).

    Each has four contacts at `reach` [m] from its centre along both sides.
    """
    n, rows = len(masses), []
    for k in range(n):
        for x, y in ((1, 1), (1, -1), (-1, 1), (-1, -1)):
            for axis in np.roll(np.eye(3), 1, axis=0):
                row = np.zeros(6 * n)
                for body, sign, z in ((k, 1.0, -0.1), (k - 1, -1.0, 0.1)):
                    if body >= 0:
                        lever = np.array([reach * x, reach * y, z])
                        row[6 * body : 6 * body + 3] = sign * axis
                        row[6 * body + 3 : 6 * body + 6] = sign * np.cross(lever, axis)
                rows.append(row)
    normals = tuple(range(0, len(rows), 3))
    sets = ConstraintSets(len(rows), normals, tuple(Disk((k + 1, k + 2), k) for k in normals))
    return sets, np.array(rows), np.concatenate([np.repeat([1.0 / m, 6.0 / (m * 0.04)], 3) for m in masses])


def stack(
    masses: Sequence[float], velocity: Floats, reach: float = 0.1
) -> tuple[ConstraintSets, Floats, Floats]:
    """Return sets, G and c of the cubes, with their velocity (6 n,) without contacts."""
    sets, J, weights = contact_rows(masses, reach)
    return sets, (J * weights) @ J.T, J @ velocity


def gravity(n: int, along: float = 0.0) -> Floats:
    """Return the velocity (6 n,) of bodies at rest after a step on a plane of this slope [rad]."""
    one = [G_H * math.sin(along), 0.0, -G_H * math.cos(along), 0.0, 0.0, 0.0]
    return np.array(one * n)


@pytest.mark.parametrize("direction", np.linspace(0.0, 6.0, 7).tolist())
@pytest.mark.parametrize("friction", [0.0, 0.3, 0.7])
def test_a_point_on_a_slope_sticks_within_the_cone_and_else_slides(direction: float, friction: float) -> None:
    mass, along = 2.0, np.array([math.cos(direction), math.sin(direction)])
    c = G_H * np.array([-math.cos(0.5), *(math.sin(0.5) * along)])
    found = solve(POINT, np.eye(3) / mass, c, np.array([friction]))
    normal = mass * G_H * math.cos(0.5)
    most = min(math.tan(0.5), friction)
    assert found.impulses == pytest.approx([normal, *(-most * normal * along)], abs=1e-15)
    assert found.velocities[1:] == pytest.approx((math.tan(0.5) - most) * math.cos(0.5) * G_H * along)
    assert conditions(POINT, np.eye(3) / mass, np.array([friction]), found) <= SOLVED


def test_a_contact_that_opens_has_no_impulse_and_one_with_a_gap_closes_it() -> None:
    G, limits = np.eye(3), np.array([0.5])
    assert not solve(POINT, G, np.array([0.1, 3.0, 0.0]), limits).impulses.any()
    gap = 0.25
    found = solve(POINT, G, np.array([-1.0 + gap, 3.0, 0.0]), limits)
    assert found.velocities[0] - gap == pytest.approx(-0.25)
    assert found.impulses == pytest.approx([0.75, -0.375, 0.0])


def test_a_rod_that_lands_on_its_end_has_the_impulses_of_the_closed_form() -> None:
    """A rod of mass m, at an angle, whose end at the lever (a, b) from the centre meets the ground: with
    sticking friction both velocities of the end vanish, without friction the normal one only."""
    mass, inertia, a, b = 1.5, 0.2, 0.4, -0.3
    J = np.array([[0.0, 1.0, a], [1.0, 0.0, -b]])
    G = (J / [mass, mass, inertia]) @ J.T
    sets = ConstraintSets(2, (0,), (Disk((1,), 0),))
    c = J @ [0.7, -2.0, 0.1]
    rough = solve(sets, G, c, np.array([50.0]))
    assert rough.impulses == pytest.approx(np.linalg.solve(G, -c), rel=1e-12)
    smooth = solve(sets, G, c, np.array([0.0]))
    assert smooth.impulses == pytest.approx([-c[0] / G[0, 0], 0.0], rel=1e-12)


def test_box_rows_are_dry_friction_and_free_rows_are_welds() -> None:
    sets = ConstraintSets(4, (), (Disk((0,)), Disk((1,)), Disk((2,))), (3,))
    G = np.diag([0.5, 0.5, 2.0, 4.0])
    found = solve(sets, G, np.array([0.1, 1.0, -3.0, 5.0]), np.array([1.0, 1.0, 0.5, 0.0][:3]))
    assert found.impulses == pytest.approx([-0.2, -1.0, 0.5, -1.25])
    assert found.velocities == pytest.approx([0.0, 0.5, -2.0, 0.0], abs=1e-15)


def test_torsional_and_rolling_friction_are_disks_of_the_normal_impulse() -> None:
    sets = ConstraintSets(6, (0,), (Disk((1, 2), 0), Disk((3,), 0), Disk((4, 5), 0)))
    found = solve(sets, np.eye(6), np.array([-2.0, 0.3, 0.4, 1.0, -0.6, 0.8]), np.array([0.5, 0.1, 0.2]))
    assert found.impulses == pytest.approx([2.0, -0.3, -0.4, -0.2, 0.24, -0.32])


@pytest.mark.parametrize("masses", [[1.0] * 5, [1.0, 1000.0], [1000.0, 1.0], [1.0, 100.0, 1.0]], ids=str)
@pytest.mark.parametrize("slope", [0.0, 0.3, 0.6])
def test_stacks_stand_or_slide_whatever_their_masses(masses: list[float], slope: float) -> None:
    sets, G, c = stack(masses, gravity(len(masses), slope), reach=1.0)
    limits = np.full(len(sets.disks), 0.5)
    found = solve(sets, G, c, limits)
    assert conditions(sets, G, limits, found) <= SOLVED
    first = found.impulses[:12].reshape(4, 3).sum(axis=0)
    normal = sum(masses) * G_H * math.cos(slope)
    sticks = math.tan(slope) <= 0.5
    friction = min(math.tan(slope), 0.5) * normal
    assert first == pytest.approx([normal, -friction, 0.0], abs=1e-12 * normal + SOLVED * sum(masses))
    assert (np.abs(found.velocities).max() <= SOLVED) == sticks


@given(
    st.sampled_from([(1.0,), (1.0, 1.0), (10.0, 1.0), (1.0, 10.0, 1.0)]),
    st.integers(0, 2**32 - 1),
    st.floats(0.0, 1.2),
)
def test_random_velocities_meet_every_condition_and_plastic_contacts_take_energy(
    masses: tuple[float, ...], seed: int, friction: float
) -> None:
    rng = np.random.default_rng(seed)
    sets, G, c = stack(masses, rng.standard_normal(6 * len(masses)), reach=0.08 + 0.04 * rng.random())
    limits = np.full(len(sets.disks), friction)
    found = solve(sets, G, c, limits)
    assert conditions(sets, G, limits, found) <= SOLVED
    energy = float(c @ np.linalg.lstsq(G, c, rcond=None)[0])
    assert found.impulses @ (c + found.velocities) / 2 <= 1e-12 * energy
    warm = solve(sets, G, c, limits, start=found.impulses)
    assert warm.iterations == 0


@given(st.integers(0, 2**32 - 1), st.floats(0.0, 1.2))
def test_impacts_make_no_energy_whatever_their_restitution(seed: int, friction: float) -> None:
    rng = np.random.default_rng(seed)
    sets, G, c = stack((1.0, 3.0), rng.standard_normal(12))
    limits = np.full(len(sets.disks), friction)
    plastic = solve(sets, G, c, limits)
    e = rng.integers(0, 2, sets.size) * rng.random(sets.size)
    found = rebound(sets, G, c, limits, plastic, e)
    assert found.velocities == pytest.approx(c + G @ found.impulses, abs=1e-12)
    scale = float(c @ np.linalg.lstsq(G, c, rcond=None)[0])
    assert found.impulses @ (c + found.velocities) / 2 <= 1e-12 * scale
    cone = residuals(sets, scales(sets, G), limits, np.zeros(sets.size), found.impulses, found.velocities)
    assert cone.cone <= SOLVED
    assert cone.gap <= SOLVED


@pytest.mark.parametrize("restitution", [0.0, 0.5, 1.0])
def test_central_impacts_have_newtons_law(restitution: float) -> None:
    """Two spheres, 1 and 3 kg: the relative velocity is reversed by the coefficient."""
    sets, G, c = ConstraintSets(1, (0,)), np.array([[1.0 + 1.0 / 3.0]]), np.array([-2.0])
    plastic = solve(sets, G, c, np.zeros(0))
    found = rebound(sets, G, c, np.zeros(0), plastic, np.array([restitution]))
    assert found.velocities == pytest.approx([2.0 * restitution], abs=1e-15)


@pytest.mark.parametrize("slope", [0.3, 0.6])
def test_sweeps_of_the_same_text_in_50_digits_confirm_the_velocities(slope: float) -> None:
    sets, G, c = stack([2.0], gravity(1, slope))
    limits = np.full(len(sets.disks), 0.5)
    found = solve(sets, G, c, limits)
    with fifty_digits():
        # Rounded, a matrix of redundant contacts would be regular in 50 digits.
        _, J, weights = contact_rows([2.0], 0.1)
        exact_G = (exactly(J) * exactly(weights)) @ exactly(J).T
        exact_c, exact_limits = exactly(J) @ exactly(gravity(1, slope)), exactly(limits)
        g, floors = scales(sets, exact_G), exactly(np.zeros(sets.size))
        state = (exactly(np.zeros(sets.size)), exact_c, mpmath.inf)
        for _ in range(2000):
            state = sweep(sets, exact_G, g, exact_limits, floors, *state[:2])
            if state[2] < mpmath.mpf(10) ** -45:
                break
        violated = residuals(sets, g, exact_limits, floors, state[0], exact_c + exact_G @ state[0])
        assert violated.largest < mpmath.mpf(10) ** -44
        assert max(abs(state[1] - found.velocities)) < 10 * TOLERANCE
