"""Joint friction for plants of the user's own."""

from __future__ import annotations

import numpy as np
import pytest

from dynx.model.loading import load
from dynx.rbd.joint_friction import FrictionLaw
from dynx.sim.plants.disturbances import Disturbances
from dynx.steppers.implicit_joints import ImplicitJoints


@pytest.mark.parametrize("v", [-0.8, 1e-4, 0.8])
def test_friction_slows_or_stops_a_joint_within_one_step(v: float) -> None:
    model, h, inertia, dry, damping = load("pendulum"), 1e-2, 0.5, 0.6, 0.3
    disturbances = Disturbances(model, damping, dry)
    # Implicit damping and dry friction of magnitude at most `dry`: (I + h d) v+ = I v - h f.
    impulse = np.clip(inertia * v, -h * dry, h * dry)
    for _ in range(2):
        slowed = disturbances.slowed(np.array([[inertia]]), np.array([v]), h)
        np.testing.assert_allclose(slowed, [(inertia * v - impulse) / (inertia + h * damping)], atol=1e-15)


def test_friction_has_no_torque_before_the_first_step() -> None:
    model, friction = load("pendulum"), np.array([0.5])
    solver = ImplicitJoints(FrictionLaw.of(model, friction), friction, 1e-3)
    np.testing.assert_array_equal(solver.torque, [0.0])


def test_the_removed_attribute_names_those_that_replace_it() -> None:
    with pytest.raises(AttributeError, match=r"names is now friction\.present, pushes and has_armature"):
        Disturbances(load("ur5")).names  # type: ignore[attr-defined]  # noqa: B018
    assert not hasattr(Disturbances(load("ur5")), "nothing")
