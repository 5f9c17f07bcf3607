"""The smallest counterexample for a difference that no rule explains: for a bug report.

First the robot is cut down while the difference stays: shapes and simulators' elements go, then links,
then moving joints become fixed; then elements, attributes and digits. Between these the state is made
simple. All of it is repeated until nothing can go any more or the budget is spent. What is cut is text,
by the places where it stands, so that a difference in how engines read it is not written away.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial

from dynx.doctor.counterexample.delta_debugging import most
from dynx.doctor.counterexample.detail_reductions import (
    DIGITS,
    fewer_attributes,
    fewer_elements,
    fewer_extras,
    frame_axes,
    plain_numbers,
    round_numbers,
    tidy,
    unit_numbers,
)
from dynx.doctor.counterexample.state_by_name import NamedState, named_states
from dynx.doctor.counterexample.state_reduction import simplest_state
from dynx.doctor.counterexample.tree_reductions import Cuts, fewer_links, fewer_moving_joints, higher_links
from dynx.doctor.counterexample.trials import Difference, Trials
from dynx.doctor.examine.right_answers import draw_states
from dynx.doctor.report import Counterexample
from dynx.errors import DescriptionError
from dynx.model.xml.source import XmlSource
from dynx.rules import Case

FIRST_STATES = 8
"""Random states at which the difference is looked for; the one where it is largest is kept."""

ROUNDS = 4
"""Repetitions of all the cuts; what a later one finds is small."""

_CUTS: tuple[Callable[[XmlSource], Cuts], ...] = (
    fewer_extras,
    fewer_links,
    higher_links,
    fewer_moving_joints,
)
_DETAILS: tuple[Callable[[XmlSource], Cuts], ...] = (
    fewer_elements,
    fewer_attributes,
    frame_axes,
    plain_numbers,
    unit_numbers,
    *(partial(round_numbers, digits=digits) for digits in DIGITS),
)


def smallest(
    case: Case, difference: Difference, *, tolerance: float, seed: int, budget: float | None
) -> Counterexample | None:
    """The smallest robot and the simplest state found at which the difference is still there.

    `difference(case, model, q, v, a)` is the relative error of an engine on the text of a case, at a
    state in the coordinates of `model` (that text with its mimic joints set free); 0 where it cannot be
    evaluated. The result has no more links and moving joints than `case`, brings in no cause that the
    catalogue knows, and its error is above `tolerance` and not far below the error found first: at
    least the geometric mean of that (1 at most) and the tolerance, lest a real difference end as noise.

    `budget` bounds the time [s] after which no new robot is tried; None leaves `trials.MAX_TRIALS`.
    Equal arguments give equal results, but for where the time ends.

    Returns None where dynx cannot read the case, or `FIRST_STATES` random states, which follow from
    `seed`, show no error above `tolerance`.
    """
    trials = Trials(difference, case, budget)
    state = _first_state(case, trials, tolerance, seed)
    if state is None:
        return None
    for _ in range(ROUNDS):
        before = case.source.data, state.key
        case = _cut(case, state, trials, _CUTS)
        if trials.spent:
            break
        state = simplest_state(state, partial(trials.holds, case), seed)
        case = _cut(case, state, trials, _DETAILS)
        if (case.source.data, state.key) == before or trials.spent:
            break
    return _result(_tidied(case, state, trials), state, trials)


def _first_state(case: Case, trials: Trials, tolerance: float, seed: int) -> NamedState | None:
    """The state of the largest error; sets the threshold of what is tried after it."""
    model = trials.model(case)
    if model is None:
        return None
    states = list(named_states(model, draw_states(model, FIRST_STATES, seed)))
    errors = [trials.error(case, state) for state in states]
    largest = max(errors)
    if largest <= tolerance:
        return None
    trials.threshold = max(tolerance, math.sqrt(tolerance * min(largest, 1.0)))
    return states[errors.index(largest)]


def _cut(
    case: Case, state: NamedState, trials: Trials, ways: tuple[Callable[[XmlSource], Cuts], ...]
) -> Case:
    for way in ways:
        cuts = way(case.source)
        made = most(cuts.changes, partial(_can_be_made, cuts, case=case, state=state, trials=trials))
        if made:
            case = case.with_source(cuts.apply(made))
    return case


def _can_be_made(cuts: Cuts, changes: list[object], *, case: Case, state: NamedState, trials: Trials) -> bool:
    if trials.spent:
        return False
    try:
        smaller = case.with_source(cuts.apply(changes))
    except DescriptionError:
        return False  # dropping a namespace, say, leaves no XML
    return trials.holds(smaller, state)


def _tidied(case: Case, state: NamedState, trials: Trials) -> Case:
    """The case in tidy text, if that shows the difference too."""
    for numbers in (True, False):
        tidied = case.with_source(XmlSource(tidy(case.source, numbers=numbers), case.source.source))
        if trials.holds(tidied, state):
            return tidied
    return case


def _result(case: Case, state: NamedState, trials: Trials) -> Counterexample:
    model = trials.model(case)
    assert model is not None
    q, v, a = (tuple(row.tolist()) for row in state.on(model))
    return Counterexample(case.source.text, q, v, a, len(model.joint_names), trials.error(case, state))
