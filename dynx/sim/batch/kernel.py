"""One step of a closed loop as one kernel: controller, plant and integrator, traced together.

A controller is array code. Here it runs on symbols, with `dynx.rbd` in place of its backend, and is compiled
together with the dynamics of the plant: what both need, such as sines and cosines, is computed once.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Mapping
from dataclasses import dataclass, fields
from functools import cached_property, partial
from math import prod
from typing import Any

import numpy as np

from dynx.compiled.kernels import evaluate_quantity
from dynx.compiled.parametric import ParametricDynamics
from dynx.compiled.simplification import simplify_mechanism
from dynx.control.base import Controller, chain_of
from dynx.control.content import content_of
from dynx.errors import ArgumentError, TraceError, UnsupportedFeatureError, shown
from dynx.model import Mechanism, Model
from dynx.rbd.elimination import factorize_mass_matrix, solve_with_factors
from dynx.sim.batch.disturbances import BatchDisturbances
from dynx.sim.batch.traced_controller import gain_shapes, innermost, traced_controller
from dynx.sim.loop.controller_checks import (
    ControllerWatch,
    defect_of_next_state,
    defect_of_outcome,
    defect_of_torque,
    is_row,
)
from dynx.sim.loop.own_controllers import refuse_irreproducible, traced_torque
from dynx.sim.plants.friction_law import FrictionLaw, FrictionStep, damped_equation
from dynx.sim.plants.integrators import SemiImplicitEuler
from dynx.sim.step import MAX_SQUARED_SPEED, at_limit, measure, squared_speed, torque_sum
from dynx.simd.cache import load_kernel, program_recipe
from dynx.simd.kernel import Kernel
from dynx.simd.trace import trace
from dynx.simd.user_code.numbers import as_symbol, as_traced, select
from dynx.spatial.branchless import difference
from dynx.spatial.scalar import Array, Floats, clamp, tanh
from dynx.trajectory.base import Setpoint

MAX_FLOAT = float(np.finfo(np.float64).max)
"""Largest finite number."""

MAX_CACHED_KERNELS = 32
"""Number of kernels that this process keeps for later batches."""

_made: dict[Hashable, Kernel] = {}


@dataclass(frozen=True)
class FusedStep:
    """A step of a closed loop, with all options that its kernel depends on."""

    model: Model
    """The robot that moves."""
    controller: Controller[Any]
    dt: float
    gains: tuple[str, ...]
    """Names of the gains that differ between rollouts."""
    plant: ParametricDynamics | None
    noisy: bool
    delayed: bool
    """True if measurements are delayed."""
    limit: Floats | None
    disturbances: BatchDisturbances

    def __post_init__(self) -> None:
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
                f"{self.controller.name} has a state of type {kind}; a batch takes an array (n,) of float64"
            )

    def kernel(self, *, controlled: bool, pushed: bool) -> Kernel:
        """Return the kernel of a step, which evaluates the controller if `controlled` and holds the last
        torque otherwise, and includes the pushes if `pushed`.

        Raises UnsupportedFeatureError for a controller that branches on its measurement.
        """
        make = partial(self._traced, controlled=controlled, pushed=pushed)
        return self.cached((controlled, pushed), make)

    def cached(self, purpose: Hashable, make: Callable[[], Kernel]) -> Kernel:
        """Return the kernel that `make` returned in an earlier batch of this process for an equal step and
        this `purpose`, or make it."""
        try:
            key = self._content(), purpose
        except TypeError:
            return make()
        kernel = _made.get(key)
        if kernel is None:
            kernel = _made[key] = make()
            for old in list(_made)[:-MAX_CACHED_KERNELS]:
                _made.pop(old, None)
        return kernel

    def _content(self) -> Hashable:
        """Return a key of everything that the kernel depends on. Raises TypeError for a controller that is
        not declared pure."""
        if not all(each.is_pure for each in chain_of(self.controller)):
            raise TypeError(f"{self.controller.name} is not declared pure")
        # A plant is immutable and the key keeps a reference to it, so its identity suffices.
        others = (each.name for each in fields(self) if each.name not in ("controller", "plant"))
        own = content_of([getattr(self, name) for name in others])
        return own, content_of(traced_controller(self.controller, {})), self.plant

    def _traced(self, *, controlled: bool, pushed: bool) -> Kernel:
        mechanism = simplify_mechanism(self.model.mechanism)
        controller = traced_controller(self.controller, {})
        if controlled:
            self._refuse_irreproducible()

        def step(**given: Array) -> dict[str, Array]:
            if controlled:
                results = self._commanded(controller, given)
            else:
                results = {name: given[name] for name in ("state", "steps_at_limit") if name in given}
            tau = results["tau"] if controlled else given["tau"]
            # An infinite torque makes the velocity infinite too, unless it was clamped.
            commanded = results.pop("commanded", None)
            center = self._center(given) if self.model.floating else None
            scheme = SemiImplicitEuler(self.model, self.dt, center)
            q, v = given["q"], given["v"]
            if self.sticks:
                slowed, settling = self._slowed(mechanism, given, pushed, tau)
                q, v, _ = scheme.moved(q, v, slowed.a, slowed.moves)
                results |= settling
            else:
                q, v, _ = scheme.moved(q, v, self._acceleration(mechanism, given, pushed, tau))
            q_reference = given["q_reference"]
            error = abs(difference(q, q_reference) if self.model.floating else q_reference - q)
            max_error = np.array([x.maximum(e) for x, e in zip(given["max_error"], error, strict=True)])
            return {
                "q": q,
                "v": v,
                "max_error": max_error,
                "squared_errors": given["squared_errors"] + error * error,
                "sound_steps": _sound_steps(given["sound_steps"], v, commanded),
                **results,
            }

        try:
            program = trace(step, self.sizes(controlled=controlled, pushed=pushed))
        except TraceError as error:
            raise self._not_compiled(error) from error
        return load_kernel(program_recipe(program), lambda: program)

    def _refuse_irreproducible(self) -> None:
        try:
            refuse_irreproducible(self.controller)
        except TraceError as error:
            raise self._not_compiled(error) from error

    def _not_compiled(self, error: TraceError) -> UnsupportedFeatureError:
        return UnsupportedFeatureError(
            f"{self.controller.name} cannot be compiled together with the plant: {error}"
        )

    def sizes(self, *, controlled: bool, pushed: bool) -> dict[str, tuple[int]]:
        """Return the inputs of a step in their order, and their sizes."""
        nq, nv = self.model.nq, self.model.nv
        sizes = {"q": nq, "v": nv, "max_error": nv, "squared_errors": nv, "q_reference": nq}
        sizes["sound_steps"] = 1
        if not controlled:
            sizes["tau"] = nv
        else:
            sizes |= {"q_wanted": nq, "v_wanted": nv, "a_wanted": nv, "t": 1}
            if self.delayed:
                sizes |= {"q_measured": nq, "v_measured": nv}
            if self.noisy:
                sizes |= {"noise_q": nv, "noise_v": nv}
            if self.controller.random_size:
                sizes["random"] = self.controller.random_size
            known = gain_shapes(innermost(self.controller))
            sizes |= {f"gain_{name}": prod(known[name]) for name in self.gains}
            if self.limit is not None:
                sizes["steps_held"] = 1
        state = self.controller.initial_state()
        if state is not None:
            sizes["state"] = state.size
        if self.limit is not None:
            sizes["steps_at_limit"] = nv
        if self.plant is not None:
            sizes["parameters"] = len(self.plant.parameters.names)
        sizes |= self.disturbances.sizes(pushed=pushed)
        if self.sticks and self._law.joints:
            sizes |= {"modes": len(self._law.joints), "one_by_one": 1}
        return {name: (size,) for name, size in sizes.items()}

    def _commanded(self, controller: Controller[Any], given: Mapping[str, Array]) -> dict[str, Array]:
        """Return the torque of the controller and within limits, the controller state, and the number of
        steps at effort limits."""
        q, v = (given["q_measured"], given["v_measured"]) if self.delayed else (given["q"], given["v"])
        noise = (given["noise_q"], given["noise_v"]) if self.noisy else None
        measurement = measure(self.model, given["t"][0], q, v, noise, given.get("random"))
        setpoint = Setpoint(given["q_wanted"], given["v_wanted"], given["a_wanted"])
        own = traced_controller(controller, {name: given[f"gain_{name}"] for name in self.gains})
        watch = ControllerWatch(own)
        outcome = traced_torque(own, measurement, setpoint, given.get("state"))
        defect = defect_of_outcome(outcome)
        if defect:
            raise ArgumentError(f"{own.name}: {defect}")
        tau, state = outcome
        if watch.changed:
            raise UnsupportedFeatureError(
                f"{watch.changed}; a batch would repeat only the first change: let torque return its state"
            )
        shape = given["v"].shape
        defect = defect_of_torque(tau, shape) or defect_of_next_state(given.get("state"), state)
        if defect:
            raise UnsupportedFeatureError(f"{own.name} cannot be part of a batch: {defect}")
        results = {} if state is None else {"state": state}
        if self.limit is None:
            return {"tau": tau, **results}
        results["commanded"] = tau
        tau = clamp(tau, self.limit)
        bounded = np.isfinite(self.limit)
        steps_at_limit = np.array(given["steps_at_limit"])
        # A controller may return plain numbers; the kernel needs symbols.
        reached = at_limit(tau[bounded] + 0.0 * steps_at_limit[bounded], self.limit[bounded])
        steps_at_limit[bounded] = steps_at_limit[bounded] + given["steps_held"] * reached
        return {"tau": tau, "steps_at_limit": steps_at_limit, **results}

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
        was not settled (`dynx.sim.batch.settling`).

        Also returns the next shift, and whether the step is to be repeated with it, for joints that stick.
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
        return found, {"next_modes": shift, "unsettled": np.array([found.changes], dtype=object)}

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
            M, r, damping, friction = self.plant.equation(given["parameters"], q, v, tau)
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
