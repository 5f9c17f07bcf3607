"""Search for the smallest counterexample for a difference that no rule explains, for use in a bug report.

The robot is reduced while the difference stays: shapes and simulators' elements are removed, then links,
then moving joints become fixed; then elements, attributes and digits. Between these the state is simplified.
All of it is repeated until nothing more can be removed or the budget is spent. The reductions edit the text
in place, so that a difference caused by the text itself is not lost.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

from dynx.doctor.counterexample.delta_debugging import maximal_changes
from dynx.doctor.counterexample.detail_reductions import (
    DIGITS,
    fewer_attributes,
    fewer_elements,
    fewer_extras,
    format_document,
    frame_axes,
    plain_numbers,
    round_numbers,
    unit_numbers,
)
from dynx.doctor.counterexample.state_reduction import ReducibleState, simplest_state
from dynx.doctor.counterexample.tree_reductions import (
    Reductions,
    fewer_links,
    fewer_moving_joints,
    higher_links,
)
from dynx.doctor.counterexample.trials import Difference, ReductionTrials
from dynx.doctor.examine.reference_values import draw_states
from dynx.doctor.report import Counterexample
from dynx.errors import DescriptionError
from dynx.model.xml.source import XmlSource
from dynx.rules import Case

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
