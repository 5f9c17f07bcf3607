"""`conform`: errors of each engine in every case, and the cause of each error that stays.

Below it stand the checks of its arguments.
"""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from dynx.argument_types import checks_types
from dynx.contacts.attribution import Attributor
from dynx.contacts.candidates import CANDIDATES, SUBSTEPS, SettingsChange
from dynx.contacts.case import BUILT_IN, ContactCase, find_case, find_cases
from dynx.contacts.run import CaseRun, Measured, Runner, Unmeasured
from dynx.contacts.verdict import VERDICTS, FigureSeries, TrialOfEngine, Verdict, VerdictKind, collect, judge
from dynx.errors import ArgumentError, UnknownNameError, nearest, shown
from dynx.model.numbers import positive_seconds, whole_number
from dynx.steppers.registry import installed_worlds, world_class
from dynx.steppers.settings import checked_settings

MIN_STEP, MAX_STEP = 1e-6, 0.1
"""Smallest and largest step [s]: runs at shorter steps take hours, and in longer ones bodies never touch."""

MAX_SUBSTEPS = 500

STEPS = (4e-3, 2e-3, 1e-3)
"""Default steps [s]."""

TIMEOUT = 60.0
"""Time [s] after which one run is ended."""


@dataclass(frozen=True)
class FigureResult:
    """A figure of one engine at every step, with the verdict on its error."""

    engine: str
    case: str
    trial: str
    """Name of the trial; empty if the case has only one."""
    figure: str
    unit: str
    exact: float
    """Value that mechanics gives, or its lower bound."""
    scale: float
    """Magnitude by which errors are divided."""
    tolerance: float
    """Relative error below which an error counts as none."""
    measured: tuple[float, ...]
    """Measured value at each step."""
    errors: tuple[float, ...]
    """Relative error at each step."""
    verdict: Verdict
    most: float | None = None
    """The largest value that mechanics allows, where it gives bounds; else None."""


@dataclass(frozen=True)
class NoResult:
    """A trial that one engine refused, or in which it failed, at one step."""

    engine: str
    case: str
    trial: str
    dt: float
    kind: str
    """``refused``, ``error``, ``crash``, ``timeout`` or ``defect``."""
    message: str


@dataclass(frozen=True)
class Conformance:
    """Results of every case in every engine."""

    steps: tuple[float, ...]
    """Steps [s], largest first."""
    engines: tuple[str, ...]
    cases: tuple[ContactCase, ...]
    settings: Mapping[str, Mapping[str, Any]]
    """Settings that the caller gave, by engine."""
    results: tuple[FigureResult, ...]
    refusals: tuple[NoResult, ...]
    """Trials that an engine cannot represent and refuses by name."""
    failures: tuple[NoResult, ...]
    """Trials in which an engine failed, crashed or took too long."""
    runs: int
    """Number of runs, those for attributions included."""
    versions: Mapping[str, str]
    """Version of each engine; empty for an engine without results."""
    not_done: int = 0
    """Number of trials of an engine that an interruption left without a verdict."""
    in_effect: Mapping[str, Mapping[str, tuple[float, ...]]] = field(default_factory=dict)
    """Values in effect at each step, by engine, of those given settings that the engine changes."""

    @checks_types
    def count(self, kind: VerdictKind, engine: str | None = None) -> int:
        """Return the number of figures with this verdict, of one engine or of all."""
        if kind not in VERDICTS:
            raise UnknownNameError(f"no kind {shown(kind)}{nearest(kind, VERDICTS)}")
        return self.counts(engine)[kind]

    @checks_types
    def counts(self, engine: str | None = None) -> dict[VerdictKind, int]:
        """Return the number of figures with each verdict, of one engine or of all."""
        found = Counter(r.verdict.kind for r in self.results if engine in (None, r.engine))
        return {kind: found[kind] for kind in VERDICTS}

    @property
    def unexplained(self) -> tuple[FigureResult, ...]:
        """Figures whose error neither falls nor has a known cause."""
        return tuple(result for result in self.results if result.verdict.kind == "unexplained")

    def __repr__(self) -> str:
        counted = ", ".join(f"{n} {kind}" for kind, n in self.counts().items() if n)
        return f"<Conformance of {', '.join(self.engines)}: {counted or 'no figures'}>"


