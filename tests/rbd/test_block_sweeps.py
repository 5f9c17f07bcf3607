"""Sweeps over blocks: contacts stick, slide and open as in the solver on floats, and converge as Newton's
method does."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import mpmath
import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from dynx.rbd.block_sweeps import (
    PROXIMAL,
    Block,
    block_residual,
    block_sweep,
    blocks_of,
    impulse_velocities,
)
from dynx.rbd.constraints import TOLERANCE, ConstraintSets, Disk, solve
from dynx.rbd.eliminated_rows import eliminate_rows
from dynx.spatial.scalar import Array, Floats
from tests.rbd.exact import exactly, fifty_digits

POINT = ConstraintSets(3, (0,), (Disk((1, 2), 0),))
"""A point on a plane: normal, then two tangents."""


def blocks(J: Array, *, redundant: bool = False) -> list[Block]:
    """Return the blocks of contacts with rows J (3 contacts, n) of a body whose mass matrix is 1."""
    n = J.shape[1]
    rows: list[Any] = [dict(enumerate(row)) for row in J]
    ones: list[Any] = [J[0, 0] * 0 + 1 for _ in range(n)]
    return blocks_of(
        eliminate_rows([{} for _ in range(n)], ones, rows), ones, len(J) // 3, 0, redundant=redundant
    )


def swept(
    parts: list[Block], c: Array, mu: Any, sweeps: int, x: Array | None = None
) -> tuple[list[Any], Any, Any]:
    """Return the impulses after sweeps from x or 0, the last change, and the residual."""
    found = [each * 0 for each in c] if x is None else list(x)
    friction = [mu] * len(parts)
    u = impulse_velocities(parts, found)
    change: Any = 0.0
    for _ in range(sweeps):
        u, found, change = block_sweep(parts, list(c), friction, [], u, found)
    return found, change, block_residual(parts, list(c), friction, [], u, found)[0]


def tip(inertia: float, x: float, y: float) -> Floats:
    """Return the rows (3, 6) of a point 0.1 m below a body of 1 kg and that `inertia` [kg m^2]."""
    lever = np.array([x, y, -0.1])
    axes = np.roll(np.eye(3), 1, axis=0)
    return np.hstack([axes, np.cross(lever, axes) / np.sqrt(inertia)])


POINTS = st.builds(tip, st.floats(0.02, 1.0), st.floats(-0.1, 0.1), st.floats(-0.1, 0.1))


@given(POINTS, st.floats(0.0, 0.7), st.tuples(*[st.floats(-2.0, 2.0)] * 3))
def test_a_contact_obeys_the_laws_after_a_few_sweeps(J: Floats, mu: float, c: tuple[float, ...]) -> None:
    """Its impulses are those of the solver on floats, and a further sweep changes nothing."""
    parts, velocities = blocks(J), np.array(c)
    x, _, residual = swept(parts, velocities, mu, 12)
    assert residual <= 1e3 * TOLERANCE
    expected = solve(POINT, J @ J.T, velocities, np.array([mu]))
    np.testing.assert_allclose(x, expected.impulses, atol=1e-8)
    again, change, _ = swept(parts, velocities, mu, 1, np.array(x))
    assert change <= 1e3 * TOLERANCE
    np.testing.assert_allclose(again, x, atol=1e3 * TOLERANCE)


def test_visits_double_the_digits_of_the_direction() -> None:
    """A contact slides, in 50 digits: in each sweep the residual falls to its square, or by the proximal
    term."""
    with fifty_digits():
        J, c = exactly(tip(0.05, 0.08, -0.05)), exactly(np.array([-1.0, 2.0, -0.5]))
        parts = blocks(J)
        residuals = [swept(parts, c, mpmath.mpf("0.5"), sweeps)[2] for sweeps in range(1, 8)]
        assert residuals[-1] < mpmath.mpf(10) ** -40
        for before, after in pairwise(residuals):
            assert after <= max(10 * before * before, 10 * PROXIMAL * before)


@pytest.mark.parametrize(("c", "sticks"), [((-1.0, 0.2, 0.0), True), ((-1.0, 3.0, 0.0), False)])
def test_points_that_move_in_a_plane_stick_and_slide(c: tuple[float, ...], sticks: bool) -> None:
    """The second tangent has no entries, so that the block is singular."""
    J = np.array([[1.0, 0.2], [0.1, 1.0], [0.0, 0.0]])
    x, _, residual = swept(blocks(J), np.array(c), 0.7, 20)
    assert residual <= 1e3 * TOLERANCE
    assert x[2] == 0.0
    assert (abs(x[1]) < 0.699 * x[0]) == sticks


def test_a_point_that_cannot_move_has_no_impulse() -> None:
    """The tip of a fixed arm has rows without entries."""
    x, change, residual = swept(blocks(np.zeros((3, 2))), np.zeros(3), 0.7, 3)
    assert (x, change, residual) == ([0.0, 0.0, 0.0], 0.0, 0.0)


@example(mu=0.5, vx=0.0, vy=0.5)
@given(st.floats(0.1, 0.7), st.floats(-2.0, 2.0), st.floats(-2.0, 2.0))
def test_redundant_points_of_a_body_obey_the_laws(mu: float, vx: float, vy: float) -> None:
    """Four points of a face have a singular matrix; their sweeps converge all the same.

    Where sticking is just possible, as in the example, a small change of the impulses decides between
    sticking and sliding. There the residual falls with a power of the number of sweeps, at least as its
    inverse.
    """
    J = np.vstack([tip(0.05, x, y) for x in (-0.1, 0.1) for y in (-0.1, 0.1)])
    c = J @ np.array([vx, vy, -1.0, 0.0, 0.0, 0.0])
    parts = blocks(J, redundant=True)
    residual = swept(parts, c, mu, 300)[2]
    assert residual <= 1e-6 or swept(parts, c, mu, 1200)[2] <= residual / 4.0


def test_a_redundant_point_that_friction_lifts_obeys_the_laws() -> None:
    """Its normal velocity grows by 0.5 with its normal impulse, and by 0.7 more with the friction of that
    impulse; full steps of the normal would lead from 0 to 0.4 and back for ever."""
    G = np.array([[0.5, 1.0, 0.0], [1.0, 3.0, 0.0], [0.0, 0.0, 3.0]])
    parts = blocks(np.linalg.cholesky(G), redundant=True)
    x, _, residual = swept(parts, np.array([-0.2, -2.0, 0.0]), 0.7, 60)
    assert residual <= 1e3 * TOLERANCE
    normal = 0.2 / (0.5 + 0.7 * 1.0)
    np.testing.assert_allclose(x, [normal, 0.7 * normal, 0.0], atol=1e3 * TOLERANCE)
