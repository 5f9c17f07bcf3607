"""The examination of a robot from beginning to end: measure, find causes, prove them, mend."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import replace

from dynx.agreement.tolerances import BAR
from dynx.doctor.examine.engine_input import without_meshes
from dynx.doctor.examine.examination import LOADING, TORQUE, Examination, Laboratory
from dynx.doctor.examine.line_map import at_given_lines
from dynx.doctor.prove.attribution import Attribution, Attributor
from dynx.doctor.prove.mending import Mending, Place, all_but, detections, mend, place, readable, treated
from dynx.doctor.report import (
    DoctorReport,
    Failure,
    Unexplained,
)
from dynx.doctor.reporting import all_findings, first_report, run_time_calls, with_after
from dynx.errors import ArgumentError, DynxError
from dynx.loaded import ENGINES, installed_engines
from dynx.model import Model
from dynx.model.configuration import checked_base
from dynx.model.loading import read_description
from dynx.model.model import Base
from dynx.model.xml.source import XmlSource
from dynx.rules import Case, Detection, Rule, all_rules
from dynx.rules.choices import checked_choices

DEFAULT_SAMPLES = 5

MARGIN = 0.1
"""Part of the tolerance that places without an effect of their own may use up together in a mended file:
at other states they may add up to more."""

COUNTEREXAMPLE_SECONDS = 20.0
"""What looking for one smallest counterexample may take."""

Progress = Callable[[str], None]
Robot = str | os.PathLike[str] | bytes | Model


def diagnose(
    robot: Robot,
    *,
    base: Base = "fixed",
    engines: Sequence[str] | None = None,
    samples: int = DEFAULT_SAMPLES,
    seed: int = 0,
    tolerance: float = BAR,
    choose: Mapping[str, str] | None = None,
    counterexamples: bool = True,
    progress: Progress | None = None,
) -> DoctorReport:
    """Why engines differ when they load this robot's file themselves, with proof, and the file mended.

    `robot` is whatever `dynx.load` takes. `engines` are names of `dynx.loaded.ENGINES` (default: all that
    are installed). Each loads the file by its documented call and is compared with the right answer at
    `samples` random states that follow from `seed`, in tilted gravity; a relative error above `tolerance`
    is a difference. `choose` maps rule ids to one of the rule's `choices`. `counterexamples` says whether
    to look for the smallest robot that shows a difference which no rule explains. `progress` is called
    with the name of each step.

    A robot that cannot be read gives a report with `error` set. Raises ArgumentError,
    UnknownBackendError, NotInstalledError and UnknownNameError for arguments that are right for no robot.
    """
    started = time.perf_counter()
    laboratory = _laboratory(engines, samples, seed, tolerance)
    choices = checked_choices((choose or {}).items())
    checked_base(base)
    say = progress or _silent
    try:
        case = open_case(robot, base, choices)
        report = _diagnosed(case, laboratory, tolerance, counterexamples, seed, say)
    except DynxError as error:
        report = refused_report(str(_label(robot)), error, base=base)
    return replace(report, samples=samples, seed=seed, seconds=time.perf_counter() - started)


def compare_as_loaded(
    robot: Robot,
    *,
    base: Base = "fixed",
    engines: Sequence[str] | None = None,
    samples: int = DEFAULT_SAMPLES,
    seed: int = 0,
    tolerance: float = BAR,
) -> DoctorReport:
    """How far apart engines are when they load the file themselves; no causes are looked for."""
    started = time.perf_counter()
    laboratory = _laboratory(engines, samples, seed, tolerance)
    checked_base(base)
    try:
        case = open_case(robot, base, {})
        before = laboratory.examine(case, truth=laboratory.truth(readable(case).case), describe=True)
        report = first_report(case, before, tolerance)
    except DynxError as error:
        report = refused_report(str(_label(robot)), error, base=base)
    return replace(report, samples=samples, seed=seed, seconds=time.perf_counter() - started)


def open_case(robot: Robot, base: Base, choices: Mapping[str, str]) -> Case:
    """The document of a robot as a case; errors as `dynx.load` raises them."""
    if isinstance(robot, Model):
        return Case(XmlSource(robot.to_urdf(), robot.source), base, choices=choices)
    data, source, _ = read_description(robot)
    return Case(XmlSource(data, source), base, choices=choices)


def refused_report(robot: str, error: DynxError, *, base: str | None = None) -> DoctorReport:
    """The report of a robot that could not be examined."""
    return DoctorReport(robot, base=base, error=Failure(type(error).__name__, str(error)))


def _diagnosed(
    case: Case,
    laboratory: Laboratory,
    tolerance: float,
    counterexamples: bool,
    seed: int,
    say: Progress,
) -> DoctorReport:
    say("loading")
    sound = readable(case).case
    truth = laboratory.truth(sound)
    before = laboratory.examine(case, truth=truth, describe=True)
    rules = _rules_for(laboratory)
    found = at_given_lines(detections(case, rules), case.source, sound.source)
    report = first_report(case, before, tolerance)
    if report.alike and not _chosen_practice(case, found):
        return replace(report, findings=all_findings(found, [], Mending(case)))
    say("mending")
    full = mend(case, rules)
    after = laboratory.examine(full.case)
    proofs = _proofs(case, rules, laboratory, before, after, tolerance, say)
    mended, last = _least_mending(case, rules, full, after, proofs, laboratory, tolerance)
    unexplained = _unexplained(last, tolerance, _beyond_remedy(mended.case, rules))
    if unexplained and counterexamples:
        unexplained = _with_counterexamples(mended.case, unexplained, laboratory, tolerance, seed, say)
    changed = mended.case.source.data != case.source.data
    return replace(
        with_after(report, last),
        findings=all_findings(found, proofs, mended),
        unexplained=unexplained,
        choices=mended.choices,
        calls=run_time_calls(mended.case, laboratory),
        mended=mended.case.source.text if changed else None,
    )


def _chosen_practice(case: Case, found: Sequence[tuple[Rule, Detection]]) -> bool:
    """Whether the user chose a remedy for bad practice that is there."""
    return any(rule.kind == "practice" and rule.id in (case.choices or {}) for rule, _ in found)


def _rules_for(laboratory: Laboratory) -> list[Rule]:
    """The rules that hold for an engine in the laboratory, and those about practice."""
    versions = {name: kind.engine_version() for name, kind in laboratory.engines.items()}
    return [rule for rule in all_rules() if rule.kind == "practice" or rule.holds_for(versions)]


def _proofs(
    case: Case,
    rules: Sequence[Rule],
    laboratory: Laboratory,
    before: Examination,
    after: Examination,
    tolerance: float,
    say: Progress,
) -> list[Attribution]:
    """Every rule about differences, at every place, with its effect.

    Rules about the text are taken away from the text as it is, rules about the robot from the text made
    readable. Shapes that engines are not given anyway are left out from the start.
    """
    slim = case.with_source(without_meshes(case.source))
    sound = readable(slim).case
    readably = before if sound is slim else laboratory.examine(sound, truth=before.truth)
    causes = [rule for rule in rules if rule.kind == "difference"]
    by_text = Attributor(laboratory, slim, causes, before, after, tolerance, say)
    by_robot = Attributor(laboratory, sound, causes, readably, after, tolerance, say)
    found = detections(slim, causes)
    proofs: list[Attribution] = []
    for rule in dict.fromkeys(rule for rule, _ in found):
        places = [each for other, each in found if other is rule]
        proofs += (by_text if rule.stage == "reading" else by_robot).attribute(rule, places)
    return proofs


def _least_mending(
    case: Case,
    rules: Sequence[Rule],
    full: Mending,
    after: Examination,
    proofs: Sequence[Attribution],
    laboratory: Laboratory,
    tolerance: float,
) -> tuple[Mending, Examination]:
    """The remedies that matter here and no others, where those do as much as all together.

    First the places that have an effect of their own, then all places of the rules that have one
    somewhere: places too small to be seen alone may add up. What shows at some states alone is always
    taken away, and so is all that concerns an engine that refuses the file to the end: nothing of it can
    be seen there.
    """
    blind = {engine for engine in laboratory.engines if after.answers[engine].refused is not None}
    idle: set[Place] = {
        place(each.rule, each.detection)
        for each in proofs
        if not (each.effects or each.rule.depends_on_state or blind.intersection(each.rule.engines))
    }
    busy = {each.rule.id for each in proofs if each.effects}
    for left in (idle, {each for each in idle if each[0] not in busy}):
        if not left:
            break
        least = mend(case, rules, all_but(left))
        if not least.case.readable:
            continue
        result = laboratory.examine(least.case)
        if all(
            result.worst(engine) <= max(MARGIN * tolerance, after.worst(engine))
            for engine in laboratory.engines
        ):
            return least, result
    return full, after


def _beyond_remedy(mended: Case, rules: Sequence[Rule]) -> set[str]:
    """The engines of which a cause is still there that nothing mends, or that the user chose to keep."""
    causes = [rule for rule in rules if rule.kind == "difference"]
    left = detections(mended, causes)
    return {engine for rule, each in left if treated(mended, rule, [each]) is None for engine in rule.engines}


def _unexplained(after: Examination, tolerance: float, known: Collection[str]) -> tuple[Unexplained, ...]:
    """What remains above the tolerance, the largest quantity of each engine; ``loading`` for one that
    refuses the file to the end and is not among those of which it is `known` why."""
    remaining = []
    for engine, answers in after.answers.items():
        if answers.refused is not None and engine not in known:
            remaining.append(Unexplained(engine, LOADING, float("inf")))
        errors = after.errors(engine)
        quantity = max(errors, key=lambda name: errors[name], default=None)
        if quantity is not None and errors[quantity] > tolerance:
            joints = after.joint_errors(engine)
            joint = max(joints, key=lambda name: joints[name], default=None) if quantity == TORQUE else None
            remaining.append(Unexplained(engine, quantity, errors[quantity], joint))
    return tuple(remaining)


def _with_counterexamples(
    case: Case,
    unexplained: tuple[Unexplained, ...],
    laboratory: Laboratory,
    tolerance: float,
    seed: int,
    say: Progress,
) -> tuple[Unexplained, ...]:
    from dynx.doctor.counterexample.search import smallest
    from dynx.doctor.counterexample.state_error import difference_of

    found = []
    for each in unexplained:
        say(f"counterexample for {each.engine}")
        difference = difference_of(laboratory, each.engine, each.quantity)
        example = smallest(case, difference, tolerance=tolerance, seed=seed, budget=COUNTEREXAMPLE_SECONDS)
        found.append(replace(each, counterexample=example))
    return tuple(found)


def _laboratory(engines: Sequence[str] | None, samples: int, seed: int, tolerance: float) -> Laboratory:
    for name, value, least in (("samples", samples, 1), ("seed", seed, 0)):
        if isinstance(value, bool) or not isinstance(value, int) or value < least:
            raise ArgumentError(f"{name} is {value!r}; wanted a whole number, at least {least}")
    if not 0.0 < tolerance < 1.0:
        raise ArgumentError(f"tolerance is {tolerance!r}; wanted a relative error between 0 and 1")
    chosen = installed_engines() if engines is None else tuple(dict.fromkeys(engines))
    if isinstance(engines, str) or not chosen:
        raise ArgumentError(f"engines is {engines!r}; wanted names out of {', '.join(ENGINES)}")
    return Laboratory(chosen, samples, seed)


def _label(robot: object) -> str:
    text = robot.name if isinstance(robot, Model) else str(robot)
    return text if len(text) <= 200 and "\n" not in text else "<string>"


def _silent(step: str) -> None:
    """No one wants to know."""
