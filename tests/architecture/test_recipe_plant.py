"""The recipe for a plant: one module and an entry point, in a package of somebody else."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import dynx
from dynx.errors import ArgumentError, UnsupportedFeatureError
from dynx.sim.plants.registry import plant_names
from tests.architecture.packages import installed_package

MODULE = '''"""Explicit Euler: q' = q (+) h v, v' = v + h a(q, v)."""

import dynx
from dynx.sim.plants.plant import Plant, StepResult


class ExplicitEuler(Plant):
    def __init__(self, model, disturbances, dt, *, substeps=1):
        super().__init__(model, disturbances, dt, substeps=substeps)
        self._engine = dynx.backend("reference", model)

    def reset(self, q, v):
        self._q, self._v = q, v

    def step(self, t, tau):
        first = None
        for _ in range(self.substeps):
            a = self._engine.forward_dynamics(self._q, self._v, tau)
            first = a if first is None else first
            self._q = self.model.integrate(self._q, self._h * self._v)
            self._v = self._v + self._h * a
        return StepResult(self._q, self._v, first, tau)

    def close(self):
        self._engine.close()
'''
NAME = "explicit_euler"
ENTRY_POINTS = f"[dynx.plants]\n{NAME} = acme_plant:ExplicitEuler\n"


@pytest.fixture
def package(tmp_path: Path) -> Iterator[Path]:
    """Yield the folder of the package, which is on the import path."""
    with installed_package(tmp_path, "acme_plant", MODULE, ENTRY_POINTS) as folder:
        yield folder


@pytest.mark.usefixtures("package")
def test_simulate_finds_it_by_name() -> None:
    assert NAME in plant_names()
    arm = dynx.load("double_pendulum")
    q0, h, n = np.array([1.0, -0.5]), 1e-3, 20
    rollout = dynx.simulate(arm, None, plant=NAME, q0=q0, dt=h, duration=n * h, joint_limits=False)
    engine, q, v = dynx.backend("reference", arm), q0, np.zeros(arm.nv)
    for k in range(n):
        a = engine.forward_dynamics(q, v, np.zeros(arm.nv))
        q, v = arm.integrate(q, h * v), v + h * a
        assert np.array_equal(rollout.q[k + 1], q)
        assert np.array_equal(rollout.v[k + 1], v)
        assert np.array_equal(rollout.a[k], a)


@pytest.mark.usefixtures("package")
def test_substeps_are_those_of_the_plant() -> None:
    arm = dynx.load("double_pendulum")
    options: dict[str, Any] = {"plant": NAME, "q0": [1.0, -0.5], "duration": 0.02, "joint_limits": False}
    fine = dynx.simulate(arm, None, dt=1e-3, **options)
    coarse = dynx.simulate(arm, None, dt=2e-3, substeps=2, **options)
    assert np.array_equal(coarse.q, fine.q[::2])


@pytest.mark.usefixtures("package")
def test_a_motor_of_another_engine_is_refused() -> None:
    arm = dynx.load("double_pendulum")
    motor = dynx.control.BulletVelocityMotor(arm)
    with pytest.raises(UnsupportedFeatureError, match="PyBullet"):
        dynx.simulate(arm, motor, arm.neutral(), plant=NAME, duration=0.01)


def test_a_name_that_nobody_provides_is_refused() -> None:
    arm = dynx.load("double_pendulum")
    with pytest.raises(ArgumentError, match="pybullet"):
        dynx.simulate(arm, None, plant=NAME, integrator="engine", duration=0.01)
