"""The planar 2R arm, whose inverse kinematics is in closed form (Siciliano et al., section 2.12.1)."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dynx.backends import backend, installed_backends
from dynx.model import Joint, Link, Model, Pose
from dynx.model.elements import Limits

L1, L2 = 0.7, 0.5
TOLERANCE = 1e-6
UNLIMITED = Limits()


def arm(limits: Limits = UNLIMITED) -> Model:
    """Build two links in the plane z = 0; the tip is at (L1 + L2, 0) when both angles are zero."""
    z = (0.0, 0.0, 1.0)
    return Model.build(
        "planar",
        [Link("base"), Link("upper"), Link("lower"), Link("tip")],
        [
            Joint("shoulder", "revolute", "base", "upper", axis=z, limits=limits),
            Joint("elbow", "revolute", "upper", "lower", Pose((L1, 0.0, 0.0)), axis=z, limits=limits),
            Joint("tool", "fixed", "lower", "tip", Pose((L2, 0.0, 0.0))),
        ],
    )


def elbow(distance: float) -> float:
    """Return the magnitude of the elbow angle for this distance of the tip from the shoulder."""
    return float(np.arccos((distance**2 - L1**2 - L2**2) / (2.0 * L1 * L2)))


@pytest.mark.parametrize("name", installed_backends())
def test_a_reachable_position_has_the_angles_of_the_closed_form(name: str) -> None:
    with backend(name, arm()) as engine:

        @given(st.floats(abs(L1 - L2) + 0.01, L1 + L2 - 0.01), st.floats(-np.pi, np.pi), st.booleans())
        def agrees(distance: float, direction: float, up: bool) -> None:
            bend = elbow(distance) * (1.0 if up else -1.0)
            shoulder = direction - np.arctan2(L2 * np.sin(bend), L1 + L2 * np.cos(bend))
            wanted = np.array([shoulder, bend])
            target = distance * np.array([np.cos(direction), np.sin(direction), 0.0])
            result = engine.inverse_kinematics(target, "tip", wanted + 0.01)
            assert result.success
            # An error e of the tip is an error of at most e / sigma of the angles, sigma being the
            # least singular value of the Jacobian; twice that covers its change over the distance.
            sigma = np.linalg.svd(engine.jacobian(wanted, "tip")[:2], compute_uv=False)[-1]
            assert np.linalg.norm(result.q - wanted) <= 2.0 * TOLERANCE / sigma

        agrees()


@pytest.mark.parametrize("bend", [0.0, np.pi])
def test_the_edge_of_the_workspace_is_reached(bend: float) -> None:
    """At the edge the Jacobian is singular and the two solutions coincide."""
    with backend("pinocchio", arm()) as engine:
        target = engine.forward_kinematics(np.array([0.4, bend]), "tip")[:3, 3]
        assert engine.inverse_kinematics(target, "tip", [0.0, 1.0]).success


@given(st.floats(0.01, 10.0), st.floats(-np.pi, np.pi))
def test_out_of_reach_the_nearest_position_is_found(beyond: float, direction: float) -> None:
    target = (L1 + L2 + beyond) * np.array([np.cos(direction), np.sin(direction), 0.0])
    with backend("pinocchio", arm()) as engine:
        result = engine.inverse_kinematics(target, "tip", max_restarts=5)
    assert not result.success
    assert not result
    assert result.status == "UNREACHABLE"
    assert result.message.startswith("out of reach")
    assert abs(float(result.position_error) - beyond) <= TOLERANCE


def test_limits_that_exclude_one_solution_leave_the_other() -> None:
    model = arm(Limits(-2.0, 0.5))
    with backend("pinocchio", model) as engine:
        target = engine.forward_kinematics(np.array([0.3, -1.0]), "tip")[:3, 3]
        result = engine.inverse_kinematics(target, "tip", [-0.5, 0.5])
        assert result.success
        np.testing.assert_allclose(result.q, [0.3, -1.0], atol=10.0 * TOLERANCE)


def test_a_solution_on_two_limits_is_reached() -> None:
    model = arm(Limits(-2.0, 0.5))
    with backend("pinocchio", model) as engine:
        target = engine.forward_kinematics(model.upper, "tip")
        result = engine.inverse_kinematics(target, "tip", [-1.0, -1.0])
    assert result.success
    assert (result.q <= model.upper).all()


def test_limits_that_exclude_every_solution() -> None:
    model = arm(Limits(-2.0, 0.5))
    with backend("pinocchio", model) as engine:
        target = [-(L1 + L2) / 2.0, 0.3, 0.0]
        result = engine.inverse_kinematics(target, "tip", max_restarts=20)
    assert not result.success
    assert (result.q >= model.lower).all()
    assert (result.q <= model.upper).all()
