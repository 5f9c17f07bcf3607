"""Integrators: semi-implicit Euler, Runge-Kutta 4 and SciPy's adaptive methods.

Each takes one step of length h from the state (q, v) under a constant torque, and depends on its arguments
alone. `accelerate(q, v, *given)` returns the acceleration. The quaternion of a floating base is a point of
the unit sphere, so increments cannot simply be added to it.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache, cached_property
from typing import Any

import numpy as np

from dynx.errors import ArgumentError, EngineError, nearest, shown
from dynx.model import Model
from dynx.sim.plants.floating_step import floating_step
from dynx.simd.cache import load_kernel, program_recipe
from dynx.simd.emit import Settings
from dynx.simd.kernel import Kernel, Workspace
from dynx.simd.simplify import STRICT
from dynx.simd.target import host
from dynx.simd.trace import trace
from dynx.spatial.scalar import Array, Floats
from dynx.spatial.so3 import quat_product, rotate, rotation_from_quat

Accelerate = Callable[..., Floats]
METHODS = ("RK23", "RK45", "DOP853", "Radau", "BDF", "LSODA")
"""SciPy's integrators by name."""

State = tuple[Floats, Floats, Floats]
"""q and v after the step, and the acceleration at its beginning."""


class SemiImplicitEuler:
    """First-order integrator v' = v + h a(q, v), q' = q (+) h v'; energy that is conserved stays bounded.

    A floating base moves by `floating_step`, which is compiled for floats, because NumPy would take twenty
    times as long as the dynamics.
    """

    def __init__(self, model: Model, h: float, center: Array | None = None) -> None:
        """`center` (3,) [m] is the centre of mass of the root, by default that of `model`."""
        self._floating = model.floating
        self._h: Floats = np.full(model.nv, h)
        self._step = h
        if center is None:
            root = model.mechanism.root
            mass = float(root.mass)
            center = np.array(root.first_moment, dtype=float) / mass if mass else np.zeros(3)
        self._center = center

    @cached_property
    def _base(self) -> Workspace:
        """Compiled `floating_step`, for floats."""
        base = _base_step().workspace()
        base.input_rows[3][:], base.input_rows[4][:] = self._step, self._center
        return base

    def __call__(self, accelerate: Accelerate, q: Array, v: Array, *given: Any) -> State:
        """Take one step, on floats or on symbols."""
        return self.moved(q, v, accelerate(q, v, *given))

    def moved(self, q: Array, v: Array, a: Array, moves: Array | None = None) -> State:
        """Take one step with a known acceleration; coordinates where `moves` is 0 and not 1 end at rest."""
        if self._floating:
            return self._float(q, v, a, moves)
        h = self._h
        v = v + h * a
        if moves is not None:
            v = moves * v
        return q + h * v, v, a

    def _float(self, q: Array, v: Array, a: Array, moves: Array | None) -> State:
        held = 1.0 if moves is None else moves[6:]
        if q.dtype == object:
            return *floating_step(q, v, a, self._step, self._center, held), a
        base, h = self._base, self._step
        numbers: Any = base.inputs
        at, speed, change = base.input_slices[:3]
        numbers[at], numbers[speed], numbers[change] = q[:7], v[:6], a[:6]
        base.run()
        pose, twist = base.results
        joints = held * (v[6:] + h * a[6:])
        return np.concatenate([pose, q[7:] + h * joints]), np.concatenate([twist, joints]), a


@cache
def _base_step() -> Kernel:
    """Compile `floating_step` of a base alone, rounded as in every other kernel that contains it."""

    def step(q: Array, v: Array, a: Array, h: Array, center: Array) -> dict[str, Array]:
        return dict(zip(("q", "v"), floating_step(q, v, a, h[0], center), strict=True))

    sizes = {"q": (7,), "v": (6,), "a": (6,), "h": (1,), "center": (3,)}
    program = trace(step, sizes, simplify=STRICT)
    return load_kernel(program_recipe(program), lambda: program, settings=Settings(host().lanes, fast=False))


class _Flow:
    """Time derivative of the state y = (q, v); between steps its quaternion need not be of unit length."""

    def __init__(self, model: Model) -> None:
        self._floating = model.floating
        self.nq = model.nq

    def configuration(self, y: Floats) -> Floats:
        """Return q with its quaternion on the unit sphere."""
        q = y[: self.nq]
        if self._floating:
            q = q.copy()
            q[3:7] /= np.sqrt(q[3:7].dot(q[3:7]))
        return q

    def __call__(self, accelerate: Accelerate, y: Floats, given: tuple[Any, ...]) -> Floats:
        v = y[self.nq :]
        q = self.configuration(y)
        a = accelerate(q, v, *given)
        if not self._floating:
            return np.concatenate([v, a])
        turning = 0.5 * quat_product(y[3:7], np.array([v[3], v[4], v[5], 0.0]))
        return np.concatenate([rotate(rotation_from_quat(q[3:7]), v[:3]), turning, v[6:], a])


class RungeKutta4:
    """The classical Runge-Kutta method of fourth order."""

    def __init__(self, model: Model, h: float) -> None:
        self._flow = _Flow(model)
        self._h = h

    def __call__(self, accelerate: Accelerate, q: Floats, v: Floats, *given: Any) -> State:
        """Return one step."""
        flow, h = self._flow, self._h
        y = np.concatenate([q, v])
        k1 = flow(accelerate, y, given)
        k2 = flow(accelerate, y + 0.5 * h * k1, given)
        k3 = flow(accelerate, y + 0.5 * h * k2, given)
        k4 = flow(accelerate, y + h * k3, given)
        y = y + (h / 6.0) * (k1 + 2.0 * (k2 + k3) + k4)
        return flow.configuration(y), y[flow.nq :], k1[flow.nq :]


class Adaptive:
    """Integrator with error-controlled steps in each step of the plant, by `scipy.integrate.solve_ivp`."""

    def __init__(self, model: Model, h: float, *, method: str, rtol: float, atol: float) -> None:
        self._flow = _Flow(model)
        self._h = h
        if method not in METHODS:
            raise ArgumentError(f"method is {shown(method)}{nearest(str(method), METHODS)}")
        for name, tolerance in (("rtol", rtol), ("atol", atol)):
            if not isinstance(tolerance, int | float) or not 0.0 < tolerance < np.inf:
                raise ArgumentError(f"{name} is {shown(tolerance)}; wanted a positive number")
        self._method: Any = method
        self._rtol, self._atol = float(rtol), float(atol)

    def __call__(self, accelerate: Accelerate, q: Floats, v: Floats, *given: Any) -> State:
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
