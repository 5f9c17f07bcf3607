"""One state of UR5, and the calls of a backend's methods at that state."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from dynx.backends import Backend
from dynx.model import Model
from dynx.spatial.scalar import Floats

Call = Callable[[], Floats]
FRAME = "tool0"


class Sample:
    """One state of a robot."""

    def __init__(self, model: Model) -> None:
        rng = np.random.default_rng(0)
        self.q = model.random(rng)
        self.v, self.a, self.tau = (rng.standard_normal(model.nv) for _ in range(3))


def through_dynx(backend: Backend, sample: Sample) -> dict[str, Call]:
    """Return the calls of a backend's methods, by name."""
    q, v, a, tau = sample.q, sample.v, sample.a, sample.tau
    return {
        "forward_kinematics": lambda: backend.forward_kinematics(q, FRAME),
        "all frames": lambda: backend.forward_kinematics(q),
        "jacobian": lambda: backend.jacobian(q, FRAME),
        "jacobian_derivative": lambda: backend.jacobian_derivative(q, v, FRAME),
        "frame_velocity": lambda: backend.frame_velocity(q, v, FRAME),
        "frame_acceleration": lambda: backend.frame_acceleration(q, v, a, FRAME),
        "inverse_dynamics": lambda: backend.inverse_dynamics(q, v, a),
        "forward_dynamics": lambda: backend.forward_dynamics(q, v, tau),
        "mass_matrix": lambda: backend.mass_matrix(q),
        "bias_torque": lambda: backend.bias_torque(q, v),
        "gravity_torque": lambda: backend.gravity_torque(q),
        "coriolis_matrix": lambda: backend.coriolis_matrix(q, v),
        "inertial_regressor": lambda: backend.inertial_regressor(q, v, a),
        "center_of_mass": lambda: backend.center_of_mass(q),
        "center_of_mass_jacobian": lambda: backend.center_of_mass_jacobian(q),
        "centroidal_momentum": lambda: backend.centroidal_momentum(q, v),
        "kinetic_energy": lambda: backend.kinetic_energy(q, v),
        "potential_energy": lambda: backend.potential_energy(q),
    }
