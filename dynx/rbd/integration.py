"""Integration of a robot's motion, for arrays of any scalar: semi-implicit and explicit Euler, Runge-Kutta 4.

Each scheme takes one step of length h from the state (q, v) under a constant torque, and depends on its
arguments alone. `accelerate(q, v, *given)` returns the acceleration. The quaternions of a floating base and
of ball joints are points of the unit sphere, so increments cannot simply be added to them.

Under semi-implicit Euler a floating base moves as in Bullet (btMultiBody): Euler's method is applied to the
velocity of the root's centre of mass and to its angular velocity, both in world axes. Because those axes do
not rotate, a free body keeps its linear momentum exactly. A ball joint turns by the rotation vector h v', in
the axes of its child, as in MuJoCo.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from dynx.errors import UnsupportedFeatureError
from dynx.model import Model
from dynx.spatial.branchless import quat_exp
from dynx.spatial.manifold import coordinate_runs, integrate
from dynx.spatial.scalar import Array
from dynx.spatial.so3 import cross, quat_product, rotate, rotate_back, rotation_from_quat

Accelerate = Callable[..., Array]

MotionState = tuple[Array, Array, Array]
"""q and v after the step, and the acceleration at its beginning."""


def floating_step(
    q: Array,
    v: Array,
    a: Array,
    h: float,
    center: Array,
    moves: Array | float = 1.0,
    balls: Sequence[int] = (),
) -> tuple[Array, Array]:
    """Return q (nq,) and v (nv,) after a step of length `h` [s] with acceleration `a` (nv,).

    `center` (3,) [m] is the centre of mass of the root, in the axes of the base frame. Coordinates where
    `moves` is 0 and not 1 end at rest. `balls` are the indices in ``q[7:]`` at which the quaternions of ball
    joints begin.
    """
    R, w = rotation_from_quat(q[3:7]), v[3:6]
    lever = cross(w, center)
    # The classical acceleration of the centre of mass, because v is expressed in axes that rotate with the
    # base.
    rising = a[:3] + cross(w, v[:3]) + cross(a[3:6], center) + cross(w, lever)
    linear = R @ (v[:3] + lever + h * rising)
    angular = R @ (w + h * a[3:6])
    quat = quat_product(quat_exp(h * angular), q[3:7])
    quat = quat / np.sqrt(quat.dot(quat))
    R_next = rotation_from_quat(quat)
    at = q[:3] + R @ center + h * linear
    w_next = rotate_back(R_next, angular)
    joints = moves * (v[6:] + h * a[6:])
    v_next = np.concatenate([rotate_back(R_next, linear) - cross(w_next, center), w_next, joints])
    return np.concatenate([at - R_next @ center, quat, moved_joints(q[7:], h * joints, balls)]), v_next


def moved_joints(q: Array, step: Array, balls: Sequence[int]) -> Array:
    """Return the positions of joints q (n,) after a displacement; `balls` as in `floating_step`."""
    if balls:
        return integrate(q, step, floating=False, balls=balls)
    # Not by np.asarray, which would take symbols of a caller's code out of their own kind of array.
    moved: Array = q + step
    return moved


def _balls_of(model: Model) -> tuple[int, ...]:
    """Return the indices in the positions of the joints at which the quaternions of ball joints begin."""
    return tuple(place - 7 * model.floating for place in model.ball_places)


class SemiImplicitEuler:
    """First-order integrator v' = v + h a(q, v), q' = q (+) h v'; energy that is conserved stays bounded."""

    def __init__(self, model: Model, h: float, center: Array | None = None) -> None:
        """`center` (3,) [m] is the centre of mass of the root, by default that of `model`."""
        self._floating = model.floating
        self.balls = _balls_of(model)
        """Indices in the positions of the joints at which the quaternions of ball joints begin."""
        self._h: Array = np.full(model.nv, h)
        self._step = h
        if center is None:
            root = model.mechanism.root
            mass = float(root.mass)
            center = np.array(root.first_moment, dtype=float) / mass if mass else np.zeros(3)
        self.center = center
        """Centre of mass (3,) of the root in the axes of the base frame [m]."""

    def __call__(self, accelerate: Accelerate, q: Array, v: Array, *given: Any) -> MotionState:
        """Take one step, on floats or on symbols."""
        return self.moved(q, v, accelerate(q, v, *given))

    def moved(self, q: Array, v: Array, a: Array, moves: Array | None = None) -> MotionState:
        """Take one step with a known acceleration; coordinates where `moves` is 0 and not 1 end at rest."""
        if self._floating:
            return self._float(q, v, a, moves)
        h = self._h
        v = v + h * a
        if moves is not None:
            v = moves * v
        return moved_joints(q, h * v, self.balls), v, a

    def _float(self, q: Array, v: Array, a: Array, moves: Array | None) -> MotionState:
        held = 1.0 if moves is None else moves[6:]
        return *floating_step(q, v, a, self._step, self.center, held, self.balls), a


