"""Tasks of velocity inverse kinematics: the velocity that a frame should have."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from dynx.backends.base import Backend
from dynx.errors import ArgumentError, ShapeError, shown
from dynx.ik.residual import Residual
from dynx.ik.tasks import frame_jacobian
from dynx.model.numbers import checked_array, checked_vector, is_real, real_array
from dynx.model.targets import checked_targets
from dynx.option_names import checks_field_names
from dynx.spatial.scalar import Floats


@checks_field_names
@dataclass(frozen=True, eq=False)
class VelocityTask:
    """The velocity of one frame, its weights, and whether it must be met.

    With neither a velocity nor a target the frame holds still: its velocity is 0.
    """

    frame: str
    velocity: ArrayLike | None = None
    """Velocity (6,) of the frame's origin [m/s], then angular velocity [rad/s], in world axes; None is 0."""
    target: ArrayLike | None = None
    """Pose T_world_target (4, 4) or `dynx.Pose`, or position (3,) [m] with free rotation, that the frame
    moves towards: `gain` times the error is added to `velocity`."""
    gain: float = 1.0
    """Velocity per error [1/s]: the error falls by exp(-gain t)."""
    weights: ArrayLike = 1.0
    """Weight of each component of the velocity, one number or (6,): at least 0."""
    hard: bool = False
    """Whether components with a weight above 0 are met exactly, before all tasks that are not hard."""
    point: ArrayLike | None = None
    """Point (3,) [m] of the frame, in its axes, that has the velocity instead of the origin."""

    def rows(self, backend: Backend, q: Floats) -> tuple[Floats, Floats]:
        """Return the weighted Jacobian (m, nv) and the weighted velocity (m,) at q.

        A component of weight 0 has no row; the weights of a hard task only select components. Raises
        UnknownNameError, ArgumentError, ShapeError, DTypeError or NotFiniteError.
        """
        backend.model.frame_index(self.frame)
        point = None if self.point is None else checked_vector("point", self.point)
        velocity = (
            np.zeros(6) if self.velocity is None else checked_array("velocity", self.velocity, 6).copy()
        )
        if velocity.shape != (6,):
            raise ShapeError(f"velocity has shape {velocity.shape}; wanted (6,)")
        weights = real_array("weights", self.weights)
        if weights.shape not in ((), (6,)):
            raise ShapeError(f"weights have shape {weights.shape}; wanted one number, or (6,)")
        if not (np.isfinite(weights).all() and (weights >= 0.0).all()):
            raise ArgumentError(f"weights are {shown(self.weights)}; wanted finite numbers of at least 0")
        weights = np.array(np.broadcast_to(weights, (6,)))
        if self.target is not None:
            if not (is_real(self.gain) and 0.0 <= self.gain < np.inf):
                raise ArgumentError(f"gain is {shown(self.gain)}; wanted a number of at least 0 [1/s]")
            targets = checked_targets(self.target)
            if targets.batch:
                raise ShapeError(f"target has shape {np.shape(self.target)}; wanted (4, 4) or (3,)")
            residual = Residual(targets.positions, targets.rotations, point)
            error, _, _ = residual(backend.forward_kinematics(q, self.frame))
            velocity[residual.rows] += self.gain * np.array(error)
            if targets.rotations is None and self.velocity is None:
                weights[3:] = 0.0
        chosen = weights > 0.0
        J = frame_jacobian(backend, q, self.frame, point)[chosen]
        scale = np.ones(int(chosen.sum())) if self.hard else weights[chosen]
        return scale[:, None] * J, scale * velocity[chosen]
