"""Inelastic stops of joints at their position limits."""

from __future__ import annotations

from collections.abc import Callable
from operator import le
from typing import TYPE_CHECKING

import numpy as np

from dynx.model import Model
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
    """

    def __init__(self, model: Model, mass_matrix: Callable[[Floats], Floats]) -> None:
        """`mass_matrix` returns M (nv, nv) of what moves, with its armature."""
        base_q, base_v = (7, 6) if model.floating else (0, 0)
        self._q_joints, self._base = slice(base_q, None), base_v
        self._lower, self._upper = stop_positions(model)
        self._lowest, self._highest = self._lower.tolist(), self._upper.tolist()
        self._unit_impulses: Floats = np.eye(model.nv)
        self._mass_matrix = mass_matrix

    def __call__(self, before: Floats, q: Floats, v: Floats) -> tuple[Floats, Floats] | None:
        """Return the state after the impacts of a step from the configuration `before` (nq,) to q, v; None if
        no joint stops."""
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
