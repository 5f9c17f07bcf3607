"""Descent to a configuration that reaches a target and keeps margins, within bounds on the coordinates.

Levenberg-Marquardt on the errors of the task and, for each pair of bodies, what its distance lacks. Within a
step a pair counts if it lacks something before the step or, to first order, after it: an active set, without
which the step away from one obstacle would lead into the next. Steps that do not reduce the sum of squares
are rejected and the damping is raised (Marquardt 1963).
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

import numpy as np

from dynx.backends.base import Backend
from dynx.distance.avoidance import Avoidance, NearPair, Pair
from dynx.ik.coordinates import FrameCoordinates
from dynx.ik.levenberg_marquardt import BoundedStep
from dynx.ik.tasks import Task, TaskError
from dynx.spatial.scalar import Floats

BUFFER = 1e-4
"""Distance [m] beyond the margin to which pairs are moved apart, so that rounding does not decide."""

REACH = 0.03
"""Room [m] above the margin within which a step counts a pair."""

MAX_STEPS = 60
"""Most steps, rejected ones included."""

DAMPING, MIN_DAMPING = 0.1, 1e-9
"""Damping per unit of squared error at first, and the least damping (as in `dynx.ik.search`)."""

ACCEPTED_FACTOR, REJECTED_FACTOR, MAX_FACTOR = 0.3, 4.0, 1e6
"""Factors of the damping after an accepted and a rejected step, and the damping per unit that ends."""

WINDOW, REQUIRED_REDUCTION = 4, 0.8
"""A descent ends unless the sum of squares falls below this fraction of itself within so many steps."""

ROUNDS = 6
"""Most changes of the active set in one step."""


@dataclass(eq=False)
class _State:
    """A configuration, its errors, and the pairs that are near."""

    q: Floats
    error: TaskError
    near: list[NearPair]
    lacks: Floats
    """What the distances of the pairs lack [m]; negative for those that have room."""
    squared: float
    done: bool


class AvoidingDescent:
    """Descent for one task. `bounds` (n,) and (n,) on the coordinates replace the limits of the joints."""

    def __init__(
        self,
        task: Task,
        avoidance: Avoidance,
        backend: Backend,
        coordinates: FrameCoordinates,
        bounds: tuple[Floats, Floats] | None = None,
    ) -> None:
        self._task, self._avoidance, self._backend = task, avoidance, backend
        self._coordinates = coordinates
        # What no step changes would only hide the progress of the others.
        self._fixed = fixed_pairs(avoidance, coordinates)
        limits = (coordinates.lower, coordinates.upper)
        lower, upper = limits if bounds is None else (bounds[0].tolist(), bounds[1].tolist())
        self._step = BoundedStep(lower, upper)

    def run(self, q: Floats) -> tuple[Floats, int, bool]:
        """Descend from q (nq,); return the configuration, the number of steps, and whether it reaches the
        target and keeps all margins."""
        best, factor, steps = self._state(q), DAMPING, 0
        recent = deque([best.squared])
        while not best.done and steps < MAX_STEPS and factor <= MAX_FACTOR:
            steps += 1
            trial = self._state(self._moved(best, factor * best.squared + MIN_DAMPING))
            gain = best.squared - trial.squared
            if not (trial.done or gain > 0.0):
                factor *= REJECTED_FACTOR
                continue
            best, factor = trial, factor * ACCEPTED_FACTOR
            recent.append(best.squared)
            if len(recent) > WINDOW and best.squared > REQUIRED_REDUCTION * recent.popleft():
                break
        return best.q, steps, best.done

    def _state(self, q: Floats) -> _State:
        error = self._task.error(q)
        every = self._avoidance.near(self._backend, q, REACH)
        near = [each for each in every if each.pair not in self._fixed]
        lacks = np.array([each.pair.margin + BUFFER - each.separation.distance for each in near])
        squared = 0.5 * sum([x * x for x in error.vector]) + 0.5 * float((np.maximum(lacks, 0.0) ** 2).sum())
        done = error.reached and all(each.is_clear for each in every)
        return _State(q, error, near, lacks, squared, done)

    def _moved(self, state: _State, damping: float) -> Floats:
        """Return the configuration after one step."""
        coordinates = self._coordinates
        J, x = self._task.jacobian(state.q, state.error), coordinates.values(state.q)
        G = self._avoidance.gradients(self._backend, state.q, state.near)[:, coordinates.columns]
        active = state.lacks > 0.0
        for _ in range(ROUNDS):
            rows, vector = (
                np.concatenate([J, G[active]]),
                [*state.error.vector, *state.lacks[active].tolist()],
            )
            y = self._step(rows, vector, x, damping)
            needed = state.lacks - G @ (np.array(y) - x) > 0.0
            if not (needed & ~active).any():
                break
            active |= needed
        return coordinates.with_values(state.q, y)


def fixed_pairs(avoidance: Avoidance, coordinates: FrameCoordinates) -> frozenset[Pair]:
    """Return the pairs whose distance these coordinates do not change."""
    moving = [coordinates.moving(part.frame) for part in avoidance.parts]
    return frozenset(pair for pair in avoidance.pairs if moving[pair.a] == moving[pair.b])


def pairs_of_target(avoidance: Avoidance, coordinates: FrameCoordinates, frame: str) -> frozenset[Pair]:
    """Return the pairs whose distance follows from the pose of a frame alone: of a body that is fixed to the
    frame, and of one that these coordinates do not move."""
    moving = [coordinates.moving(part.frame) for part in avoidance.parts]
    wanted = {coordinates.moving(frame), frozenset[int]()}
    return frozenset(pair for pair in avoidance.pairs if {moving[pair.a], moving[pair.b]} == wanted)
