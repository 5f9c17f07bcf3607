"""Verdicts on figures, and the settings that errors are attributed to."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

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
    """Part that the setting plays in the engine."""
    errors: tuple[tuple[float, ...], ...]
    """Relative errors at every step, for each of the values in turn."""
    outcome: AttributionOutcome
    order: float | None
    """Order at which the error then falls with the step, under ``falls``, or with the setting, under
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
    """Order at which the error falls with the step, under ``falls``."""
    attribution: Attribution | None = None
    """The setting, under ``setting``."""
    reason: str | None = None
    """Why the engine cannot give the exact value, under ``cannot``."""
