"""The text of one step of a closed loop: controller, plant and integrator, traced together.

A controller is array code. Here it runs on symbols. With `dynx.rbd` in place of its backend it becomes one
kernel together with the dynamics of the plant: what both need, such as sines and cosines, is computed once.
Batches use this kernel for all their rollouts, single rollouts on the plant ``compiled`` one lane of it.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Mapping
from dataclasses import dataclass, fields
from functools import cached_property, partial
from math import prod
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dynx.backends.dynamics import MATRICES, QUANTITIES, Dynamics, EngineDynamics, Evaluation
from dynx.backends.joint_friction import JointFriction
from dynx.compiled.array_dynamics import ArrayDynamics
from dynx.compiled.kernels import evaluate_quantity
from dynx.compiled.parametric import ParametricDynamics
from dynx.compiled.simplification import simplify_mechanism
from dynx.compiled.status import Status
from dynx.compiled.step import StepText, position_excess
from dynx.control.base import Controller, chain_of, gains_of, rebind
from dynx.control.content import attributes_of, content_of, fields_of, is_foreign
from dynx.errors import ArgumentError, TraceError, UnsupportedFeatureError, shown
from dynx.model import Mechanism, Model
from dynx.model.elements import JointSprings
from dynx.model.numbers import is_real
from dynx.rbd.elimination import factorize_mass_matrix, solve_with_factors
from dynx.rbd.integration import SemiImplicitEuler
from dynx.rbd.joint_friction import FrictionLaw, FrictionStep, damped_equation
from dynx.sim.controller_checks import (
    ControllerWatch,
    defect_of_next_state,
    defect_of_outcome,
    defect_of_torque,
    is_row,
)
from dynx.sim.own_controllers import refuse_irreproducible, traced_torque
from dynx.sim.plants.disturbances import Disturbances
from dynx.sim.plants.integrated import IntegratedPlant
from dynx.sim.step import MAX_SQUARED_SPEED, at_limit, measure, squared_speed, torque_sum, with_disturbances
from dynx.simd.call_sequence import Integers
from dynx.simd.cuts import CutStep, EngineCall, EngineCallTracer
from dynx.simd.user_code.arrays import is_traced, symbol_array, traced_array
from dynx.simd.user_code.numbers import as_symbol, as_traced, select
from dynx.spatial.manifold import difference
from dynx.spatial.scalar import Array, Floats, clamp, tanh
from dynx.steppers.forces import ExternalForce
from dynx.trajectory.base import Setpoint

MAX_FLOAT = float(np.finfo(np.float64).max)
"""Largest finite number."""

MAX_NV_WITHOUT_PUSHES = 32
"""Largest number of coordinates for which steps without a push have a kernel of their own: it saves computing
the place where pushes act, but compiles for seconds if the robot is larger."""

WRENCH = 6
"""Size of the wrench of one push."""

PLACEHOLDER = 1.0
"""Value in `Disturbances` of a coefficient that each rollout has as an input of the kernel."""

CONTROLLER, PLANT = "controller", "plant"
"""Origins of the engine calls of a step."""

SETPOINT = ("q_wanted", "v_wanted", "a_wanted")
"""Names of the inputs of the setpoint of a control step."""


@dataclass(frozen=True)
class ArrayDisturbances:
    """Friction, springs, armature and pushes of a plant, as array code.

    They mean the same as on floats (`dynx.sim.plants.disturbances`). Coefficients of joints that differ
    between rollouts are inputs of the step; all others are constants in it.
    """

    model: Model
    joint_friction: JointFriction
    armature: Floats
    """Armature (nv,) [kg m^2 or kg], added to the diagonal of the mass matrix."""
    varied: Mapping[str, int]
    """Number of joints with a coefficient that differs between rollouts, by the name of the coefficient."""
    pushes: tuple[ExternalForce, ...]
    springs: JointSprings | None = None

    @classmethod
    def of(cls, model: Model, disturbances: Disturbances, varied: Mapping[str, Floats]) -> ArrayDisturbances:
        """Make the disturbances of a batch; `varied` has the coefficients (n, joints) for placeholders."""
        sizes = {name: rows.shape[1] for name, rows in varied.items()}
        # Each joint depends on at most one coordinate, so the armature matrix is diagonal.
        armature = disturbances.armature.diagonal().copy()
        return cls(model, disturbances.friction, armature, sizes, disturbances.pushes, disturbances.springs)

    def sizes(self, *, pushed: bool) -> dict[str, int]:
        """Return the inputs of the kernel for friction, armature and pushes, and their sizes."""
        return {**self.varied, **({"wrenches": WRENCH * len(self.pushes)} if pushed else {})}

    def wrenches(self, dt: float, steps: Integers) -> Floats:
        """Return the wrenches of the pushes in steps of `dt` [s] (n, 6 per push), zero for idle pushes."""
        times = (steps * dt).tolist()
        shares = np.array([[push.share(t, dt) for push in self.pushes] for t in times])
        strength = np.array([push.wrench for push in self.pushes], dtype=np.float64)
        return np.asarray((shares[:, :, None] * strength).reshape(len(steps), -1))

    @property
    def sticks(self) -> bool:
        """True if joint friction is solved for at the end of each step."""
        return self.joint_friction.sticks

    def added_to(
        self,
        tau: Array,
        mechanism: Mechanism,
        q: Array,
        v: Array,
        given: Mapping[str, Array],
        *,
        pushed: bool,
    ) -> Array:
        """Return `tau` minus the torque of friction with a slip speed plus that of springs and pushes
        (nv,)."""
        if self.springs is not None:
            tau = tau + self.springs.torque(q)
        friction, pushes = self.joint_friction, []
        if pushed:
            for push, wrench in zip(self.pushes, given["wrenches"].reshape(-1, WRENCH), strict=True):
                frame = self.model.frame_index(push.on)
                if push.has_point:
                    T = evaluate_quantity(mechanism, "forward_kinematics", (frame,), q)
                    wrench = push.at_origin(wrench, T[:3, :3])
                J = evaluate_quantity(mechanism, "jacobian", (frame, push.reference), q)
                pushes.append((J, wrench))
        smooth = friction.torque_for(v, *self._coefficients(given)) if friction.smooth else None
        return with_disturbances(tau, smooth, pushes)

    def friction_of(self, given: Mapping[str, Array]) -> tuple[Array, Array]:
        """Return damping and dry friction (nv,) of the model's coordinates, where there is no slip speed."""
        nothing = np.zeros(self.model.nv)
        if not self.sticks:
            return nothing, nothing
        damping, friction = self._coefficients(given)
        return self.joint_friction.viscous_for(damping), self.joint_friction.dry_for(friction)

    def _coefficients(self, given: Mapping[str, Array]) -> tuple[Array, Array]:
        own = self.joint_friction
        return (
            self._in_place("joint_damping", own.damping, given),
            self._in_place("joint_friction", own.friction, given),
        )

    def armature_of(self, given: Mapping[str, Array]) -> Array:
        """Return the armature (nv,)."""
        return self._in_place("joint_armature", self.armature, given)

    def _in_place(self, name: str, constant: Floats, given: Mapping[str, Array]) -> Array:
        """Replace placeholders by the coefficients of the rollout; constants stay."""
        if name not in self.varied:
            return constant
        found = np.zeros(len(constant), dtype=object)
        found[np.flatnonzero(constant)] = given[name]
        return found


