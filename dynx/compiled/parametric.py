"""Dynamics with chosen parameters as arguments, one set per sample, instead of constants.

For Monte Carlo studies, identification, and robots that grasp objects: the kernel is compiled once, and every
sample of a batch may have its own inertias, payload or joint friction.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from dynx.backends.arguments import Arguments
from dynx.backends.quantities import QUANTITIES
from dynx.compiled.model_coordinates import argument_shapes, reduce_columns, reduce_rows, tree_coordinates
from dynx.compiled.robot_kernel import RobotKernels
from dynx.compiled.simplification import simplify_mechanism
from dynx.errors import ArgumentError, UnknownNameError, nearest, shown
from dynx.model import Mechanism, Model
from dynx.model.mechanism import ROOT, build_mechanism
from dynx.model.model import refuse_other_than_model
from dynx.model.numbers import checked_array
from dynx.rbd import crba, rnea
from dynx.rbd.elimination import factorize_mass_matrix, solve_with_factors
from dynx.rbd.regressor import PARAMETERS, inertia_from_parameters, link_inertia, parameters_from_inertia
from dynx.simd.program import Program
from dynx.simd.trace import trace
from dynx.spatial.inertia import RigidInertia
from dynx.spatial.scalar import Array, Floats
from dynx.spatial.so3 import skew


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

    - `links`: all ten inertial parameters of each of these links, which replace those of the model
    - `payload`: ten inertial parameters of a body fixed to this frame, about its origin and in its axes;
      zeros by default
    - `point_payload`: mass and position of a point mass fixed to this frame, in its axes
    - `joint_dynamics`: damping, dry friction and armature of every moving joint

    A batch is split over at most `threads` threads; None stands for one per processor. Raises
    UnknownNameError for an unknown link or frame, ArgumentError for a link named twice.
    """
    refuse_other_than_model(model)
    if isinstance(links, str):
        raise ArgumentError(f"links is the text {shown(links)}; wanted a list of names: [{shown(links)}]")
    selection = Selection(model, tuple(links), payload, point_payload, joint_dynamics)
    return ParametricDynamics(selection, threads=threads)


