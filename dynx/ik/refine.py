"""Solutions chosen among the candidates of a target, and improved: filtered by what they keep away from, and
ranked by an objective, such as being near to a configuration.

For each sample the candidates are the solution of the search, those of the closed form where there is one,
and those from random starts. With `avoid` the first that keeps all margins counts. Where joints are
redundant, the candidates that lack least are improved: the distances that are too small count as further
errors of a descent, so that the arm moves within the null space of the target, away from what it meets.

With an objective the best candidates are improved within the null space of the task (Siciliano et al.,
section 3.5.1): each step goes along the projected gradient, returns to the target by Newton steps, and counts
only if the target is still reached and the objective is better. So the first objective never suffers.
"""

from __future__ import annotations

import math
from collections import Counter, deque
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from dynx.backends.base import Backend
from dynx.errors import NoClosedFormError
from dynx.ik.coordinates import FrameCoordinates
from dynx.ik.problem import Objective, Problem, Secondary
from dynx.ik.result import IKResult
from dynx.ik.search import Candidate, Search, SearchTask, TaskError
from dynx.ik.step import ACCEPTED_FACTOR, DAMPING, MIN_DAMPING, REJECTED_FACTOR, bounded_step
from dynx.model.targets import Targets
from dynx.spatial.scalar import Floats
from dynx.spatial.se3 import homogeneous
from dynx.time_limit import UNLIMITED, TimeLimit, not_counted

if TYPE_CHECKING:
    from dynx.distance.avoidance import Avoidance, NearPair, Pair

STARTS = 24
"""Most random starts from which solutions are sought for an objective, and between two rounds of
improvement for clearance."""

MAX_STEPS = 60
"""Most steps of an improvement, rejected ones included."""

_SAME = 1e-6
"""Largest difference of a joint [rad or m] between configurations that count as one."""

_COLUMNS = ("position_error", "rotation_error", "iterations", "restarts")


def refined_solutions(backend: Backend, problem: Problem, first: IKResult) -> IKResult:
    """Return `first` with solutions that keep all margins, and of those the best by the objective.

    Samples that `first` does not reach stay. Where each candidate is too close to something, `success` is
    False, q is the one that lacks least, and `collision` says which pairs prevent it. What was not examined
    before the time is over counts as too close.
    """
    avoidance, secondary = problem.avoidance, problem.secondary
    q = first.q.reshape(problem.count, -1).copy()
    columns = [getattr(first, name).reshape(-1).copy() for name in _COLUMNS]
    success = first.success.reshape(-1).copy()
    sentences = np.full(len(q), "", dtype=object)
    late = np.zeros(len(q), dtype=bool) if first.timed_out is None else first.timed_out.reshape(-1).copy()
    parts = np.array([np.stack(errors, axis=-1).reshape(-1, 2) for errors in first.by_frame.values()])
    time_limit = problem.limits.time_limit
    search, starts = Search(backend.model, problem.coordinates, problem.limits), problem.starts()
    goals = None
    if secondary is not None and secondary.nearest is not None:
        goals = np.broadcast_to(secondary.nearest, (*problem.batch, q.shape[1])).reshape(q.shape)
    finder = None if avoidance is None else _ClearFinder(backend, problem, avoidance, search)

    def keep(k: int, found: Candidate) -> None:
        q[k] = found.q
        for column, name in zip(columns, _COLUMNS, strict=True):
            value = getattr(found, name)
            column[k] = value if name.endswith("error") else column[k] + value
        if len(parts):
            parts[:, k] = found.by_frame

    samples = zip(problem.tasks(backend), problem.targets.rows(problem.batch), strict=True)
    for (k, task), target in samples:
        if not success[k]:
            continue
        if k and time_limit.is_over():
            late[k], success[k] = True, finder is None
            continue
        wanted = _OneTarget(backend, problem, search, task, target, starts[k])
        if finder is not None:
            found, sentences[k] = finder.find(wanted, q[k])
            success[k], late[k] = not (sentences[k] or found.timed_out), found.timed_out
            keep(k, found)
        if secondary is not None and success[k] and problem.coordinates.count:
            goal = None if goals is None else goals[k]
            best = _preferred(wanted, q[k], replace(secondary, nearest=goal), avoidance)
            # Rounding decides at the edge of a tolerance or of a margin: otherwise what was found stays.
            if best is not None:
                keep(k, best)
            late[k] = time_limit.is_over()
    shaped = {name: x.reshape(problem.batch) for name, x in zip(_COLUMNS, columns, strict=True)}
    if avoidance is not None:
        shaped |= {"collision": sentences.reshape(problem.batch)}
    return replace(
        first,
        q=q.reshape(first.q.shape),
        success=success.reshape(problem.batch),
        timed_out=late.reshape(problem.batch) if late.any() else None,
        by_frame=problem.by_frame(parts.swapaxes(0, 1).tolist()) if len(parts) else {},
        **shaped,
    )


