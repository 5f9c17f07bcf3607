"""A step of joints with dry friction whose modes are given, by the kernel and by NumPy."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dynx.backends import backend
from dynx.model.loading import load
from dynx.rbd.joint_friction import FrictionLaw
from dynx.steppers.implicit_joints import ImplicitJoints

EPS = float(np.finfo(float).eps)
ARM = load("planar_2r")
ENGINE = backend("reference", ARM)
H = 1e-2
FRICTION, DAMPING, ARMATURE = np.array([0.5, 2.0]), np.array([0.3, 0.0]), np.array([0.0, 0.1])


@cache
def solver(*, compiled: bool) -> ImplicitJoints:
    with pytest.MonkeyPatch.context() as patch:
        if not compiled:
            patch.setattr("dynx.steppers.implicit_joints.MAX_COMPILED_OPERATIONS", 0)
        law = FrictionLaw.of(ARM, FRICTION)
        return ImplicitJoints(law, FRICTION, H, damping=DAMPING, armature=ARMATURE)


@pytest.mark.parametrize("compiled", [True, False])
@given(modes=st.tuples(*[st.sampled_from([-1.0, 0.0, 1.0])] * 2), seed=st.integers(0, 999))
def test_joints_that_stick_stop_in_the_step_and_the_others_obey_the_equation_of_motion(
    compiled: bool, modes: tuple[float, float], seed: int
) -> None:
    rng = np.random.default_rng(seed)
    M = ENGINE.mass_matrix(ARM.random(rng))
    bias, tau, v = 3.0 * rng.standard_normal((3, 2))
    given_modes = np.array(modes)
    a = solver(compiled=compiled).with_modes(M, bias, tau, v, given_modes)
    after = v + H * a
    stuck = given_modes == 0.0
    assert np.abs(after[stuck]).max(initial=0.0) <= 4 * EPS * np.abs(v).max()
    # (M + armature) a = tau - bias - damping (v + h a) - f
    left = (M + np.diag(ARMATURE)) @ a - (tau - bias - DAMPING * after - given_modes * FRICTION)
    size = (np.abs(M) + np.diag(ARMATURE)) @ np.abs(a) + np.abs(tau) + np.abs(bias) + np.abs(v) + FRICTION
    assert np.abs(left[~stuck]).max(initial=0.0) <= 64 * EPS * size.max()
