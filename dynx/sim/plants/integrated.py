"""A plant over any backend: its forward dynamics, integrated by dynx."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from typing import Any

from dynx.backends import Backend
from dynx.backends.solvability import singular_coordinates
from dynx.model import Model
from dynx.sim.plants.disturbances import Disturbances, DisturbedAcceleration
from dynx.sim.plants.integrators import Accelerate, Adaptive, RungeKutta4, SemiImplicitEuler, State
from dynx.sim.plants.plant import Plant, StepResult
from dynx.spatial.scalar import Array, Floats

SCHEMES: dict[str, Callable[..., SemiImplicitEuler | RungeKutta4 | Adaptive]] = {
    "semi_implicit": SemiImplicitEuler,
    "rk4": RungeKutta4,
    "adaptive": Adaptive,
}
"""Integration schemes by name, each made of a model, a step [s] and its own options."""


@lru_cache(maxsize=64)
def _is_singular(model: Model) -> bool:
    """Check whether the mass matrix is singular because nothing that a joint moves has inertia. The answer
    is cached, because the check takes as long as some hundred steps."""
    return bool(singular_coordinates(model))


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
        self._undisturbed = self._accelerate.is_undisturbed
        self._singular = not disturbances.has_armature and _is_singular(engine.model)

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
        found = self.disturbances.names
        # For a floating base, floats and symbols are rounded differently.
        if self.model.floating and isinstance(self._scheme, RungeKutta4):
            found.append("the integrator rk4 with a floating base")
        if isinstance(self._scheme, Adaptive):
            found.append("the integrator adaptive")
        verb = "is" if len(found) == 1 and found != ["pushes"] else "are"
        return f"{' and '.join(found)} {verb}" if found else ""

    @property
    def evaluations(self) -> int:
        """Number of evaluations of the acceleration in one step that can be compiled."""
        return self.substeps * (4 if isinstance(self._scheme, RungeKutta4) else 1)

    def advanced(self, accelerate: Accelerate, q: Array, v: Array, tau: Array) -> State:
        """Take one step from q, v, with `accelerate(q, v, tau)` in place of the engine."""
        q, v, first = self._scheme(accelerate, q, v, tau)
        for _ in range(1, self.substeps):
            q, v, _ = self._scheme(accelerate, q, v, tau)
        return q, v, first

    def _advance(self, t: float, tau: Floats) -> State:
        if self._undisturbed:
            state = self._scheme(self._forward, self._q, self._v, tau)
        else:
            state = self._scheme(self._accelerate, self._q, self._v, tau, t)
        self._q, self._v, _ = state
        return state

    def close(self) -> None:
        self._engine.close()
