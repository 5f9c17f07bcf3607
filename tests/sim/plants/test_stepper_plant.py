"""Engines' own steppers as plants: those of MuJoCo and Drake are semi-implicit Euler without contacts."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import dynx
from dynx.backends import installed_backends
from dynx.control import BulletPositionMotor
from dynx.errors import UnsupportedFeatureError
from tests.backends.robots import mixed_robot
from tests.sim.bars import tutorial_robot

ENGINES = [name for name in ("mujoco", "drake") if name in installed_backends()]


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("mimic", [False, True])
def test_a_step_of_the_engine_is_that_of_dynx(engine: str, mimic: bool) -> None:
    model = mixed_robot("fixed", mimic=mimic)
    rng = np.random.default_rng(2)
    given: dict[str, Any] = {
        "q0": model.random(rng),
        "v0": 0.3 * rng.standard_normal(model.nv),
        "duration": 0.1,
        "substeps": 2,
        "damping": True,
        "friction": True,
        "armature": True,
        "pushes": dynx.ExternalForce("tip", [1.0, 2.0, 3.0, 0.1, 0.2, 0.3], start=0.02, duration=0.033),
    }
    own = dynx.simulate(model, plant=engine, integrator="engine", **given)
    ours = dynx.simulate(model, plant=engine, integrator="semi_implicit", **given)
    # Drake's solver couples mimic joints by an iteration.
    tolerance = 1e-6 if mimic and engine == "drake" else 1e-10
    for name in ("q", "v"):
        np.testing.assert_allclose(getattr(own, name), getattr(ours, name), rtol=0.0, atol=tolerance)
    assert ours.settings["integrator"] == "semi_implicit"
    assert own.settings["integrator"] == "engine"


@pytest.mark.parametrize("engine", ENGINES)
def test_motors_of_bullet_are_those_of_bullet(engine: str) -> None:
    arm = tutorial_robot()
    with pytest.raises(UnsupportedFeatureError, match="motor inside PyBullet"):
        dynx.simulate(
            arm, BulletPositionMotor(arm), arm.neutral(), plant=engine, integrator="engine", duration=0.1
        )
