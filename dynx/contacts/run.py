"""Runs: a trial of a case in one engine at one step, and the worker processes that carry them out."""

from __future__ import annotations

import math
import sys
import traceback
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

from dynx.argument_types import is_listed
from dynx.contacts.case import ContactCase, Figure
from dynx.errors import (
    ArgumentError,
    DynxError,
    EngineLimitError,
    NotInstalledError,
    UnsupportedFeatureError,
    located,
    shown,
)
from dynx.steppers.registry import register, world_names
from dynx.steppers.stepper import Stepper
from dynx.workers import WorkerResult, Workers
from dynx.world import World


@dataclass(frozen=True)
class CaseRun:
    """A trial of a case in one engine at the step `dt` [s], with settings that differ from the defaults."""

    engine: str
    case: ContactCase
    trial: str
    dt: float
    settings: Mapping[str, Any]
    kind: type[Stepper] | None = None
    """Class of an engine that the running program registered, which a worker process does not know."""


@dataclass(frozen=True)
class Measured:
    """Figures of a run."""

    figures: tuple[Figure, ...]
    version: str = ""
    """Version of the engine."""
    lacking: Mapping[str, str] = field(default_factory=dict)
    """Coefficients that the engine does not have as the scene states them, each with its reason."""


@dataclass(frozen=True)
class Unmeasured:
    """Reason why a run has no figures: the engine refused the scene or failed in it."""

    kind: Literal["refused", "error", "crash", "timeout", "defect"]
    message: str


def carry_out(run: CaseRun) -> Measured | Unmeasured:
    """Open the world of a run, and measure."""
    if run.kind is not None and run.engine not in world_names():
        kind = run.kind
        register(run.engine, lambda: kind)
    try:
        parameters = run.case.trials[run.trial]
        scene = run.case.scene(parameters)
        interval = run.case.contact_interval
        with World(scene, run.engine, run.dt, contact_interval=interval, **run.settings) as world:
            version = world.version
            lacking = {each.quantity: str(each) for each in world.inexact_materials()}
            figures = checked_figures(run.case.measure(world, parameters))
    except NotInstalledError:
        raise
    except (UnsupportedFeatureError, EngineLimitError) as error:
        return Unmeasured("refused", str(error))
    except Exception as error:
        where = line_in_case(run.case, error)
        if where is None and not isinstance(error, DynxError):
            raise
        return Unmeasured("error", located(f"{type(error).__name__}: {error}", where, None))
    return Measured(figures, version, lacking)


def checked_figures(figures: object) -> tuple[Figure, ...]:
    """Return what a case measured; ArgumentError where it is not at least one figure, each with its name."""
    found = tuple(figures) if is_listed(figures) else ()
    if not found or not all(isinstance(each, Figure) for each in found):
        raise ArgumentError("measure returned no figures; wanted at least one Figure")
    names = [each.name for each in found]
    for name in names:
        if names.count(name) > 1:
            raise ArgumentError(f"measure returned two figures of the name {shown(name)}")
    for each in found:
        if not math.isfinite(each.measured):
            raise ArgumentError(f"the figure {shown(each.name)} is {each.measured}; wanted a finite number")
    return found


def line_in_case(case: ContactCase, error: BaseException) -> str | None:
    """Return file and line of the last call in the module of a case that led to an error; None for a case of
    dynx itself."""
    module = sys.modules[type(case).__module__]
    if module.__name__.startswith("dynx."):
        return None
    lines = [
        f"{frame.filename}:{frame.lineno}"
        for frame in traceback.extract_tb(error.__traceback__)
        if frame.filename == getattr(module, "__file__", None)
    ]
    return lines[-1] if lines else None


class Runner:
    """Worker processes that carry out runs, or this process where `jobs` is 0; leaving the context ends them.

    With `interruptible`, KeyboardInterrupt ends the runs and is not raised again.
    """

    def __init__(
        self,
        jobs: int,
        timeout: float | None,
        progress: Callable[[int, int], object] | None,
        *,
        interruptible: bool = False,
    ) -> None:
        self._workers = Workers(carry_out, jobs, timeout) if jobs else None
        self._progress = progress
        self._interruptible = interruptible
        self.interrupted = False
        """True once KeyboardInterrupt has ended the runs."""
        self.done = 0
        """Number of runs that have been carried out."""

    def __enter__(self) -> Runner:
        return self

    def __exit__(self, *_: object) -> None:
        if self._workers is not None:
            self._workers.close()

    def run(self, runs: Sequence[CaseRun]) -> list[Measured | Unmeasured | None]:
        """Carry out all runs and return their outcomes in the order of the runs; None for a run left out."""
        outcomes: list[Measured | Unmeasured | None] = [None] * len(runs)
        try:
            if not self.interrupted:
                self._carry_out(runs, outcomes)
        except KeyboardInterrupt:
            if not self._interruptible:
                raise
            self.interrupted = True
        return outcomes

    def _carry_out(self, runs: Sequence[CaseRun], outcomes: list[Measured | Unmeasured | None]) -> None:
        total = self.done + len(runs)
        for outcome in self._outcomes(runs):
            if outcome.failure is not None:
                outcomes[outcome.index] = Unmeasured(outcome.failure.kind, outcome.failure.message)
            else:
                outcomes[outcome.index] = outcome.value
            self.done += 1
            if self._progress is not None:
                self._progress(self.done, total)

    def _outcomes(self, runs: Sequence[CaseRun]) -> Iterator[WorkerResult]:
        if self._workers is not None:
            return self._workers.run(runs)
        return (WorkerResult(number, carry_out(run)) for number, run in enumerate(runs))