Target = tuple[Floats | None, Floats | None]
"""Position (3,) and rotation (3, 3) of a target, or None for a part that is free."""


@dataclass(frozen=True, eq=False)
class _OneTarget:
    """One target of a problem, and the sources of its candidates."""

    backend: Backend
    problem: Problem
    search: Search
    task: SearchTask
    target: Target
    start: Floats

    def from_closed_form(self) -> list[Floats] | None:
        """Return all solutions, or None if there is no closed form."""
        problem, (position, rotation) = self.problem, self.target
        is_pose = problem.is_plain and position is not None and rotation is not None
        if not is_pose or problem.point is not None or problem.coordinates.count != 6:
            return None
        with not_counted():
            from dynx.ik.closed_forms.solver import all_solutions

        assert position is not None
        assert rotation is not None
        T, limits = homogeneous(rotation, position), problem.limits
        tolerances = (limits.position_tolerance, limits.rotation_tolerance)
        try:
            found = all_solutions(self.backend, T, problem.frame, self.start, None, *tolerances)
        except NoClosedFormError:
            return None
        return list(found.q[found.success]) or None

    def from_kernel(
        self, rng: np.random.Generator, count: int, others: Sequence[Floats] = ()
    ) -> list[Floats] | None:
        """Return solutions from random starts and `others`, or None if no kernel applies."""
        if not self.backend.compiles:
            return None
        with not_counted():
            from dynx.ik.kernels import kernel_applies, kernel_solution

        problem = self.problem
        if not kernel_applies(self.backend, problem):
            return None
        draws = [problem.coordinates.random(self.start, rng) for _ in range(count)]
        several = self.from_starts([*draws, *others])
        limits = replace(problem.limits, max_restarts=0)
        found = kernel_solution(self.backend, replace(several, limits=limits))
        return None if found is None else list(found.q[found.success])

    def from_starts(self, starts: Sequence[Floats]) -> Problem:
        """Return the problem of this target from several starts (nq,)."""
        q0 = np.array(starts).reshape(-1, len(self.start))
        requirement = replace(self.problem.requirements[0], targets=Targets(*self.target))
        return replace(self.problem, requirements=(requirement,), q0=q0, begins_at_q0=True, batch=(len(q0),))

    def descended(self, start: Floats, near: Floats) -> tuple[Candidate, int]:
        """Return the end of a search from one start, with angles near to a configuration, and its steps."""
        q, steps = self.search.descend(start, self.task)
        return self.search.evaluate(self.problem.coordinates.nearest(q, near), self.task), steps


MAX_IMPROVED = 3
"""Most solutions that are improved: the best one may lead to a poor local optimum."""

_LEAST_STEP = 1e-7
"""Length of a step [rad or m] below which the objective counts as stationary."""

_FIRST_STEP, _GREATEST_STEP = 0.1, 0.5
"""Lengths of steps [rad or m]."""

_DIFFERENCE = 1e-5
"""Half the distance [rad or m] of central differences of the objective."""

_RANK = 1e-6
"""Singular values below this fraction of the largest count as zero."""