@dataclass(frozen=True)
class LoopStep:
    """A step of a closed loop, with all options that its kernels depend on.

    A variant of the step is named by two conditions: the controller is evaluated, otherwise the last torque
    is held; a push may act.
    """

    model: Model
    """The robot that moves."""
    controller: Controller[Any] | None
    dt: float
    gains: tuple[str, ...]
    """Names of the gains of the innermost controller that differ between rollouts."""
    plant: ParametricDynamics | None
    noisy: bool
    delayed: bool
    """True if measurements are delayed."""
    limit: Floats | None
    stops: bool
    """True if joints stop at their position limits."""
    disturbances: ArrayDisturbances

    def __post_init__(self) -> None:
        if self.controller is None:
            return
        inner = innermost(self.controller)
        known = gain_shapes(inner)
        for name in self.gains:
            if name not in known:
                raise ArgumentError(
                    f"{inner.name} has no gain {shown(name)}; it has {', '.join(known) or 'none'}"
                )
        state = self.controller.initial_state()
        if state is not None and not is_row(state):
            kind = f"array {state.shape}" if isinstance(state, np.ndarray) else type(state).__name__
            raise UnsupportedFeatureError(
                f"{self.controller.name} has a state of type {kind}; compiled steps take an array (n,) of "
                "float64"
            )

    def text(self, variant: Hashable) -> StepText:
        """Return the text of a variant (controlled, pushed). Its function raises TraceError for a controller
        that branches on its measurement."""
        assert isinstance(variant, tuple)
        controlled, pushed = variant
        function = partial(self._evaluated, controlled=controlled, pushed=pushed)
        name = "the step" if self.controller is None else self.controller.name
        failure = f"{name} cannot be compiled together with the plant"
        return StepText(
            function, self.sizes(controlled=controlled, pushed=pushed), failure, self.key(variant)
        )

    @property
    def always_pushed(self) -> bool:
        """True if every variant has the pushes, in a step without a push with wrenches of zero."""
        return self.model.nv > MAX_NV_WITHOUT_PUSHES and bool(self.disturbances.pushes)

    def pushed_steps(self, wrenches: Floats) -> NDArray[np.bool_]:
        """Check for each step whether its variant has pushes, from their wrenches (n_steps, 6 per push)."""
        return np.asarray(wrenches.any(axis=1) | self.always_pushed)

    @property
    def n_modes(self) -> int:
        """Number of joints whose mode of dry friction is an input."""
        return len(self._law.joints) if self.sticks else 0

    def key(self, purpose: Hashable) -> Hashable | None:
        """Return the content that a kernel for this purpose depends on; None for a controller that is not
        declared pure, that has a class outside dynx, whose code may change, or whose content is not known."""
        controller = self.controller
        if controller is not None and any(
            not each.is_pure or is_foreign(type(each)) for each in chain_of(controller)
        ):
            return None
        others = [
            getattr(self, each.name) for each in fields(self) if each.name not in ("controller", "plant")
        ]
        try:
            known = content_of(others)
            inner = (
                None if controller is None else content_of(traced_controller(controller, self._zero_gains))
            )
        except TypeError:
            return None
        # A plant is immutable and the key keeps a reference to it, so its identity suffices.
        return known, inner, self.plant, purpose

    def gain_values(self) -> dict[str, Floats]:
        """Return the gains that are inputs, by the names of the inputs; those that differ between rollouts
        as the controller has them."""
        found = {}
        for depth, each in enumerate(() if self.controller is None else chain_of(self.controller)):
            own = attributes_of(each)
            shapes = gain_shapes(each)
            for name in self._gain_inputs(each):
                found[f"gain_{depth}_{name}"] = np.asarray(own[name], dtype=np.float64).reshape(
                    prod(shapes[name])
                )
        return found

    def gain_input(self, name: str) -> str:
        """Return the name of the input of a gain of the innermost controller."""
        assert self.controller is not None
        return f"gain_{len(list(chain_of(self.controller))) - 1}_{name}"

    def _gain_inputs(self, each: Controller[Any]) -> tuple[str, ...]:
        """Return the names of gains that are inputs: those of dynx's controllers, so that a kernel holds for
        all gains, and those that differ between rollouts."""
        assert self.controller is not None
        names = (
            () if is_foreign(type(each)) else tuple(k for k, gain in gains_of(each).items() if gain.ndim == 1)
        )
        varied = self.gains if each is innermost(self.controller) else ()
        return tuple(dict.fromkeys((*names, *varied)))

    def _zero_gains(self, depth: int, each: Controller[Any]) -> dict[str, Floats]:
        shapes = gain_shapes(each)
        return {name: np.zeros(shapes[name]) for name in self._gain_inputs(each)}

    def _evaluated(self, *, controlled: bool, pushed: bool, **given: Array) -> dict[str, Array]:
        """Return the outputs of a step for its inputs."""
        mechanism, q, v = simplify_mechanism(self.model.mechanism), given["q"], given["v"]
        if controlled and self.controller is not None:
            refuse_irreproducible(self.controller)
            results = commanded_torque(self, self._traced_controller(given), given)
            if self.limit is not None:
                results["steps_at_limit"] = self._steps_at_limit(given, results["tau"])
        elif controlled:
            results = {"tau": 0.0 * v}
        else:
            results = {name: given[name] for name in ("state", "steps_at_limit", "tau") if name in given}
        tau = results["tau"]
        center = self._center(given) if self.model.floating else None
        scheme = SemiImplicitEuler(self.model, self.dt, center)
        changes: Any = None
        if self.sticks:
            slowed, settling = self._slowed(mechanism, given, pushed, tau)
            q, v, a = scheme.moved(q, v, slowed.a, slowed.moves)
            if settling:
                results["next_modes"], changes = settling["next_modes"], slowed.changes
        else:
            q, v, a = scheme.moved(q, v, self._acceleration(mechanism, given, pushed, tau))
        q_reference = given["q_reference"]
        model = self.model
        error = abs(difference(q, q_reference, floating=model.floating, balls=model.ball_places))
        max_error = np.array([x.maximum(e) for x, e in zip(given["max_error"], error, strict=True)])
        # An infinite torque makes the velocity infinite too, unless it was clamped.
        commanded = results.get("commanded")
        excess = position_excess(self.model, given["q"], q) if self.stops else None
        return {
            "q": q,
            "v": v,
            "a": a,
            "max_error": max_error,
            "squared_errors": given["squared_errors"] + error * error,
            "sound_steps": _sound_steps(given["sound_steps"], v, commanded),
            "status": step_status(
                v, (tau if commanded is None else commanded) if controlled else None, excess, changes
            ),
            **results,
        }

    def _traced_controller(self, given: Mapping[str, Array]) -> Controller[Any]:
        """Return the controller with array code as its engine and inputs as its gains."""
        assert self.controller is not None

        def gains(depth: int, each: Controller[Any]) -> dict[str, Array]:
            found = {name: given[f"gain_{depth}_{name}"] for name in self._gain_inputs(each)}
            if not is_foreign(type(each)):
                return found
            shapes = gain_shapes(each)
            return {name: _like_attribute(traced_array(gain), shapes[name]) for name, gain in found.items()}

        return traced_controller(self.controller, gains)

    @property
    def control_inputs(self) -> dict[str, int]:
        """Sizes of the inputs of a control step besides the state."""
        controller, nq, nv = self.controller, self.model.nq, self.model.nv
        if controller is None:
            return {}
        sizes = {"q_wanted": nq, "v_wanted": nv, "a_wanted": nv, "t": 1}
        if self.delayed:
            sizes |= {"q_measured": nq, "v_measured": nv}
        if self.noisy:
            sizes |= {"noise_q": nv, "noise_v": nv}
        if controller.random_size:
            sizes["random"] = controller.random_size
        return sizes

    @cached_property
    def controller_state(self) -> dict[str, int]:
        """Size of the state of the controller, if it has one."""
        state = None if self.controller is None else self.controller.initial_state()
        return {} if state is None else {"state": state.size}

    def sizes(self, *, controlled: bool, pushed: bool) -> dict[str, int]:
        """Return the inputs of a step in their order, and their sizes."""
        nq, nv, controller = self.model.nq, self.model.nv, self.controller
        sizes = {"q": nq, "v": nv, "max_error": nv, "squared_errors": nv, "q_reference": nq}
        sizes["sound_steps"] = 1
        if not controlled:
            sizes["tau"] = nv
        elif controller is not None:
            sizes |= self.control_inputs
            sizes |= {name: len(gain) for name, gain in self.gain_values().items()}
            if self.limit is not None:
                sizes["steps_held"] = 1
        sizes |= self.controller_state
        if self.limit is not None and controller is not None:
            sizes["steps_at_limit"] = nv
        if self.plant is not None:
            sizes["parameters"] = len(self.plant.parameters.names)
        sizes |= self.disturbances.sizes(pushed=pushed)
        if self.sticks and self._law.joints:
            sizes |= {"modes": len(self._law.joints), "one_by_one": 1}
        return sizes

    def _steps_at_limit(self, given: Mapping[str, Array], tau: Array) -> Array:
        """Return the number of steps (nv,) at effort limits after a control step."""
        assert self.limit is not None
        bounded = np.isfinite(self.limit)
        steps = np.array(given["steps_at_limit"])
        # A controller may return plain numbers; the kernel needs symbols.
        reached = at_limit(tau[bounded] + 0.0 * steps[bounded], self.limit[bounded])
        steps[bounded] = steps[bounded] + given["steps_held"] * reached
        return steps

    @cached_property
    def _law(self) -> FrictionLaw:
        friction = self.disturbances.joint_friction.dry
        if self.plant is not None and self.plant.has_joint_dynamics:
            friction = np.ones(self.model.nv)
            friction[: 6 * self.model.floating] = 0.0
        return FrictionLaw.of(self.model, friction)

    @property
    def sticks(self) -> bool:
        """True if joint friction is solved for at the end of each step."""
        slip = self.disturbances.joint_friction.slip
        of_plant = self.plant is not None and self.plant.has_joint_dynamics
        return self.disturbances.sticks or (of_plant and not slip)

    def _slowed(
        self, mechanism: Mechanism, given: Mapping[str, Array], pushed: bool, tau: Array
    ) -> tuple[FrictionStep, dict[str, Array]]:
        """Solve the law of friction; ``modes`` shift the first modes in a step that is repeated because it
        was not settled (`Settling`).

        Also returns the next shift, with which the step is repeated, for joints that stick.
        """
        law, v, h = self._law, given["v"], self.dt
        damping, friction = self.disturbances.friction_of(given)
        M, r, armature, own_damping, own_friction = self._equation(mechanism, given, pushed, tau)
        if own_damping is not None and own_friction is not None:
            damping, friction = damping + own_damping, friction + own_friction
        A, r = damped_equation(M, r, v, h, damping, armature)
        if not law.joints:
            return law.solve(A, r, v, [], h, [], 0.0), {}
        most = friction[list(law.joints)].tolist()
        _, found, shift = law.step(A, r, v, most, h, given["modes"], given["one_by_one"][0])
        return found, {"next_modes": shift}

    def _equation(
        self, mechanism: Mechanism, given: Mapping[str, Array], pushed: bool, tau: Array
    ) -> tuple[Array, Array, Array, Array | None, Array | None]:
        """Return M, r, armature, and damping and dry friction of the plant's parameters, of
        (M + armature) a = r minus friction."""
        q, v = given["q"], given["v"]
        tau = self.disturbances.added_to(tau, mechanism, q, v, given, pushed=pushed)
        armature = self.disturbances.armature_of(given)
        if self.plant is None:
            M = evaluate_quantity(mechanism, "mass_matrix", (), q)
            r, damping, friction = tau - evaluate_quantity(mechanism, "bias_torque", (), q, v), None, None
        else:
            M, r, joints = self.plant.equation(given["parameters"], q, v, tau)
            damping, friction = (None, None) if joints is None else (joints.damping, joints.friction)
        return M, r, armature, damping, friction

    def _acceleration(
        self, mechanism: Mechanism, given: Mapping[str, Array], pushed: bool, tau: Array
    ) -> Array:
        if self.plant is None and not self.disturbances.armature.any():
            q, v = given["q"], given["v"]
            tau = self.disturbances.added_to(tau, mechanism, q, v, given, pushed=pushed)
            return evaluate_quantity(mechanism, "forward_dynamics", (), q, v, tau)
        M, r, armature, damping, friction = self._equation(mechanism, given, pushed, tau)
        if damping is not None:
            slip = self.disturbances.joint_friction.slip
            r = r - damping * given["v"] - friction * tanh(given["v"] / slip)
        return solve_with_factors(*factorize_mass_matrix(mechanism, M + np.diag(armature)), r)

    def _center(self, given: Mapping[str, Array]) -> Array:
        """Return the centre of mass of the root (3,)."""
        root = self.model.mechanism.root if self.plant is None else self.plant.root(given["parameters"])
        mass = root.mass[()]
        if isinstance(mass, float | int) and not mass:
            return np.zeros(3)
        return np.asarray(root.first_moment / mass)


