"""How well a motion shows the inertial parameters of a robot.

Torque is linear in them, tau = Y pi; samples of a motion stacked give a least-squares problem whose
condition number says by how much noise of the torque is magnified in the parameters (Swevers et al. 1997).
Not all of them can be found from torques; those that can are as many as the rank of Y over all motions.
"""

from __future__ import annotations

from types import TracebackType

import numpy as np

from dynx.backends import backend as make_backend
from dynx.errors import ArgumentError, ShapeError, shown
from dynx.model import Model
from dynx.spatial.scalar import Floats
from dynx.trajectory.base import Trajectory

SAMPLES = 200
"""Samples of a motion that are looked at."""


class Identifiability:
    """The condition number of the inertial regressor along motions of one robot.

    To be closed after use, or used in a ``with`` statement, as the backend that it holds.
    """

    def __init__(self, model: Model, *, backend: str = "pinocchio", samples: int = SAMPLES) -> None:
        if isinstance(samples, bool) or not isinstance(samples, int | np.integer) or samples < 1:
            raise ArgumentError(f"samples is {shown(samples)}; wanted a whole number, at least 1")
        self._engine = make_backend(backend, model)
        self._samples = int(samples)
        rng = np.random.default_rng(0)
        v, a = rng.standard_normal((2, SAMPLES, model.nv))
        Y = self._engine.inertial_regressor(model.random(rng, SAMPLES), v, a)
        _, sizes, directions = np.linalg.svd(_stacked(Y), full_matrices=False)
        # numpy.linalg.matrix_rank's bound; what can be shown is many orders of magnitude above it.
        least = sizes[0] * max(SAMPLES * model.nv, Y.shape[-1]) * np.finfo(np.float64).eps
        self.identifiable = int(np.sum(sizes > least))
        """How many combinations of parameters torques can show at all."""
        self._combinations = directions[: self.identifiable].T

    def condition_number(self, trajectory: Trajectory) -> float:
        """Largest over least singular value of Y at evenly spaced times, over what can be identified.

        In SI units, with the ten parameters of each link about its frame (`Backend.inertial_regressor`);
        infinity if the motion does not show all that can be shown.
        """
        model = self._engine.model
        if (trajectory.nq, trajectory.nv) != (model.nq, model.nv):
            raise ShapeError(f"the trajectory has nq {trajectory.nq}; {model.name} has {model.nq}")
        Y = self._engine.inertial_regressor(*trajectory(np.linspace(0.0, trajectory.duration, self._samples)))
        shown_by = _stacked(Y) @ self._combinations
        sizes = np.linalg.svd(shown_by, compute_uv=False)
        if len(sizes) < self.identifiable or not sizes[-1] > 0.0:
            return float("inf")
        return float(sizes[0] / sizes[-1])

    def close(self) -> None:
        """Release the backend."""
        self._engine.close()

    def __enter__(self) -> Identifiability:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self.close()


def _stacked(Y: Floats) -> Floats:
    """The rows of all samples."""
    return Y.reshape(-1, Y.shape[-1])
