"""A plant over any backend: its forward dynamics, integrated by dynx."""

from __future__ import annotations

from typing import Any

from dynx.backends import Backend
from dynx.backends.solvability import singular_coordinates
from dynx.rbd.integration import MotionState, RungeKutta4, SemiImplicitEuler
from dynx.sim.plants.disturbances import Disturbances
from dynx.sim.plants.plant import Plant, StepResult
from dynx.spatial.scalar import Array, Floats
from dynx.steppers.integrators import Adaptive
from dynx.steppers.robot_step import RecordCall, RobotStep


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
        self._advance = RobotStep(
            engine,
            disturbances.joints,
            self._h,
            integrator=integrator,
            add_load=disturbances.load_on(engine),
            **options,
        )
        self.dynamics = self._advance.dynamics
        """The engine's dynamics without disturbances."""
        self._singular = not disturbances.has_armature and bool(singular_coordinates(engine.model))

    def reset(self, q: Floats, v: Floats) -> None:
        """Set the state. Raises SingularMassMatrixError where the acceleration is not unique."""
        if self._singular:
            self._engine.forward_dynamics(q, v, 0.0 * v)
        self._q, self._v = q, v

    def step(self, t: float, tau: Floats) -> StepResult:
        q, v, a = self._advance(self._q, self._v, tau, t)
        for k in range(1, self.substeps):
            q, v, _ = self._advance(q, v, tau, t + k * self._h)
        self._q, self._v = q, v
        return StepResult(q, v, a, tau)

    @property
    def uncompiled(self) -> str:
        """Name of the feature that cannot be compiled; empty if `advanced` is the complete step."""
        scheme = self._advance.scheme
        found = ["pushes"] if self.disturbances.pushes else []
        if self.disturbances.sticks and isinstance(scheme, RungeKutta4):
            found.append("joint friction under the integrator rk4")
        # Floats and symbols of quaternions are rounded differently.
        if self.model.ball_joints:
            found.append("ball joints")
        if self.model.floating and isinstance(scheme, RungeKutta4):
            found.append("the integrator rk4 with a floating base")
        if isinstance(scheme, Adaptive):
            found.append("the integrator adaptive")
        verb = "is" if len(found) == 1 and found[0] not in ("pushes", "ball joints") else "are"
        return f"{' and '.join(found)} {verb}" if found else ""

    @property
    def is_one_semi_implicit_step(self) -> bool:
        """True if a step is one of semi-implicit Euler, as in a batch."""
        return isinstance(self._advance.scheme, SemiImplicitEuler) and self.substeps == 1

    @property
    def evaluations(self) -> int:
        """Number of evaluations of the acceleration in one step that can be compiled."""
        return self.substeps * (4 if isinstance(self._advance.scheme, RungeKutta4) else 1)

    def advanced(self, record: RecordCall, q: Array, v: Array, tau: Array) -> MotionState:
        """Take one step from q, v on symbols; `record(call, shape, *arguments)` stands for an engine call."""
        q, v, first = self._advance.traced(record, q, v, tau)
        for _ in range(1, self.substeps):
            q, v, _ = self._advance.traced(record, q, v, tau)
        return q, v, first

    def close(self) -> None:
        self._engine.close()
