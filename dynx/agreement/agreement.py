"""Comparison of a robot in several backends."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, replace
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np

from dynx.agreement.compared_quantities import compared_quantities
from dynx.agreement.comparison import (
    DERIVED,
    REFEREE,
    BackendResults,
    Comparison,
    compare,
    compare_forward_dynamics,
    compare_inverse_kinematics,
)
from dynx.agreement.identities import IdentityCheck, check_identities
from dynx.agreement.magnitudes import Magnitudes
from dynx.agreement.referee import Referee
from dynx.agreement.report import AgreementReport, find_suspects, refused_report
from dynx.agreement.sampling import Samples, draw_samples
from dynx.argument_types import checks_types
from dynx.backends import (
    Backend,
    DerivedBackend,
    backend,
    backend_class,
    installed_backends,
    native_quantities,
)
from dynx.backends.solvability import singular_coordinates
from dynx.errors import ArgumentError, DynxError
from dynx.model import Model, Pose
from dynx.model.loading import load
from dynx.model.numbers import checked_seed, whole_number
from dynx.model.tree import Base

DEFAULT_SAMPLES = 16
DEFAULT_REFEREE_SAMPLES = 2

DERIVED_SAMPLES = 2
"""Number of samples at which the results of an engine are compared with those derived from its poses and
torques. It is small because a derived mass matrix takes one evaluation per column."""

IDENTITY_SAMPLES = 4
"""Number of samples at which identities are tested, small because a derivative takes eight evaluations."""

Progress = Callable[[str], None]


@checks_types
def agree(
    model: Model | str | Path,
    backends: Sequence[str | Backend] | None = None,
    samples: int = DEFAULT_SAMPLES,
    seed: int = 0,
    *,
    referee_samples: int = DEFAULT_REFEREE_SAMPLES,
    progress: Progress | None = None,
) -> AgreementReport:
    """Compare the results of backends on a robot.

    `model` is a `Model` or any argument of `dynx.load`. `backends` are names, or backends made of this model,
    which stay open. By default all installed backends take part. For a robot with ball joints these are the
    backends that accept ball joints.

    - dynx compares each pair of backends in every quantity at `samples` states, which follow from `seed`.
    - At `referee_samples` of these states, dynx compares each backend with the 50-digit referee.
    - If an engine computes a quantity itself, dynx compares the result with the value that dynx derives from
      the engine's poses and inverse dynamics.
    - dynx tests each backend alone against the identities of mechanics.

    `progress` is called with the name of each step.

    If dynx cannot read the robot, or a backend refuses it, the report has `error` set. Raises ArgumentError
    for arguments that are invalid for every robot, UnknownBackendError for an unknown backend, and
    NotInstalledError for a backend whose engine is missing.
    """
    started = time.perf_counter()
    chosen = _check_arguments(backends, samples, seed, referee_samples)
    names = [each if isinstance(each, str) else each.name for each in chosen]
    try:
        loaded = load(model)
    except DynxError as error:
        seconds = time.perf_counter() - started
        return refused_report(_label(model), error, backends=names, seconds=seconds)
    _require_same_model(loaded, chosen)
    left_out: list[str] = []
    if backends is None and loaded.ball_joints:
        left_out = [name for name in names if not backend_class(name).takes_ball_joints]
        chosen = [each for each in chosen if each not in left_out]
        names = [name for name in names if name not in left_out]
    try:
        # NaN and infinity from an engine appear in the report, so NumPy's warnings are silenced.
        with ExitStack() as opened, np.errstate(all="ignore"):
            engines = [_open(each, loaded, opened) for each in chosen]
            tell = progress or (lambda step: None)
            return _compare_all(loaded, engines, samples, seed, referee_samples, tell, started, left_out)
    except DynxError as error:
        return refused_report(
            loaded.name,
            error,
            source=loaded.source,
            base=loaded.base,
            backends=names,
            seconds=time.perf_counter() - started,
        )


def _compare_all(
    model: Model,
    engines: list[Backend],
    count: int,
    seed: int,
    referee_samples: int,
    progress: Progress,
    started: float,
    left_out: Sequence[str],
) -> AgreementReport:
    names = _distinct_names(engines)
    samples = draw_samples(model, count, seed)
    magnitudes = Magnitudes(samples)
    all_results = [BackendResults(name, engine, samples) for name, engine in zip(names, engines, strict=True)]
    rows: list[Comparison] = []
    for first, second in combinations(all_results, 2):
        progress(f"{first.name}~{second.name}")
        rows += [compare(quantity, first, second, magnitudes) for quantity in compared_quantities()]
        rows.append(compare_forward_dynamics(first, second, magnitudes))
        if model.nv:
            rows.append(compare_inverse_kinematics(first, second, magnitudes))
    if referee_samples:
        progress(REFEREE)
        rows += _compare_with_referee(
            samples.take(list(range(min(referee_samples, count))), 1), names, engines
        )
    derived_samples = samples.take(list(range(min(DERIVED_SAMPLES, count))), 1)
    for name, engine in zip(names, engines, strict=True):
        progress(f"{name}~{DERIVED}")
        rows += _compare_with_derived(Magnitudes(derived_samples), name, engine)
    identities: list[IdentityCheck] = []
    differentiable = samples.differentiable(IDENTITY_SAMPLES)
    if differentiable and model.nv:
        identity_magnitudes = Magnitudes(samples.take(differentiable, 1))
        for name, engine in zip(names, engines, strict=True):
            progress(f"identities of {name}")
            identities += check_identities(name, engine, identity_magnitudes)
    return AgreementReport(
        robot=model.name,
        source=model.source,
        base=model.base,
        backends=tuple(names),
        nq=model.nq,
        nv=model.nv,
        samples=count,
        seed=seed,
        quantities=tuple(rows),
        identities=tuple(identities),
        suspects=find_suspects(rows, identities, names),
        notes=_notes(model, names, left_out),
        seconds=time.perf_counter() - started,
    )


def _compare_with_referee(samples: Samples, names: list[str], engines: list[Backend]) -> list[Comparison]:
    """Compare each backend with the referee."""
    magnitudes = Magnitudes(samples)
    exact = BackendResults(REFEREE, Referee(samples.model), samples)
    rows = []
    for name, engine in zip(names, engines, strict=True):
        results = BackendResults(name, engine, samples)
        rows += [
            compare(quantity, results, exact, magnitudes)
            for quantity in compared_quantities()
            if quantity.refereed
        ]
        rows.append(compare_forward_dynamics(results, exact, magnitudes, both=False))
    return rows


def _compare_with_derived(magnitudes: Magnitudes, name: str, engine: Backend) -> list[Comparison]:
    """Compare what the engine computes itself with what dynx derives from its poses and torques."""
    native = native_quantities(engine)
    own = BackendResults(name, engine, magnitudes.samples)
    derived = BackendResults(DERIVED, DerivedBackend(engine), magnitudes.samples)
    rows = [
        compare(quantity, own, derived, magnitudes)
        for quantity in compared_quantities()
        if quantity.native in native
    ]
    if "forward_dynamics" in native:
        rows.append(compare_forward_dynamics(own, derived, magnitudes, both=False))
    return rows


def _notes(model: Model, names: list[str], left_out: Sequence[str]) -> tuple[str, ...]:
    notes = [str(note) for note in model.notes]
    singular = singular_coordinates(model)
    if singular:
        notes.append(
            f"the mass matrix is singular ({singular.reason}): "
            "forward dynamics has no solution, and each backend must refuse it"
        )
    if left_out:
        notes.append(f"ball joints are not taken by {' and '.join(left_out)}: not compared")
    if len(names) == 1:
        notes.append("a single backend: compared with the referee and with itself only")
    return tuple(notes)


def _check_arguments(
    backends: Sequence[str | Backend] | None, samples: int, seed: int, referee_samples: int
) -> list[str | Backend]:
    for name, value, least in (("samples", samples, 1), ("referee_samples", referee_samples, 0)):
        whole_number(name, value, least)
    checked_seed("seed", seed)
    if isinstance(backends, (str, Backend)):
        backends = [backends]
    chosen = list(installed_backends() if backends is None else backends)
    if not chosen:
        raise ArgumentError("backends is empty; wanted at least one name or backend")
    for each in chosen:
        if isinstance(each, str):
            backend_class(each)
    return chosen


def _require_same_model(model: Model, chosen: list[str | Backend]) -> None:
    for each in chosen:
        if isinstance(each, Backend) and each.model != model:
            raise ArgumentError(f"{each!r} was made of another model than {model!r}")


def _open(chosen: str | Backend, model: Model, opened: ExitStack) -> Backend:
    if isinstance(chosen, str):
        return opened.enter_context(backend(chosen, model))
    return chosen


def _distinct_names(engines: list[Backend]) -> list[str]:
    """Return the names of the engines; a repeated name gets a number."""
    names: list[str] = []
    for engine in engines:
        again = sum(name.partition("#")[0] == engine.name for name in names)
        names.append(f"{engine.name}#{again + 1}" if again else engine.name)
    return names


def _label(model: object) -> str:
    text = str(model)
    return text if len(text) <= 200 and "\n" not in text else "<string>"


# Agreement of one robot that the user named, as a task of a worker process.


@dataclass(frozen=True)
class AgreementTask:
    """A robot and the options of its comparison; None stands for the default of `load` or `dynx.agree`."""

    robot: str
    base: Base | None
    lock: tuple[tuple[str, float], ...]
    backends: tuple[str, ...] | None
    samples: int | None
    seed: int
    base_pose: Pose | None = None


def measure(task: AgreementTask) -> AgreementReport:
    """Report the agreement of one robot, or the error where it cannot be used."""
    chosen: dict[str, Any] = {"seed": task.seed}
    if task.samples is not None:
        chosen["samples"] = task.samples
    try:
        model = load(task.robot, base=task.base, lock=dict(task.lock), base_pose=task.base_pose)
        report = agree(model, backends=task.backends, **chosen)
    except DynxError as error:
        return refused(task, error)
    return replace(report, robot=task.robot)


def refused(task: AgreementTask, error: DynxError) -> AgreementReport:
    """Report a robot that could not be compared."""
    return refused_report(task.robot, error, base=task.base, backends=task.backends or ())