def commanded_torque(
    step: LoopStep, controller: Controller[Any], given: Mapping[str, Array]
) -> dict[str, Array]:
    """Return the torque of a controller within limits (``tau``), the one before (``commanded``) and its
    state, for inputs of a step.

    Raises TraceError for a controller that cannot be traced, ArgumentError for one that returns no pair.
    """
    q, v = (given["q_measured"], given["v_measured"]) if step.delayed else (given["q"], given["v"])
    noise = (given["noise_q"], given["noise_v"]) if step.noisy else None
    measurement = measure(step.model, given["t"][0], q, v, noise, given.get("random"))
    watch = ControllerWatch(controller)
    outcome = traced_torque(
        controller, measurement, Setpoint(*(given[name] for name in SETPOINT)), given.get("state")
    )
    defect = defect_of_outcome(outcome)
    if defect:
        raise ArgumentError(f"{controller.name}: {defect}")
    tau, state = outcome
    if watch.changed:
        raise TraceError(
            f"{watch.changed}; only the first change would be repeated: let torque return its state"
        )
    defect = defect_of_torque(tau, given["v"].shape) or defect_of_next_state(given.get("state"), state)
    if defect:
        raise TraceError(defect)
    results = {} if state is None else {"state": state}
    if step.limit is None:
        return {"tau": tau, **results}
    return {"tau": clamp(tau, step.limit), "commanded": tau, **results}


