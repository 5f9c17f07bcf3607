"""Position limits as hard stops: a joint that reaches one does not bounce, and does not pass."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from dynx.model import Model
from dynx.spatial.scalar import Floats


class Stops:
    """Inelastic impact, after each step of the plant, of the joints that passed their limits.

    The joint is set to its limit. An impulse in that joint alone makes its outward velocity zero and changes
    the velocities of the other joints according to the mass matrix: v+ = v - M^-1 E (E' M^-1 E)^-1 E' v. An
    impulse only pushes inwards, so a joint that already moves away from its limit gets none.
    """

    def __init__(self, model: Model, mass_matrix: Callable[[Floats], Floats]) -> None:
        """`mass_matrix` returns M (nv, nv) of the plant with its armature."""
        base_q, base_v = (7, 6) if model.floating else (0, 0)
        self._q_joints, self._v_joints = slice(base_q, None), slice(base_v, None)
        self._base = base_v
        self._lower, self._upper = model.lower[self._q_joints], model.upper[self._q_joints]
        self._mass_matrix = mass_matrix

    def __call__(self, q: Floats, v: Floats) -> tuple[Floats, Floats] | None:
        """Return the state after the impact, or None if no joint is beyond its limits."""
        joints = q[self._q_joints]
        held = np.clip(joints, self._lower, self._upper)
        past = np.flatnonzero(joints != held)
        if not past.size:
            return None
        q = q.copy()
        q[self._q_joints] = held
        outward = np.sign(joints[past] - held[past])
        columns = past + self._base
        inverse = np.linalg.inv(self._mass_matrix(q))
        struck = outward * v[columns] > 0.0
        while struck.any():
            at = columns[struck]
            impulse = np.linalg.solve(inverse[np.ix_(at, at)], -v[at])
            pulling = impulse * outward[struck] > 0.0
            if not pulling.any():
                v = v + inverse[:, at] @ impulse
                v[at] = 0.0
                break
            struck[np.flatnonzero(struck)[pulling]] = False
        return q, v
