"""The closed loop that everything here is timed on: UR5, the motion and the gains of the tutorial."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from dynx.control import ComputedTorque
from dynx.model import Model
from dynx.model.loading import load
from dynx.spatial.scalar import Floats
from dynx.trajectory import Setpoint, Trajectory, cycloidal

GRAVITY = (0.0, 0.0, -9.8)
KP, KD = 400.0, 40.0
DT = 1e-3
STEPS = 2000
END = (-1.5, -1.0, 1.0, -1.57, -1.57, -1.57)

TRACKING = 1.3e-4
"""Largest error of a joint that this law may leave in steps of 1 ms [rad]."""
AGREEMENT = 1e-9
"""Largest difference between the records of two engines under one scheme [rad]."""


@dataclass(frozen=True)
class Task:
    """Computed torque 400/40 along a cycloid from 0 to `END` in 2 s, of which the first steps are done."""

    n_steps: int = STEPS

    @cached_property
    def model(self) -> Model:
        """UR5, in the gravity of the tutorial."""
        return load("ur5").with_gravity(GRAVITY)

    @cached_property
    def motion(self) -> Trajectory:
        """All of it."""
        return cycloidal(np.zeros(len(END)), END, duration=STEPS * DT)

    @cached_property
    def duration(self) -> float:
        """The part that is done [s]."""
        return self.n_steps * DT

    @cached_property
    def wanted(self) -> Setpoint:
        """Reference q, v, a at the start of each step and at the end: (n_steps + 1, 6) each."""
        return self.motion(np.arange(self.n_steps + 1) * DT)

    def law(self, backend: str = "pinocchio") -> ComputedTorque:
        """The controller, with its model evaluated by that backend."""
        return ComputedTorque(self.model, kp=KP, kd=KD, backend=backend)

    def tracking_error(self, q: Floats) -> float:
        """The largest distance of a record (n_steps + 1, 6) from what was wanted [rad]."""
        return float(np.max(np.abs(q - self.wanted.q)))
