"""Condition number of a motion for the identification of inertial parameters.

Torque is linear in the parameters, tau = Y pi; the stacked samples of a motion form a least-squares problem
whose condition number bounds how much the noise of the torque is amplified in the parameters (Swevers et al.
1997). Only some linear combinations of parameters affect the torque: as many as the rank of Y.
"""

from __future__ import annotations

import numpy as np

from dynx.backends import backend as make_backend
from dynx.errors import ShapeError
from dynx.model import Model
from dynx.model.numbers import whole_number
from dynx.registry import DEFAULT_ENGINE
from dynx.spatial.scalar import Floats
from dynx.trajectory.base import Trajectory

SAMPLES = 200
"""Default number of samples of a motion."""


class Identifiability:
    """Condition number of the inertial regressor along motions of one robot.

    It holds a backend: close it after use, or use it in a ``with`` statement.
    """

    def __init__(self, model: Model, *, backend: str = DEFAULT_ENGINE, samples: int = SAMPLES) -> None:
        self._samples = whole_number("samples", samples, 1)
        self._engine = make_backend(backend, model)
        rng = np.random.default_rng(0)
        v, a = rng.standard_normal((2, SAMPLES, model.nv))
        Y = self._engine.inertial_regressor(model.random(rng, SAMPLES), v, a)
        _, singular_values, directions = np.linalg.svd(_stack_samples(Y), full_matrices=False)
        # Bound of numpy.linalg.matrix_rank; identifiable combinations are many orders of magnitude above it.
        least = singular_values[0] * max(SAMPLES * model.nv, Y.shape[-1]) * np.finfo(np.float64).eps
        self.identifiable = int(np.sum(singular_values > least))
        """Number of identifiable combinations of parameters."""
        self._combinations = directions[: self.identifiable].T

    def condition_number(self, trajectory: Trajectory) -> float:
        """Return the ratio of the largest to the smallest singular value of Y at evenly spaced times.

        Only identifiable combinations of parameters are considered. Units are SI, with the ten parameters of
        each link about its frame (`Backend.inertial_regressor`). Returns infinity if the motion does not
        excite all identifiable combinations.
        """
        model = self._engine.model
        if (trajectory.nq, trajectory.nv) != (model.nq, model.nv):
            raise ShapeError(f"the trajectory has nq {trajectory.nq}; {model.name} has {model.nq}")
        Y = self._engine.inertial_regressor(*trajectory(np.linspace(0.0, trajectory.duration, self._samples)))
        regressor = _stack_samples(Y) @ self._combinations
        singular_values = np.linalg.svd(regressor, compute_uv=False)
        if len(singular_values) < self.identifiable or not singular_values[-1] > 0.0:
            return float("inf")
        return float(singular_values[0] / singular_values[-1])

    def close(self) -> None:
        """Release the backend."""
        self._engine.close()

    def __enter__(self) -> Identifiability:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def _stack_samples(Y: Floats) -> Floats:
    """Return the rows of all samples as one matrix."""
    return Y.reshape(-1, Y.shape[-1])
