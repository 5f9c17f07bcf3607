"""Configurations that reach a target and keep bodies apart: solutions are checked, then improved.

Descent to a configuration that reaches a target and keeps margins, within bounds on the coordinates.

Levenberg-Marquardt on the errors of the task and, for each pair of bodies, what its distance lacks. Within a
step a pair counts if it lacks something before the step or, to first order, after it: an active set, without
which the step away from one obstacle would lead into the next. Steps that do not reduce the sum of squares
are rejected and the damping is raised (Marquardt 1963).

Configurations that reach a target and keep bodies apart: every solution is checked, then improved.

For each sample the solutions are those of the search without obstacles, of the closed form where there is
one, and of random starts. The first that keeps all margins is the result. Where joints are redundant, the
solutions that lack least are improved: the distances that are too small count as further errors of the
search, so that the arm moves within the null space of the target, away from what it meets.
"""

from __future__ import annotations

import math
from collections import Counter, deque
from collections.abc import Iterator
from dataclasses import dataclass, field, replace

import numpy as np

from dynx.backends.base import Backend
from dynx.distance.avoidance import (
    FIXED,
    OF_TARGET,
    Avoidance,
    NearPair,
    Pair,
    collision_sentence,
    inevitable_sentence,
)
from dynx.ik.coordinates import FrameCoordinates
from dynx.ik.problem import Problem
from dynx.ik.refine import Target, from_closed_form, from_kernel
from dynx.ik.result import IKResult
from dynx.ik.search import Candidate, Search, SearchTask, TaskError
from dynx.ik.step import ACCEPTED_FACTOR, DAMPING, MIN_DAMPING, REJECTED_FACTOR, bounded_step
from dynx.spatial.scalar import Floats

BUFFER = 1e-4
"""Distance [m] beyond the margin to which pairs are moved apart, so that rounding does not decide."""

REACH = 0.03
"""Room [m] above the margin within which a step counts a pair."""

MAX_STEPS = 60
"""Most steps, rejected ones included."""

MAX_FACTOR = 1e6
"""Damping per unit of squared error that ends a descent."""

WINDOW, REQUIRED_REDUCTION = 4, 0.8
"""A descent ends unless the sum of squares falls below this fraction of itself within so many steps."""

ROUNDS = 6
"""Most changes of the active set in one step."""


@dataclass(eq=False)
class _ClearStep:
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
        task: SearchTask,
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
        self._bounds = lower, upper

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

    def _state(self, q: Floats) -> _ClearStep:
        error = self._task.error(q)
        every = self._avoidance.near(self._backend, q, REACH)
        near = [each for each in every if each.pair not in self._fixed]
        lacks = np.array([each.pair.margin + BUFFER - each.separation.distance for each in near])
        squared = 0.5 * sum([x * x for x in error.vector]) + 0.5 * float((np.maximum(lacks, 0.0) ** 2).sum())
        done = error.reached and all(each.is_clear for each in every)
        return _ClearStep(q, error, near, lacks, squared, done)

    def _moved(self, state: _ClearStep, damping: float) -> Floats:
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
            y = bounded_step(rows, np.array(vector), x, *self._bounds, damping)
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


ROUND = 24
"""Random starts between two rounds of improvement."""

IMPROVED, MOST_IMPROVED = 4, 16
"""Most solutions that are improved in a round, and in all."""

FRAME_REACH = 10.0
"""Bound [m] on how far a body extends from the frame that it is fixed to, for what tolerances move it."""

_SAME = 1e-6
"""Largest difference of a joint [rad or m] between configurations that count as one."""


