"""Angles whose range exceeds 2 pi: within limits first, then nearest to the start."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from dynx.backends import backend
from dynx.model import Joint, Limits, Link, Model, Pose

REACH = 4.0
"""Limit [rad] in both directions, between pi and 2 pi."""


def wheel() -> Model:
    joints = [
        Joint("axle", "revolute", "base", "wheel", axis=(0.0, 0.0, 1.0), limits=Limits(-REACH, REACH)),
        Joint("tool", "fixed", "wheel", "tip", Pose((1.0, 0.0, 0.0))),
    ]
    return Model.build("wheel", [Link("base"), Link("wheel"), Link("tip")], joints)


@given(st.floats(-REACH, REACH), st.sampled_from((-3.9, -2.0, 2.0, 3.9)))
def test_an_angle_beyond_its_limit_is_shifted_by_a_full_turn(angle: float, start: float) -> None:
    with backend("reference", wheel()) as engine:
        target = engine.forward_kinematics(np.array([angle]), "tip")
        result = engine.inverse_kinematics(target, "tip", np.array([start]))
    assert result.success
    assert np.abs(result.q[0]) <= REACH
    turns = 2.0 * np.pi * np.arange(-1, 2)
    within = [x for x in result.q[0] + turns if abs(x) <= REACH - 1e-5]
    assert abs(result.q[0] - start) <= min((abs(x - start) for x in within), default=np.inf) + 1e-5
