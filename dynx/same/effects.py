"""Effect of one element: the change of poses, mass matrix and torque when it alone is as it was."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dynx.model import Model
from dynx.reference.backend import ReferenceBackend
from dynx.spatial.scalar import Floats

STATES, SEED = 4, 0
"""Number of random states within limits, and their seed."""


@dataclass(frozen=True)
class ElementEffect:
    """Largest change over random states: of the position of a link [m], of its rotation (of an entry of the
    matrix), of an entry of the mass matrix relative to sqrt(M_ii M_jj), and of a torque relative to the
    largest one."""

    position: float
    rotation: float
    mass_matrix: float
    torque: float


@dataclass(frozen=True)
class Values:
    """Poses of the links, mass matrices and torques of a model at the states."""

    poses: Floats
    mass_matrix: Floats
    torque: Floats

    def effect_of(self, other: Values) -> ElementEffect | None:
        """Return the change to other values; None where the robots have other numbers of coordinates."""
        if self.torque.shape != other.torque.shape:
            return None
        diagonal = np.sqrt(np.abs(np.diagonal(self.mass_matrix, axis1=-2, axis2=-1)))
        scale = diagonal[:, :, None] * diagonal[:, None, :]
        apart = np.abs(other.mass_matrix - self.mass_matrix)
        largest = float(np.max(np.abs(self.torque), initial=0.0)) or 1.0
        poses = np.abs(other.poses - self.poses)
        return ElementEffect(
            float(np.max(np.linalg.norm(poses[..., :3, 3], axis=-1), initial=0.0)),
            float(np.max(poses[..., :3, :3], initial=0.0)),
            float(np.max(apart / np.where(scale > 0.0, scale, 1.0), initial=0.0)),
            float(np.max(np.abs(other.torque - self.torque), initial=0.0)) / largest,
        )


def values(model: Model, states: Model) -> Values:
    """Evaluate a model at random states within the limits of the model `states`."""
    rng = np.random.default_rng(SEED)
    q = states.random(rng, STATES)
    v, a = (rng.uniform(-1.0, 1.0, (STATES, states.nv)) for _ in range(2))
    if model.nq != states.nq:
        q = model.random(rng, STATES)
        v, a = (rng.uniform(-1.0, 1.0, (STATES, model.nv)) for _ in range(2))
    backend = ReferenceBackend(model)
    return Values(backend.forward_kinematics(q), backend.mass_matrix(q), backend.inverse_dynamics(q, v, a))
