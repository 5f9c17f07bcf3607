"""Exact derivatives of the dynamics and of poses, compiled for one robot.

There is no step size. For small robots the graph of the algorithm itself is differentiated
(`dynx.simd.differentiate`); for others a closed form (`dynx.rbd.derivatives`) gives shorter code. For large
ones that is evaluated by routines, which are compiled once for all robots (`dynx.compiled.table_loops`), and
for large ones with ball joints by NumPy. With mimic joints, derivatives are by the coordinates of the model.

Forward dynamics is differentiated by the implicit function theorem: at a = FD(q, v, tau) the torque
ID(q, v, a) stays tau, so

    da/dq = -M^-1 dID/dq,    da/dv = -M^-1 dID/dv,    da/dtau = M^-1.

That is as exact as differentiating the articulated-body algorithm, but takes several times less code
(`tests/compiled/test_derivatives.py` measures the ratio), because all columns share the inverse of M.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property, partial
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from dynx.argument_types import checks_types
from dynx.backends.arguments import Arguments
from dynx.backends.evaluation import common_batch
from dynx.backends.solvability import Solvability
from dynx.compiled import derivative_programs as programs
from dynx.compiled.backend import CompiledBackend
from dynx.compiled.model_coordinates import reduce_columns, reduce_rows, tree_coordinates
from dynx.compiled.robot_kernel import Making, RobotKernels
from dynx.compiled.simplification import simplify_mechanism
from dynx.compiled.table_kernels import derivatives_kernel
from dynx.model import Model
from dynx.rbd.derivatives import inverse_dynamics_derivatives
from dynx.simd.call_table import TableKernel
from dynx.spatial.scalar import Floats

MAX_NV_OF_ONE_KERNEL = 12
"""Largest number of degrees of freedom for which one kernel computes all derivatives of forward dynamics;
its code grows with the cube of that number. For larger robots, the equations are solved one right-hand
side at a time."""

MAX_COMPILED_PAIRS = 250
"""Largest number of pairs of a joint and an ancestor, coordinates of a floating base included, for which the
derivatives of inverse dynamics are compiled for one robot. Routines are faster for larger robots: reading
long code from memory takes longer than computing."""

MIN_SAMPLES_BY_COLUMN = 64
"""Smallest number of samples at which systems of equations are solved column by column for all samples at
once, rather than sample by sample for all columns."""


class InverseDynamicsDerivatives(NamedTuple):
    """Derivatives of the torque, each (..., nv, nv): rows count the torques, columns the variables."""

    dtau_dq: Floats
    dtau_dv: Floats
    dtau_da: Floats


class ForwardDynamicsDerivatives(NamedTuple):
    """Derivatives of the acceleration, each (..., nv, nv): rows count the accelerations."""

    da_dq: Floats
    da_dv: Floats
    da_dtau: Floats


@checks_types
class Derivatives:
    """Partial derivatives of the kinematics and dynamics of one robot, for single samples and for batches.

    Arrays are float64 with leading batch axes that broadcast, as in `Backend`. The derivative of f(q) is the
    derivative of f(model.integrate(q, d)) with respect to the displacement d (nv,) at d = 0. For joints this
    is the ordinary partial derivative. For a floating base, d contains a translation and a rotation in the
    axes of the base. The unit is the unit of f divided by the unit of the variable.

    The derivatives do not include damping, friction, armature, springs and external forces.

    A batch is split over at most `threads` threads; None stands for one per processor. Kernels are compiled
    when they are first needed and kept in the cache of `dynx.simd.cache`. Several threads may share an
    object; pickling keeps the model and the options. Raises errors of `dynx.errors` only.
    """

    def __init__(self, model: Model, *, threads: int | None = None) -> None:
        """Raises ArgumentError for an argument that is not a Model, and for an invalid number of threads."""
        self.model = model
        self._option = threads
        self._kernels = RobotKernels(model, threads)
        self._arguments = Arguments(model)
        self._solvability = Solvability(model)
        self._engine = CompiledBackend(model, threads=threads)

    def inverse_dynamics_derivatives(
        self, q: ArrayLike, v: ArrayLike, a: ArrayLike
    ) -> InverseDynamicsDerivatives:
        """Return the derivatives of tau = M a + bias with respect to q, v and a; the last is the mass
        matrix."""
        arrays = self._checked(q, v, a, "a")
        if programs.pair_count(self.model.mechanism) > MAX_COMPILED_PAIRS:
            return self._by_routines(arrays)
        found = self._evaluate("inverse_dynamics", programs.inverse_dynamics_derivatives, arrays)
        return InverseDynamicsDerivatives(*found)

    def forward_dynamics_derivatives(
        self, q: ArrayLike, v: ArrayLike, tau: ArrayLike
    ) -> ForwardDynamicsDerivatives:
        """Return the derivatives of a = M^-1 (tau - bias) with respect to q, v and tau; the last is the
        inverse of the mass matrix.

        Raises SingularMassMatrixError, which names the joints, if nothing that a joint moves has inertia.
        """
        arrays = self._checked(q, v, tau, "tau")
        self._solvability.refuse_singular(joint_dynamics=False)
        if self.model.nv <= MAX_NV_OF_ONE_KERNEL:
            found = self._evaluate("forward_dynamics", programs.forward_dynamics_derivatives, arrays)
            return ForwardDynamicsDerivatives(*map(self._arguments.finite_acceleration, found))
        a = self._engine.forward_dynamics(*arrays)
        dtau_dq, dtau_dv, M = self.inverse_dynamics_derivatives(arrays[0], arrays[1], a)
        nv = self.model.nv
        entries = M.reshape(*a.shape[:-1], nv * nv)
        (factors,) = self._evaluate("factors", programs.factors_of_mass, [entries])
        return ForwardDynamicsDerivatives(
            self._solve(factors, -dtau_dq),
            self._solve(factors, -dtau_dv),
            self._solve(factors, np.broadcast_to(np.eye(nv), M.shape)),
        )

    @checks_types
    def forward_kinematics_derivative(self, q: ArrayLike, frame: str) -> Floats:
        """Return the derivative of T_world_frame with respect to q (..., 4, 4, nv); the last axis counts
        entries of v."""
        index = self.model.frame_index(frame)
        program = partial(programs.pose_derivative, frame=index)
        (derivative,) = self._evaluate(("pose", index), program, [self._arguments.q(q)])
        return derivative

    def _by_routines(self, arrays: list[Floats]) -> InverseDynamicsDerivatives:
        mechanism = self.model.mechanism
        if mechanism.balls:
            # Routines have no ball joints: NumPy evaluates the closed form.
            arrays = [np.broadcast_to(x, (*common_batch(*arrays), x.shape[-1])) for x in arrays]
            return InverseDynamicsDerivatives(*inverse_dynamics_derivatives(mechanism, *arrays))
        found = self._kernels.run(self._routines, list(tree_coordinates(mechanism, *arrays)))
        if mechanism.coupling is None:
            return InverseDynamicsDerivatives(*found)
        by_q, by_v, M = (reduce_rows(mechanism, reduce_columns(mechanism, matrix)) for matrix in found)
        # Products of matrices are symmetric to rounding only.
        return InverseDynamicsDerivatives(by_q, by_v, (M + np.swapaxes(M, -1, -2)) / 2)

    @cached_property
    def _routines(self) -> TableKernel:
        return derivatives_kernel(replace(simplify_mechanism(self.model.mechanism), coupling=None))

    def _solve(self, factors: Floats, b: Floats) -> Floats:
        """Solve M x = b for matrices b (..., nv, nv), from the factors of M."""
        nv, columns = b.shape[-2:]
        kernel = self._kernels.kernel(("derivatives", "solution"), programs.solution_by_factors)
        sides = np.ascontiguousarray(np.swapaxes(b, -1, -2)).reshape(-1, columns, nv)
        factors = factors.reshape(len(sides), factors.shape[-1])
        found = np.empty_like(sides)
        if len(sides) < MIN_SAMPLES_BY_COLUMN:
            for k in range(len(sides)):
                kernel([np.broadcast_to(factors[k], (columns, factors.shape[-1])), sides[k]], [found[k]])
        else:
            for c in range(columns):
                kernel([factors, sides[:, c]], [found[:, c]], threads=self._kernels.threads)
        return np.swapaxes(found, -1, -2).reshape(b.shape)

    def _checked(self, q: ArrayLike, v: ArrayLike, x: ArrayLike, name: str) -> list[Floats]:
        return [self._arguments.q(q), self._arguments.v(v), self._arguments.v(x, name)]

    def _evaluate(self, purpose: object, program: Making, arrays: list[Floats]) -> list[Floats]:
        return self._kernels.evaluate(("derivatives", purpose), program, arrays)

    def __reduce__(self) -> tuple[object, ...]:
        return partial(Derivatives, self.model, threads=self._option), ()

    def __repr__(self) -> str:
        return f"<Derivatives of {self.model.name}>"
