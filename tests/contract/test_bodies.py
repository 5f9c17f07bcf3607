"""Inertia, centre of mass and energy, summed link by link from poses alone.

A link that is welded to another counts where it sits. Each sum here is the definition: over the
links of the description, at the poses and velocities that the backend itself gives.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from dynx.backends import Backend
from dynx.model import Model
from dynx.spatial.scalar import Floats
from tests.contract.conftest import Make
from tests.contract.engine_calls import random_state
from tests.contract.robots import branched, mimicking
from tests.error_bounds import ErrorBounds, samples_at

MODELS = {
    "fixed": branched(),
    "floating": branched().with_base("floating"),
    "mimicking": mimicking(),
}
each_model = pytest.mark.parametrize("model", MODELS.values(), ids=MODELS.keys())


def center_jacobians(model: Model, engine: Backend, q: Floats) -> list[tuple[float, Floats, Floats, Floats]]:
    """For each body: mass, centre of mass, its Jacobian, and inertia tensor, in the world."""
    found = []
    for link in model.links:
        if link.inertial is None:
            continue
        T = engine.forward_kinematics(q, link.name)
        R = T[:3, :3] @ Rotation.from_euler("xyz", link.inertial.origin.rpy).as_matrix()
        center = np.array(link.inertial.origin.xyz)
        J = engine.jacobian(q, link.name, point=center)
        found.append((link.inertial.mass, T[:3, :3] @ center + T[:3, 3], J, R @ link.inertial.tensor @ R.T))
    return found


@each_model
def test_mass_matrix_is_the_sum_over_the_links(make: Make, model: Model) -> None:
    """M = sum of m J_v' J_v + J_w' I J_w (Siciliano et al., Robotics, eq. 7.32)."""
    engine = make(model)
    for seed in range(3):
        state = random_state(model, 90 + seed)
        close = ErrorBounds(samples_at(model, state.q, state.v))
        M = np.zeros((model.nv, model.nv))
        for mass, _, J, tensor in center_jacobians(model, engine, state.q):
            M += mass * J[:3].T @ J[:3] + J[3:].T @ tensor @ J[3:]
        close.check("mass_matrix", engine.mass_matrix(state.q), M)
        energy = 0.5 * state.v @ M @ state.v
        close.check("kinetic_energy", engine.kinetic_energy(state.q, state.v), energy)


@each_model
def test_centre_of_mass_and_gravity_are_those_of_the_links(make: Make, model: Model) -> None:
    engine = make(model)
    for seed in range(3):
        q = random_state(model, 95 + seed).q
        close = ErrorBounds(samples_at(model, q))
        gravity, moment, torque = np.array(model.gravity), np.zeros(3), np.zeros(model.nv)
        for mass, center, J, _ in center_jacobians(model, engine, q):
            moment += mass * center
            torque -= mass * J[:3].T @ gravity
        close.check("center_of_mass", engine.center_of_mass(q), moment / model.total_mass)
        close.check("potential_energy", engine.potential_energy(q), -gravity @ moment)
        close.check("gravity_torque", engine.gravity_torque(q), torque)