def conform(
    engines: Sequence[str] | None = None,
    steps: Sequence[float] = STEPS,
    cases: Sequence[str | ContactCase] | None = None,
    *,
    settings: Mapping[str, Mapping[str, Any]] | None = None,
    candidates: Mapping[str, Sequence[SettingsChange]] = CANDIDATES,
    jobs: int | None = None,
    timeout: float | None = TIMEOUT,
    progress: Callable[[int, int], object] | None = None,
    interruptible: bool = False,
) -> Conformance:
    """Measure engines against mechanics: every trial of every case, in every engine, at every step.

    By default all installed engines and all cases take part. Steps are 1e-6 to 0.1 s; with a single step dynx
    cannot check whether an error falls with the step. `settings` are those of `World` by engine, `substeps`
    included; `candidates` are the settings to which errors may be attributed. Runs take place in `jobs`
    processes (default: one for each processor). dynx records a run that crashes or takes longer than
    `timeout` [s]. With 0 jobs the runs take place in this process, which a crash ends. `progress(done,
    total)` is called after each run; the total grows when errors have to be attributed. With `interruptible`,
    KeyboardInterrupt ends the runs, and the results so far are returned.

    Raises the errors of `World` for engines and settings, UnknownNameError for the name of a case,
    ArgumentError for steps and for a case that cannot be used.
    """
    chosen = checked_engines(engines)
    given = checked_given(chosen, {} if settings is None else settings)
    sizes = checked_steps(steps)
    found = checked_cases(cases)
    workers = (os.cpu_count() or 1) if jobs is None else whole_number("jobs", jobs, 0)
    with Runner(workers, timeout, progress, interruptible=interruptible) as runner:
        trials = [
            TrialOfEngine(name, case, trial) for case in found for trial in case.trials for name in chosen
        ]
        runs = [each.run(dt, given[each.engine]) for each in trials for dt in sizes]
        outcomes = runner.run(runs)
        series, lost = _gather(trials, runs, outcomes, sizes)
        verdicts = _verdicts_without_reruns(series, sizes)
        open_series = [each for each in series if each not in verdicts]
        verdicts |= Attributor(sizes, given, candidates, runner).attribute(open_series, series)
        total = runner.done
    results = tuple(_result(each, verdicts[each]) for each in series if each in verdicts)
    refusals = tuple(each for each in lost if each.kind == "refused")
    failures = tuple(each for each in lost if each.kind != "refused")
    versions = _versions(runs, outcomes)
    not_done = {trials[k // len(sizes)] for k, outcome in enumerate(outcomes) if outcome is None}
    not_done |= {each.trial for each in series if each not in verdicts}
    return Conformance(
        *(sizes, chosen, found, given, results, refusals, failures, total, versions, len(not_done)),
        in_effect={name: values_in_effect(name, given[name], sizes) for name in chosen},
    )


def _versions(runs: Sequence[CaseRun], outcomes: Sequence[Measured | Unmeasured | None]) -> dict[str, str]:
    """Return the version of each engine, without the engine's name, with which most versions begin."""
    found = {run.engine: "" for run in runs}
    for run, outcome in zip(runs, outcomes, strict=True):
        if isinstance(outcome, Measured):
            found[run.engine] = outcome.version.removeprefix(run.engine).strip()
    return found


def _gather(
    trials: Sequence[TrialOfEngine],
    runs: Sequence[CaseRun],
    outcomes: Sequence[Measured | Unmeasured | None],
    steps: tuple[float, ...],
) -> tuple[list[FigureSeries], list[NoResult]]:
    """Return the series of every figure, and the runs without any."""
    series: list[FigureSeries] = []
    lost = [
        NoResult(run.engine, run.case.name, run.trial, run.dt, outcome.kind, outcome.message)
        for run, outcome in zip(runs, outcomes, strict=True)
        if isinstance(outcome, Unmeasured)
    ]
    for number, trial in enumerate(trials):
        series += collect(trial, outcomes[number * len(steps) : (number + 1) * len(steps)])
    return series, lost


def _verdicts_without_reruns(
    series: Sequence[FigureSeries], steps: tuple[float, ...]
) -> dict[FigureSeries, Verdict]:
    """Return the verdicts that need no further run."""
    verdicts: dict[FigureSeries, Verdict] = {}
    for each in series:
        trend = judge(steps, each.errors, each.tolerance)
        if trend.kind != "stays":
            verdicts[each] = Verdict(trend.kind, order=trend.order)
        elif each.reason is not None:
            verdicts[each] = Verdict("cannot", reason=each.reason)
    return verdicts


def _result(series: FigureSeries, verdict: Verdict) -> FigureResult:
    trial, first = series.trial, series.figures[0]
    return FigureResult(
        trial.engine,
        trial.case.name,
        trial.trial,
        first.name,
        first.unit,
        first.exact,
        first.scale,
        first.tolerance,
        tuple(figure.measured for figure in series.figures),
        series.errors,
        verdict,
        first.most,
    )


def checked_engines(engines: Sequence[str] | None) -> tuple[str, ...]:
    """Return the engines, or all that are installed, each once."""
    if engines is None:
        return installed_worlds()
    _check_is_list("engines", engines, "names")
    return tuple(dict.fromkeys(engines))


def checked_given(
    engines: Sequence[str], settings: Mapping[str, Mapping[str, Any]]
) -> dict[str, dict[str, Any]]:
    """Return the settings given to each engine, `substeps` of the world among them, after a check that the
    engine is installed and has them."""
    if not isinstance(settings, Mapping):
        raise ArgumentError(
            f"settings is of type {type(settings).__name__}; wanted a dict such as "
            "{'mujoco': {'impratio': 1000.0}}"
        )
    for name, given in settings.items():
        if name not in engines:
            raise UnknownNameError(
                f"settings are given for {shown(name)}, which does not run{nearest(name, engines)}"
            )
        if not isinstance(given, Mapping):
            raise ArgumentError(f"settings of {name} is of type {type(given).__name__}; wanted a dict")
    for name in engines:
        kind = world_class(name)
        kind.require_engine()
        given = dict(settings.get(name, {}))
        if SUBSTEPS in given:
            whole_number(SUBSTEPS, given.pop(SUBSTEPS), 1, MAX_SUBSTEPS)
        checked_settings(name, kind.settings, given)
    return {name: dict(settings.get(name, {})) for name in engines}


def values_in_effect(
    engine: str, given: Mapping[str, Any], steps: Sequence[float]
) -> dict[str, tuple[float, ...]]:
    """Return the values at each step of those settings given that the engine changes."""
    kind, substeps = world_class(engine), given.get(SUBSTEPS, 1)
    in_use = {name: setting.default for name, setting in kind.settings.items()} | dict(given)
    found = [kind.settings_in_effect(in_use, dt / substeps) for dt in steps]
    return {
        name: tuple(float(each[name]) for each in found)
        for name, value in given.items()
        if name in found[0] and any(each[name] != value for each in found)
    }


def checked_steps(steps: Sequence[float]) -> tuple[float, ...]:
    """Return the steps [s], the largest first, each once."""
    _check_is_list("steps", steps, "steps [s]")
    sizes = sorted({positive_seconds("a step", step) for step in steps}, reverse=True)
    if not sizes:
        raise ArgumentError("steps is empty; wanted at least one step [s]")
    for size in sizes:
        if not MIN_STEP <= size <= MAX_STEP:
            raise ArgumentError(f"a step is {size:g} s; wanted {MIN_STEP:g} to {MAX_STEP:g} s")
    return tuple(sizes)


def checked_cases(cases: Sequence[str | ContactCase] | None) -> tuple[ContactCase, ...]:
    """Return the cases, found by name where they are names; all where none are given."""
    if cases is None:
        found = find_cases()
    else:
        _check_is_list("cases", cases, "names and cases")
        found = tuple(find_case(each) if isinstance(each, str) else _checked_case(each) for each in cases)
    for number, each in enumerate(found):
        _check_attributes(each)
        if each.name in [other.name for other in found[:number]]:
            raise ArgumentError(f"two cases have the name {shown(each.name)}")
    return found


def _check_is_list(name: str, value: object, what: str) -> None:
    """Raise ArgumentError for a text, and for anything that is neither a sequence nor a set."""
    if isinstance(value, str) or not isinstance(value, Sequence | set | frozenset):
        text = shown(value) if isinstance(value, str | int | float) else f"of type {type(value).__name__}"
        raise ArgumentError(f"{name} is {text}; wanted a list of {what}")


def _checked_case(case: object) -> ContactCase:
    if isinstance(case, type) and issubclass(case, ContactCase):
        raise ArgumentError(f"a case is the class {case.__name__}; wanted an instance, {case.__name__}()")
    if not isinstance(case, ContactCase):
        raise ArgumentError(f"a case is of type {type(case).__name__}; wanted a Case or the name of one")
    return case


def _check_attributes(case: ContactCase) -> None:
    """Raise ArgumentError for a case whose attributes cannot be used."""
    kind = type(case)
    where = f"{kind.__module__}.{kind.__qualname__}"
    for attribute in ("name", "title", "law", "source"):
        text = getattr(case, attribute, None)
        if not isinstance(text, str) or not text.strip():
            raise ArgumentError(f"the case {where} has no {attribute}; wanted a text that is not empty")
    trials = case.trials
    if not isinstance(trials, Mapping) or not trials or not all(isinstance(each, str) for each in trials):
        raise ArgumentError(f"trials of the case {where} is not a dict of parameters by name")
    if kind.__module__ == "__main__":
        raise ArgumentError(
            f"the case {shown(case.name)} is defined in the program that runs; it has to be in a module "
            "of its own, which worker processes import"
        )
    if case.name in BUILT_IN and not isinstance(case, type(find_case(case.name))):
        raise ArgumentError(f"the case {where} has the name {shown(case.name)}, which is one of dynx's own")
