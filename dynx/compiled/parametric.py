"""Dynamics with chosen parameters as arguments, one set per sample, instead of constants.

For Monte Carlo studies, identification, and robots that grasp objects: the kernel is compiled once, and every
sample of a batch may have its own inertias, payload or joint friction.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property, partial

import numpy as np
from numpy.typing import ArrayLike

from dynx.argument_types import checks_types
from dynx.backends.arguments import Arguments
from dynx.backends.quantities import QUANTITIES
from dynx.compiled.model_coordinates import argument_shapes, reduce_columns, reduce_rows, tree_coordinates
from dynx.compiled.robot_kernel import RobotKernels
from dynx.compiled.simplification import simplify_mechanism
from dynx.errors import ArgumentError, shown
from dynx.model import Mechanism, Model
from dynx.model.elements import JointCoefficients
from dynx.model.numbers import checked_array
from dynx.rbd import crba, rnea
from dynx.rbd.elimination import factorize_mass_matrix, solve_with_factors
from dynx.rbd.parameters import Parameters
from dynx.simd.program import Program
from dynx.simd.trace import trace
from dynx.spatial.inertia import RigidInertia
from dynx.spatial.scalar import Array, Floats, sign


@checks_types
def parametric(
    model: Model,
    *,
    links: Sequence[str] = (),
    payload: str | None = None,
    point_payload: str | None = None,
    joint_dynamics: bool = False,
    threads: int | None = None,
) -> ParametricDynamics:
    """Return the dynamics of `model` with parameters as arguments.

    These options choose the parameters:

    - `links`: the ten inertial parameters of each of these links. They replace the parameters of the model
    - `payload`: the ten inertial parameters of a body that is fixed to this frame, about the origin of the
      frame and in its axes. The default values are zeros
    - `point_payload`: mass and position of a point mass that is fixed to this frame, in the axes of the frame
    - `joint_dynamics`: damping, dry friction and armature of every moving joint, and the springs of the
      joints if the robot has any

    A batch is split over at most `threads` threads; None stands for one per processor. Raises
    UnknownNameError for an unknown link or frame, ArgumentError for a link named twice.
    """
    if isinstance(links, str):
        raise ArgumentError(f"links is the text {shown(links)}; wanted a list of names: [{shown(links)}]")
    parameters = Parameters(
        model,
        tuple(links),
        payload=payload,
        point_payload=point_payload,
        joint_dynamics=joint_dynamics,
    )
    return ParametricDynamics(parameters, threads=threads)


@checks_types
class ParametricDynamics:
    """Inverse and forward dynamics and the mass matrix of one robot, as functions of its parameters.

    Arrays are float64 with leading batch axes that broadcast: q (..., nq), v, a, tau (..., nv) and
    `parameters` (..., n) in the order of ``self.parameters.names``; the default is the model's own
    parameters. Mass and inertia may have any values, even physically impossible ones. If joint dynamics are
    parameters, they are included in every result: the torque is that of the rigid bodies, plus ``armature a +
    damping v + friction sign(v) + stiffness (q - spring_reference)`` of every joint, with sign(0) = 0.

    Several threads may share an object; pickling keeps the model and the options. Raises errors of
    `dynx.errors` only.
    """

    def __init__(self, parameters: Parameters, *, threads: int | None = None) -> None:
        """Called by `parametric`. Raises ArgumentError for an invalid number of threads."""
        self.model = parameters.model
        self.parameters = parameters
        """Names and defaults of the parameters."""
        self._option = threads
        self._arguments = Arguments(self.model)
        self._kernels = RobotKernels(self.model, threads)

    def inverse_dynamics(
        self, q: ArrayLike, v: ArrayLike, a: ArrayLike, parameters: ArrayLike | None = None
    ) -> Floats:
        """Return the torque (..., nv) that gives acceleration `a`."""
        arrays = [self._arguments.q(q), self._arguments.v(v), self._arguments.v(a, "a")]
        return self._evaluate("inverse_dynamics", _inverse_dynamics, arrays, parameters)

    def forward_dynamics(
        self, q: ArrayLike, v: ArrayLike, tau: ArrayLike, parameters: ArrayLike | None = None
    ) -> Floats:
        """Return the acceleration (..., nv) that `tau` gives, by factors of the mass matrix.

        Raises SingularMassMatrixError where the mass matrix is singular.
        """
        arrays = [self._arguments.q(q), self._arguments.v(v), self._arguments.v(tau, "tau")]
        a = self._evaluate("forward_dynamics", _forward_dynamics, arrays, parameters)
        return self._arguments.finite_acceleration(a)

    def mass_matrix(self, q: ArrayLike, parameters: ArrayLike | None = None) -> Floats:
        """Return M (..., nv, nv), symmetric, armature included where it is a parameter."""
        return self._evaluate("mass_matrix", _mass_matrix, [self._arguments.q(q)], parameters)

    @property
    def has_joint_dynamics(self) -> bool:
        """True if damping, dry friction, armature and springs of the joints are parameters."""
        return self.parameters.joint_dynamics

    def dry_friction(self, parameters: Floats) -> Floats:
        """Return the dry friction (n, nv) of the model's coordinates, for parameters (n, p)."""
        joints = self.parameters.joints(parameters)
        return np.zeros((len(parameters), self.model.nv)) if joints is None else joints.friction

    def equation(
        self, parameters: Array, q: Array, v: Array, tau: Array
    ) -> tuple[Array, Array, JointCoefficients | None]:
        """Return M with armature, r and the coefficients of one sample, for arrays of symbols in a trace.

        The acceleration solves M a = r minus the torque of damping and dry friction; r has the torque of
        springs. The coefficients of damping and dry friction are None if they are no parameters.
        """
        mechanism, joints = self._with(parameters), self.parameters.joints(parameters)
        bias = _inverse_dynamics(mechanism, None, q, v, np.zeros(len(v)))
        if joints is not None and joints.springs is not None:
            tau = tau + joints.springs.torque(q)
        return _mass_matrix(mechanism, joints, q), tau - bias, joints

    def root(self, parameters: Array) -> RigidInertia:
        """Return the inertia of the root and everything fixed to it, for an array of symbols."""
        return self.parameters.mechanism(self.parameters.remainder(), parameters).root

    def inertia(self, parameters: Array, q: Array) -> Array:
        """Return the mass matrix (nv, nv) of one sample, for arrays of symbols in a trace."""
        return _mass_matrix(self._with(parameters), self.parameters.joints(parameters), q)

    def acceleration(self, parameters: Array, q: Array, v: Array, tau: Array) -> Array:
        """Return the acceleration (nv,) of one sample, for arrays of symbols in a trace."""
        joints = self.parameters.joints(parameters)
        return _forward_dynamics(self._with(parameters), joints, q, v, tau)

    def _with(self, parameters: Array) -> Mechanism:
        return self.parameters.mechanism(self._remainder, parameters)

    @cached_property
    def _remainder(self) -> Mechanism:
        return simplify_mechanism(self.parameters.remainder())

    def _evaluate(
        self, name: str, function: Callable[..., Array], arrays: list[Floats], parameters: ArrayLike | None
    ) -> Floats:
        if parameters is None:
            values = self.parameters.defaults
        else:
            values = checked_array("parameters", parameters, len(self.parameters.names))
        purpose = ("parametric", name, self.parameters.choices)
        (result,) = self._kernels.evaluate(
            purpose, lambda _: self._program(name, function), [*arrays, values]
        )
        return result

    def _program(self, name: str, function: Callable[..., Array]) -> Program:
        """Trace `function` of the arguments of the quantity `name` and of the parameters."""
        shapes = argument_shapes(self._remainder, QUANTITIES[name].arguments)

        def result(parameters: Array, **state: Array) -> Array:
            return function(self._with(parameters), self.parameters.joints(parameters), *state.values())

        return trace(result, {**shapes, "parameters": (len(self.parameters.names),)})

    def __reduce__(self) -> tuple[object, ...]:
        return partial(ParametricDynamics, self.parameters, threads=self._option), ()

    def __repr__(self) -> str:
        return f"<ParametricDynamics of {self.model.name}: {len(self.parameters.names)} parameters>"


