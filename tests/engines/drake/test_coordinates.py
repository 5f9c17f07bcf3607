"""Drake's coordinates and those of dynx: there and back, and the power that joins them."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dynx.agreement.tolerances import BAR
from dynx.engines.drake.coordinates import DrakeCoordinates
from dynx.spatial.so3 import rotation_from_quat

JOINTS = 4


@st.composite
def coordinates(draw: st.DrawFn, floating: bool) -> DrakeCoordinates:
    """Joints in any order among those of a plant, some of them unknown to dynx, after the base."""
    extra = draw(st.integers(0, 2))
    order = draw(st.permutations(range(JOINTS + extra)))[:JOINTS]
    if not floating:
        return DrakeCoordinates(order, order, JOINTS + extra, JOINTS + extra)
    after = draw(st.booleans())
    n = JOINTS + extra
    base = (n, n) if after else (0, 0)
    q_index, v_index = ([k + (0 if after else size) for k in order] for size in (7, 6))
    return DrakeCoordinates(q_index, v_index, n + 7, n + 6, base)


@pytest.mark.parametrize("floating", [False, True])
@given(data=st.data())
def test_there_and_back(floating: bool, data: st.DataObject) -> None:
    mapped = data.draw(coordinates(floating))
    rng = np.random.default_rng(data.draw(st.integers(0, 999)))
    base = 6 if floating else 0
    q = rng.standard_normal(base + JOINTS + (1 if floating else 0))
    if floating:
        q[3:7] /= np.linalg.norm(q[3:7])
    v, a, tau = rng.standard_normal((3, base + JOINTS))
    R = mapped.attitude(q)
    if floating:
        np.testing.assert_allclose(R, rotation_from_quat(q[3:7]), rtol=0.0, atol=BAR)
    scale = BAR * (base + JOINTS)
    force = mapped.forces(R, tau)
    np.testing.assert_allclose(mapped.forces_back(R, force), tau, rtol=0.0, atol=scale)
    vdot = mapped.accelerations(R, v, a)
    np.testing.assert_allclose(mapped.accelerations_back(R, v, vdot), a, rtol=0.0, atol=scale)
    # Power and kinetic energy do not depend on the coordinates.
    speed = mapped.velocities(R, v)
    np.testing.assert_allclose(force @ speed, tau @ v, rtol=0.0, atol=scale * base + scale)
    A = rng.standard_normal((len(speed), len(speed)))
    M = A + A.T
    reduced = mapped.matrix_back(R, M)
    np.testing.assert_allclose(v @ reduced @ v, speed @ M @ speed, rtol=0.0, atol=100 * scale)
    assert len(mapped.positions(q)) == len(speed) + (1 if floating else 0)


def test_a_floating_base_is_where_drake_has_it() -> None:
    mapped = DrakeCoordinates([7], [6], 8, 7, (0, 0))
    # A quarter turn about z: the x axis of the base is the y axis of the world.
    half = np.sqrt(0.5)
    q = np.array([1.0, 2.0, 3.0, 0.0, 0.0, half, half, 0.25])
    assert mapped.positions(q).tolist() == [half, 0.0, 0.0, half, 1.0, 2.0, 3.0, 0.25]
    R = mapped.attitude(q)
    v = np.array([1.0, 0.0, 0.0, 0.0, 2.0, 0.0, 5.0])
    np.testing.assert_allclose(mapped.velocities(R, v), [-2.0, 0.0, 0.0, 0.0, 1.0, 0.0, 5.0], atol=BAR)
    # w x u = (0, 2, 0) x (1, 0, 0) = (0, 0, -2)
    rest = mapped.accelerations(R, v, np.zeros(7))
    np.testing.assert_allclose(rest, [0.0, 0.0, 0.0, 0.0, 0.0, -2.0, 0.0], atol=BAR)
