"""Runs of trials with settings changed, each carried out once."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from dynx.contacts.run import Measured, Unmeasured
from dynx.contacts.runner import Runner
from dynx.contacts.series import Series, TrialOfEngine
from dynx.contacts.verdict import Price

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

    def price(self, series: Sequence[Series], cause: Series, change: Change, dt: float) -> tuple[Price, ...]:
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
