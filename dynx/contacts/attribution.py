"""Attribution of errors that stay: each candidate setting is changed, and the trial is run again.

An error is attributed to the first candidate with which it vanishes, falls with the step, or falls in
proportion to the setting, at the smallest step, as `dynx.contacts.trend` judges.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from dynx.contacts.candidates import Candidate
from dynx.contacts.run import Measured, Run, Unmeasured
from dynx.contacts.runner import Runner
from dynx.contacts.series import Series, TrialOfEngine
from dynx.contacts.trend import judge
from dynx.contacts.verdict import Attribution, Verdict
from dynx.world.registry import world_class

LEAST_GAIN = 2.0
"""Factor by which a change has to reduce the error at the smallest step to be its cause."""


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
            trial: candidates[trial.engine][number]
            for trial in dict.fromkeys(each.trial for each in left)
            if number < len(candidates.get(trial.engine, ()))
        }
        runs = [run for trial, each in tried.items() for run in _runs(trial, each, steps, settings)]
        outcomes = iter(runner.run(runs))
        found = {trial: _errors(each, steps, outcomes) for trial, each in tried.items()}
        for each in left:
            if each.trial in tried:
                cause = _cause(each, tried[each.trial], found[each.trial], steps, settings)
                if cause is not None:
                    verdicts[each] = Verdict("setting", attribution=cause)
        left = [each for each in left if each not in verdicts]
    return verdicts | ({} if runner.interrupted else {each: Verdict("unexplained") for each in left})


def _runs(
    trial: TrialOfEngine,
    candidate: Candidate,
    steps: tuple[float, ...],
    settings: Mapping[str, Mapping[str, Any]],
) -> Iterator[Run]:
    for changed in changes(candidate):
        for dt in steps:
            yield Run(trial.engine, trial.case, trial.trial, dt, {**settings[trial.engine], **changed})


def changes(candidate: Candidate) -> list[dict[str, Any]]:
    """Return the settings that a candidate changes together, one dict for each change."""
    names = list(candidate.values)
    return [dict(zip(names, values, strict=True)) for values in zip(*candidate.values.values(), strict=True)]


def _errors(
    candidate: Candidate, steps: tuple[float, ...], outcomes: Iterator[Measured | Unmeasured | None]
) -> list[dict[str, tuple[float, ...]]] | None:
    """Return the errors at every step of every figure, one dict for each change; None if a run failed."""
    found: list[dict[str, tuple[float, ...]]] | None = []
    for _ in changes(candidate):
        measured = [next(outcomes) for _ in steps]
        figures = [outcome.figures for outcome in measured if isinstance(outcome, Measured)]
        if len(figures) < len(steps):
            found = None
        if found is not None:
            names = [figure.name for figure in figures[0]]
            found.append({name: tuple(each[k].error for each in figures) for k, name in enumerate(names)})
    return found


def _cause(
    series: Series,
    candidate: Candidate,
    found: list[dict[str, tuple[float, ...]]] | None,
    steps: tuple[float, ...],
    settings: Mapping[str, Mapping[str, Any]],
) -> Attribution | None:
    """Return the candidate as the cause of the error of a series; None where it is not."""
    if found is None:
        return None
    figure = series.figures[0]
    errors = (series.errors, *(each[figure.name] for each in found))
    values = _values_in_use(series.trial.engine, candidate, settings)
    for k in range(1, len(errors)):
        gained = errors[k][-1] * LEAST_GAIN <= errors[0][-1]
        if gained and judge(steps, errors[k], figure.tolerance).kind != "stays":
            tried = {name: found_values[: k + 1] for name, found_values in values.items()}
            return Attribution(tried, candidate.reason, errors[: k + 1], None)
    order = _order([*values.values()], [each[-1] for each in errors], figure.tolerance)
    return None if order is None else Attribution(values, candidate.reason, errors, order)


def _order(values: Sequence[tuple[Any, ...]], errors: list[float], tolerance: float) -> float | None:
    """Return the order at which errors fall with the values of one setting; None where they do not."""
    numbers = values[0]
    if len(values) > 1 or len(numbers) < 3 or errors[-1] * LEAST_GAIN > errors[0]:
        return None
    if not all(type(number) in (int, float) and number > 0 for number in numbers):
        return None
    sizes = numbers if numbers[-1] < numbers[0] else tuple(1.0 / number for number in numbers)
    trend = judge(sizes, errors, tolerance)
    return trend.order if trend.kind == "falls" else None


def _values_in_use(
    engine: str, candidate: Candidate, settings: Mapping[str, Mapping[str, Any]]
) -> dict[str, tuple[Any, ...]]:
    """Return the values of each setting of a candidate, after the one in use."""
    known = world_class(engine).settings
    used = {name: settings[engine].get(name, known[name].default) for name in candidate.values}
    return {name: (used[name], *values) for name, values in candidate.values.items()}
