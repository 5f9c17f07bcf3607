"""Methods of every backend that follow paths of poses, and velocities of frames."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from dynx.backends.quantity_calls import QuantityCalls
from dynx.ik import Kinematics
from dynx.ik.avoidance import AvoidanceSource
from dynx.ik.tracking import TrackResult, track
from dynx.ik.tracking.tracker import Motion
from dynx.ik.velocity import VelocityResult, VelocityTask, velocity_ik
from dynx.option_names import checks_option_names


class PathCalls(QuantityCalls):
    """Base of backends: inverse kinematics along a path, and of velocities."""

    @checks_option_names
    def track(
        self: Kinematics,
        targets: ArrayLike | Motion,
        frame: str,
        q0: ArrayLike | None = None,
        *,
        dt: float | None = None,
        velocity_limit: ArrayLike | None = None,
        free: str | Sequence[str] | None = None,
        point: ArrayLike | None = None,
        position_tolerance: float = 1e-6,
        rotation_tolerance: float = 1e-6,
        limit_margin: ArrayLike = 0.0,
        max_step: float = 0.2,
        jumps: bool | None = None,
        max_starts: int = 32,
        rng: np.random.Generator | int = 0,
        avoid: AvoidanceSource | None = None,
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
            avoid=avoid,
        )

    @checks_option_names
    def velocity_ik(
        self: Kinematics,
        q: ArrayLike,
        tasks: VelocityTask | Sequence[VelocityTask],
        *,
        dt: float,
        damping: float = 1e-6,
        posture: ArrayLike | None = None,
        posture_weight: float = 1e-2,
        posture_gain: float = 1.0,
        velocity_limit: ArrayLike | None = None,
        acceleration_limit: ArrayLike | None = None,
        v0: ArrayLike | None = None,
        avoid: AvoidanceSource | None = None,
        avoid_gain: float = 5.0,
    ) -> VelocityResult:
        """Return the velocity v (nv,) that meets `tasks` best at q (nq,) and keeps the limits for `dt` [s].

        `dynx.ik.velocity.velocity_ik` describes the options; needs the extra ``qp``. Elsewhere: Pink and mink
        `solve_ik`, Drake `DoDifferentialInverseKinematics`.
        """
        return velocity_ik(
            self,
            q,
            tasks,
            dt=dt,
            damping=damping,
            posture=posture,
            posture_weight=posture_weight,
            posture_gain=posture_gain,
            velocity_limit=velocity_limit,
            acceleration_limit=acceleration_limit,
            v0=v0,
            avoid=avoid,
            avoid_gain=avoid_gain,
        )
