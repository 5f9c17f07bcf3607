"""Attribution of errors that stay: each candidate setting is changed, and the trial is run again.

An error is attributed to the first candidate that at least halves it at the smallest step, makes it larger
at no step, and under which it is within the tolerance or falls with the step, or in proportion to which it
falls, as `dynx.contacts.verdict` judges. Where the error is within the tolerance at the smallest step, the
step of the largest error counts. Of several settings changed together, those are left out again without
which the change does the same. The price of a change is measured by running the whole case with it.

Runs that cannot matter are left out: a change is run at all steps only if it reduces the error at that step,
and further values of a candidate only if the one before changes the error and is not its cause.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Any

from dynx.contacts.candidates import SUBSTEPS, SettingsChange
from dynx.contacts.run import Measured, Runner, Unmeasured
from dynx.contacts.verdict import (
    Attribution,
    AttributionOutcome,
    FigureSeries,
    Price,
    TrialOfEngine,
    Verdict,
    judge,
)
from dynx.steppers.registry import world_class

Change = Mapping[str, Any]
"""Settings that are changed together, with their new values."""

Rerun = tuple[TrialOfEngine, Change, Sequence[float]]
"""A trial, the settings that are changed in it, and the steps [s] at which it is run again."""

WORSE = 2.0
"""Factor from which on an error that a change increases is part of its price."""


class Reruns:
    """Errors of trials under changes of settings, from runs that are kept."""

    def __init__(self, settings: Mapping[str, Mapping[str, Any]], runner: Runner) -> None:
        self._settings = settings
        self._runner = runner
        self._outcomes: dict[tuple[TrialOfEngine, str, float], Measured | Unmeasured | None] = {}

    def carry_out(self, wanted: Iterable[Rerun]) -> None:
        """Carry out what has not been run yet, all together."""
        missing = {
            (trial, _key(change), dt): trial.run(dt, {**self._settings[trial.engine], **change})
            for trial, change, steps in wanted
            for dt in steps
            if (trial, _key(change), dt) not in self._outcomes
        }
        self._outcomes.update(zip(missing, self._runner.run([*missing.values()]), strict=True))

    def errors(
        self, trial: TrialOfEngine, change: Change, steps: Sequence[float], figure: str
    ) -> tuple[float, ...] | None:
        """Return the errors of a figure at steps that were carried out; None where a run has no figures."""
        found: list[float] = []
        for dt in steps:
            outcome = self._outcomes.get((trial, _key(change), dt))
            if not isinstance(outcome, Measured):
                return None
            found += [each.error for each in outcome.figures if each.name == figure]
        return tuple(found) if len(found) == len(steps) else None

    def price(
        self, series: Sequence[FigureSeries], cause: FigureSeries, change: Change, dt: float
    ) -> tuple[Price, ...]:
        """Return the other errors in the case of `cause` that a change makes worse at the smallest step."""
        found = []
        for each in series:
            if each is cause:
                continue
            after = self.errors(each.trial, change, (dt,), each.name)
            if after is None:
                outcome = self._outcomes.get((each.trial, _key(change), dt))
                if not isinstance(outcome, Unmeasured):
                    continue
                after = (math.inf,)
            before = each.errors[-1]
            if not after[0] <= max(WORSE * before, each.tolerance):
                found.append(Price(each.trial.trial, each.name, before, after[0]))
        return tuple(found)


def _key(change: Change) -> str:
    return repr(sorted(change.items()))


LEAST_GAIN = 2.0
"""Factor by which a change has to reduce the error at the smallest step to be its cause."""


class Attributor:
    """Search for the causes of errors at these steps, among candidates by engine."""

    def __init__(
        self,
        steps: tuple[float, ...],
        settings: Mapping[str, Mapping[str, Any]],
        candidates: Mapping[str, Sequence[SettingsChange]],
        runner: Runner,
    ) -> None:
        self._steps = steps
        self._settings = settings
        self._candidates = candidates
        self._runner = runner
        self._reruns = Reruns(settings, runner)

    def attribute(
        self, open_series: Sequence[FigureSeries], series: Sequence[FigureSeries]
    ) -> dict[FigureSeries, Verdict]:
        """Return the verdict on every open series: a setting that is its cause, or none.

        `series` are all that were measured, in which the price of a change is looked for. Series are left out
        where the runner was interrupted before a cause was found.
        """
        left = list(open_series)
        causes: dict[FigureSeries, Attribution] = {}
        for number in range(max(map(len, self._candidates.values()), default=0)):
            tried = {
                each: self._candidates[each.trial.engine][number]
                for each in left
                if number < len(self._candidates.get(each.trial.engine, ()))
            }
            causes |= self._reduced(self._round(tried))
            left = [each for each in left if each not in causes]
        causes = self._priced(causes, series)
        verdicts = {each: Verdict("setting", attribution=cause) for each, cause in causes.items()}
        return verdicts | (
            {} if self._runner.interrupted else {each: Verdict("unexplained") for each in left}
        )

    def _round(self, tried: Mapping[FigureSeries, SettingsChange]) -> dict[FigureSeries, Attribution]:
        """Return the causes among one candidate for each series."""
        causes: dict[FigureSeries, Attribution] = {}
        left = dict(tried)
        for place in range(max((len(each.changes) for each in tried.values()), default=0)):
            changes = {
                each: candidate.changes[place]
                for each, candidate in left.items()
                if place < len(candidate.changes) and self._acting(each, candidate.changes[place])
            }
            causes |= self._causes(changes, {each: tried[each].reason for each in changes})
            inert = {each for each, change in changes.items() if self._has_no_effect(each, change)}
            left = {each: found for each, found in left.items() if each not in causes and each not in inert}
        falling = {each: found for each, found in left.items() if self._along(each, found) is not None}
        self._reruns.carry_out(
            (each.trial, change, self._steps) for each, found in falling.items() for change in found.changes
        )
        in_proportion = {each: self._proportion(each, found) for each, found in falling.items()}
        return causes | {each: cause for each, cause in in_proportion.items() if cause is not None}

    def _causes(
        self, changes: Mapping[FigureSeries, Change], reasons: Mapping[FigureSeries, str]
    ) -> dict[FigureSeries, Attribution]:
        """Return the causes among one change for each series, which is run at the decisive step first."""
        self._reruns.carry_out((each.trial, change, self._decisive(each)) for each, change in changes.items())
        helpful = {each: change for each, change in changes.items() if self._may_help(each, change)}
        self._reruns.carry_out((each.trial, change, self._steps) for each, change in helpful.items())
        found = {each: self._caused(each, change, reasons[each]) for each, change in helpful.items()}
        return {each: cause for each, cause in found.items() if cause is not None}

    def _may_help(self, series: FigureSeries, change: Change) -> bool:
        """Check whether a change reduces an error at the decisive step as far as a cause has to."""
        errors = self._reruns.errors(series.trial, change, self._decisive(series), series.name)
        return errors is not None and errors[0] * LEAST_GAIN <= series.errors[series.decisive]

    def _has_no_effect(self, series: FigureSeries, change: Change) -> bool:
        """Check whether a change leaves an error as it is, to the last digit."""
        errors = self._reruns.errors(series.trial, change, self._decisive(series), series.name)
        return errors == (series.errors[series.decisive],)

    def _decisive(self, series: FigureSeries) -> Sequence[float]:
        """Return the step at which a cause has to reduce an error."""
        return (self._steps[series.decisive],)

    def _caused(self, series: FigureSeries, change: Change, reason: str) -> Attribution | None:
        """Return a change as the cause of an error that it removes or makes fall with the step, or None."""
        errors = self._reruns.errors(series.trial, change, self._steps, series.name)
        at = series.decisive
        if errors is None or errors[at] * LEAST_GAIN > series.errors[at] or _larger(series, errors):
            return None
        trend = judge(self._steps, errors, series.tolerance)
        if trend.kind == "stays":
            return None
        outcome: AttributionOutcome = "removed" if trend.kind == "within" else "falls"
        acting = self._acting(series, change)
        return Attribution(acting, reason, (series.errors, errors), outcome, trend.order)

    def _reduced(self, causes: dict[FigureSeries, Attribution]) -> dict[FigureSeries, Attribution]:
        """Return the causes without the settings whose change does nothing."""
        for place in range(max((len(each.values) for each in causes.values()), default=0)):
            fewer: dict[FigureSeries, dict[str, Any]] = {}
            for each, cause in causes.items():
                if cause.outcome == "proportion" or len(cause.values) < 2:
                    continue
                change = {name: tried[-1] for name, tried in cause.values.items()}
                # Settings that have been left out before move the others forward.
                kept = len(cause.values) - 1 - place
                if kept >= 0:
                    del change[[*change][kept]]
                    fewer[each] = change
            self._reruns.carry_out((each.trial, change, self._steps) for each, change in fewer.items())
            for each, change in fewer.items():
                alone = self._caused(each, change, causes[each].reason)
                if alone is not None and _as_good(each, alone, causes[each]):
                    causes = causes | {each: alone}
        return causes

    def _along(self, series: FigureSeries, candidate: SettingsChange) -> float | None:
        """Return the order at which an error at the smallest step falls along the values of the first setting
        of a candidate, if that is numeric, or None."""
        last = self._steps[-1:]
        errors = [self._reruns.errors(series.trial, each, last, series.name) for each in candidate.changes]
        used = self._in_use(series, candidate.values)
        name, tried = next(iter(candidate.values.items()))
        numbers = (used[name], *tried)
        if len(errors) < 2 or not all(type(each) in (int, float) and each > 0 for each in numbers):
            return None
        sizes = numbers if numbers[-1] < numbers[0] else tuple(1.0 / number for number in numbers)
        # A setting that the user has changed may be beyond values that are tried.
        if any(after >= before for before, after in pairwise(sizes)):
            return None
        found = [series.errors[-1], *(each[0] for each in errors if each is not None)]
        if len(found) < len(sizes) or found[-1] * LEAST_GAIN > found[0]:
            return None
        return judge(sizes, found, series.tolerance).order

    def _proportion(self, series: FigureSeries, candidate: SettingsChange) -> Attribution | None:
        """Return the candidate as the cause of an error that falls in proportion to it, or None."""
        order = self._along(series, candidate)
        rows = [
            self._reruns.errors(series.trial, each, self._steps, series.name) for each in candidate.changes
        ]
        errors = tuple(each for each in rows if each is not None)
        if order is None or len(errors) < len(rows) or _larger(series, errors[-1]):
            return None
        used = self._in_use(series, candidate.values)
        values = {name: (used[name], *tried) for name, tried in candidate.values.items()}
        acting = {name: each for name, each in values.items() if len(set(each)) > 1}
        return Attribution(acting, candidate.reason, (series.errors, *errors), "proportion", order)

    def _priced(
        self, causes: Mapping[FigureSeries, Attribution], series: Sequence[FigureSeries]
    ) -> dict[FigureSeries, Attribution]:
        """Return the causes with their price: the errors in the same case that they make worse."""
        around: dict[tuple[str, str], list[FigureSeries]] = {}
        for each in series:
            around.setdefault((each.trial.engine, each.trial.case.name), []).append(each)
        changes = {
            each: {name: tried[-1] for name, tried in cause.values.items()} for each, cause in causes.items()
        }
        others = {each: around[each.trial.engine, each.trial.case.name] for each in causes}
        self._reruns.carry_out(
            (other.trial, changes[each], self._steps[-1:]) for each in causes for other in others[each]
        )
        return {
            each: replace(cause, price=self._reruns.price(others[each], each, changes[each], self._steps[-1]))
            for each, cause in causes.items()
        }

    def _acting(self, series: FigureSeries, change: Change) -> dict[str, tuple[Any, Any]]:
        """Return the settings that a change gives another value, each with both values."""
        used = self._in_use(series, change)
        return {name: (used[name], value) for name, value in change.items() if used[name] != value}

    def _in_use(self, series: FigureSeries, names: Mapping[str, Any]) -> dict[str, Any]:
        """Return the values of settings before a change."""
        known = world_class(series.trial.engine).settings
        defaults = {name: setting.default for name, setting in known.items()} | {SUBSTEPS: 1}
        given = self._settings[series.trial.engine]
        return {name: given.get(name, defaults[name]) for name in names}


def _larger(series: FigureSeries, errors: Sequence[float]) -> bool:
    """Check whether an error is larger at some step than before, beyond the tolerance."""
    return any(
        not after <= before + series.tolerance for before, after in zip(series.errors, errors, strict=True)
    )


def _as_good(series: FigureSeries, fewer: Attribution, cause: Attribution) -> bool:
    """Check whether a change of fewer settings leaves no more of an error than the cause does."""
    return fewer.outcome == cause.outcome and all(
        one <= max(LEAST_GAIN * both, series.tolerance)
        for one, both in zip(fewer.errors[-1], cause.errors[-1], strict=True)
    )
