"""Integrators of a plant on floats: semi-implicit Euler with a compiled base, and SciPy's adaptive methods.

The schemes themselves are array code (`dynx.rbd.integration`).
"""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from dynx.errors import ArgumentError, EngineError, nearest, shown
from dynx.model import Model
from dynx.rbd.integration import Accelerate, Flow, MotionState, SemiImplicitEuler, moved_joints
from dynx.spatial.scalar import Array, Floats

if TYPE_CHECKING:
    from dynx.simd.kernel import Workspace

METHODS = ("RK23", "RK45", "DOP853", "Radau", "BDF", "LSODA")
"""SciPy's integrators by name."""


class CompiledBaseEuler(SemiImplicitEuler):
    """Semi-implicit Euler whose step of a floating base is compiled for floats, because NumPy would take
    twenty times as long as the dynamics."""

    @cached_property
    def _base(self) -> Workspace:
        """Compiled `floating_step`, for floats."""
        # Imported here, because robots with a fixed base need no compiler.
        from dynx.steppers.step_kernels import base_kernel

        base = base_kernel().workspace()
        base.input_rows[3][:], base.input_rows[4][:] = self._step, self.center
        return base

    def _float(self, q: Array, v: Array, a: Array, moves: Array | None) -> MotionState:
        if q.dtype == object:
            return super()._float(q, v, a, moves)
        held = 1.0 if moves is None else moves[6:]
        base, h = self._base, self._step
        numbers: Any = base.inputs
        at, speed, change = base.input_slices[:3]
        numbers[at], numbers[speed], numbers[change] = q[:7], v[:6], a[:6]
        base.run()
        pose, twist = base.results
        joints = held * (v[6:] + h * a[6:])
        moved = moved_joints(q[7:], h * joints, self.balls)
        return np.concatenate([pose, moved]), np.concatenate([twist, joints]), a


class Adaptive:
    """Integrator with error-controlled steps in each step of the plant, by `scipy.integrate.solve_ivp`."""

    def __init__(self, model: Model, h: float, *, method: str, rtol: float, atol: float) -> None:
        self._flow = Flow(model)
        self._h = h
        if method not in METHODS:
            raise ArgumentError(f"method is {shown(method)}{nearest(method, METHODS)}")
        for name, tolerance in (("rtol", rtol), ("atol", atol)):
            if not isinstance(tolerance, int | float) or not 0.0 < tolerance < np.inf:
                raise ArgumentError(f"{name} is {shown(tolerance)}; wanted a positive number")
        self._method: Any = method
        self._rtol, self._atol = float(rtol), float(atol)

    def __call__(self, accelerate: Accelerate, q: Floats, v: Floats, *given: Any) -> MotionState:
        """Return one step. Raises EngineError where the method gives up."""
        # Imported here because the import takes half a second.
        from scipy.integrate import solve_ivp

        flow, y = self._flow, np.concatenate([q, v])
        found = solve_ivp(
            lambda t, y: flow(accelerate, y, given),
            (0.0, self._h),
            y,
            method=self._method,
            rtol=self._rtol,
            atol=self._atol,
        )
        if not found.success:
            raise EngineError(f"SciPy's integrator gave up: {found.message}")
        y = found.y[:, -1]
        return flow.configuration(y), y[flow.nq :], accelerate(q, v, *given)
