"""Bounds on the simulator's errors, from its specification and not from its behaviour."""

from __future__ import annotations

import numpy as np

from dynx.model import Model
from dynx.model.loading import load
from dynx.spatial.scalar import Floats
from dynx.trajectory import Trajectory, cycloidal

TRACKING = 1.3e-4
"""Largest error [rad] of computed torque 400/40 on the tutorial's motion, in steps of 1 ms."""
EXACT_ON_BULLET = 1e-8
"""Largest error [rad] of the discrete law on PyBullet's own stepper."""
EXACT_ON_DYNX = 1e-10
"""Bound on that error on an integrator of dynx."""
PLANTS_AGREE = 1e-8
"""Relative difference of the configurations that two plants reach under the same torques."""
ENERGY = 1e-10
"""Drift of the energy in 10 s of RK4 at 1 ms, over the largest kinetic energy."""
MOMENTUM = 1e-12
"""Change of the momentum of a free body in one step."""


def tutorial_robot() -> Model:
    """Return the arm of the tutorial, in its gravity."""
    return load("ur5").with_gravity((0.0, 0.0, -9.8))


def tutorial_motion(duration: float = 2.0) -> Trajectory:
    """Return the tutorial's cycloidal motion."""
    return cycloidal(np.zeros(6), [-1.5, -1.0, 1.0, -1.57, -1.57, -1.57], duration=duration)


def apart(a: Floats, b: Floats) -> float:
    """Return the largest difference of two records, over the largest entry."""
    return float(np.max(np.abs(a - b)) / max(1.0, float(np.max(np.abs(b)))))
