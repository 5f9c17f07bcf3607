"""Search for the smallest counterexample for a difference that no rule explains, for use in a bug report.

The robot is reduced while the difference stays: shapes and simulators' elements are removed, then links,
then moving joints become fixed; then elements, attributes and digits. Between these the state is simplified.
All of it is repeated until nothing more can be removed or the budget is spent. The reductions edit the text
in place, so that a difference caused by the text itself is not lost.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Callable, Sequence
from functools import partial
from time import perf_counter
from typing import Any

import numpy as np

from dynx.doctor.counterexample.reductions import (
    DIGITS,
    ReducibleState,
    Reductions,
    fewer_attributes,
    fewer_elements,
    fewer_extras,
    fewer_links,
    fewer_moving_joints,
    format_document,
    frame_axes,
    higher_links,
    maximal_changes,
    plain_numbers,
    round_numbers,
    simplest_state,
    unit_numbers,
)
from dynx.doctor.examine.examination import (
    Examiner,
    States,
    draw_states,
    model_without_mimics,
    reference_values,
)
from dynx.doctor.prove.mending import Place, detections, place_of
from dynx.doctor.report import Counterexample
from dynx.errors import DescriptionError, DynxError
from dynx.model import Model
from dynx.model.xml.source import XmlSource
from dynx.rules import Case, all_rules
from dynx.spatial.scalar import Floats

# Trials of smaller robots at simpler states: whether each still shows a difference, within a budget.


Difference = Callable[[Case, Model, Floats, Floats, Floats], float]
"""Function of (case, model, q, v, a) that returns the relative error of the engine in question; 0 where it
cannot be evaluated."""

MAX_TRIALS = 1500
"""Largest number of trials; each loads an engine, which takes 5 to 50 ms."""


class ReductionTrials:
    """Evaluator of `difference` that stores its values and stops when the budget [s] is spent.

    A robot is tried only if it has no cause of the catalogue that the `original` does not have: a link
    without ``<inertial>``, for example, would show that difference instead. A state is tried only within the
    limits of the joints, outside which some engines apply a force; an exception are joints of the original
    whose limits leave no range.
    """

    def __init__(self, difference: Difference, original: Case, budget: float | None) -> None:
        self._difference = difference
        self._known_causes = _causes(original)
        self._until = math.inf if budget is None else perf_counter() + budget
        self._errors: dict[tuple[bytes, object], float] = {}
        self._cause_free: dict[bytes, bool] = {}
        self._last_model: tuple[bytes, Model | None] = (b"", None)
        self._count = 0
        self.threshold = 0.0
        model = self.model(original)
        self._without_range = frozenset() if model is None else _joints_without_range(model)

    @property
    def spent(self) -> bool:
        """True if the budget is spent."""
        return self._count >= MAX_TRIALS or perf_counter() >= self._until

    def holds(self, case: Case, state: ReducibleState) -> bool:
        """Check that the error is above the threshold; False if it was not tried within the budget."""
        return self.error(case, state) > self.threshold and self._adds_no_cause(case)

    def error(self, case: Case, state: ReducibleState) -> float:
        """Return the relative error, infinite for NaN; 0 where nothing was tried."""
        model = self.model(case)
        if model is None:
            return 0.0
        key = (_digest(case), state.within(model).key)
        if key not in self._errors:
            q, v, a = state.on(model)
            if self.spent or not self._is_within_limits(model, q):
                return 0.0
            self._count += 1
            found = float(self._difference(case, model, q, v, a))
            self._errors[key] = math.inf if math.isnan(found) else found
        return self._errors[key]

    def model(self, case: Case) -> Model | None:
        """Return the robot in the coordinates of all its moving joints; None where dynx refuses the text."""
        text = _digest(case)
        if self._last_model[0] != text:
            try:
                self._last_model = text, model_without_mimics(case.source, case.base)
            except DynxError:
                self._last_model = text, None
        return self._last_model[1]

    def _is_within_limits(self, model: Model, q: Floats) -> bool:
        joints = model.coordinate_joints
        fine = (model.lower <= q) & (q <= model.upper)
        inside = fine[len(q) - len(joints) :]
        outside = {joint.name for joint, fits in zip(joints, inside, strict=True) if not fits}
        return outside <= self._without_range

    def _adds_no_cause(self, case: Case) -> bool:
        text = _digest(case)
        if text not in self._cause_free:
            self._cause_free[text] = _causes(case) <= self._known_causes
        return self._cause_free[text]


def _digest(case: Case) -> bytes:
    return hashlib.blake2b(case.source.data, digest_size=16).digest()


def _causes(case: Case) -> frozenset[Place]:
    causes = [rule for rule in all_rules() if rule.kind == "difference"]
    return frozenset(place_of(rule, each) for rule, each in detections(case, causes))


def _joints_without_range(model: Model) -> frozenset[str]:
    return frozenset(
        joint.name for joint in model.coordinate_joints if joint.limits.lower >= joint.limits.upper
    )


def difference_of(examiner: Examiner, engine: str, quantity: str) -> Difference:
    """Return the relative error of `engine` in `quantity` when it loads the text of a case."""

    def difference(case: Case, model: Model, q: Floats, v: Floats, a: Floats) -> float:
        try:
            free = model_without_mimics(case.source, case.base)
            if (free.nq, free.nv) != (len(q), len(v)):
                return 0.0
            rows = [np.asarray(row, dtype=np.float64)[None] for row in (q, v, a)]
            states = States(rows[0], rows[1], rows[2], np.zeros_like(rows[2]))
            examination = examiner.examine(case, [engine], reference=reference_values(free, states))
        except DynxError:
            return 0.0
        output = examination.outputs[engine]
        if output.no_results is not None or quantity in output.failed:
            return 0.0
        return examination.error(engine, quantity)

    return difference


INITIAL_STATES = 8
"""Number of random states at which the difference is measured. The search starts from the one with the
largest difference."""

MAX_ROUNDS = 4
"""Largest number of repetitions of all reductions; later ones remove little."""

TREE_REDUCTIONS: tuple[Callable[[XmlSource], Reductions], ...] = (
    fewer_extras,
    fewer_links,
    higher_links,
    fewer_moving_joints,
)
DETAIL_REDUCTIONS: tuple[Callable[[XmlSource], Reductions], ...] = (
    fewer_elements,
    fewer_attributes,
    frame_axes,
    plain_numbers,
    unit_numbers,
    *(partial(round_numbers, digits=digits) for digits in DIGITS),
)


def smallest_counterexample(
    case: Case, difference: Difference, *, tolerance: float, seed: int, budget: float | None
) -> Counterexample | None:
    """Find the smallest robot and the simplest state at which the difference is still there.

    `difference(case, model, q, v, a)` is the relative error of an engine on the text of a case, at a state in
    the coordinates of `model` (that text without mimic joints); 0 where it cannot be evaluated. The result
    has no more links and moving joints than `case` and adds no cause of the catalogue. Its error is above
    `tolerance`, and at least the geometric mean of the tolerance and the error found first (or 1, if that is
    smaller), so that a real difference is not reduced to noise.

    `budget` is the time [s] after which no new robot is tried; with None only `trials.MAX_TRIALS` limits the
    search. Equal arguments give equal results unless the time runs out.

    Returns None where dynx cannot read the case, or `INITIAL_STATES` random states, which follow from
    `seed`, show no error above `tolerance`.
    """
    trials = ReductionTrials(difference, case, budget)
    state = _first_state(case, trials, tolerance, seed)
    if state is None:
        return None
    for _ in range(MAX_ROUNDS):
        before = case.source.data, state.key
        case = _reduce(case, state, trials, TREE_REDUCTIONS)
        if trials.spent:
            break
        state = simplest_state(state, partial(trials.holds, case), seed)
        case = _reduce(case, state, trials, DETAIL_REDUCTIONS)
        if (case.source.data, state.key) == before or trials.spent:
            break
    return _result(_format_case(case, state, trials), state, trials)


def _first_state(case: Case, trials: ReductionTrials, tolerance: float, seed: int) -> ReducibleState | None:
    """Find the state of the largest error, and set the threshold of the trials by it."""
    model = trials.model(case)
    if model is None:
        return None
    drawn = draw_states(model, INITIAL_STATES, seed)
    states = [ReducibleState.of(model, *each) for each in zip(drawn.q, drawn.v, drawn.a, strict=True)]
    errors = [trials.error(case, state) for state in states]
    largest = max(errors)
    if largest <= tolerance:
        return None
    trials.threshold = max(tolerance, math.sqrt(tolerance * min(largest, 1.0)))
    return states[errors.index(largest)]


def _reduce(
    case: Case,
    state: ReducibleState,
    trials: ReductionTrials,
    kinds: Sequence[Callable[[XmlSource], Reductions]],
) -> Case:
    for kind in kinds:
        reductions = kind(case.source)

        def still_holds(
            changes: Sequence[Any], reductions: Reductions = reductions, case: Case = case
        ) -> bool:
            if trials.spent:
                return False
            try:
                smaller = case.with_source(reductions.apply(changes))
            except DescriptionError:
                return False  # For example, the text is not XML after removal of a namespace.
            return trials.holds(smaller, state)

        made = maximal_changes(reductions.changes, still_holds)
        if made:
            case = case.with_source(reductions.apply(made))
    return case


def _format_case(case: Case, state: ReducibleState, trials: ReductionTrials) -> Case:
    """Format the text of the case, if the formatted text shows the difference too."""
    for numbers in (True, False):
        text = format_document(case.source, numbers=numbers)
        candidate = case.with_source(XmlSource(text, case.source.source))
        if trials.holds(candidate, state):
            return candidate
    return case


def _result(case: Case, state: ReducibleState, trials: ReductionTrials) -> Counterexample:
    model = trials.model(case)
    assert model is not None
    q, v, a = (tuple(row.tolist()) for row in state.on(model))
    return Counterexample(case.source.text, q, v, a, len(model.joint_names), trials.error(case, state))