@dataclass(eq=False)
class _Tally:
    """Solutions of one sample that reach the target but are too close to something."""

    best: Candidate | None = None
    """The one that lacks least, or what an attempt to improve one ended with."""
    blockers: list[NearPair] = field(default_factory=list)
    """The pairs that are too close in the best one."""
    lack: float = math.inf
    """Sum of what the distances of the best one lack [m]."""
    pairs: Counter[tuple[int, int]] = field(default_factory=Counter)
    """In how many solutions each pair is too close."""
    count: int = 0
    complete: bool = False
    """Whether these are all solutions of the closed form."""
    reason: str = ""
    """Why the pairs that are too close are so in every solution, if that is proved."""

    def add(self, candidate: Candidate, violated: list[NearPair]) -> float:
        """Count a solution; return what its distances lack [m]."""
        self.count += 1
        self.pairs.update({(each.pair.a, each.pair.b) for each in violated})
        return self.compare(candidate, violated)

    def compare(self, candidate: Candidate, violated: list[NearPair]) -> float:
        """Keep a configuration if it lacks less than the best; return what it lacks [m]."""
        lack = sum(each.pair.margin - each.separation.lower for each in violated)
        if lack < self.lack:
            self.best, self.blockers, self.lack = candidate, violated, lack
        return lack


def clear_solutions(
    backend: Backend,
    problem: Problem,
    avoidance: Avoidance,
    first: IKResult,
) -> IKResult:
    """Return `first` with solutions that keep all margins, where one is found.

    Samples that `first` does not reach stay. Where each solution found is too close to something, `success`
    is False, q is the one that lacks least, and `collision` says which pairs prevent it.
    """
    nq = backend.model.nq
    q = first.q.reshape(-1, nq).copy()
    columns = (first.position_error, first.rotation_error, first.iterations, first.restarts)
    distances, angles, iterations, restarts = (column.reshape(-1).copy() for column in columns)
    success = first.success.reshape(-1).copy()
    sentences = np.full(len(q), "", dtype=object)
    search = Search(backend.model, problem.coordinates, problem.limits)
    finder = _Finder(backend, problem, avoidance, search)
    samples = zip(problem.tasks(backend), problem.targets.rows(problem.batch), strict=True)
    starts = problem.starts()
    for (k, task), target in samples:
        if not success[k]:
            continue
        found, tally = finder.find(task, target, starts[k], q[k])
        if found is None:
            assert tally.best is not None
            found, success[k] = tally.best, False
            sentences[k] = (
                inevitable_sentence(avoidance, tally.blockers, tally.reason)
                if tally.reason
                else collision_sentence(
                    avoidance, tally.blockers, tally.pairs, tally.count, complete=tally.complete
                )
            )
        q[k], distances[k], angles[k] = found.q, found.position_error, found.rotation_error
        iterations[k] += found.iterations
        restarts[k] += found.restarts
    batch = problem.batch
    return replace(
        first,
        q=q.reshape(first.q.shape),
        success=success.reshape(batch),
        position_error=distances.reshape(batch),
        rotation_error=angles.reshape(batch),
        iterations=iterations.reshape(batch),
        restarts=restarts.reshape(batch),
        collision=sentences.reshape(batch),
    )


