"""Position limits as hard stops: a joint that reaches one does not bounce, and does not pass."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from math import isfinite
from operator import le
from typing import Any

import numpy as np

from dynx.backends import Backend, backend
from dynx.model import Model
from dynx.sim.plants.integrated import IntegratedPlant
from dynx.sim.plants.plant import Plant
from dynx.sim.step import held_at_limits
from dynx.spatial.scalar import Array, Floats


class Stops:
    """Inelastic impact, after each step of the plant, of the joints that passed their limits.

    The joint is set to its limit. An impulse in that joint alone makes its outward velocity zero and changes
    the velocities of the other joints according to the mass matrix: v+ = v - M^-1 E (E' M^-1 E)^-1 E' v. An
    impulse only pushes inwards, so a joint that already moves away from its limit gets none. Steps in which
    no joint is beyond its limits cost one comparison for each limit.
    """

    def __init__(self, model: Model, mass_matrix: Callable[[Floats], Floats]) -> None:
        """`mass_matrix` returns M (nv, nv) of the plant with its armature."""
        base_q, base_v = (7, 6) if model.floating else (0, 0)
        self._q_joints, self._base = slice(base_q, None), base_v
        self._lower, self._upper = model.lower[self._q_joints], model.upper[self._q_joints]
        self._lowest, self._highest = self._lower.tolist(), self._upper.tolist()
        self._unit_impulses: Floats = np.eye(model.nv)
        self._mass_matrix = mass_matrix

    @classmethod
    def of(cls, plant: Plant, armature: Floats) -> Stops:
        """Make the stops of a plant with `armature` (nv, nv), by its engine's mass matrix if it has one."""
        if isinstance(plant, IntegratedPlant):
            mass_matrix = plant.dynamics.mass_matrix
        else:
            mass_matrix = _MassMatrix(plant.model)
        return cls(plant.model, lambda q: mass_matrix(q) + armature)

    def excess(self, q: Array) -> Any:
        """Return a number that is positive if a joint is beyond a limit at q (nq,), for symbols."""
        found: Any = 0.0
        for x, low, high in zip(q[self._q_joints].tolist(), self._lowest, self._highest, strict=True):
            beyond = [low - x] if isfinite(low) else []
            beyond += [x - high] if isfinite(high) else []
            for each in beyond:
                found = each.maximum(found)
        return found

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


class _MassMatrix:
    """Mass matrix of a robot without joint dynamics, by a kernel that is loaded when it is first needed."""

    def __init__(self, model: Model) -> None:
        self._model = model

    @cached_property
    def _engine(self) -> Backend:
        return backend("compiled", self._model, validate=False)

    def __call__(self, q: Floats) -> Floats:
        return self._engine.mass_matrix(q)
