"""Damping, friction, armature and limits by the name of the joint are those of an array."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import dynx
from dynx.backends.joint_friction import JointFriction, coefficients_by_joint
from dynx.control import PD, FrictionCompensation
from dynx.control.saturation import checked_limit
from dynx.errors import GainError, UnknownNameError
from dynx.model.loading import load
from tests.sim.bars import tutorial_robot

ARM = tutorial_robot()
DOG = load("a1", base="floating")
NAMES = ARM.joint_names


@given(st.dictionaries(st.sampled_from(NAMES), st.floats(0.0, 10.0)))
def test_an_array_has_the_numbers_at_their_joints(numbers: dict[str, float]) -> None:
    array = np.array([numbers.get(name, 0.0) for name in NAMES])
    np.testing.assert_array_equal(coefficients_by_joint(ARM, "friction", numbers), array)
    law, same = JointFriction(ARM, numbers, numbers), JointFriction(ARM, array, array)
    np.testing.assert_array_equal(law.damping, same.damping)
    np.testing.assert_array_equal(law.friction, same.friction)
    bounds = checked_limit(ARM, {name: value + 1.0 for name, value in numbers.items()})
    np.testing.assert_array_equal(bounds, [numbers.get(name, np.inf) + 1.0 for name in NAMES])


def test_a_floating_base_has_none() -> None:
    law = JointFriction(DOG, {DOG.joint_names[3]: 2.0}, False)
    np.testing.assert_array_equal(np.flatnonzero(law.damping), [6 + 3])


def test_rollouts_and_batches_are_those_of_an_array() -> None:
    q0 = np.array([0.2, -1.0, 0.8, 0.3, -0.4, 0.5])
    law = FrictionCompensation(PD(ARM, kp=100.0, kd=10.0), friction={NAMES[2]: 1.0}, damping=False)
    assert law.friction[2] == 1.0  # type: ignore[index]  # an array, as numbers were given
    names = {
        "joint_friction": {NAMES[2]: 1.0, NAMES[4]: 0.5},
        "joint_armature": {NAMES[0]: 0.1},
        "joint_damping": {NAMES[1]: 2.0},
    }
    arrays = {name: coefficients_by_joint(ARM, name, given) for name, given in names.items()}
    limits = {NAMES[1]: 5.0}
    runs = [
        dynx.simulate(
            ARM, law, q0, plant="compiled", duration=0.02, q0=0.9 * q0, effort_limits=limit, **given
        )
        for given, limit in ((names, limits), (arrays, np.where(np.arange(6) == 1, 5.0, np.inf)))
    ]
    assert runs[0].scenario == runs[1].scenario
    np.testing.assert_array_equal(runs[0].q, runs[1].q)
    rows: tuple[Any, ...] = (
        {NAMES[2]: [0.0, 1.0], NAMES[4]: 0.5},
        [[0, 0, 0, 0, 0.5, 0], [0, 0, 1.0, 0, 0.5, 0]],
    )
    many = [
        dynx.simulate_batch(ARM, law, q0, q0=0.9 * q0, duration=0.02, joint_friction=each) for each in rows
    ]
    assert len(many[0]) == 2
    np.testing.assert_array_equal(many[0].q, many[1].q)


def test_joints_without_a_coordinate_are_refused() -> None:
    with pytest.raises(UnknownNameError, match=f"^armature: .*'{NAMES[0]}'"):
        coefficients_by_joint(ARM, "armature", {NAMES[0][:-1]: 1.0})
    with pytest.raises(
        UnknownNameError, match=r"damping: .* has no coordinate: it follows 'panda_finger_joint1'"
    ):
        JointFriction(load("panda"), {"panda_finger_joint2": 1.0})
    with pytest.raises(GainError, match="one for each rollout"):
        coefficients_by_joint(ARM, "armature", {NAMES[0]: np.ones((2, 2))})
