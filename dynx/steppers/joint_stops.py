"""Inelastic stops of joints at their position limits."""

from __future__ import annotations

from collections.abc import Callable
from operator import le

import numpy as np

from dynx.model import Model
from dynx.spatial.scalar import Floats


class JointStops:
    """Inelastic impact, after each step, of the joints that passed their limits.

    The joint is set to its limit. An impulse in that joint alone makes its outward velocity zero and changes
    the velocities of the other joints according to the mass matrix: v+ = v - M^-1 E (E' M^-1 E)^-1 E' v. An
    impulse only pushes inwards, so a joint that already moves away from its limit gets none. Steps in which
    no joint is beyond its limits cost one comparison for each limit.
    """

    def __init__(self, model: Model, mass_matrix: Callable[[Floats], Floats]) -> None:
        """`mass_matrix` returns M (nv, nv) of what moves, with its armature."""
        base_q, base_v = (7, 6) if model.floating else (0, 0)
        self._q_joints, self._base = slice(base_q, None), base_v
        self._lower, self._upper = model.lower[self._q_joints], model.upper[self._q_joints]
        self._lowest, self._highest = self._lower.tolist(), self._upper.tolist()
        self._unit_impulses: Floats = np.eye(model.nv)
        self._mass_matrix = mass_matrix

    def __call__(self, q: Floats, v: Floats) -> tuple[Floats, Floats] | None:
        """Return the state after the impact, or None if no joint is beyond its limits."""
        values = q[self._q_joints].tolist()
        if all(map(le, self._lowest, values)) and all(map(le, values, self._highest)):
            return None
        held, impacts = held_at_limits(q[self._q_joints], v[self._base :], self._lower, self._upper)
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


def held_at_limits(joints: Floats, speeds: Floats, lower: Floats, upper: Floats) -> tuple[Floats, Floats]:
    """Return the positions of joints (..., n), set to limits that they passed, and the impacts on them.

    An impact is the outward sign, 1 or -1, of a joint that passed a limit and moves outwards, otherwise 0.
    """
    held = np.clip(joints, lower, upper)
    outward = np.sign(joints - held)
    return held, outward * (outward * speeds > 0.0)