class ParametricDynamics:
    """Inverse and forward dynamics and the mass matrix of one robot, as functions of its parameters.

    Arrays are float64 with leading batch axes that broadcast: q (..., nq), v, a, tau (..., nv) and
    `parameters` (..., n) in the order of ``self.parameters.names``; the default is the model's own
    parameters. Mass and inertia may have any values, even physically impossible ones. If joint dynamics are
    parameters, they are included in every result: the torque is that of the rigid bodies, plus ``armature a +
    damping v + friction sign(v)`` of every joint, with sign(0) = 0.

    Several threads may share an object; pickling keeps the model and the options. Raises errors of
    `dynx.errors` only.
    """

    def __init__(self, selection: Selection, *, threads: int | None = None) -> None:
        """Called by `parametric`. Raises ArgumentError for an invalid number of threads."""
        self.model = selection.model
        self.parameters: Parameters = selection.parameters()
        self._selection = selection
        self._option = threads
        self._arguments = Arguments(selection.model)
        self._kernels = RobotKernels(selection.model, threads)

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
        a = self._evaluate("forward_dynamics", solve_forward_dynamics, arrays, parameters)
        return self._arguments.finite_acceleration(a)

    def mass_matrix(self, q: ArrayLike, parameters: ArrayLike | None = None) -> Floats:
        """Return M (..., nv, nv), symmetric, armature included where it is a parameter."""
        return self._evaluate("mass_matrix", _mass_matrix, [self._arguments.q(q)], parameters)

    @property
    def has_joint_dynamics(self) -> bool:
        """True if damping, dry friction and armature of the joints are parameters."""
        return self._selection.joint_dynamics

    def dry_friction(self, parameters: Floats) -> Floats:
        """Return the dry friction (n, nv) of the model's coordinates, for parameters (n, p)."""
        friction = np.zeros((len(parameters), self.model.mechanism.nv))
        if self.has_joint_dynamics:
            # The parameters of the joints are the last ones.
            moving = sum(joint.moves for joint in self.model.joints)
            first = len(self.parameters.names) - len(JOINT) * moving + JOINT.index("friction")
            friction[:, 6 if self.model.floating else 0 :] = parameters[:, first :: len(JOINT)]
        coupling = self.model.mechanism.coupling
        return friction if coupling is None else np.asarray(friction @ abs(coupling.matrix()))

    def equation(
        self, parameters: Array, q: Array, v: Array, tau: Array
    ) -> tuple[Array, Array, Array | None, Array | None]:
        """Return M, r, damping and dry friction of one sample, for arrays of symbols in a trace.

        The acceleration solves M a = r minus the torque of joint friction. Damping and friction (nv,) are
        those of the model's coordinates, and None if they are no parameters.
        """
        known = self._selection.read(parameters)
        mechanism = known.added_to(simplify_mechanism(self._selection.remainder()))
        M, r = _mass_matrix(mechanism, known.joints, q), tau - _rigid_bias(mechanism, q, v)
        if known.joints is None:
            return M, r, None, None
        base = np.zeros(6 if mechanism.floating else 0)
        damping, friction = (np.concatenate([base, known.joints[:, k]]) for k in (0, 1))
        if mechanism.coupling is not None:
            S = mechanism.coupling.matrix()
            damping, friction = (S**2).T @ damping, abs(S).T @ friction
        return M, r, damping, friction

    def root(self, parameters: Array) -> RigidInertia:
        """Return the inertia of the root and everything fixed to it, for an array of symbols."""
        return self._selection.read(parameters).added_to(self._selection.remainder()).root

    def inertia(self, parameters: Array, q: Array) -> Array:
        """Return the mass matrix (nv, nv) of one sample, for arrays of symbols in a trace."""
        known = self._selection.read(parameters)
        return _mass_matrix(known.added_to(simplify_mechanism(self._selection.remainder())), known.joints, q)

    def _evaluate(
        self, name: str, function: Callable[..., Array], arrays: list[Floats], parameters: ArrayLike | None
    ) -> Floats:
        if parameters is None:
            values = self.parameters.defaults
        else:
            values = checked_array("parameters", parameters, len(self.parameters.names))
        purpose = ("parametric", name, self._selection.choices)
        (result,) = self._kernels.evaluate(
            purpose, lambda _: _program(self._selection, name, function), [*arrays, values]
        )
        return result

    def __reduce__(self) -> tuple[object, ...]:
        return partial(ParametricDynamics, self._selection, threads=self._option), ()

    def __repr__(self) -> str:
        return f"<ParametricDynamics of {self.model.name}: {len(self.parameters.names)} parameters>"


def _program(selection: Selection, name: str, function: Callable[..., Array]) -> Program:
    """Trace `function` of the arguments of the quantity `name` and of the parameters."""
    mechanism = simplify_mechanism(selection.remainder())
    shapes = argument_shapes(mechanism, QUANTITIES[name].arguments)

    def result(parameters: Array, **state: Array) -> Array:
        known = selection.read(parameters)
        return function(known.added_to(mechanism), known.joints, *state.values())

    return trace(result, {**shapes, "parameters": (len(selection.parameters().names),)})


def _inverse_dynamics(mechanism: Mechanism, joints: Array | None, q: Array, v: Array, a: Array) -> Array:
    q, v, a = tree_coordinates(mechanism, q, v, a)
    tau = rnea.inverse_dynamics(mechanism, q, v, a)
    return reduce_columns(mechanism, tau + _joint_torque(mechanism, joints, v, a))


def _rigid_bias(mechanism: Mechanism, q: Array, v: Array) -> Array:
    return _inverse_dynamics(mechanism, None, q, v, np.zeros(len(v)))


def _mass_matrix(mechanism: Mechanism, joints: Array | None, q: Array) -> Array:
    (q,) = tree_coordinates(mechanism, q)
    M = crba.mass_matrix(mechanism, q)
    if joints is not None:
        base = 6 if mechanism.floating else 0
        for k in range(len(mechanism.bodies)):
            M[base + k, base + k] = M[base + k, base + k] + joints[k, 2]
    return reduce_rows(mechanism, reduce_columns(mechanism, M))


