"""A plant over any backend: its forward dynamics, integrated by dynx."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from dynx.backends import Backend
from dynx.backends.solvability import singular_coordinates
from dynx.rbd.integration import MotionState, RungeKutta4, SemiImplicitEuler
from dynx.sim.plants.disturbances import Disturbances, DisturbedAcceleration
from dynx.sim.plants.plant import Plant, StepResult
from dynx.spatial.scalar import Array, Floats
from dynx.steppers.integrators import Adaptive, CompiledBaseEuler

SCHEMES: dict[str, Callable[..., SemiImplicitEuler | RungeKutta4 | Adaptive]] = {
    "semi_implicit": CompiledBaseEuler,
    "rk4": RungeKutta4,
    "adaptive": Adaptive,
}
"""Integration schemes by name, each made of a model, a step [s] and its own options."""

RecordCall = Callable[..., Array]
"""Function of a call, the shape of its result and its arguments, which are symbols; returns symbols."""


class IntegratedPlant(Plant):
    """Forward dynamics of a backend under an integrator of dynx."""

    def __init__(
        self,
        engine: Backend,
        disturbances: Disturbances,
        dt: float,
        *,
        integrator: str = "semi_implicit",
        substeps: int = 1,
        **options: Any,
    ) -> None:
        """`options` are those of the integrator `adaptive`. Raises ArgumentError for invalid ones."""
        super().__init__(engine.model, disturbances, dt, substeps=substeps)
        self._engine = engine
        self._accelerate = DisturbedAcceleration(engine, disturbances)
        self._scheme = SCHEMES[integrator](engine.model, self._h, **options)
        self.dynamics = self._accelerate.dynamics
        """The engine's dynamics without disturbances."""
        self._forward = self.dynamics.forward_dynamics
        self._undisturbed = self._accelerate.is_undisturbed and not disturbances.sticks
        if disturbances.sticks:
            damped = isinstance(self._scheme, SemiImplicitEuler)
            self._friction = disturbances.implicit_joints(self._h, damped=damped)
            self._dry = list(self._friction.law.joints)
        self._singular = not disturbances.has_armature and bool(singular_coordinates(engine.model))

    def reset(self, q: Floats, v: Floats) -> None:
        """Set the state. Raises SingularMassMatrixError where the acceleration is not unique."""
        if self._singular:
            self._engine.forward_dynamics(q, v, 0.0 * v)
        self._q, self._v = q, v

    def step(self, t: float, tau: Floats) -> StepResult:
        q, v, a = self._advance(t, tau)
        for k in range(1, self.substeps):
            q, v, _ = self._advance(t + k * self._h, tau)
        return StepResult(q, v, a, tau)

    @property
    def uncompiled(self) -> str:
        """Name of the feature that cannot be compiled; empty if `advanced` is the complete step."""
        found = ["pushes"] if self.disturbances.pushes else []
        if self.disturbances.sticks and isinstance(self._scheme, RungeKutta4):
            found.append("joint friction under the integrator rk4")
        # For a floating base, floats and symbols are rounded differently.
        if self.model.floating and isinstance(self._scheme, RungeKutta4):
            found.append("the integrator rk4 with a floating base")
        if isinstance(self._scheme, Adaptive):
            found.append("the integrator adaptive")
        verb = "is" if len(found) == 1 and found != ["pushes"] else "are"
        return f"{' and '.join(found)} {verb}" if found else ""

    @property
    def is_one_semi_implicit_step(self) -> bool:
        """True if a step is one of semi-implicit Euler, as in a batch."""
        return isinstance(self._scheme, SemiImplicitEuler) and self.substeps == 1

    @property
    def evaluations(self) -> int:
        """Number of evaluations of the acceleration in one step that can be compiled."""
        return self.substeps * (4 if isinstance(self._scheme, RungeKutta4) else 1)

    def advanced(self, record: RecordCall, q: Array, v: Array, tau: Array) -> MotionState:
        """Take one step from q, v on symbols; `record(call, shape, *arguments)` stands for an engine call."""
        state = self._advanced(record, q, v, tau)
        first = state[2]
        for _ in range(1, self.substeps):
            state = self._advanced(record, *state[:2], tau)
        return *state[:2], first

    def _advanced(self, record: RecordCall, q: Array, v: Array, tau: Array) -> MotionState:
        if self.disturbances.sticks and isinstance(self._scheme, SemiImplicitEuler):
            return self._scheme.moved(q, v, *record(self._slowed, (2, len(v)), q, v, tau))
        call: Callable[..., Floats] = self._accelerate
        if self._undisturbed:
            call = self.dynamics.bound_to_thread("forward_dynamics")
        return self._scheme(lambda q, v, tau: record(call, v.shape, q, v, tau), q, v, tau)

    def _advance(self, t: float, tau: Floats) -> MotionState:
        if self._undisturbed:
            state = self._scheme(self._forward, self._q, self._v, tau)
        elif not self.disturbances.sticks:
            state = self._scheme(self._accelerate, self._q, self._v, tau, t)
        elif isinstance(self._scheme, SemiImplicitEuler):
            state = self._scheme.moved(self._q, self._v, *self._slowed(self._q, self._v, tau, t))
        else:
            state = self._advance_in_modes(self._scheme, t, tau)
        self._q, self._v, _ = state
        return state

    def _slowed(self, q: Floats, v: Floats, tau: Floats, t: float = 0.0) -> Floats:
        """Return the acceleration under joint friction, and 1 for coordinates that move and 0 for those that
        stick, (2, nv)."""
        return self._accelerate.with_friction(self._friction, q, v, tau, t)

    def _advance_in_modes(self, scheme: RungeKutta4 | Adaptive, t: float, tau: Floats) -> MotionState:
        """Take one step in which each joint sticks or slides as the law of friction has it for Euler's step.

        A joint whose velocity would have changed its sign at the end of the step stops there instead.
        """
        start, dry, pushed = self._v, self._dry, self._accelerate.pushed
        damping, friction = self.disturbances.friction.viscous, self._friction
        mass_matrix_and_bias = self.dynamics.mass_matrix_and_bias
        torque = pushed(self._q, start, tau, t) - damping * start
        M, bias = mass_matrix_and_bias(self._q, start)
        a, moves = friction.step(M, bias, torque, start)
        modes = np.sign(start + self._h * a)[dry] * moves[dry]

        def accelerate(q: Floats, v: Floats, tau: Floats) -> Floats:
            torque = pushed(q, v, tau, t) - damping * v
            return friction.with_modes(*mass_matrix_and_bias(q, v), torque, start, modes)

        while True:
            q, v, a = scheme(accelerate, self._q, start, tau)
            turned = modes * v[dry] < 0.0
            if not turned.any():
                break
            modes = np.where(turned, 0.0, modes)
        v[dry] *= np.abs(modes)
        return q, v, a

    def close(self) -> None:
        self._engine.close()