def cut_step(step: LoopStep, plant: IntegratedPlant, *, controlled: bool) -> CutStep:
    """Return a step of a loop on a plant whose engine is called, in pieces between the calls.

    It evaluates the controller if `controlled`, otherwise it holds the last torque. Raises TraceError for a
    controller that cannot be traced, or whose operations are not rounded as NumPy rounds them.
    """
    nq, nv = step.model.nq, step.model.nv
    sizes = {"q": nq, "v": nv} | (step.control_inputs if controlled else {"tau": nv}) | step.controller_state
    tracer = EngineCallTracer(sizes)
    given = tracer.given
    if controlled and step.controller is not None:
        results = commanded_torque(step, _controller_of_calls(step.controller, tracer), given)
        tracer.refuse_inexact_rounding()
    else:
        results = {"tau": given["tau"] if not controlled else np.zeros(nv, dtype=object)}
        results |= {name: given[name] for name in step.controller_state}
    tau = results["tau"]
    before: dict[str, Array] = {}
    if controlled and step.controller is not None:
        commanded = results.setdefault("commanded", tau)
        before = {"status": step_status(0.0 * given["v"], commanded), "commanded": commanded}

    def record(call: EngineCall, shape: tuple[int, ...], *arguments: Array) -> Array:
        # The engine may not survive a torque that is not finite.
        written = dict(before)
        before.clear()
        return tracer.record(call, shape, *arguments, origin=PLANT, before=written)

    q, v, a = plant.advanced(record, given["q"], given["v"], tau)
    excess = position_excess(step.model, given["q"], q) if step.stops else None
    return tracer.compile({"q": q, "v": v, "a": a, "status": step_status(v, None, excess), **results})