def solve_forward_dynamics(
    mechanism: Mechanism, joints: Array | None, q: Array, v: Array, tau: Array
) -> Array:
    """Return the acceleration (nv,) of a mechanism of symbols, by factors of its mass matrix; `joints` (n, 3)
    are damping, friction and armature."""
    bias = _inverse_dynamics(mechanism, joints, q, v, np.zeros(len(v)))
    L, D = factorize_mass_matrix(mechanism, _mass_matrix(mechanism, joints, q))
    return solve_with_factors(L, D, tau - bias)


def _joint_torque(mechanism: Mechanism, joints: Array | None, v: Array, a: Array) -> Array:
    """Return the torque of damping, friction and armature, in tree coordinates."""
    torque = np.zeros(len(v), dtype=object)
    if joints is None:
        return torque
    base = 6 if mechanism.floating else 0
    for k, (damping, friction, armature) in enumerate(joints):
        speed, change = v[base + k], a[base + k]
        torque[base + k] = damping * speed + friction * _sign(speed) + armature * change
    return torque


def _sign(x: Any) -> Any:
    # The speed of a mimic joint with multiplier 0 is a constant.
    return np.sign(x) if isinstance(x, (int, float)) else x.sign()


POINT = ("mass", "cx", "cy", "cz")
"""Parameters of a point payload: mass [kg] and centre of mass [m] in the axes of its frame."""

JOINT = ("damping", "friction", "armature")
"""Parameters of a joint: [N m s] or [N s/m], [N m] or [N], [kg m^2] or [kg]."""


@dataclass(frozen=True, eq=False)
class Parameters:
    """The parameters of a robot that are arguments.

    `names` are for example ``forearm.m``, ``tool0.payload.mcx``, ``tool0.point.mass`` and ``elbow.damping``;
    `defaults` (n,) are the model's own, zeros for a payload.
    """

    names: tuple[str, ...]
    defaults: Floats

    def index(self, name: str) -> int:
        """Return the index of a parameter on the last axis; raises UnknownNameError."""
        try:
            return self.names.index(name)
        except ValueError:
            raise UnknownNameError(f"no parameter {shown(name)}{nearest(str(name), self.names)}") from None


@dataclass(frozen=True)
class ParameterValues:
    """Bodies to add to the mechanism, by the number of the frame to which they are fixed, and damping,
    friction and armature of the joints (n, 3)."""

    bodies: tuple[tuple[int, RigidInertia], ...]
    joints: Array | None

    def added_to(self, mechanism: Mechanism) -> Mechanism:
        """Return the mechanism with these bodies rigidly connected to it."""
        inertia = {ROOT: mechanism.root, **{k: body.inertia for k, body in enumerate(mechanism.bodies)}}
        for number, added in self.bodies:
            frame = mechanism.frames[number]
            inertia[frame.body] = inertia[frame.body] + added.transform(frame.R, frame.p)
        bodies = tuple(replace(body, inertia=inertia[k]) for k, body in enumerate(mechanism.bodies))
        return replace(mechanism, root=inertia[ROOT], bodies=bodies)


