"""The referee: the algorithms of `dynx.rbd` evaluated with 50 digits.

It has the methods of a backend and returns arrays of mpmath numbers, starting from the decimal values of
the description (as read into doubles). Its own rounding errors are 34 digits below those of any engine, so
the distance of an engine from it is the engine's error.

The precision is raised inside each call only. It is a setting of the whole process in mpmath, so only one
thread may use a referee.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import mpmath
import numpy as np
from numpy.typing import ArrayLike

from dynx.agreement.comparison import REFEREE
from dynx.argument_types import checks_types
from dynx.backends.quantities import QUANTITIES, Quantity
from dynx.model import Model
from dynx.model.mechanism import Mechanism, build_mechanism
from dynx.model.numbers import checked_array
from dynx.rbd import jacobians, kinematics
from dynx.rbd.kinematics import Poses
from dynx.spatial.scalar import Array

DIGITS = 50


def exactly(numbers: object) -> Array:
    """Convert doubles to mpmath numbers, which represent them exactly."""
    return np.asarray(np.frompyfunc(mpmath.mpf, 1, 1)(np.asarray(numbers, dtype=np.float64)), dtype=object)


@checks_types
class Referee:
    """Quantities of one model in 50 digits, with the methods and shapes of `Backend`.

    Arguments are doubles, taken as exact, or mpmath numbers, with any leading axes.
    """

    name = REFEREE

    def __init__(self, model: Model) -> None:
        self.model = model
        with mpmath.mp.workdps(DIGITS):
            self._mechanism: Mechanism = build_mechanism(model, convert=exactly)
        self._poses: dict[object, Poses] = {}
        coupling = self._mechanism.coupling
        self._S = None if coupling is None else coupling.matrix()

    def forward_kinematics(self, q: ArrayLike) -> Array:
        """Return T_world_frame of every frame (..., n_frames, 4, 4)."""
        q = checked_array("q", q, self.model.nq)
        return self._evaluate(kinematics.frame_placements, 3, q)

    def __getattr__(self, name: str) -> Callable[..., Array]:
        """Return the method of `Backend` of that name, unless its quantity solves an equation."""
        if name not in QUANTITIES or QUANTITIES[name].solves:
            raise AttributeError(f"the referee does not compute {name}")
        return partial(self._quantity, QUANTITIES[name])

    def _quantity(
        self, quantity: Quantity, *arguments: Any, reference: str = jacobians.LOCAL_WORLD_ALIGNED
    ) -> Array:
        """Evaluate a quantity at its arguments, the last of which is a frame for a quantity of frames."""
        state, frame = arguments[: len(quantity.arguments)], arguments[len(quantity.arguments) :]
        details = quantity.implied_details(self.model)
        if quantity.of_frame:
            details = (self.model.frame_index(*frame), jacobians.REFERENCES[reference])
        algorithm = self._from_poses(quantity.algorithm) if quantity.takes_poses else quantity.algorithm
        result = self._evaluate(algorithm, len(quantity.shape), *state, details=details)
        if self._S is None:
            return result
        if quantity.reduces_columns:
            result = self._multiply(result, exactly(self._S))
        return self._multiply(exactly(self._S.T), result) if quantity.reduces_rows else result

    def _evaluate(
        self,
        algorithm: Callable[..., Array],
        rank: int,
        q: ArrayLike,
        *velocities: ArrayLike,
        details: tuple[Any, ...] = (),
    ) -> Array:
        """Evaluate `algorithm` in tree coordinates for every sample; the last `rank` axes are no batch."""
        with mpmath.mp.workdps(DIGITS):
            q, rates = exactly(q), [exactly(v) for v in velocities]
            coupling = self._mechanism.coupling
            if coupling is not None and self._S is not None:
                base = 7 if self.model.floating else 0
                driven = q[..., base:][..., list(coupling.index)]
                joints = driven * exactly(coupling.scale) + exactly(coupling.offset)
                q = np.concatenate([q[..., :base], joints], axis=-1)
                rates = [v @ exactly(self._S.T) for v in rates]
            result = np.asarray(algorithm(self._mechanism, q, *rates, *details))
            # A result that depends on no coordinate lacks the batch axes.
            batch = np.broadcast_shapes(q.shape[:-1], *(v.shape[:-1] for v in rates))
            return np.array(np.broadcast_to(result, (*batch, *result.shape[result.ndim - rank :])))

    def _multiply(self, A: Array, B: Array) -> Array:
        with mpmath.mp.workdps(DIGITS):
            return np.asarray(A @ B)

    def _from_poses(self, algorithm: Callable[..., Array]) -> Callable[..., Array]:
        """Return `algorithm` as a function of q. Poses of the bodies are stored: they serve all frames."""

        def evaluate(mechanism: Mechanism, q: Array, *rest: Any) -> Array:
            key = tuple(np.ravel(q).tolist()), q.shape
            if key not in self._poses:
                self._poses[key] = kinematics.body_poses(mechanism, q)
            return algorithm(mechanism, self._poses[key], *rest)

        return evaluate
