"""Verdicts on figures, and the settings that errors are attributed to."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, Literal, NamedTuple

import numpy as np

from dynx.contacts.case import ContactCase, Figure
from dynx.contacts.run import CaseRun, Measured, Unmeasured
from dynx.errors import ArgumentError, shown
from dynx.steppers.registry import world_class

VerdictKind = Literal["within", "falls", "setting", "cannot", "unexplained"]
"""Verdict on the errors of one figure of one engine over the steps.

``within``: within the tolerance at every step. ``falls``: falls with the step. ``setting``: stays, and is
removed or falls when a setting of the engine is changed. ``cannot``: the engine lacks a coefficient
on which the exact value rests. ``unexplained``: none of these.
"""

VERDICTS: tuple[VerdictKind, ...] = ("within", "falls", "setting", "cannot", "unexplained")


AttributionOutcome = Literal["removed", "falls", "proportion"]
"""Effect of the last change on the error it is the cause of.

``removed``: within the tolerance at every step. ``falls``: falls with the step. ``proportion``: falls at the
smallest step from each value of the setting to the next.
"""


@dataclass(frozen=True)
class Price:
    """Another figure of the same case, whose error a change at least doubles at the smallest step."""

    trial: str
    figure: str
    before: float
    """Relative error with the setting in use."""
    after: float
    """Relative error with the last value tried; infinite where the engine then has no result."""


@dataclass(frozen=True)
class Attribution:
    """A setting, or several changed together, that are the cause of an error: proved by running again."""

    values: Mapping[str, tuple[Any, ...]]
    """Values by the name of the setting: the one in use, then those that were tried, in order."""
    reason: str
    """Effect of the setting in the engine."""
    errors: tuple[tuple[float, ...], ...]
    """Relative errors at every step, for each of the values in turn."""
    outcome: AttributionOutcome
    order: float | None
    """Order at which the error then falls: with the step if `outcome` is ``falls``, with the setting if it is
    ``proportion``."""
    price: tuple[Price, ...] = ()
    """Errors of other figures of the case that the last change makes worse."""

    @property
    def before(self) -> float:
        """Relative error at the smallest step with the setting in use."""
        return self.errors[0][-1]

    @property
    def after(self) -> float:
        """Relative error at the smallest step with the last value tried."""
        return self.errors[-1][-1]


@dataclass(frozen=True)
class Verdict:
    """Verdict on a figure, with what proves it."""

    kind: VerdictKind
    order: float | None = None
    """Order at which the error falls with the step, if the verdict is ``falls``."""
    attribution: Attribution | None = None
    """Setting that causes the error, if the verdict is ``setting``."""
    reason: str | None = None
    """Reason why the engine cannot give the exact value, if the verdict is ``cannot``."""


class TrialOfEngine(NamedTuple):
    """A trial of a case in one engine."""

    engine: str
    case: ContactCase
    trial: str

    def run(self, dt: float, settings: Mapping[str, Any]) -> CaseRun:
        """Return the run of the trial at a step, with these settings of the engine."""
        return CaseRun(self.engine, self.case, self.trial, dt, settings, world_class(self.engine))


@dataclass(frozen=True, eq=False)
class FigureSeries:
    """One figure of a trial at every step, largest first."""

    trial: TrialOfEngine
    figures: tuple[Figure, ...]
    reason: str | None = None
    """Why the engine cannot give the exact value; None where it can."""

    @property
    def name(self) -> str:
        """Name of the figure."""
        return self.figures[0].name

    @property
    def tolerance(self) -> float:
        """Relative error below which an error counts as none."""
        return self.figures[0].tolerance

    @property
    def errors(self) -> tuple[float, ...]:
        """Relative error at each step."""
        return tuple(figure.error for figure in self.figures)

    @property
    def decisive(self) -> int:
        """Index of the step at which a cause has to reduce the error: the smallest step, or the step of the
        largest error where the error is within the tolerance at the smallest step."""
        errors = self.errors
        last = len(errors) - 1
        return last if not errors[last] <= self.tolerance else errors.index(max(errors))


def collect(trial: TrialOfEngine, outcomes: Sequence[Measured | Unmeasured | None]) -> list[FigureSeries]:
    """Return the series of every figure of a trial; none where a run of it has no figures."""
    measured = [outcome for outcome in outcomes if isinstance(outcome, Measured)]
    if len(measured) < len(outcomes):
        return []
    names = [[figure.name for figure in outcome.figures] for outcome in measured]
    if any(each != names[0] for each in names):
        differing = next(each for each in names if each != names[0])
        raise ArgumentError(
            f"the case {shown(trial.case.name)} has the figures {', '.join(names[0])} at one step and "
            f"{', '.join(differing)} at another; wanted the same at every step"
        )
    # An engine may have a coefficient in short steps only.
    lacking = measured[-1].lacking
    series = []
    for number, first in enumerate(measured[0].figures):
        reasons = [lacking[name] for name in first.rests_on if name in lacking]
        figures = tuple(outcome.figures[number] for outcome in measured)
        series.append(FigureSeries(trial, figures, reasons[0] if reasons else None))
    return series


MIN_ORDER = 0.5
"""Least order at which an error counts as falling: half the step leaves at most 71 % of it."""

TrendKind = Literal["within", "falls", "stays"]


@dataclass(frozen=True)
class Trend:
    """Trend of a series of errors, with the order at which they fall (None unless they do)."""

    kind: TrendKind
    order: float | None = None


def judge(steps: Sequence[float], errors: Sequence[float], tolerance: float) -> Trend:
    """Return the trend of `errors` at `steps`, largest step first."""
    if not all(math.isfinite(error) for error in errors):
        return Trend("stays")
    counted = [max(error, tolerance) for error in errors]
    if max(counted) <= tolerance:
        return Trend("within")
    if len(counted) < 2:
        return Trend("stays")
    logs = [math.log(error) for error in counted]
    sizes = [math.log(step) for step in steps]
    for (a, b), (s, t) in zip(pairwise(logs), pairwise(sizes), strict=True):
        to_tolerance = b == math.log(tolerance)
        if not to_tolerance and a - b < MIN_ORDER * (s - t):
            return Trend("stays")
    return Trend("falls", float(np.polyfit(sizes, logs, 1)[0]))
