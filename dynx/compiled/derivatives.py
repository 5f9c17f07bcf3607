"""Derivatives of the dynamics and of poses, exact, compiled for one robot.

They come from differentiating the graph of the algorithm itself (`dynx.simd.differentiate`), so there is
no step to choose and no second text that could differ from the first. With mimic joints the derivative
is that of the reduced robot.

Forward dynamics is differentiated by the implicit function theorem: at a = FD(q, v, tau) the torque
ID(q, v, a) stays tau, so

    da/dq = -M^-1 dID/dq,    da/dv = -M^-1 dID/dv,    da/dtau = M^-1.

That is as exact as differentiating the articulated-body algorithm, whose graph gives several times the
code (`tests/compiled/test_derivatives.py` holds the ratio): the inverse of M is shared by all columns.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from dynx.backends.arguments import Arguments
from dynx.backends.registry import refuse_other_than_model
from dynx.backends.solvability import Solvability
from dynx.compiled import derivative_programs as programs
from dynx.compiled.kernels import tidied
from dynx.compiled.robot_kernel import evaluated, robot_kernel
from dynx.model import Mechanism, Model
from dynx.simd.kernel import Kernel
from dynx.simd.program import Program
from dynx.simd.threads import checked_threads
from dynx.spatial.scalar import Floats

SOLVED_AT_ONCE = 12
"""Degrees of freedom up to which one kernel does all of forward dynamics' derivatives; its code grows
with their cube. Beyond, systems of equations are solved one side after the other."""

MANY = 64
"""Samples from which on systems of equations are solved column by column for all samples at once, rather
than sample by sample for all columns."""


class InverseDynamicsDerivatives(NamedTuple):
    """Of the torque, each (..., nv, nv): row i belongs to tau[i], column j to what it is derived by."""

    dtau_dq: Floats
    dtau_dv: Floats
    dtau_da: Floats


class ForwardDynamicsDerivatives(NamedTuple):
    """Of the acceleration, each (..., nv, nv): row i belongs to a[i]."""

    da_dq: Floats
    da_dv: Floats
    da_dtau: Floats


class Derivatives:
    """Partial derivatives for one robot, of single samples and of batches.

    Arrays are float64 with leading batch axes that broadcast, as in `Backend`. A derivative by q is one
    by a displacement d (nv,) in the coordinates of v: f(model.integrate(q, d)) at d = 0. With a floating
    base these are translation and rotation in the axes of the base; without one, plain partial
    derivatives. Units are those of the one over those of the other.

    Rigid bodies alone: damping, friction, armature and external forces have no part in it.

    `threads` bounds how many threads a batch is split over; None stands for all processors. Kernels are
    compiled when they are first asked for and kept in the cache of `dynx.simd.cache`. Safe to use from
    several threads; pickled by its recipe. Raises errors of `dynx.errors` only.
    """

    def __init__(self, model: Model, *, threads: int | None = None) -> None:
        """Raises ArgumentError for what is no model, or a number of threads that is none."""
        refuse_other_than_model(model)
        self.model = model
        self._option = threads
        self._threads = checked_threads(threads)
        self._arguments = Arguments(model)
        self._solvability = Solvability(model)
        self._kernels: dict[object, Kernel] = {}
        self._making = threading.Lock()

    def inverse_dynamics_derivatives(
        self, q: ArrayLike, v: ArrayLike, a: ArrayLike
    ) -> InverseDynamicsDerivatives:
        """Of tau = M a + bias by q, v and a; the last is the mass matrix."""
        kernel = self._kernel("inverse_dynamics", programs.inverse_dynamics_derivatives)
        return InverseDynamicsDerivatives(*evaluated(kernel, self._checked(q, v, a, "a"), self._threads))

    def forward_dynamics_derivatives(
        self, q: ArrayLike, v: ArrayLike, tau: ArrayLike
    ) -> ForwardDynamicsDerivatives:
        """Of a = M^-1 (tau - bias) by q, v and tau; the last is the inverse of the mass matrix.

        Raises SingularMassMatrixError, which names the joints, where a joint moves no inertia.
        """
        arrays = self._checked(q, v, tau, "tau")
        self._solvability.refuse_singular(joint_dynamics=False)
        if self.model.nv <= SOLVED_AT_ONCE:
            kernel = self._kernel("forward_dynamics", programs.forward_dynamics_derivatives)
            found = evaluated(kernel, arrays, self._threads)
            return ForwardDynamicsDerivatives(*map(self._arguments.finite_acceleration, found))
        (a,) = evaluated(self._kernel("acceleration", programs.acceleration), arrays, self._threads)
        self._arguments.finite_acceleration(a)
        dtau_dq, dtau_dv, M = self.inverse_dynamics_derivatives(arrays[0], arrays[1], a)
        nv = self.model.nv
        (factors,) = evaluated(
            self._kernel("factors", programs.factors_of_mass),
            [M.reshape(*a.shape[:-1], nv * nv)],
            self._threads,
        )
        return ForwardDynamicsDerivatives(
            self._solved(factors, -dtau_dq),
            self._solved(factors, -dtau_dv),
            self._solved(factors, np.broadcast_to(np.eye(nv), M.shape)),
        )

    def forward_kinematics_derivative(self, q: ArrayLike, frame: str) -> Floats:
        """Of T_world_frame by q: (..., 4, 4, nv), the last axis being what it is derived by."""
        index = self.model.frame_index(frame)
        kernel = self._kernel(("pose", index), lambda mechanism: programs.pose_derivative(mechanism, index))
        (derivative,) = evaluated(kernel, [self._arguments.q(q)], self._threads)
        return derivative

    def _solved(self, factors: Floats, b: Floats) -> Floats:
        """M^-1 b for matrices b (..., nv, nv), from the factors of M."""
        kernel, (nv, columns) = self._kernel("solution", programs.solution_by_factors), b.shape[-2:]
        sides = np.ascontiguousarray(np.swapaxes(b, -1, -2)).reshape(-1, columns, nv)
        factors = factors.reshape(len(sides), factors.shape[-1])
        found = np.empty_like(sides)
        if len(sides) < MANY:
            for k in range(len(sides)):
                kernel([np.broadcast_to(factors[k], (columns, factors.shape[-1])), sides[k]], [found[k]])
        else:
            for c in range(columns):
                kernel([factors, sides[:, c]], [found[:, c]], threads=self._threads)
        return np.swapaxes(found, -1, -2).reshape(b.shape)

    def _checked(self, q: ArrayLike, v: ArrayLike, x: ArrayLike, name: str) -> list[Floats]:
        return [self._arguments.q(q), self._arguments.v(v), self._arguments.v(x, name)]

    def _kernel(self, question: object, program: Callable[[Mechanism], Program]) -> Kernel:
        kernel = self._kernels.get(question)
        if kernel is None:
            with self._making:
                kernel = self._kernels.get(question)
                if kernel is None:
                    mechanism = tidied(self.model.mechanism)
                    kernel = robot_kernel(self.model, ("derivatives", question), lambda: program(mechanism))
                    self._kernels[question] = kernel
        return kernel

    def __reduce__(self) -> tuple[Callable[..., Derivatives], tuple[Model, int | None]]:
        return _rebuild, (self.model, self._option)

    def __repr__(self) -> str:
        return f"<Derivatives of {self.model.name}>"


def _rebuild(model: Model, threads: int | None) -> Derivatives:
    return Derivatives(model, threads=threads)