class ExplicitEuler:
    """First-order integrator q' = q + h v, v' = v + h a(q, v), which adds energy to an oscillation.

    It is here because environments of Gymnasium use it; for a fixed base only.
    """

    def __init__(self, model: Model, h: float) -> None:
        if model.floating:
            raise UnsupportedFeatureError("the integrator euler is for robots with a fixed base")
        self._h, self.balls = h, _balls_of(model)

    def __call__(self, accelerate: Accelerate, q: Array, v: Array, *given: Any) -> MotionState:
        """Return q and v after the step, and the acceleration at its beginning."""
        a = accelerate(q, v, *given)
        return moved_joints(q, self._h * v, self.balls), v + self._h * a, a


class Flow:
    """Time derivative of the state y = (q, v); between steps its quaternions need not be of unit length."""

    def __init__(self, model: Model) -> None:
        self._floating, self.balls = model.floating, model.ball_places
        self._quaternions = model.quaternions
        self.nq = model.nq

    def configuration(self, y: Array) -> Array:
        """Return q with its quaternions on the unit sphere."""
        q = y[: self.nq]
        if self._quaternions:
            q = q.copy()
            for first in self._quaternions:
                quat = q[first : first + 4]
                q[first : first + 4] = quat / np.sqrt(quat.dot(quat))
        return q

    def __call__(self, accelerate: Accelerate, y: Array, given: tuple[Any, ...]) -> Array:
        v = y[self.nq :]
        q = self.configuration(y)
        a = accelerate(q, v, *given)
        if not self._quaternions:
            return np.concatenate([v, a])
        rates = []
        for kind, of_q, of_v in coordinate_runs(self.nq, floating=self._floating, balls=self.balls):
            rate, omega = v[of_v], v[of_v][-3:]
            if kind == "base":
                rates.append(rotate(rotation_from_quat(q[3:7]), rate[:3]))
            if kind != "joints":
                rate = 0.5 * quat_product(y[of_q][-4:], np.array([omega[0], omega[1], omega[2], 0.0]))
            rates.append(rate)
        return np.concatenate([*rates, a])


class RungeKutta4:
    """The classical Runge-Kutta method of fourth order."""

    def __init__(self, model: Model, h: float) -> None:
        self._flow = Flow(model)
        self._h = h

    def __call__(self, accelerate: Accelerate, q: Array, v: Array, *given: Any) -> MotionState:
        """Return one step."""
        flow, h = self._flow, self._h
        y = np.concatenate([q, v])
        k1 = flow(accelerate, y, given)
        k2 = flow(accelerate, y + 0.5 * h * k1, given)
        k3 = flow(accelerate, y + 0.5 * h * k2, given)
        k4 = flow(accelerate, y + h * k3, given)
        y = y + (h / 6.0) * (k1 + 2.0 * (k2 + k3) + k4)
        return flow.configuration(y), y[flow.nq :], k1[flow.nq :]
