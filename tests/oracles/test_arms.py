"""Closed forms of the wrist positions of the two arms in `models/`."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given

from dynx.backends import backend, installed_backends
from dynx.model.loading import load
from dynx.testing.strategies import configurations
from tests.error_bounds import ErrorBounds, samples_at
from tests.examples import one_robot
from tests.oracles.closed_form import MODELS


@pytest.mark.parametrize("name", installed_backends())
def test_wrist_centre_of_the_six_axis_arm(name: str) -> None:
    """The position depends on three joints: s, h offset and height, u upper arm, e, f offset and forearm."""
    s, h, u, e, f = 0.10, 0.40, 0.45, 0.05, 0.42
    model = load(MODELS / "six_axis_arm.urdf")
    with backend(name, model) as engine:

        @one_robot
        @given(configurations(model))
        def is_where_it_should_be(q: np.ndarray) -> None:
            raised = q[1] + q[2]
            out = s + u * np.sin(q[1]) + e * np.sin(raised) + f * np.cos(raised)
            up = h + u * np.cos(q[1]) + e * np.cos(raised) - f * np.sin(raised)
            wrist = engine.forward_kinematics(q, "wrist")
            wanted = wrist.copy()
            wanted[:3, 3] = out * np.cos(q[0]), out * np.sin(q[0]), up
            close = ErrorBounds(samples_at(model, q))
            close.check("forward_kinematics", wrist, wanted)
            flange = engine.forward_kinematics(q, "flange")
            wanted = flange.copy()
            wanted[:3, 3] = wrist[:3, 3]
            close.check("forward_kinematics", flange, wanted)

        is_where_it_should_be()


@pytest.mark.parametrize("name", installed_backends())
def test_distance_of_the_seven_axis_arms_wrist(name: str) -> None:
    """The distance from the shoulder centre depends on the elbow alone (law of cosines)."""
    h, u, f = 0.34, 0.40, 0.39
    model = load(MODELS / "seven_axis_arm.urdf")
    with backend(name, model) as engine:

        @one_robot
        @given(configurations(model))
        def follows_from_the_elbow(q: np.ndarray) -> None:
            wrist = engine.forward_kinematics(q, "link6")
            arm = wrist[:3, 3] - np.array([0.0, 0.0, h])
            distance2 = u * u + f * f + 2 * u * f * np.cos(q[3])
            # Both squares in the place of a position: their size is that of the robot, about 1.
            got, wanted = wrist.copy(), wrist.copy()
            got[:3, 3], wanted[:3, 3] = [arm @ arm, 0.0, 0.0], [distance2, 0.0, 0.0]
            ErrorBounds(samples_at(model, q)).check("forward_kinematics", got, wanted)

        follows_from_the_elbow()
