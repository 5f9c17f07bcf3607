"""Inelastic stops of joints at their position limits."""

from __future__ import annotations

import math
from collections.abc import Callable
from copy import copy
from operator import le
from typing import TYPE_CHECKING

import numpy as np

from dynx.model import Model
from dynx.model.limited_positions import rotation_angle
from dynx.spatial.scalar import Array, Floats
from dynx.steppers.layout import stop_positions

if TYPE_CHECKING:
    from dynx.rbd.joint_friction import FrictionLaw

MOVES_NO_FURTHER = "so that it moves no further out"
"""Motion of a joint that begins beyond its limits, as a clause."""


class JointStops:
    """Inelastic impact, after each step, of the joints that passed their limits in it.

    In a step a joint moves at most to its limit. A joint that begins the step beyond a limit moves at most to
    where it is: it is neither set to the limit nor pushed inwards, and moves back freely. So a start beyond
    a limit makes no energy.

    A joint that passed this bound is set to it. An impulse in that joint alone makes its outward velocity
    zero and changes the velocities of the other joints according to the mass matrix:
    v+ = v - M^-1 E (E' M^-1 E)^-1 E' v. An impulse only pushes inwards, so a joint that already moves inwards
    gets none. Steps in which no joint is beyond its limits cost one comparison for each limit.

    A ball joint beyond its largest angle is turned back to it about the axis n of its rotation. Its angle
    changes at the rate n . w, so the impulse is about n: a column of E.
    """

    def __init__(self, model: Model, mass_matrix: Callable[[Floats], Floats]) -> None:
        """`mass_matrix` returns M (nv, nv) of what moves, with its armature."""
        base_q, base_v = (7, 6) if model.floating else (0, 0)
        self._q_joints, self._base = slice(base_q, None), base_v
        self._lower, self._upper = stop_positions(model)
        self._lowest, self._highest = self._lower.tolist(), self._upper.tolist()
        self._unit_impulses: Floats = np.eye(model.nv)
        self._mass_matrix = mass_matrix
        self._balls = _BallStops(model) if model.ball_joints else None

    def with_mass_matrix(self, mass_matrix: Callable[[Floats], Floats]) -> JointStops:
        """Return the stops of the same joints in a robot with another mass matrix."""
        twin = copy(self)
        twin._mass_matrix = mass_matrix
        return twin

    def __call__(self, before: Floats, q: Floats, v: Floats) -> tuple[Floats, Floats] | None:
        """Return the state after the impacts of a step from the configuration `before` (nq,) to q, v; None if
        no joint stops."""
        if self._balls is not None:
            return self._stop_along(before, q, v, self._balls)
        joints = q[self._q_joints]
        values = joints.tolist()
        if all(map(le, self._lowest, values)) and all(map(le, values, self._highest)):
            return None
        start, speeds = before[self._q_joints], v[self._base :]
        held, impacts = held_at_limits(start, joints, speeds, self._lower, self._upper)
        if (held == joints).all():
            return None
        q = q.copy()
        q[self._q_joints] = held
        struck = np.flatnonzero(impacts)
        outward, columns = impacts[struck], struck + self._base
        if not columns.size:
            return q, v
        # Velocities after unit impulses on these joints.
        effects = np.linalg.solve(self._mass_matrix(q), self._unit_impulses[:, columns])
        while columns.size:
            impulse = np.linalg.solve(effects[columns], -v[columns])
            pushing = impulse * outward <= 0.0
            if pushing.all():
                v = v + effects @ impulse
                v[columns] = 0.0
                break
            outward, columns, effects = outward[pushing], columns[pushing], effects[:, pushing]
        return q, v

    def _stop_along(
        self, before: Floats, q: Floats, v: Floats, balls: _BallStops
    ) -> tuple[Floats, Floats] | None:
        """Return what `__call__` returns, for a robot with ball joints."""
        in_q, in_v = balls.plain
        held, impacts = held_at_limits(
            before[in_q],
            q[in_q],
            v[in_v],
            *(bound[in_q - self._q_joints.start] for bound in (self._lower, self._upper)),
        )
        turned = balls.stopped(before, q)
        if not turned and (held == q[in_q]).all():
            return None
        q = q.copy()
        q[in_q] = held
        struck = np.flatnonzero(impacts)
        columns = [impacts[k] * self._unit_impulses[in_v[k]] for k in struck.tolist()]
        for place, first, axis, angle in turned:
            q[place : place + 4] = [*(axis * math.sin(0.5 * angle)), math.cos(0.5 * angle)]
            if axis @ v[first : first + 3] > 0.0:
                columns.append(np.zeros(len(v)))
                columns[-1][first : first + 3] = axis
        if not columns:
            return q, v
        outward = np.array(columns).T
        effects = np.linalg.solve(self._mass_matrix(q), outward)
        while outward.size:
            impulse = np.linalg.solve(outward.T @ effects, -(outward.T @ v))
            pushing = impulse <= 0.0
            if pushing.all():
                v = v + effects @ impulse
                break
            outward, effects = outward[:, pushing], effects[:, pushing]
        return q, v


