"""Verdicts on figures, and the settings that errors are attributed to."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

VerdictKind = Literal["exact", "falls", "setting", "cannot", "unexplained"]
"""Verdict on the errors of one figure of one engine over the steps.

``exact``: within the tolerance at every step. ``falls``: falls with the step. ``setting``: stays, and falls
or vanishes when a setting of the engine is changed. ``cannot``: the engine lacks a coefficient on which the
exact value rests. ``unexplained``: none of these.
"""

VERDICTS: tuple[VerdictKind, ...] = ("exact", "falls", "setting", "cannot", "unexplained")


@dataclass(frozen=True)
class Attribution:
    """A setting, or several changed together, whose change removes an error: proved by running again."""

    values: Mapping[str, tuple[Any, ...]]
    """Values by the name of the setting: the one in use, then those that were tried, in order."""
    reason: str
    """Part that the setting plays in the engine."""
    errors: tuple[tuple[float, ...], ...]
    """Relative errors for each of the values in turn: at every step, or at the smallest step alone where the
    error falls with the setting."""
    order: float | None
    """Order at which the error falls with the setting; None where the last change removes it."""

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
