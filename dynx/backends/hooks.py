"""The hooks of an engine, and the derivation of every quantity that the engine does not compute itself.

A backend implements two hooks, the placements of all frames and inverse dynamics; every other quantity is
derived from those two: by a method here or, for a quantity without one, by its algorithm evaluated at the
poses of the bodies, which follow from the placements. A hook that a backend defines under the name of
`Quantity.hook` replaces the derivation.

Hooks work in tree coordinates (one for every moving joint, mimic joints included; see `dynx.model.mechanism`)
and receive checked float64 arrays: one sample or, if `vectorized` is set, any leading batch axes. The caller
may overwrite those arrays after the hook has returned, and may keep and change the result.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from functools import cache
from math import prod
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from dynx.backends.quantities import QUANTITIES, Quantity
from dynx.backends.solvability import magnitudes_of_rows, rounding_of_eigenvalues, singular_matrix
from dynx.backends.straight import BindingCall
from dynx.model import Mechanism, Model
from dynx.rbd import jacobians, kinematics
from dynx.rbd.jacobians import Reference
from dynx.spatial.scalar import Floats


class EngineHooks(ABC):
    """The calls of an engine, in tree coordinates."""

    vectorized: ClassVar[bool] = False
    """True if the hooks take leading batch axes."""

    takes_ball_joints: ClassVar[bool] = False
    """True if the hooks take robots with ball joints, whose q is longer than their v; others are refused."""

    compiles: ClassVar[bool] = False
    """True if every quantity is a kernel of dynx's own."""

    model: Model
    _mechanism: Mechanism

    @property
    def threads(self) -> int:
        """Most threads for a batch."""
        return 1

    def _unchecked_callable(self, quantity: str) -> Callable[..., Floats] | None:
        """Return the unchecked callable for `quantity` bound to the calling thread, or None if the engine has
        none.

        It takes one sample, in the coordinates of the model, and saves microseconds in loops of one thread.
        Exceptions of the engine are not translated, and a call may overwrite the result of the one before.
        """
        return None

    def _sample_hook(self, hook: str, arguments: int, details: tuple[Any, ...]) -> Callable[..., Any]:
        """Return the function of this backend and of `arguments` arrays of one sample that evaluates a hook,
        without the translation of exceptions.

        `details` is empty or has what hooks take after the arrays: a frame, or a frame and a reference.
        """
        function = untranslated(getattr(type(self), hook))
        return _with_details(function, arguments, *details) if details else function

    def _binding_call(self, hook: str) -> BindingCall | None:
        """Return the only call of the engine's binding that a hook for three arrays makes, or None."""
        return None

    @classmethod
    def _is_native(cls, quantity: Quantity) -> bool:
        """Check whether the engine computes the quantity itself, rather than by a derivation of dynx."""
        derivation = getattr(EngineHooks, quantity.hook, None)
        return getattr(cls, quantity.hook, None) is not derivation

    def _derive(self, quantity: Quantity | str, q: Floats, *rest: Any) -> Floats:
        """Evaluate the algorithm of a quantity, at the engine's own poses of the bodies if it takes poses.

        `rest` has the arguments of the algorithm after q: velocities and the like, then the details.
        """
        known = QUANTITIES[quantity] if isinstance(quantity, str) else quantity
        first = self._body_poses(q) if known.takes_poses else q
        return np.asarray(known.algorithm(self._mechanism, first, *rest))

    # -- what every engine must compute -------------------------------------------------------

    @abstractmethod
    def _frame_placements(self, q: Floats) -> Floats:
        """Return T_world_frame of every frame, (..., n_frames, 4, 4)."""

    @abstractmethod
    def _inverse_dynamics(self, q: Floats, v: Floats, a: Floats) -> Floats:
        """Return the torque (..., nv) without external forces, damping, friction and armature."""

    # -- kinematics ---------------------------------------------------------------------------

    def _frame_placement(self, q: Floats, frame: int) -> Floats:
        """Return T_world_frame of frame number `frame`, (..., 4, 4)."""
        return self._frame_placements(q)[..., frame, :, :]

    def _jacobian(self, q: Floats, frame: int, reference: Reference) -> Floats:
        """Return the geometric Jacobian (..., 6, nv), linear rows first."""
        return jacobians.frame_jacobian(self._mechanism, self._body_poses(q), frame, reference)

    def _jacobian_derivative(self, q: Floats, v: Floats, frame: int, reference: Reference) -> Floats:
        """Return the time derivative of the Jacobian (..., 6, nv) along the velocity `v`."""
        return jacobians.frame_jacobian_derivative(self._mechanism, self._body_poses(q), v, frame, reference)

    def _frame_velocity(self, q: Floats, v: Floats, frame: int, reference: Reference) -> Floats:
        """Return J v, (..., 6)."""
        return apply_matrix(self._jacobian(q, frame, reference), v)

    def _frame_acceleration(
        self, q: Floats, v: Floats, a: Floats, frame: int, reference: Reference
    ) -> Floats:
        """Return J a + dJ/dt v, (..., 6)."""
        return apply_matrix(self._jacobian(q, frame, reference), a) + apply_matrix(
            self._jacobian_derivative(q, v, frame, reference), v
        )

    # -- dynamics -----------------------------------------------------------------------------

    def _bias_torque(self, q: Floats, v: Floats) -> Floats:
        """Return the inverse dynamics at zero acceleration (..., nv)."""
        return self._inverse_dynamics(q, v, np.zeros(v.shape))

    def _gravity_torque(self, q: Floats) -> Floats:
        """Return the inverse dynamics at rest (..., nv)."""
        rest = np.zeros((*q.shape[:-1], self._mechanism.nv))
        return self._inverse_dynamics(q, rest, rest)

    def _mass_matrix(self, q: Floats) -> Floats:
        """Return the joint-space inertia (..., nv, nv), a column for each unit acceleration."""
        n = self._mechanism.nv
        rest = np.zeros((*q.shape[:-1], n))
        gravity = self._inverse_dynamics(q, rest, rest)
        columns = [self._inverse_dynamics(q, rest, rest + unit) - gravity for unit in np.eye(n)]
        if not columns:
            return np.zeros((*q.shape[:-1], 0, 0))
        M = np.stack(columns, axis=-1)
        return np.asarray(0.5 * (M + np.swapaxes(M, -1, -2)))

    def _mass_matrix_and_bias(self, q: Floats, v: Floats) -> tuple[Floats, Floats]:
        """Return the mass matrix and the bias torque of one sample, for plants with joint friction."""
        return self._mass_matrix(q), self._bias_torque(q, v)

    def _forward_dynamics(self, q: Floats, v: Floats, tau: Floats) -> Floats:
        """Return the acceleration a (..., nv) with M a + bias = tau, not finite where M is singular."""
        return solution_or_nan(self._mass_matrix(q), tau - self._bias_torque(q, v))

    def _kinetic_energy(self, q: Floats, v: Floats) -> Floats:
        """Return v' M v / 2, (...,)."""
        return np.asarray(0.5 * np.sum(v * apply_matrix(self._mass_matrix(q), v), axis=-1))

    def _body_poses(self, q: Floats) -> kinematics.Poses:
        """Return the poses of the root and of each moving body, from the engine's frame placements."""
        return kinematics.poses_from_frames(self._mechanism, self._frame_placements(q))