def _preferred(
    wanted: _OneTarget, q: Floats, secondary: Secondary, avoidance: Avoidance | None
) -> Candidate | None:
    """Return the best solution, improved, of those that keep all margins; None if no candidate is one.

    Candidates are q (nq,), the start with the joints of the goal, and the solutions of the closed form, if
    there is one, or those from random starts: in a kernel, if one applies, otherwise one after the other.
    """
    coordinates, limits, goal = wanted.problem.coordinates, wanted.problem.limits, secondary.nearest
    rng, count = np.random.default_rng(wanted.problem.rng), min(limits.max_restarts, STARTS)
    begins = [q] if goal is None else [coordinates.with_joints_of(wanted.start, goal), q]
    known = wanted.from_closed_form()
    is_complete = known is not None
    if known is None:
        known = wanted.from_kernel(rng, count, begins[:-1])
    if known is None:
        known = [coordinates.random(wanted.start, rng) for _ in range(count)]
    begins += [coordinates.clipped(each) for each in known]
    # The kernel knows nothing of what is to be avoided.
    if avoidance is None and not is_complete:
        best = _nearest_by_kernel(wanted, begins, secondary)
        if best is not None:
            return best

    time_limit = limits.time_limit

    def is_admissible(q: Floats) -> bool:
        return avoidance is None or avoidance.is_clear(wanted.backend, q, time_limit)

    objective = secondary.objective(coordinates, wanted.task)
    solutions: list[tuple[float, Candidate]] = []
    iterations = 0
    for start in begins:
        if time_limit.is_over():
            break
        found, steps = wanted.descended(start, begins[0] if goal is None else goal)
        iterations += steps
        if found.success and is_admissible(found.q):
            solutions.append((objective(found.q), found))
    solutions.sort(key=lambda each: each[0])
    improved: list[tuple[float, Candidate]] = []
    for value, begin in solutions[:MAX_IMPROVED]:
        found, steps, reached = _improved(wanted, begin, value, objective, is_admissible)
        iterations += steps
        improved.append((reached, found))
    if not improved:
        return None
    best = min(improved, key=lambda each: each[0])[1]
    best.iterations, best.restarts = iterations, len(begins) - 1
    return best


def _improved(
    wanted: _OneTarget,
    best: Candidate,
    value: float,
    objective: Objective,
    is_admissible: Callable[[Floats], bool],
) -> tuple[Candidate, int, float]:
    """Return the solution after steps in the null space that lower the objective from `value`, the number of
    steps, and the objective."""
    coordinates, length, steps = wanted.problem.coordinates, _FIRST_STEP, 0
    direction: Floats | None = None
    is_over = wanted.problem.limits.time_limit.is_over
    while steps < MAX_STEPS and length > _LEAST_STEP and not is_over():
        steps += 1
        if direction is None:
            direction = _descent_direction(coordinates, wanted.task, best.q, objective)
            if direction is None:
                break
        x = np.array(coordinates.values(best.q)) + length * direction
        moved = np.clip(x, coordinates.lower, coordinates.upper).tolist()
        trial, _ = wanted.descended(coordinates.with_values(best.q, moved), best.q)
        lower = objective(trial.q) if trial.success else np.inf
        if lower < value and is_admissible(trial.q):
            best, value, direction = trial, lower, None
            length = min(1.6 * length, _GREATEST_STEP)
        else:
            length *= 0.4
    return best, steps, value


def _descent_direction(
    coordinates: FrameCoordinates, task: SearchTask, q: Floats, objective: Objective
) -> Floats | None:
    """Return the unit direction (n,) of steepest descent among those that keep the task; None if there is
    none."""
    x = np.array(coordinates.values(q))
    lower, upper = np.array(coordinates.lower), np.array(coordinates.upper)
    J = task.jacobian(q, task.error(q))
    free = np.ones(len(x), dtype=bool)
    for _ in range(len(x)):
        _, s, V_T = np.linalg.svd(J * free)
        rank = int((s > _RANK * max(float(s[0]), 1e-300)).sum()) if len(s) else 0
        null = V_T[rank:] * free
        null = null[np.abs(null).max(axis=1) > _RANK]
        if not len(null):
            return None
        slopes = [
            objective(coordinates.with_values(q, (x + h * row).tolist()))
            for row in null
            for h in (_DIFFERENCE, -_DIFFERENCE)
        ]
        gradient = (np.array(slopes[::2]) - np.array(slopes[1::2])) / (2.0 * _DIFFERENCE)
        direction = -gradient @ null
        length = float(np.linalg.norm(direction))
        if length < 1e-9:
            return None
        direction /= length
        # A coordinate at a limit does not move beyond it.
        blocked = free & (((x <= lower) & (direction < 0.0)) | ((x >= upper) & (direction > 0.0)))
        if not blocked.any():
            return np.asarray(direction)
        free &= ~blocked
    return None