def step_status(v: Array, torque: Array | None, excess: Any = None, changes: Any = None) -> Array:
    """Return the status (1,) of a step to the velocity `v` under a commanded `torque`, both (nv,).

    `excess` is positive if a joint passed a position limit, `changes` if the modes of dry friction are
    not settled.
    """
    found = select(as_traced(squared_speed(v)) < MAX_SQUARED_SPEED, 0.0, float(Status.DIVERGED))
    if torque is not None:
        finite = as_traced(abs(torque_sum(torque + 0.0 * v))) <= MAX_FLOAT
        found = select(finite, found, float(Status.TORQUE))
    for amount, flag in ((excess, Status.AT_LIMIT), (changes, Status.UNSETTLED)):
        if amount is not None:
            found = found + select(as_traced(amount) > 0.0, float(flag), 0.0)
    return np.array([as_symbol(found)], dtype=object)


def _sound_steps(before: Array, v: Array, commanded: Array | None) -> Array:
    """Return the number of steps before divergence (1,) after a step to the velocity `v`, counted on from
    `before`; in and after the step k that leads to divergence it is -1 - k.

    A torque `commanded` that is not finite counts as divergence, even if effort limits made it finite.
    """
    (steps,) = map(as_traced, before)
    sound = as_traced(squared_speed(v)) < MAX_SQUARED_SPEED
    counted = select(sound, steps + 1.0, -1.0 - steps)
    if commanded is not None:
        counted = select(as_traced(abs(torque_sum(commanded + 0.0 * v))) <= MAX_FLOAT, counted, -1.0 - steps)
    counted = select(steps < 0.0, steps, counted)
    return np.array([as_symbol(counted)], dtype=object)


