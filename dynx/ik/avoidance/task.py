"""A task that counts distances below their margins as errors, beside those of the target."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from dynx.ik.avoidance.avoidance import Avoidance, NearPair
from dynx.ik.coordinates import FrameCoordinates
from dynx.ik.tasks import Kinematics, Task, TaskError
from dynx.spatial.scalar import Floats

BUFFER = 1e-3
"""Distance [m] beyond the margin to which pairs are moved apart, so that rounding does not decide."""


class _Rows(NamedTuple):
    """What the Jacobian needs beside the configuration."""

    task: TaskError
    near: list[NearPair]


class AvoidingTask:
    """Errors of a task, and for each pair of bodies what its distance lacks."""

    def __init__(
        self, task: Task, avoidance: Avoidance, kinematics: Kinematics, coordinates: FrameCoordinates
    ) -> None:
        self._task, self._avoidance, self._kinematics = task, avoidance, kinematics
        self._columns = coordinates.columns

    def error(self, q: Floats) -> TaskError:
        """Return the errors at q (nq,): reached only where all margins are kept."""
        own = self._task.error(q)
        near = self._avoidance.near(self._kinematics, q, BUFFER)
        lacking = [each.pair.margin + BUFFER - each.separation.distance for each in near]
        pushed = [(each, lack) for each, lack in zip(near, lacking, strict=True) if lack > 0.0]
        return TaskError(
            (*own.vector, *(lack for _, lack in pushed)),
            own.position,
            own.rotation,
            own.reached and all(each.is_clear for each in near),
            _Rows(own, [each for each, _ in pushed]),
        )

    def jacobian(self, q: Floats, error: TaskError) -> Floats:
        """Return the Jacobian (m, n) of the errors at q."""
        rows: _Rows = error.rows
        J = self._task.jacobian(q, rows.task)
        if not rows.near:
            return J
        gradients = self._avoidance.gradients(self._kinematics, q, rows.near)[:, self._columns]
        return np.concatenate([J, gradients])
