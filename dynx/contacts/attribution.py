"""Attribution of errors that stay: each candidate setting is changed, and the trial is run again.

An error is attributed to the first candidate that at least halves it at the smallest step, and under which it
is within the tolerance or falls with the step, or in proportion to which it falls, as `dynx.contacts.trend`
judges. Where the error is within the tolerance at the smallest step, the step of the largest error counts.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Any

from dynx.contacts.candidates import SUBSTEPS, Candidate
from dynx.contacts.run import Measured
from dynx.contacts.runner import Runner
from dynx.contacts.series import Series, TrialOfEngine
from dynx.contacts.trend import judge
from dynx.contacts.verdict import Attribution, Verdict
from dynx.world.registry import world_class

LEAST_GAIN = 2.0
"""Factor by which a change has to reduce the error at the smallest step to be its cause."""

Change = tuple[TrialOfEngine, int]
"""A trial, and the number of a change of the candidate that is tried, from 0."""

Errors = dict[str, tuple[float, ...]]
"""Errors by the name of the figure, at every step or at the smallest alone."""


Used = Mapping[str, Any]
"""Values of settings before a change."""


def attribute(
    series: Sequence[Series],
    steps: tuple[float, ...],
    settings: Mapping[str, Mapping[str, Any]],
    candidates: Mapping[str, Sequence[Candidate]],
    runner: Runner,
) -> dict[Series, Verdict]:
    """Return the verdict on every series: a setting that is its cause, or none.

    Series are left out where the runner was interrupted before a cause was found.
    """
    left = list(series)
    verdicts: dict[Series, Verdict] = {}
    rounds = max((len(candidates.get(each.trial.engine, ())) for each in left), default=0)
    for number in range(rounds):
        tried = {
            each.trial: candidates[each.trial.engine][number]
            for each in left
            if number < len(candidates.get(each.trial.engine, ()))
        }
        trial_series = [each for each in left if each.trial in tried]
        finest, all_steps = _try(tried, trial_series, steps, settings, runner)
        for each in trial_series:
            candidate = tried[each.trial]
            used = _settings_in_use(each, candidate, settings[each.trial.engine])
            cause = _removal(each, candidate, all_steps, steps, used)
            cause = cause or _proportion(each, candidate, finest, used)
            if cause is not None:
                verdicts[each] = Verdict("setting", attribution=cause)
        left = [each for each in left if each not in verdicts]
    return verdicts | ({} if runner.interrupted else {each: Verdict("unexplained") for each in left})


def _try(
    tried: Mapping[TrialOfEngine, Candidate],
    series: Sequence[Series],
    steps: tuple[float, ...],
    settings: Mapping[str, Mapping[str, Any]],
    runner: Runner,
) -> tuple[dict[Change, Errors], dict[Change, Errors]]:
    """Return the errors under every change: at the smallest step, and at all steps where it helps there."""
    changed = {
        (trial, k): {**settings[trial.engine], **change}
        for trial, candidate in tried.items()
        for k, change in enumerate(candidate.changes)
    }
    finest = _errors(changed, steps[-1:], runner)
    helpful = {
        (trial, k): changed[trial, k]
        for (trial, k), found in finest.items()
        if any(each.trial == trial and _may_help(each, found[each.name][-1]) for each in series)
    }
    coarser = _errors(helpful, steps[:-1], runner)
    return finest, {
        change: {name: (*found.get(name, ()), *last) for name, last in finest[change].items()}
        for change, found in coarser.items()
    }


def _errors(
    changed: Mapping[Change, Mapping[str, Any]], steps: tuple[float, ...], runner: Runner
) -> dict[Change, Errors]:
    """Return the errors under settings at these steps; changes under which a run failed are left out."""
    runs = [trial.run(dt, given) for (trial, _), given in changed.items() for dt in steps]
    outcomes = iter(runner.run(runs))
    found: dict[Change, Errors] = {}
    for change in changed:
        measured = [outcome for outcome in (next(outcomes) for _ in steps) if isinstance(outcome, Measured)]
        if len(measured) == len(steps):
            names = [figure.name for figure in measured[0].figures] if measured else []
            found[change] = {
                name: tuple(outcome.figures[k].error for outcome in measured) for k, name in enumerate(names)
            }
    return found


def _may_help(series: Series, error: float) -> bool:
    """Check whether a change with this error at the smallest step may remove the error of a series."""
    return series.decisive < len(series.errors) - 1 or error * LEAST_GAIN <= series.errors[-1]


def _removal(
    series: Series, candidate: Candidate, found: Mapping[Change, Errors], steps: tuple[float, ...], used: Used
) -> Attribution | None:
    """Return the candidate as the cause of an error that one of its changes removes, or None."""
    for k, change in enumerate(candidate.changes):
        errors = found.get((series.trial, k), {}).get(series.name)
        at = series.decisive
        if errors is None or errors[at] * LEAST_GAIN > series.errors[at]:
            continue
        if judge(steps, errors, series.tolerance).kind != "stays":
            values = {name: (used[name], value) for name, value in change.items()}
            return Attribution(values, candidate.reason, (series.errors, errors), None)
    return None


def _proportion(
    series: Series, candidate: Candidate, found: Mapping[Change, Errors], used: Used
) -> Attribution | None:
    """Return the candidate as the cause of an error that falls along the values of its first setting, if that
    is numeric, or None."""
    errors = [found.get((series.trial, k), {}).get(series.name) for k in range(len(candidate.changes))]
    if len(errors) < 2 or None in errors:
        return None
    values = {name: (used[name], *tried) for name, tried in candidate.values.items()}
    numbers = next(iter(values.values()))
    if not all(type(number) in (int, float) and number > 0 for number in numbers):
        return None
    sizes = numbers if numbers[-1] < numbers[0] else tuple(1.0 / number for number in numbers)
    # A setting that the user has changed may be beyond values that are tried.
    if any(after >= before for before, after in pairwise(sizes)):
        return None
    falling = (series.errors[-1:], *(each for each in errors if each is not None))
    trend = judge(sizes, [each[-1] for each in falling], series.tolerance)
    if trend.kind != "falls" or falling[-1][-1] * LEAST_GAIN > series.errors[-1]:
        return None
    return Attribution(values, candidate.reason, falling, trend.order)


def _settings_in_use(series: Series, candidate: Candidate, given: Mapping[str, Any]) -> Used:
    """Return the value of each setting of a candidate before its changes."""
    known = world_class(series.trial.engine).settings
    defaults = {name: setting.default for name, setting in known.items()} | {SUBSTEPS: 1}
    return {name: given.get(name, defaults[name]) for name in candidate.values}