def untranslated(hook: Callable[..., Any]) -> Callable[..., Any]:
    """Return a hook without the translation of its engine's exceptions (`dynx.backends.engine_errors`)."""
    found: Callable[..., Any] = getattr(hook, "untranslated", hook)
    return found


def _with_details(hook: Callable[..., Any], arguments: int, *details: Any) -> Callable[..., Any]:
    """Return the function of a backend and `arguments` arrays that calls a hook with them and `details`."""
    # Arguments are written out, because a call with a star takes longer.
    if len(details) == 1:
        (frame,) = details
        return lambda backend, q: hook(backend, q, frame)
    frame, reference = details
    if arguments == 1:
        return lambda backend, q: hook(backend, q, frame, reference)
    if arguments == 2:
        return lambda backend, q, v: hook(backend, q, v, frame, reference)
    return lambda backend, q, v, a: hook(backend, q, v, a, frame, reference)


def solve_mass_matrix(M: Floats, torque: Floats) -> Floats:
    """Return a (..., nv) with M a = torque. Raises SingularMassMatrixError where M is singular to rounding.

    M (..., nv, nv) may be indefinite, because the inertias of a file are used as they are.
    """
    a = solution_or_nan(M, torque)
    if not np.isfinite(a).all():
        raise singular_matrix()
    return a