class _Finder:
    """Search for a configuration of one sample that keeps all margins."""

    def __init__(
        self,
        backend: Backend,
        problem: Problem,
        avoidance: Avoidance,
        search: Search,
    ) -> None:
        self._backend, self._problem, self._avoidance = backend, problem, avoidance
        self._search = search
        self._fixed = fixed_pairs(avoidance, problem.coordinates)
        self._of_target: frozenset[Pair] = frozenset()
        targets, limits = problem.targets, problem.limits
        if problem.is_plain and targets.positions is not None and targets.rotations is not None:
            self._of_target = pairs_of_target(avoidance, problem.coordinates, problem.frame)
        # Two solutions differ by twice the tolerances.
        self._slack = 2.0 * (limits.position_tolerance + FRAME_REACH * limits.rotation_tolerance)

    def find(
        self, task: SearchTask, target: Target, start: Floats, solution: Floats
    ) -> tuple[Candidate | None, _Tally]:
        """Return a configuration that reaches the target and keeps the margins, or None; and what failed."""
        tally = _Tally()
        descent = AvoidingDescent(task, self._avoidance, self._backend, self._problem.coordinates)
        restarts, improvements = -1, 0
        for solutions, drawn, complete in self._rounds(task, target, start, solution):
            restarts += drawn
            tally.complete = complete
            lacking: list[tuple[float, Candidate]] = []
            for q in solutions:
                candidate = self._search.evaluate(q, task)
                if not candidate.success:
                    continue
                violated = self._avoidance.violated(self._backend, candidate.q)
                if not violated:
                    candidate.restarts = max(restarts, 0)
                    return candidate, tally
                lacking.append((tally.add(candidate, violated), candidate))
                hopeless = [each for each in violated if self._is_in_every_solution(each)]
                if hopeless:
                    candidate.restarts = max(restarts, 0)
                    tally.best, tally.blockers = candidate, hopeless
                    tally.reason = FIXED if hopeless[0].pair in self._fixed else OF_TARGET
                    return None, tally
            lacking.sort(key=lambda each: each[0])
            for _, candidate in lacking[: min(IMPROVED, MOST_IMPROVED - improvements)]:
                improvements += 1
                if self._is_redundant(task, candidate.q):
                    improved = self._improved(task, descent, candidate, tally)
                    if improved is not None:
                        improved.restarts = max(restarts, 0)
                        return improved, tally
        if tally.best is not None:
            tally.best.restarts = max(restarts, 0)
        return None, tally

    def _rounds(
        self, task: SearchTask, target: Target, start: Floats, solution: Floats
    ) -> Iterator[tuple[list[Floats], int, bool]]:
        """Yield solutions with the number of starts that they took, and whether there are no others."""
        problem, coordinates = self._problem, self._problem.coordinates
        known = from_closed_form(self._backend, problem, target, start) if coordinates.count else []
        if known is not None:
            distinct = [solution]
            for q in map(coordinates.clipped, known):
                # Full turns change no distance.
                if all(_angles_differ(q, other) for other in distinct):
                    distinct.append(q)
            yield distinct, 1, True
            return
        yield [solution], 1, False
        rng, left = np.random.default_rng(problem.rng), problem.limits.max_restarts
        seen: list[Floats] = [solution]
        while left > 0:
            count = min(ROUND, left)
            left -= count
            found = from_kernel(self._backend, problem, target, start, rng, count)
            if found is None:
                found = []
                for _ in range(count):
                    q, _ = self._search.descend(coordinates.random(start, rng), task)
                    found.append(coordinates.nearest(q, start))
            new = []
            for q in map(coordinates.clipped, found):
                if all(np.abs(q - other).max() > _SAME for other in seen):
                    new.append(q)
                    seen.append(q)
            yield new, count, False

    def _improved(
        self, task: SearchTask, descent: AvoidingDescent, candidate: Candidate, tally: _Tally
    ) -> Candidate | None:
        """Return a configuration near a solution that reaches the target and keeps the margins, or None."""
        q, steps, _ = descent.run(candidate.q)
        found = self._search.evaluate(self._problem.coordinates.nearest(q, candidate.q), task)
        found.iterations = steps
        if not found.success:
            return None
        violated = self._avoidance.violated(self._backend, found.q)
        if not violated:
            return found
        tally.compare(found, violated)
        return None

    def _is_in_every_solution(self, near: NearPair) -> bool:
        """Return whether a pair is proved to be too close at every configuration that reaches the target."""
        if near.pair in self._fixed:
            return near.separation.upper < near.pair.margin
        return near.pair in self._of_target and near.separation.upper + self._slack < near.pair.margin

    def _is_redundant(self, task: SearchTask, q: Floats) -> bool:
        """Return whether the joints can move without moving what the target fixes."""
        J = task.jacobian(q, task.error(q))
        rank = int(np.linalg.matrix_rank(J, tol=1e-6))
        return len(J.T) > rank


def _angles_differ(q: Floats, other: Floats) -> bool:
    """Return whether two configurations of revolute joints are different ones."""
    return any(abs(math.remainder(x, 2.0 * math.pi)) > _SAME for x in (q - other).tolist())
