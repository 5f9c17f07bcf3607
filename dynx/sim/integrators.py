"""From an acceleration to the next state: semi-implicit Euler, Runge-Kutta 4, SciPy's adaptive methods.

Each takes one step of length h from the state (q, v) under a constant torque, and is a function of what it
is given and of nothing else. `accelerate(q, v, *given)` is the acceleration. A quaternion is a point of
the unit sphere, so a floating base needs more than adding.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from scipy.integrate import BDF, DOP853, LSODA, RK23, RK45, Radau, solve_ivp

from dynx.errors import ArgumentError, EngineError, nearest, shown
from dynx.model import Model
from dynx.spatial.scalar import Floats
from dynx.spatial.so3 import cross, quat_exp, quat_product, rotate, rotate_back, rotation_from_quat

Accelerate = Callable[..., Floats]
METHODS = {"RK23": RK23, "RK45": RK45, "DOP853": DOP853, "Radau": Radau, "BDF": BDF, "LSODA": LSODA}
"""SciPy's integrators by name."""

State = tuple[Floats, Floats, Floats]
"""q and v after the step, and the acceleration at its beginning."""


class SemiImplicitEuler:
    """v' = v + h a(q, v), q' = q (+) h v': first order, and energy stays bounded where it is conserved.

    The base of a floating robot moves as Bullet has it (btMultiBody): the step is taken by the centre of
    mass of the root and by its angular velocity, both along the axes of the world. Those axes do not turn,
    so a body that nothing touches keeps its linear momentum exactly.
    """

    def __init__(self, model: Model, h: float) -> None:
        self._floating = model.floating
        self._h: Floats = np.full(model.nv, h)
        self._step = h
        root = model.mechanism.root
        mass = float(root.mass)
        self._center: Floats = np.array(root.first_moment, dtype=float) / mass if mass else np.zeros(3)

    def __call__(self, accelerate: Accelerate, q: Floats, v: Floats, *given: Any) -> State:
        """One step."""
        a = accelerate(q, v, *given)
        if self._floating:
            return self._float(q, v, a)
        h = self._h
        v = v + h * a
        return q + h * v, v, a

    def _float(self, q: Floats, v: Floats, a: Floats) -> State:
        h, c = self._step, self._center
        R, w = rotation_from_quat(q[3:7]), v[3:6]
        # The classical acceleration of the centre of mass: v is in axes that turn with the base.
        rising = a[:3] + cross(w, v[:3]) + cross(a[3:6], c) + cross(w, cross(w, c))
        linear = R @ (v[:3] + cross(w, c) + h * rising)
        angular = R @ (w + h * a[3:6])
        quat = quat_product(quat_exp(h * angular), q[3:7])
        quat /= np.sqrt(quat.dot(quat))
        R_next = rotation_from_quat(quat)
        center = q[:3] + R @ c + h * linear
        w_next = rotate_back(R_next, angular)
        joints = v[6:] + h * a[6:]
        v_next = np.concatenate([rotate_back(R_next, linear) - cross(w_next, c), w_next, joints])
        return np.concatenate([center - R_next @ c, quat, q[7:] + h * joints]), v_next, a


class _Flow:
    """The rate of change of the state y = (q, v), where a quaternion may be off its sphere in between."""

    def __init__(self, model: Model) -> None:
        self._floating = model.floating
        self.nq = model.nq

    def configuration(self, y: Floats) -> Floats:
        """q with its quaternion on the unit sphere."""
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
        """One step."""
        flow, h = self._flow, self._h
        y = np.concatenate([q, v])
        k1 = flow(accelerate, y, given)
        k2 = flow(accelerate, y + 0.5 * h * k1, given)
        k3 = flow(accelerate, y + 0.5 * h * k2, given)
        k4 = flow(accelerate, y + h * k3, given)
        y = y + (h / 6.0) * (k1 + 2.0 * (k2 + k3) + k4)
        return flow.configuration(y), y[flow.nq :], k1[flow.nq :]


class Adaptive:
    """Error-controlled steps within each step of the plant, by `scipy.integrate.solve_ivp`."""

    def __init__(self, model: Model, h: float, *, method: str, rtol: float, atol: float) -> None:
        self._flow = _Flow(model)
        self._h = h
        if method not in METHODS:
            raise ArgumentError(f"method is {shown(method)}{nearest(str(method), METHODS)}")
        for name, tolerance in (("rtol", rtol), ("atol", atol)):
            if not isinstance(tolerance, int | float) or not 0.0 < tolerance < np.inf:
                raise ArgumentError(f"{name} is {shown(tolerance)}; wanted a positive number")
        self._method, self._rtol, self._atol = METHODS[method], float(rtol), float(atol)

    def __call__(self, accelerate: Accelerate, q: Floats, v: Floats, *given: Any) -> State:
        """One step. Raises EngineError where the method gives up."""
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
