"""One step of a robot: dynamics of any backend, its joint dynamics, and an integrator of dynx."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from dynx.backends import Backend
from dynx.backends.dynamics import EngineDynamics
from dynx.backends.hooks import solve_mass_matrix
from dynx.model.elements import JointCoefficients
from dynx.rbd.integration import ExplicitEuler, MotionState, RungeKutta4, SemiImplicitEuler
from dynx.rbd.joint_friction import FrictionLaw, damped_equation
from dynx.spatial.scalar import Array, Floats
from dynx.steppers.implicit_joints import ImplicitJoints
from dynx.steppers.integrators import Adaptive, CompiledBaseEuler

Scheme = SemiImplicitEuler | RungeKutta4 | Adaptive | ExplicitEuler

SCHEMES: dict[str, Callable[..., Scheme]] = {
    "semi_implicit": CompiledBaseEuler,
    "rk4": RungeKutta4,
    "adaptive": Adaptive,
    "euler": ExplicitEuler,
}
"""Integration schemes by name, each made of a model, a step [s] and its own options."""

AddLoad = Callable[[Floats, Floats, Floats, float], Floats]
"""From a torque (nv,), q, v and the time t at the beginning of a step to the torque with what else acts."""

RecordCall = Callable[..., Array]
"""Function of a call, the shape of its result and its arguments, which are symbols; returns symbols."""


class RobotStep:
    """Steps of `h` [s] of a robot: forward dynamics of a backend under an integrator of dynx.

    Damping and dry friction are solved for the velocity at the end of the step (`ImplicitJoints`). A step
    depends on its arguments alone.
    """

    def __init__(
        self,
        engine: Backend,
        joints: JointCoefficients,
        h: float,
        *,
        integrator: str = "semi_implicit",
        add_load: AddLoad | None = None,
        **options: Any,
    ) -> None:
        """`joints` are coefficients (nv,) of the model's coordinates; `add_load` is called wherever the
        acceleration is evaluated, and so are springs; `options` are those of the integrator `adaptive`.

        Raises ArgumentError for invalid options, UnsupportedFeatureError for a floating base under `euler`.
        """
        self.dynamics = EngineDynamics(engine)
        """The engine's dynamics without joint dynamics."""
        self.scheme = SCHEMES[integrator](engine.model, h, **options)
        self.sticks = bool(joints.damping.any() or joints.friction.any())
        """True if damping or dry friction is solved for at the end of each step."""
        self._h, self._add_load, self._springs = h, add_load, joints.springs
        self._armature = np.diag(joints.armature) if joints.armature.any() else None
        self._damping, self._inertia = joints.damping, joints.armature
        self._is_free = not self.sticks and all(
            each is None for each in (self._armature, add_load, self._springs)
        )
        if self.sticks:
            law = FrictionLaw.of(engine.model, joints.friction)
            damping = joints.damping if isinstance(self.scheme, SemiImplicitEuler) else None
            self._joints = ImplicitJoints(law, joints.friction, h, damping=damping, armature=joints.armature)
            self._dry = list(law.joints)

    def __call__(self, q: Floats, v: Floats, tau: Floats, t: float = 0.0) -> MotionState:
        """Return q and v after a step under the torque `tau` (nv,), which begins at `t` [s], and the
        acceleration at its beginning."""
        if isinstance(self.scheme, SemiImplicitEuler):
            return self.scheme.moved(q, v, *self.motion(q, v, tau, t))
        if self._is_free:
            return self.scheme(self.dynamics.forward_dynamics, q, v, tau)
        if not self.sticks:
            return self.scheme(self.acceleration, q, v, tau, t)
        return self._step_in_modes(self.scheme, q, v, tau, t)

    def motion(
        self, q: Floats, v: Floats, tau: Floats, t: float = 0.0, added: Floats | None = None
    ) -> tuple[Floats, Floats | None]:
        """Return the acceleration (nv,) of a step of semi-implicit Euler, and 1 for coordinates that move and
        0 for those that stick (nv,); None where all move. `added` (nv,) is inertia beside the armature."""
        if added is not None:
            return self._motion_with_inertia(q, v, self._loaded(q, v, tau, t), added)
        if self._is_free:
            return self.dynamics.forward_dynamics(q, v, tau), None
        if not self.sticks:
            return self.acceleration(q, v, tau, t), None
        a, moves = self.slowed(q, v, tau, t)
        return a, moves

    def _motion_with_inertia(
        self, q: Floats, v: Floats, tau: Floats, added: Floats
    ) -> tuple[Floats, Floats | None]:
        M, bias = self.dynamics.mass_matrix_and_bias(q, v)
        M = M + np.diag(added)
        if self.sticks:
            a, moves = self._joints.step(M, bias, tau, v)
            return a, moves
        return solve_mass_matrix(M if self._armature is None else M + self._armature, tau - bias), None

    def without_dry_friction(
        self, q: Floats, v: Floats, tau: Floats, added: Floats | float = 0.0
    ) -> tuple[Floats, Floats]:
        """Return the acceleration (nv,) of a step of semi-implicit Euler without dry friction, and the matrix
        A (nv, nv) that impulses act on: M with armature, the damping of the step and other `added` inertia
        (nv,)."""
        M, bias = self.dynamics.mass_matrix_and_bias(q, v)
        rest = self._loaded(q, v, tau, 0.0) - bias
        A, rest = damped_equation(M, rest, v, self._h, self._damping, self._inertia + added)
        return solve_mass_matrix(A, rest), A

    def inertia(self, q: Floats, added: Floats | float = 0.0) -> Floats:
        """Return the matrix A (nv, nv) that impulses act on, as `without_dry_friction` does."""
        A: Floats = self.dynamics.mass_matrix(q) + np.diag(self._inertia + self._h * self._damping + added)
        return A

    def traced(self, record: RecordCall, q: Array, v: Array, tau: Array) -> MotionState:
        """Take one step on symbols; `record(call, shape, *arguments)` stands for a call of the engine."""
        if self.sticks and isinstance(self.scheme, SemiImplicitEuler):
            return self.scheme.moved(q, v, *record(self.slowed, (2, len(v)), q, v, tau))
        call: Callable[..., Floats] = self.acceleration
        if self._is_free:
            call = self.dynamics.bound_to_thread("forward_dynamics")
        return self.scheme(lambda q, v, tau: record(call, v.shape, q, v, tau), q, v, tau)

    def acceleration(self, q: Floats, v: Floats, tau: Floats, t: float = 0.0) -> Floats:
        """Return the acceleration (nv,) at q, v in a step that began at `t`, without damping and friction
        that are solved for."""
        tau = self._loaded(q, v, tau, t)
        if self._armature is None:
            a: Floats = self.dynamics.forward_dynamics(q, v, tau)
            return a
        M, bias = self.dynamics.mass_matrix_and_bias(q, v)
        return solve_mass_matrix(M + self._armature, tau - bias)

    def slowed(self, q: Floats, v: Floats, tau: Floats, t: float = 0.0) -> Floats:
        """Return the acceleration under damping and friction, and 1 for coordinates that move and 0 for those
        that stick, (2, nv)."""
        tau = self._loaded(q, v, tau, t)
        return self._joints.step(*self.dynamics.mass_matrix_and_bias(q, v), tau, v)

    def _loaded(self, q: Floats, v: Floats, tau: Floats, t: float) -> Floats:
        if self._springs is not None:
            tau = tau + self._springs.torque(q)
        return tau if self._add_load is None else self._add_load(tau, q, v, t)

    def _step_in_modes(
        self, scheme: Scheme, start_q: Floats, start: Floats, tau: Floats, t: float
    ) -> MotionState:
        """Take one step in which each joint sticks or slides as the law of friction has it for Euler's step.

        A joint whose velocity would have changed its sign at the end of the step stops there instead.
        """
        dry, damping, joints = self._dry, self._damping, self._joints
        mass_matrix_and_bias = self.dynamics.mass_matrix_and_bias
        torque = self._loaded(start_q, start, tau, t) - damping * start
        M, bias = mass_matrix_and_bias(start_q, start)
        a, moves = joints.step(M, bias, torque, start)
        modes = np.sign(start + self._h * a)[dry] * moves[dry]

        def accelerate(q: Floats, v: Floats, tau: Floats) -> Floats:
            torque = self._loaded(q, v, tau, t) - damping * v
            return joints.with_modes(*mass_matrix_and_bias(q, v), torque, start, modes)

        while True:
            q, v, a = scheme(accelerate, start_q, start, tau)
            turned = modes * v[dry] < 0.0
            if not turned.any():
                break
            modes = np.where(turned, 0.0, modes)
        v[dry] *= np.abs(modes)
        return q, v, a
