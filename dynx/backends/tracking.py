"""Methods of every backend that follow paths of poses."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from dynx.backends.quantity_calls import QuantityCalls
from dynx.ik import Kinematics
from dynx.ik.tracking import TrackResult, track
from dynx.ik.tracking.tracker import Motion


class PathCalls(QuantityCalls):
    """Base of backends: inverse kinematics along a path."""

    def track(
        self: Kinematics,
        targets: ArrayLike | Motion,
        frame: str,
        q0: ArrayLike | None = None,
        *,
        dt: float | None = None,
        velocity_limit: ArrayLike | None = None,
        free: str | None = None,
        point: ArrayLike | None = None,
        position_tolerance: float = 1e-6,
        rotation_tolerance: float = 1e-6,
        limit_margin: ArrayLike = 0.0,
        max_step: float = 0.2,
        jumps: bool | None = None,
        max_starts: int = 32,
        rng: np.random.Generator | int = 0,
    ) -> TrackResult:
        """Return configurations (..., n, nq) that follow `targets`, poses (..., n, 4, 4), continuously.

        `dynx.ik.tracking.track` describes the options. Elsewhere: MoveIt `computeCartesianPath`, TRAC-IK
        called with the previous solution.
        """
        return track(
            self,
            targets,
            frame,
            q0,
            dt=dt,
            velocity_limit=velocity_limit,
            free=free,
            point=point,
            position_tolerance=position_tolerance,
            rotation_tolerance=rotation_tolerance,
            limit_margin=limit_margin,
            max_step=max_step,
            jumps=jumps,
            max_starts=max_starts,
            rng=rng,
        )
