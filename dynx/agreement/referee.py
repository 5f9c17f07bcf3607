"""The referee: the algorithms of `dynx.rbd` evaluated with 50 digits.

It answers some of the questions that a backend answers, with arrays of mpmath numbers, starting from
the decimal values of the description (as read into doubles). Its own rounding errors are 34 digits
below those of any engine, so the distance of an engine from it is the engine's error.

The precision is raised inside each call only; mpmath keeps it per process, so the referee is for
one thread.
"""

from __future__ import annotations

from collections.abc import Callable

import mpmath
import numpy as np
from numpy.typing import ArrayLike

from dynx.agreement.answers import EXACT
from dynx.model import Model
from dynx.model.mechanism import Mechanism, build_mechanism
from dynx.rbd import centroidal, crba, jacobians, kinematics, rnea
from dynx.rbd.kinematics import Poses
from dynx.spatial.scalar import Array

DIGITS = 50


def exactly(numbers: object) -> Array:
    """The same numbers as mpmath's, without rounding: every double is exact in them."""
    return np.asarray(np.frompyfunc(mpmath.mpf, 1, 1)(np.asarray(numbers, dtype=np.float64)), dtype=object)


class Referee:
    """Answers in 50 digits for one model, with the methods and shapes of `Backend`.

    Arguments are doubles with any leading axes, taken as exact; an argument that already holds
    mpmath numbers is used as it stands.
    """

    name = EXACT

    def __init__(self, model: Model) -> None:
        self.model = model
        with mpmath.mp.workdps(DIGITS):
            self._mechanism: Mechanism = build_mechanism(model, numbers=exactly)
        self._poses: dict[object, Poses] = {}
        coupling = self._mechanism.coupling
        self._S = None if coupling is None else coupling.matrix()

    def forward_kinematics(self, q: ArrayLike) -> Array:
        """T_world_frame of every frame (..., n_frames, 4, 4)."""
        return self._asked(kinematics.frame_placements, 3, q)

    def jacobian(self, q: ArrayLike, frame: str, *, reference: str = "local_world_aligned") -> Array:
        """J (..., 6, nv)."""
        index, axes = self.model.frame_index(frame), jacobians.REFERENCES[reference]

        def of_poses(mechanism: Mechanism, poses: Poses) -> Array:
            return jacobians.frame_jacobian(mechanism, poses, index, axes)

        return self._reduced_columns(self._asked(self._of_poses(of_poses), 2, q))

    def inverse_dynamics(self, q: ArrayLike, v: ArrayLike, a: ArrayLike) -> Array:
        """tau (..., nv)."""
        return self._reduced_columns(self._asked(rnea.inverse_dynamics, 1, q, v, a))

    def bias_torque(self, q: ArrayLike, v: ArrayLike) -> Array:
        """C v + g (..., nv)."""
        return self.inverse_dynamics(q, v, np.zeros_like(np.asarray(v)))

    def gravity_torque(self, q: ArrayLike) -> Array:
        """g (..., nv)."""
        q = np.asarray(q)
        rest = np.zeros((*q.shape[:-1], self.model.nv))
        return self.inverse_dynamics(q, rest, rest)

    def mass_matrix(self, q: ArrayLike) -> Array:
        """M (..., nv, nv)."""
        M = self._asked(crba.mass_matrix, 2, q)
        return M if self._S is None else self._multiply(exactly(self._S.T), self._reduced_columns(M))

    def center_of_mass(self, q: ArrayLike) -> Array:
        """(..., 3)"""
        return self._asked(self._of_poses(centroidal.center_of_mass), 1, q)

    def potential_energy(self, q: ArrayLike) -> Array:
        """(...,)"""
        return self._asked(self._of_poses(centroidal.potential_energy), 0, q)

    def kinetic_energy(self, q: ArrayLike, v: ArrayLike) -> Array:
        """(...,)"""
        return self._asked(self._of_poses(centroidal.kinetic_energy), 0, q, v)

    def _asked(
        self, algorithm: Callable[..., Array], rank: int, q: ArrayLike, *velocities: ArrayLike
    ) -> Array:
        """`algorithm` in tree coordinates, for every sample; `rank` axes of its answer are no batch."""
        with mpmath.mp.workdps(DIGITS):
            q, rates = exactly(q), [exactly(v) for v in velocities]
            coupling = self._mechanism.coupling
            if coupling is not None and self._S is not None:
                base = 7 if self.model.floating else 0
                driven = q[..., base:][..., list(coupling.index)]
                joints = driven * exactly(coupling.scale) + exactly(coupling.offset)
                q = np.concatenate([q[..., :base], joints], axis=-1)
                rates = [v @ exactly(self._S.T) for v in rates]
            answer = np.asarray(algorithm(self._mechanism, q, *rates))
            # What no coordinate moves comes without batch axes.
            batch = np.broadcast_shapes(q.shape[:-1], *(v.shape[:-1] for v in rates))
            return np.array(np.broadcast_to(answer, (*batch, *answer.shape[answer.ndim - rank :])))

    def _reduced_columns(self, answer: Array) -> Array:
        return answer if self._S is None else self._multiply(answer, exactly(self._S))

    def _multiply(self, A: Array, B: Array) -> Array:
        with mpmath.mp.workdps(DIGITS):
            return np.asarray(A @ B)

    def _of_poses(self, algorithm: Callable[..., Array]) -> Callable[..., Array]:
        """`algorithm` of body poses, which are kept: a robot has many frames at one configuration."""

        def evaluate(mechanism: Mechanism, q: Array, *v: Array) -> Array:
            key = tuple(np.ravel(q).tolist()), q.shape
            if key not in self._poses:
                self._poses[key] = kinematics.body_poses(mechanism, q)
            return algorithm(mechanism, self._poses[key], *v)

        return evaluate