def _inverse_dynamics(
    mechanism: Mechanism, joints: JointCoefficients | None, q: Array, v: Array, a: Array
) -> Array:
    tree = tree_coordinates(mechanism, q, v, a)
    tau = reduce_columns(mechanism, rnea.inverse_dynamics(mechanism, *tree))
    if joints is not None:
        moving = slice(6 if mechanism.floating else 0, None)
        damping, friction, armature = (each[moving] for each in joints[:3])
        tau[moving] = tau[moving] + damping * v[moving] + friction * sign(v[moving]) + armature * a[moving]
        if joints.springs is not None:
            tau[moving] = tau[moving] - joints.springs.torque(q)[moving]
    return tau


def _mass_matrix(mechanism: Mechanism, joints: JointCoefficients | None, q: Array) -> Array:
    (tree_q,) = tree_coordinates(mechanism, q)
    M = reduce_rows(mechanism, reduce_columns(mechanism, crba.mass_matrix(mechanism, tree_q)))
    if joints is not None:
        for k in range(6 if mechanism.floating else 0, len(M)):
            M[k, k] = M[k, k] + joints.armature[k]
    return M


def _forward_dynamics(
    mechanism: Mechanism, joints: JointCoefficients | None, q: Array, v: Array, tau: Array
) -> Array:
    bias = _inverse_dynamics(mechanism, joints, q, v, np.zeros(len(v)))
    L, D = factorize_mass_matrix(mechanism, _mass_matrix(mechanism, joints, q))
    return solve_with_factors(L, D, tau - bias)