def solution_or_nan(M: Floats, torque: Floats) -> Floats:
    """Return a (..., nv) with M a = torque, NaN at samples where M is singular to rounding.

    M is scaled to a unit diagonal first, and singular if its smallest eigenvalue is
    `rounding_of_eigenvalues`. Pivots are chosen by size, whatever the signs of the eigenvalues are.
    """
    if M.ndim == 2 and torque.ndim == 1:
        a = _definite_solution(M, torque)
        if a is not None:
            return a
    size = magnitudes_of_rows(M)
    scaled = M / (size[..., :, None] * size[..., None, :])
    identity = np.eye(M.shape[-1])
    regular = np.asarray(np.isfinite(scaled).all(axis=(-2, -1)))
    scaled = np.where(regular[..., None, None], scaled, identity)
    values = np.abs(np.linalg.eigvalsh(scaled))
    regular = regular & (np.min(values, axis=-1, initial=np.inf) > rounding_of_eigenvalues(values))
    scaled = np.where(regular[..., None, None], scaled, identity)
    a = np.linalg.solve(scaled, (torque / size)[..., None])[..., 0] / size
    return np.where(regular[..., None], a, np.nan)


def _definite_solution(M: Floats, torque: Floats) -> Floats | None:
    """Solve M a = torque for one sample by one call of LAPACK; None where M may be indefinite or singular.

    The eigenvalues of a positive definite matrix of unit diagonal have the sum n, so the smallest is at least
    ((n - 1) / n)^(n - 1) > 1/e times their product, the determinant. The pivots of a Cholesky factorisation,
    which needs no scaling to a unit diagonal, give that; the bound leaves room for rounding.
    """
    if len(M) < 2:
        # A quotient is exact where a square root is not.
        return np.asarray(torque / M[0]) if len(M) and 0.0 < M[0, 0] < np.inf else None
    factor, a, failed = cholesky_solver()(M, torque)
    if failed:
        return None
    determinant = prod(
        pivot * pivot / inertia
        for pivot, inertia in zip(factor.diagonal().tolist(), M.diagonal().tolist(), strict=True)
    )
    return np.asarray(a) if determinant > 1e3 * len(M) * np.finfo(np.float64).eps else None


@cache
def cholesky_solver() -> Callable[..., Any]:
    """Return LAPACK's dposv: A, b -> factor, solution, 0 or the order of the minor that is not positive."""
    # Importing it takes a tenth of a second, which most programs can save.
    from scipy.linalg.lapack import dposv

    solver: Callable[..., Any] = dposv
    return solver


def apply_matrix(matrix: Floats, vector: ArrayLike) -> Floats:
    """Return the products A x over batch axes, for A (..., m, n) and x (..., n)."""
    if matrix.ndim == 2 and type(vector) is np.ndarray and vector.ndim == 1:
        # For small arrays `dot` takes a third of the time of `matmul`.
        return np.asarray(matrix.dot(vector))
    return np.asarray((matrix @ np.asarray(vector)[..., None])[..., 0])
