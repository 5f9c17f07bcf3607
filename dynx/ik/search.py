"""Descent from one start, and restarts from random configurations until the target is reached.

Levenberg-Marquardt whose damping is proportional to the remaining squared error, so that it is
robust far from the target and converges quadratically at it, whether or not the target can be
reached and the Jacobian has full rank (Sugihara, Solvability-unconcerned inverse kinematics by the
Levenberg-Marquardt method, IEEE Trans. Robotics 27(5), 2011, eq. 13). Limits are kept at every
step. No step is refused; a start is given up when the squared error has not fallen enough over a
few steps, which needs no scale and holds at a bound, at a singularity and in a local minimum alike.
If no start reaches the target, the best configuration is refined to a local minimum.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from dynx.ik.coordinates import FrameCoordinates
from dynx.ik.levenberg_marquardt import BoundedStep
from dynx.ik.residual import Residual
from dynx.model import Model
from dynx.spatial.scalar import Floats

# Chosen on UR5, Panda, iiwa and a Talos arm for the fewest evaluations; a factor of 3 in either
# direction, or a window of 2 to 6 steps, costs at most a third more.
_DAMPING = 0.1
"""Damping for a unit of squared error (half the squared length of the residual)."""
_LEAST_DAMPING = 1e-9
"""Keeps the system definite at a singular configuration on the target."""
_WINDOW = 3
"""Steps over which progress is judged."""
_PROGRESS = 0.6
"""The squared error must fall below this part of itself over the window, or the start is given up."""
_LEAST_PROGRESS = 1e-12
"""Refinement of an unreached target ends with a step that takes off a smaller part than this."""


class Kinematics(Protocol):
    """What the solver asks of a backend: one sample, a frame by name."""

    @property
    def model(self) -> Model:
        """The robot."""

    def forward_kinematics(self, q: Floats, frame: str) -> Floats:
        """T_world_frame (4, 4)."""

    def jacobian(self, q: Floats, frame: str, *, point: Floats | None = None) -> Floats:
        """J (6, nv), linear rows first, at the frame (or a point of it) in world axes."""


@dataclass(frozen=True)
class Effort:
    """When a target counts as reached, and how long to try."""

    position_tolerance: float  # [m]
    rotation_tolerance: float  # [rad]
    max_iterations: int  # of each start
    max_restarts: int


@dataclass
class Found:
    """A configuration and how far it is from the target."""

    q: Floats
    position_error: float
    rotation_error: float
    squared_error: float
    success: bool
    iterations: int = 0
    restarts: int = 0


class Search:
    """Searches configurations that bring one frame (or a point of it) to targets."""

    def __init__(self, kinematics: Kinematics, frame: str, point: Floats | None, effort: Effort) -> None:
        self._kinematics = kinematics
        self._frame = frame
        self._point = point
        self._effort = effort
        self._coordinates = FrameCoordinates(kinematics.model, frame)
        self._step = BoundedStep(self._coordinates.lower, self._coordinates.upper)

    def run(
        self,
        position: Floats,
        rotation: Floats | None,
        q0: Floats,
        rng: np.random.Generator | int | None,
        *,
        begin_at_q0: bool,
    ) -> Found:
        """Reach the target from q0 (nq,) within limits, or from a random start."""
        residual = Residual(position, rotation, self._point)
        if self._coordinates.count == 0:
            return self.measured(q0, residual)
        start, best, iterations = q0, None, 0
        for restarts in range(self._effort.max_restarts + 1):
            if restarts or not begin_at_q0:
                # Made when it is first needed: that takes longer than a step.
                rng = np.random.default_rng(rng)
                start = self._coordinates.random(q0, rng)
            q, steps = self._descend(start, residual)
            iterations += steps
            found = self.measured(self._coordinates.nearest(q, q0), residual)
            if best is None or found.squared_error < best.squared_error or found.success:
                best = found
            best.iterations, best.restarts = iterations, restarts
            if best.success:
                return best
        assert best is not None
        q, steps = self._refine(best.q, residual)
        refined = self.measured(self._coordinates.nearest(q, q0), residual)
        if refined.success or refined.squared_error <= best.squared_error:
            refined.restarts = best.restarts
            best = refined
        best.iterations = iterations + steps
        return best

    def within_limits(self, q: Floats, q0: Floats) -> Floats:
        """q less whole turns, as near to q0 as its limits allow, and then clipped to them."""
        return self._kinematics.model.clip(self._coordinates.nearest(q, q0))

    def measured(self, q: Floats, residual: Residual) -> Found:
        """What forward kinematics says of q."""
        placement = self._kinematics.forward_kinematics(q, self._frame)
        way, position_error, rotation_error = residual(placement)
        success = (
            position_error <= self._effort.position_tolerance
            and rotation_error <= self._effort.rotation_tolerance
        )
        return Found(q, position_error, rotation_error, _half_square(way), success)

    def _descend(self, q: Floats, residual: Residual) -> tuple[Floats, int]:
        """(the best configuration on the way, the number of steps) from one start."""
        forward_kinematics, frame = self._kinematics.forward_kinematics, self._frame
        position_tolerance = self._effort.position_tolerance
        rotation_tolerance = self._effort.rotation_tolerance
        best, least = q, float("inf")
        recent: deque[float] = deque(maxlen=_WINDOW)
        for steps in range(self._effort.max_iterations + 1):
            way, position_error, rotation_error = residual(forward_kinematics(q, frame))
            if position_error <= position_tolerance and rotation_error <= rotation_tolerance:
                return q, steps
            squared_error = _half_square(way)
            if squared_error < least:
                best, least = q, squared_error
            stagnant = len(recent) == _WINDOW and squared_error > _PROGRESS * recent[0]
            if stagnant or steps == self._effort.max_iterations:
                break
            recent.append(squared_error)
            q = self._moved(q, way, _DAMPING * squared_error + _LEAST_DAMPING)
        return best, steps

    def _refine(self, q: Floats, residual: Residual) -> tuple[Floats, int]:
        """(the configuration nearest to the target around q, the number of steps).

        Where the error stays large the full step overshoots, so a step that does not help is
        refused and the damping raised (Marquardt 1963).
        """
        way, _, _ = residual(self._kinematics.forward_kinematics(q, self._frame))
        squared_error, factor, steps = _half_square(way), _DAMPING, 0
        while steps < self._effort.max_iterations:
            steps += 1
            trial = self._moved(q, way, factor * squared_error + _LEAST_DAMPING)
            trial_way, _, _ = residual(self._kinematics.forward_kinematics(trial, self._frame))
            trial_error = _half_square(trial_way)
            gain = squared_error - trial_error
            if gain > 0.0:
                q, way, squared_error = trial, trial_way, trial_error
                factor *= 0.3
            else:
                factor *= 4.0
            if abs(gain) <= _LEAST_PROGRESS * squared_error:
                break
        return q, steps

    def _moved(self, q: Floats, way: tuple[float, ...], damping: float) -> Floats:
        """The configuration after one step from q."""
        if self._point is None:
            J = self._kinematics.jacobian(q, self._frame)
        else:
            J = self._kinematics.jacobian(q, self._frame, point=self._point)
        coordinates = self._coordinates
        y = self._step(J[: len(way), coordinates.columns], way, coordinates.of(q), damping)
        return coordinates.moved(q, y)


def _half_square(residual: tuple[float, ...]) -> float:
    return 0.5 * sum([x * x for x in residual])