@dataclass(frozen=True)
class Selection:
    """Parameters of `model` that are arguments; checked when it is constructed."""

    model: Model
    links: tuple[str, ...]
    payload: str | None
    point_payload: str | None
    joint_dynamics: bool

    def __post_init__(self) -> None:
        for link in self.links:
            self.model.link(link)
            if self.links.count(link) > 1:
                raise ArgumentError(f"link {shown(link)} is named twice")
        for frame in (self.payload, self.point_payload):
            if frame is not None:
                self.model.frame_index(frame)

    @property
    def choices(self) -> tuple[object, ...]:
        """All fields except the model."""
        return self.links, self.payload, self.point_payload, self.joint_dynamics

    def parameters(self) -> Parameters:
        """Return the names and defaults of the parameters."""
        names: list[str] = []
        defaults: list[Floats] = []
        for link in self.links:
            names += [f"{link}.{name}" for name in PARAMETERS]
            defaults.append(parameters_from_inertia(link_inertia(self.model, link)))
        if self.payload is not None:
            names += [f"{self.payload}.payload.{name}" for name in PARAMETERS]
            defaults.append(np.zeros(len(PARAMETERS)))
        if self.point_payload is not None:
            names += [f"{self.point_payload}.point.{name}" for name in POINT]
            defaults.append(np.zeros(len(POINT)))
        if self.joint_dynamics:
            for joint in self.model.joints:
                if joint.moves:
                    own = joint.dynamics
                    names += [f"{joint.name}.{name}" for name in JOINT]
                    defaults.append(np.array([own.damping, own.friction, own.armature]))
        whole = np.concatenate(defaults) if defaults else np.zeros(0)
        whole.setflags(write=False)
        return Parameters(tuple(names), whole)

    def remainder(self) -> Mechanism:
        """Return the mechanism without the links whose inertia is an argument."""
        links = [
            replace(link, inertial=None) if link.name in self.links else link for link in self.model.links
        ]
        return build_mechanism(replace(self.model, links=tuple(links)))

    def read(self, parameters: Array) -> ParameterValues:
        """Return the values in an array (n,) of parameters."""
        values = iter(parameters)
        bodies = [
            (self.model.frame_index(link), inertia_from_parameters(_next(values, 10))) for link in self.links
        ]
        if self.payload is not None:
            bodies.append((self.model.frame_index(self.payload), inertia_from_parameters(_next(values, 10))))
        if self.point_payload is not None:
            mass, *center = _next(values, len(POINT))
            bodies.append((self.model.frame_index(self.point_payload), point_mass(mass, np.array(center))))
        if not self.joint_dynamics:
            return ParameterValues(tuple(bodies), None)
        moving = sum(joint.moves for joint in self.model.joints)
        return ParameterValues(tuple(bodies), _next(values, len(JOINT) * moving).reshape(moving, len(JOINT)))


def _next(values: Iterator[object], count: int) -> Array:
    return np.array([next(values) for _ in range(count)], dtype=object)


def point_mass(mass: object, center: Array) -> RigidInertia:
    """Return the inertia of a mass [kg] at a place (3,) [m] about the origin, for any scalar."""
    C = skew(center)
    return RigidInertia(np.asarray(mass), center * mass, -(C @ C) * mass)


class ScaledLinks:
    """A robot whose links are scaled in mass and inertia, and which carries a point mass on a frame.

    `parametric` has all ten parameters of a link as inputs; a factor on a link takes a tenth of the
    operations, because the constants of the link are placed in its body before they are scaled.
    """

    def __init__(self, model: Model, links: Sequence[str], payload: str | None = None) -> None:
        """Raises UnknownNameError for a link or a frame, ArgumentError for a link that is named twice."""
        self._selection = Selection(model, tuple(links), None, payload, joint_dynamics=False)

    @cached_property
    def _constant(self) -> Mechanism:
        return simplify_mechanism(self._selection.remainder())

    @cached_property
    def _placed(self) -> list[tuple[int, RigidInertia]]:
        """The body of each link, and the link's inertia in it."""
        model, mechanism, placed = self._selection.model, self._constant, []
        for link in self._selection.links:
            frame = mechanism.frames[model.frame_index(link)]
            placed.append((frame.body, link_inertia(model, link).transform(frame.R, frame.p)))
        return placed

    def forward_dynamics(
        self, factors: Sequence[Any], payload: Sequence[Any], q: Array, v: Array, tau: Array
    ) -> Array:
        """Return the acceleration (nv,), for one factor of each link, and mass [kg] and place [m] (4,) of the
        payload in its frame; arrays of symbols of a trace."""
        mechanism = self._constant
        inertia = {ROOT: mechanism.root, **{k: body.inertia for k, body in enumerate(mechanism.bodies)}}
        for (body, own), factor in zip(self._placed, factors, strict=True):
            inertia[body] = inertia[body] + RigidInertia(
                own.mass * factor, own.first_moment * factor, own.rotational_inertia * factor
            )
        if self._selection.point_payload is not None:
            frame = mechanism.frames[self._selection.model.frame_index(self._selection.point_payload)]
            carried = point_mass(payload[0], np.array(payload[1:], dtype=object))
            inertia[frame.body] = inertia[frame.body] + carried.transform(frame.R, frame.p)
        bodies = tuple(replace(body, inertia=inertia[k]) for k, body in enumerate(mechanism.bodies))
        varied = replace(mechanism, root=inertia[ROOT], bodies=bodies)
        return solve_forward_dynamics(varied, None, q, v, tau)
