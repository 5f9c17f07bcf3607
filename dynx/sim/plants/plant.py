"""What is simulated: a state that a torque moves on by one step.

`DynxPlant` steps over any backend's forward dynamics; `dynx.engines.pybullet.plant` is PyBullet's own
stepper.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from functools import lru_cache
from typing import ClassVar

from dynx.backends import Backend
from dynx.backends.solvability import singular_coordinates
from dynx.control.engine_motors import EngineMotor, MotorCommand
from dynx.errors import ArgumentError, UnsupportedFeatureError, shown
from dynx.model import Model
from dynx.sim.plants.integrators import Accelerate, Adaptive, RungeKutta4, SemiImplicitEuler, State
from dynx.sim.plants.loads import Acceleration, Loads
from dynx.spatial.scalar import Array, Floats

INTEGRATORS = ("semi_implicit", "rk4", "adaptive", "engine")
"""Schemes; ``engine`` is the engine's own stepper, where it has one."""


@lru_cache(maxsize=64)
def _is_singular(model: Model) -> bool:
    """Whether some joint moves no inertia; found once, for that takes as long as some hundred steps."""
    return bool(singular_coordinates(model))


class Plant(ABC):
    """A robot in motion. A step depends on the state and on what is given, and on nothing before."""

    takes_motors: ClassVar[bool] = False
    """Whether it understands the motors of `dynx.control.engine_motors`."""

    model: Model

    def __init__(self, model: Model, dt: float, substeps: int) -> None:
        self.model = model
        self._dt = dt
        self.substeps = substeps

    @abstractmethod
    def reset(self, q: Floats, v: Floats) -> None:
        """Make this the state."""

    @abstractmethod
    def step(self, t: float, tau: Floats) -> State:
        """q and v after one step of `dt` from time `t` under `tau`, and the acceleration as it began."""

    def step_motors(self, t: float, command: MotorCommand) -> tuple[Floats, Floats, Floats, Floats]:
        """The same with the engine's own motors; last the torque that they gave as the step began."""
        raise UnsupportedFeatureError(f"{type(self).__name__} has no motors of its own")

    def refuse(self, controller: object) -> None:
        """Raise UnsupportedFeatureError for a controller that this plant cannot obey."""
        if isinstance(controller, EngineMotor) and not self.takes_motors:
            raise UnsupportedFeatureError(
                f"{controller.name} is a motor inside PyBullet, so it runs with plant='pybullet' and "
                "its own stepper only"
            )

    @abstractmethod
    def close(self) -> None:
        """Give back what the engine holds."""


class DynxPlant(Plant):
    """Forward dynamics of a backend, integrated by dynx."""

    def __init__(
        self,
        engine: Backend,
        loads: Loads,
        dt: float,
        *,
        integrator: str = "semi_implicit",
        substeps: int = 1,
        method: str = "DOP853",
        rtol: float = 1e-10,
        atol: float = 1e-12,
    ) -> None:
        """Raises ArgumentError for an integrator that does not exist."""
        super().__init__(engine.model, dt, substeps)
        self._engine = engine
        self._accelerate = Acceleration(engine, loads)
        h = self._h = dt / substeps
        if integrator == "semi_implicit":
            self._scheme: SemiImplicitEuler | RungeKutta4 | Adaptive = SemiImplicitEuler(engine.model, h)
        elif integrator == "rk4":
            self._scheme = RungeKutta4(engine.model, h)
        elif integrator == "adaptive":
            self._scheme = Adaptive(engine.model, h, method=method, rtol=rtol, atol=atol)
        else:
            raise ArgumentError(
                f"integrator is {shown(integrator)}; a plant of dynx has {', '.join(INTEGRATORS[:3])}"
            )
        self.dynamics = self._accelerate.dynamics
        """What the engine answers, without loads."""
        self._forward = self.dynamics.forward_dynamics
        self._plain = self._accelerate.is_plain
        self._singular = not loads.has_rotors and _is_singular(engine.model)

    def reset(self, q: Floats, v: Floats) -> None:
        """Make this the state. Raises SingularMassMatrixError where it has no acceleration."""
        if self._singular:
            self._engine.forward_dynamics(q, v, 0.0 * v)
        self._q, self._v = q, v

    def step(self, t: float, tau: Floats) -> State:
        """One step, or as many sub-steps."""
        first = self._advance(t, tau)
        if self.substeps == 1:
            return first
        for k in range(1, self.substeps):
            self._advance(t + k * self._h, tau)
        return self._q, self._v, first[2]

    @property
    def is_array_code(self) -> bool:
        """Whether a step is `advanced` over the engine's forward dynamics, for arrays of any scalar."""
        # Floats and symbols take the flow of a floating base in other roundings.
        schemes = SemiImplicitEuler if self.model.floating else SemiImplicitEuler | RungeKutta4
        return self._plain and isinstance(self._scheme, schemes)

    @property
    def evaluations(self) -> int:
        """How often a step asks for the acceleration, where it `is_array_code`."""
        return self.substeps * (4 if isinstance(self._scheme, RungeKutta4) else 1)

    def advanced(self, accelerate: Accelerate, q: Array, v: Array, tau: Array) -> State:
        """One step from q, v, with `accelerate(q, v, tau)` in the place of the engine."""
        q, v, first = self._scheme(accelerate, q, v, tau)
        for _ in range(1, self.substeps):
            q, v, _ = self._scheme(accelerate, q, v, tau)
        return q, v, first

    def _advance(self, t: float, tau: Floats) -> State:
        if self._plain:
            state = self._scheme(self._forward, self._q, self._v, tau)
        else:
            state = self._scheme(self._accelerate, self._q, self._v, tau, t)
        self._q, self._v, _ = state
        return state

    def close(self) -> None:
        """Close the backend."""
        self._engine.close()
