"""Stops of joints at their limits in the steps of a task, by the law of `dynx.steppers.joint_stops`.

`stopped_move` runs on floats. In kernels `LimitWatch` finds the lanes in which a joint passed a limit, and
only these are evaluated again, by a kernel with `StopsText`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from dynx.backends.dynamics import Dynamics
from dynx.compiled.step import position_excess
from dynx.envs.task import Move
from dynx.model import Model
from dynx.model.numbers import DIVERGENCE_SPEED
from dynx.rbd.joint_friction import FrictionLaw
from dynx.simd.user_code.arrays import symbol_array, traced_array
from dynx.simd.user_code.numbers import as_symbol, as_traced, select
from dynx.spatial.scalar import Array, Floats
from dynx.steppers.joint_stops import JointStops, held_at_limits, velocity_after_impact
from dynx.steppers.layout import stop_positions


def stopped_move(model: Model, move: Move, dynamics: Dynamics) -> Move:
    """Return the steps `move` of the integrator with stops, on floats.

    Impacts are those of the mass matrix of `dynamics` with the armature of its joints.
    """
    joints = dynamics.joints
    armature = 0.0 if joints is None else np.diag(joints.armature)
    stops = JointStops(model, lambda q: dynamics.mass_matrix(q) + armature)

    def moved(q: Floats, v: Floats, tau: Floats) -> tuple[Floats, Floats]:
        after = move(q, v, tau)
        # A stop hides no divergence, which the episode detects.
        return (_is_sound(after[1]) and stops(q, *after)) or after

    return moved


def _is_sound(v: Floats) -> bool:
    return bool(v @ v < DIVERGENCE_SPEED**2)


class _LimitedJoints:
    """Joints with limits of a robot: the numbers of their coordinates in q and v, and the limits (n,)."""

    def __init__(self, model: Model) -> None:
        lower, upper = stop_positions(model)
        joints = np.flatnonzero(np.isfinite(lower) | np.isfinite(upper))
        self.q, self.v = joints + 7 * model.floating, joints + 6 * model.floating
        self.lower, self.upper = lower[joints], upper[joints]


class LimitWatch:
    """Steps of the integrator on symbols without stops, and whether a joint passed a limit in one."""

    def __init__(self, model: Model) -> None:
        self._model = model
        self.excess: Any = 0.0
        """Positive if a joint passed a limit in a step of the control step."""

    def moves(self, move: Move, mass_matrix: Callable[[Array], Array], inputs: Mapping[str, Array]) -> Move:
        """Return the steps of a control step, from those of the integrator."""
        self._move, self.excess = move, 0.0
        return self.move

    def move(self, q: Array, v: Array, tau: Array) -> tuple[Array, Array]:
        """Return q and v after a step."""
        after = self._move(q, v, tau)
        configurations = symbol_array(q), symbol_array(after[0])
        self.excess = as_traced(position_excess(self._model, *configurations, as_symbol(self.excess)))
        return after


class StopsText:
    """Steps of the integrator on symbols with stops.

    Which stops would pull, and get no impulse, is an input; a step is repeated until it is right.
    """

    def __init__(self, model: Model) -> None:
        self._joints = _LimitedJoints(model)
        self._law = FrictionLaw.of(model, np.zeros(model.nv))
        self.size = len(self._joints.q)
        """Number of stops in a step of the integrator."""

    def moves(self, move: Move, mass_matrix: Callable[[Array], Array], inputs: Mapping[str, Array]) -> Move:
        """Return the steps of a control step, from those of the integrator; `mass_matrix` returns M (nv, nv)
        of what moves, with its armature, for symbols."""
        self._move, self._mass_matrix = move, mass_matrix
        self._given, self._found = inputs["released"], list[Array]()
        return self.move

    @property
    def released(self) -> Array:
        """Stops (substeps n,) with which an unsettled step is repeated: 1 for one without an impulse."""
        return np.concatenate(self._found)

    @property
    def changes(self) -> Any:
        """Number of stops that still pull."""
        return np.sum(self.released - self._given)

    def move(self, q: Array, v: Array, tau: Array) -> tuple[Array, Array]:
        """Return q and v after a step and its impacts."""
        joints, start = self._joints, q[self._joints.q]
        q, v = (each.copy() for each in self._move(q, v, tau))
        sound = np.sum(v * v) < DIVERGENCE_SPEED**2
        first = len(self._found) * self.size
        released = self._given[first : first + self.size]
        held, impacts = held_at_limits(start, q[joints.q], v[joints.v], joints.lower, joints.upper)
        q[joints.q] = np.where(sound, held, q[joints.q])
        struck = 0.0 * v
        struck[joints.v] = np.where(sound, impacts * (1.0 - released), 0.0)
        after, pull = map(
            traced_array,
            velocity_after_impact(self._law, self._mass_matrix(q), symbol_array(v), symbol_array(struck)),
        )
        self._found.append(np.where(pull[joints.v] > 0.0, 1.0, released))
        after[joints.v] = np.where(struck[joints.v] == 0.0, after[joints.v], 0.0)
        return q, traced_array([select(sound, x, y) for x, y in zip(after, v, strict=True)])