def traced_controller(
    controller: Controller[Any], gains: Callable[[int, Controller[Any]], Mapping[str, Any]]
) -> Controller[Any]:
    """Return the controller with array code as its engine, and other gains (`gains` of the number and the
    controller, counted from the outermost)."""
    depths = {id(each): depth for depth, each in enumerate(chain_of(controller))}
    return rebind(controller, _array_dynamics, lambda each: gains(depths[id(each)], each))


def _array_dynamics(dynamics: Dynamics) -> Dynamics:
    return dynamics if isinstance(dynamics, ArrayDynamics) else ArrayDynamics(dynamics.model)


def _controller_of_calls(controller: Controller[Any], tracer: EngineCallTracer) -> Controller[Any]:
    """Return the controller with engine calls for its dynamics, and symbols for its gains."""

    def symbols(each: Controller[Any]) -> dict[str, Array]:
        gains = gains_of(each).items()
        numbers = {name: tracer.number(gain) for name, gain in gains if gain.ndim == 1}
        if is_foreign(type(each)):
            return {name: traced_array(number) for name, number in numbers.items()}
        return numbers

    return rebind(controller, partial(_EngineCalls, tracer), symbols)


class _EngineCalls(Dynamics):
    """Dynamics of a controller that is traced: each evaluation is recorded as an engine call."""

    def __init__(self, tracer: EngineCallTracer, dynamics: Dynamics) -> None:
        if not isinstance(dynamics, EngineDynamics):
            raise TraceError(f"{type(dynamics).__name__} is not evaluated by an engine")
        self._tracer, self._engine = tracer, dynamics
        super().__init__(dynamics.model)

    def evaluation(self, quantity: str) -> Evaluation:
        """Return the callable that records an engine call and returns symbols for its result."""
        nv = self.model.nv
        shape = (nv, nv) if quantity in MATRICES else (nv,)

        def record(*arguments: Array) -> Array:
            if quantity not in QUANTITIES:
                raise TraceError(f"{quantity} of a frame is no engine call of a compiled step")
            if any(map(is_traced, arguments)):
                return traced_array(record(*map(symbol_array, arguments)))
            call = self._engine.bound_to_thread(quantity)
            return self._tracer.record(call, shape, *arguments, origin=CONTROLLER)

        return record


def gain_shapes(controller: Controller[Any]) -> dict[str, tuple[int, ...]]:
    """Return the shapes of the numbers of a controller that may differ between the rollouts of a batch.

    These are its gains. Of a class outside dynx they are all public attributes that are a real number (shape
    ()) or an array of numbers, except fields that are declared as parameters.
    """
    shapes = {name: gain.shape for name, gain in gains_of(controller).items()}
    if not is_foreign(type(controller)):
        return shapes
    declared = {name for name, each in fields_of(controller).items() if each.metadata}
    for name, value in attributes_of(controller).items():
        real = is_real(value)
        numbers = isinstance(value, np.ndarray) and value.dtype.kind in "fi"
        if name not in declared and not name.startswith("_") and (real or numbers):
            shapes[name] = np.shape(value)
    return shapes


def _like_attribute(gain: Array, shape: tuple[int, ...]) -> Array:
    """Return the input (size,) in the shape of the attribute in whose place it stands."""
    return gain[0] if shape == () else gain.reshape(shape)


def innermost(controller: Controller[Any]) -> Controller[Any]:
    """Return the controller without any wrapping controllers."""
    return list(chain_of(controller))[-1]