def _nearest_by_kernel(wanted: _OneTarget, begins: list[Floats], secondary: Secondary) -> Candidate | None:
    """Return the best of some solutions, improved by a kernel, or None if no kernel applies, or if the
    objective is no posture."""
    backend, coordinates = wanted.backend, wanted.problem.coordinates
    posture = None if coordinates.floating else secondary.posture(coordinates)
    if posture is None or not backend.compiles:
        return None
    from dynx.ik.kernels import nearest_solutions

    found = nearest_solutions(backend, wanted.from_starts(begins), posture)
    if found is None:
        return None
    objective, solutions = found
    best = int(np.argmin(np.where(solutions.success, objective, np.inf)))
    if not solutions.success[best]:
        return None
    # Joints that do not count stay near the start.
    shift_to, counts = wanted.start.copy(), posture.weights > 0.0
    shift_to[np.array(coordinates.indices)[counts]] = posture.goal[counts]
    q = coordinates.nearest(solutions.q[best], shift_to)
    errors = float(solutions.position_error[best]), float(solutions.rotation_error[best])
    steps = int(solutions.iterations.sum())
    return Candidate(q, *errors, float(objective[best]), True, steps, len(begins) - 1)


BUFFER = 1e-4
"""Distance [m] beyond the margin to which pairs are moved apart, so that rounding does not decide."""

REACH = 0.03
"""Room [m] above the margin within which a step counts a pair."""

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
    """Margin and `BUFFER` minus the distance of each pair (n,) [m]; negative for pairs farther apart."""
    squared: float
    done: bool


class AvoidingDescent:
    """Descent to a configuration that reaches a target and keeps margins.

    Levenberg-Marquardt on the errors of the task and, for each pair of bodies, what its distance lacks.
    Within a step a pair counts if it lacks something before the step or, to first order, after it: an active
    set, without which the step away from one obstacle would lead into the next. Steps that do not reduce the
    sum of squares are rejected and the damping is raised (Marquardt 1963).
    """

    def __init__(
        self,
        task: SearchTask,
        avoidance: Avoidance,
        backend: Backend,
        coordinates: FrameCoordinates,
        bounds: tuple[Floats, Floats] | None = None,
        time_limit: TimeLimit = UNLIMITED,
    ) -> None:
        """`bounds` (n,) and (n,) on the coordinates replace the limits of the joints."""
        self._time_limit = time_limit
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
        if best is None:
            return q, steps, False
        recent = deque([best.squared])
        while not best.done and steps < MAX_STEPS and factor <= MAX_FACTOR:
            if self._time_limit.is_over():
                break
            steps += 1
            trial = self._state(self._moved(best, factor * best.squared + MIN_DAMPING))
            if trial is None:
                break
            gain = best.squared - trial.squared
            if not (trial.done or gain > 0.0):
                factor *= REJECTED_FACTOR
                continue
            best, factor = trial, factor * ACCEPTED_FACTOR
            recent.append(best.squared)
            if len(recent) > WINDOW and best.squared > REQUIRED_REDUCTION * recent.popleft():
                break
        return best.q, steps, best.done

    def _state(self, q: Floats) -> _ClearStep | None:
        """Return the state at q (nq,); None if the time was over before it was known."""
        error = self._task.error(q)
        every = self._avoidance.near(self._backend, q, REACH, time_limit=self._time_limit)
        if every is None:
            return None
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


IMPROVED, MOST_IMPROVED = 4, 16
"""Most solutions that are improved in a round, and in all."""

FRAME_REACH = 10.0
"""Bound [m] on how far a body extends from the frame that it is fixed to, for what tolerances move it."""


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