class _BallStops:
    """Places of ball joints with a largest angle, and of the joints with one coordinate."""

    def __init__(self, model: Model) -> None:
        ones = [joint for joint in model.coordinate_joints if joint.type != "ball"]
        self.plain = (
            np.array([model.position_index(joint.name) for joint in ones], dtype=np.intp),
            np.array([model.coordinate_index(joint.name) for joint in ones], dtype=np.intp),
        )
        """Indices of the joints with one coordinate, in q and in v."""
        self._limited = [
            (model.position_index(joint.name), model.coordinate_index(joint.name), joint.limits.upper)
            for joint in model.ball_joints
            if joint.limits.upper < math.pi
        ]

    def stopped(self, before: Floats, q: Floats) -> list[tuple[int, int, Floats, float]]:
        """Return the ball joints that passed their largest angle in a step: index in q, index in v, axis (3,)
        of the rotation, and angle at which it stops."""
        found = []
        for place, first, upper in self._limited:
            quat = slice(place, place + 4)
            angle = float(rotation_angle(q[quat]))
            if angle > upper and angle > (most := max(upper, float(rotation_angle(before[quat])))):
                vector = q[place : place + 3] * math.copysign(1.0, q[place + 3])
                found.append((place, first, vector / np.linalg.norm(vector), most))
        return found


def bounds_of_step(start: Array, lower: Array, upper: Array) -> tuple[Array, Array]:
    """Return the positions (..., n) between which joints move in a step that begins at `start`, for any
    scalar: their limits, or where a joint is that begins beyond one."""
    return np.minimum(lower, start), np.maximum(upper, start)


def held_at_limits(
    start: Array, joints: Array, speeds: Array, lower: Array, upper: Array
) -> tuple[Array, Array]:
    """Return the positions of joints (..., n) after a step from `start`, within its bounds, and the impacts
    on them, for any scalar.

    An impact is the outward sign, 1 or -1, of a joint that passed a bound and moves outwards, otherwise 0.
    """
    low, high = bounds_of_step(start, lower, upper)
    held = np.clip(joints, low, high)
    outward = np.sign(joints - held)
    return held, outward * (outward * speeds > 0.0)


def velocity_after_impact(law: FrictionLaw, M: Array, v: Array, struck: Array) -> tuple[Array, Array]:
    """Return the velocity (nv,) after inelastic impulses on the coordinates that are struck, and the impulses
    along their outward signs, for symbols: a stop that would pull has one above 0.

    `struck` (nv,) has these signs, and 0 for the others; `law` is that of the robot without dry friction. The
    change of velocity x has x = -v where a joint is struck, and no impulse M x elsewhere: the equation of
    joints that stick under dry friction.
    """
    stuck = abs(struck)
    x, left = law.accelerations(M, [0.0] * len(v), list(1.0 - stuck), list(-stuck * v))
    return v + np.array(x), -struck * np.array(left)
