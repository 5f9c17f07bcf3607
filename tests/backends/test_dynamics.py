"""Dynamics that plants evaluate in each step: calls of one thread, and M with the bias torque."""

from __future__ import annotations

import numpy as np
import pytest

from dynx.backends import backend, installed_backends
from dynx.backends.dynamics import EngineDynamics
from dynx.reference.backend import ReferenceBackend
from dynx.spatial.scalar import Floats
from tests.backends.robots import assert_close, mixed_robot, motion


@pytest.mark.parametrize("name", installed_backends())
@pytest.mark.parametrize("base", ["fixed", "floating"])
@pytest.mark.parametrize("mimic", [False, True])
def test_mass_matrix_and_bias_are_those_of_two_calls(name: str, base: str, mimic: bool) -> None:
    robot, rng = mixed_robot(base, mimic=mimic), np.random.default_rng(0)
    with backend(name, robot) as engine:
        both = EngineDynamics(engine).mass_matrix_and_bias
        for _ in range(5):
            q, v = robot.random(rng), rng.normal(size=robot.nv)
            M, bias = both(q, v)
            wanted, torque = engine.mass_matrix(q), engine.bias_torque(q, v)
            size = np.sqrt(np.diagonal(wanted))
            np.testing.assert_allclose(M / np.outer(size, size), wanted / np.outer(size, size), atol=1e-11)
            np.testing.assert_allclose(bias / size, torque / size, atol=1e-10 * np.abs(torque / size).max())


@pytest.mark.parametrize("name", installed_backends())
@pytest.mark.parametrize("mimic", [False, True])
def test_a_call_bound_to_a_thread_takes_the_coordinates_of_the_model(name: str, mimic: bool) -> None:
    robot = mixed_robot("floating", mimic=mimic)
    q, v, x = motion(robot)
    with backend(name, robot) as engine:
        quick = EngineDynamics(engine)
        for quantity, sample in (
            ("inverse_dynamics", (q, v, x)),
            ("forward_dynamics", (q, v, x)),
            ("mass_matrix", (q,)),
            ("bias_torque", (q, v)),
            ("gravity_torque", (q,)),
        ):
            wanted = getattr(engine, quantity)(*sample)
            size = float(np.linalg.cond(engine.mass_matrix(q))) if quantity == "forward_dynamics" else 1.0
            assert_close(quick.bound_to_thread(quantity)(*sample), wanted, size, quantity)


@pytest.mark.skipif("mujoco" not in installed_backends(), reason="MuJoCo is not installed")
def test_an_overridden_hook_is_called_instead_of_the_hook_of_its_base_class() -> None:
    from dynx.engines.mujoco.backend import MujocoBackend

    class Heavier(MujocoBackend):
        """MuJoCo with twice the inertia."""

        def _mass_matrix(self, q: Floats) -> Floats:
            return 2.0 * super()._mass_matrix(q)

    robot = mixed_robot("fixed")
    q, v = robot.neutral(), np.zeros(robot.nv)
    with Heavier(robot) as engine, ReferenceBackend(robot) as exact:
        M, _ = EngineDynamics(engine).mass_matrix_and_bias(q, v)
        np.testing.assert_allclose(M, 2.0 * exact.mass_matrix(q), rtol=1e-9, atol=1e-9)