class _ClearFinder:
    """Search for configurations that keep all margins."""

    def __init__(self, backend: Backend, problem: Problem, avoidance: Avoidance, search: Search) -> None:
        self._backend, self._problem, self._avoidance = backend, problem, avoidance
        self._search = search
        self._fixed = fixed_pairs(avoidance, problem.coordinates)
        self._of_target: frozenset[Pair] = frozenset()
        targets, limits = problem.targets, problem.limits
        if problem.is_plain and targets.positions is not None and targets.rotations is not None:
            self._of_target = pairs_of_target(avoidance, problem.coordinates, problem.frame)
        # Two solutions differ by twice the tolerances.
        self._slack = 2.0 * (limits.position_tolerance + FRAME_REACH * limits.rotation_tolerance)

    def find(self, wanted: _OneTarget, solution: Floats) -> tuple[Candidate, str]:
        """Return a configuration that reaches the target and keeps the margins, and an empty text; or the one
        that lacks least, and a sentence on what prevents it."""
        from dynx.distance.avoidance import FIXED, OF_TARGET, collision_sentence, inevitable_sentence

        tally, task = _Tally(), wanted.task
        time_limit = self._problem.limits.time_limit
        descent = AvoidingDescent(
            task, self._avoidance, self._backend, self._problem.coordinates, time_limit=time_limit
        )
        starts, improvements = 0, 0
        for solutions, drawn, is_all in self._rounds(wanted, solution):
            starts, complete = starts + drawn, is_all
            restarts = starts - 1
            lacking: list[tuple[float, Candidate]] = []
            for q in solutions:
                if tally.count and time_limit.is_over():
                    break
                candidate = self._search.evaluate(q, task)
                if not candidate.success:
                    continue
                candidate.restarts = restarts
                violated = self._avoidance.violated(self._backend, candidate.q, time_limit=time_limit)
                if violated is None:
                    break
                if not violated:
                    return candidate, ""
                lacking.append((tally.add(candidate, violated), candidate))
                hopeless = [each for each in violated if self._is_in_every_solution(each)]
                if hopeless:
                    reason = FIXED if hopeless[0].pair in self._fixed else OF_TARGET
                    return candidate, inevitable_sentence(self._avoidance, hopeless, reason)
            lacking.sort(key=lambda each: each[0])
            for _, candidate in lacking[: min(IMPROVED, MOST_IMPROVED - improvements)]:
                improvements += 1
                if time_limit.is_over():
                    break
                if self._is_redundant(task, candidate.q):
                    improved = self._improved(task, descent, candidate, tally)
                    if improved is not None:
                        improved.restarts = restarts
                        return improved, ""
            if time_limit.is_over():
                complete = False
                break
        if tally.best is None:
            # The time was over before the distances at a solution were known, or rounding decided against the
            # solution at the edge of a tolerance.
            return replace(self._search.evaluate(solution, task), success=False, timed_out=True), ""
        tally.best.restarts, tally.best.timed_out = max(starts - 1, 0), time_limit.is_over()
        return tally.best, collision_sentence(
            self._avoidance, tally.blockers, tally.pairs, tally.count, complete=complete
        )

    def _rounds(self, wanted: _OneTarget, solution: Floats) -> Iterator[tuple[list[Floats], int, bool]]:
        """Yield solutions with the number of starts that they took, and whether there are no others."""
        problem, coordinates, start = self._problem, self._problem.coordinates, wanted.start
        known = wanted.from_closed_form() if coordinates.count else []
        if known is not None:
            # Full turns change no distance.
            yield [solution, *_distinct(known, [solution], coordinates, 2.0 * math.pi)], 1, True
            return
        yield [solution], 1, False
        rng, left = np.random.default_rng(problem.rng), problem.limits.max_restarts
        seen: list[Floats] = [solution]
        while left > 0:
            count = min(STARTS, left)
            left -= count
            found = wanted.from_kernel(rng, count)
            if found is None:
                found = []
                while len(found) < count and not problem.limits.time_limit.is_over():
                    found.append(wanted.descended(coordinates.random(start, rng), start)[0].q)
            new = _distinct(found, seen, coordinates)
            seen += new
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
        violated = self._avoidance.violated(
            self._backend, found.q, time_limit=self._problem.limits.time_limit
        )
        if violated == []:
            return found
        if violated is not None:
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


def _distinct(
    found: Sequence[Floats], seen: Sequence[Floats], coordinates: FrameCoordinates, period: float = math.inf
) -> list[Floats]:
    """Return the configurations, moved into the limits, that are not among those seen, up to a period [rad]
    of every joint, each once."""
    new: list[Floats] = []
    for q in map(coordinates.clipped, found):
        differences = ((q - other).tolist() for other in (*seen, *new))
        if all(any(abs(math.remainder(x, period)) > _SAME for x in each) for each in differences):
            new.append(q)
    return new
