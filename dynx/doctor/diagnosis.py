"""Diagnosis of a robot from beginning to end: measure, find causes, prove them, mend."""

from __future__ import annotations

import math
import os
import time
from collections import Counter
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import replace
from itertools import combinations

from dynx.agreement.report import LoadFailure
from dynx.agreement.tolerances import BAR
from dynx.argument_types import checks_types
from dynx.doctor.attribution import (
    AttributedCause,
    CauseAttributor,
    Proofs,
    SelectedPlaces,
    coarsest_mending,
    smallest_mending,
    with_refusals,
)
from dynx.doctor.counterexample import difference_of, smallest_counterexample
from dynx.doctor.examination import (
    QUANTITIES,
    TORQUE,
    Examination,
    Examiner,
    ReferenceValues,
    deepest_contact,
    describe_contacts,
    model_without_mimics,
    referee_error,
    require_bounded,
    with_original_lines,
)
from dynx.doctor.mending import (
    Mending,
    Place,
    all_except,
    changed_parts,
    detections,
    differs,
    left_undone,
    level_of,
    mend,
    place_of,
    readable,
    reading_change,
    refusal,
    refusing_rules,
    remedy_of,
)
from dynx.doctor.report import (
    Change,
    DoctorReport,
    Effect,
    EngineResult,
    Finding,
    PairError,
    RunTimeCall,
    Unexplained,
    UnreadMesh,
    VariantResult,
)
from dynx.errors import ArgumentError, DescriptionError, DynxError, UnknownNameError, nearest, shown
from dynx.loaded import COMMON_VARIANTS, ENGINES, VARIANTS, engine_of, installed_engines, loader_class
from dynx.loaded.difference import model_difference
from dynx.loaded.robot import LoadedRobot, format_name
from dynx.model import Model
from dynx.model.ball_joints import refuse_ball_joints
from dynx.model.document_format import format_of_root
from dynx.model.documents import bare_urdf
from dynx.model.loading import read_description, read_model
from dynx.model.numbers import checked_seed, is_real, whole_number
from dynx.model.tree import STANDARD_GRAVITY, Base, checked_base
from dynx.model.xml.source import XmlSource
from dynx.rules import LEVELS, CallingRule, Case, Detection, Level, Rule, all_rules
from dynx.rules.case import end_of
from dynx.rules.geometry import is_found, is_found_above, named_meshes, parts_with_meshes, reason_unread
from dynx.rules.registry import checked_choices, ignored_rules

REFERENCE_MARGIN = 10.0
"""Smallest error that counts as a difference, in errors of the reference values: engines round, too."""

MAX_RAISED_TOLERANCE = 1e-9
"""Largest tolerance for want of accuracy: beyond it a difference is more than rounding."""


def first_report(case: Case, before: Examination, tolerance: float) -> DoctorReport:
    """Report a case as engines load it, before any search for causes.

    Where the reference values themselves are less accurate than `tolerance`, because large terms cancel (a
    centre of mass that is written in millimetres), that of the report is raised by `REFERENCE_MARGIN`.
    """
    referee = referee_error(before.reference)
    descriptions = [each.description for each in before.outputs.values() if each.description is not None]
    model = before.reference.model
    stated = STANDARD_GRAVITY
    if case.form != "urdf" and isinstance(case.reading, Model):
        stated = case.reading.gravity
    return DoctorReport(
        robot=model.name,
        format=case.form,
        source=case.source.source,
        base=case.base,
        total_mass=sum(link.inertial.mass for link in model.links if link.inertial is not None),
        kinematics_only=before.reference.kinematics_only,
        engines=tuple(_engine_result(case, name, before) for name in before.outputs),
        residual=_residual(before),
        tolerance=max(tolerance, min(REFERENCE_MARGIN * referee, MAX_RAISED_TOLERANCE)),
        pairs=_pairs(before),
        referee=referee,
        model_difference=tuple(model_difference(model, descriptions, stated)),
        refusal=None if isinstance(case.reading, Model) else _failure(case.reading),
        text=case.source.text,
        form=case.source.form,
    )


def _failure(error: DynxError) -> LoadFailure:
    return LoadFailure(type(error).__name__, str(error))


def with_meshes(report: DoctorReport, source: XmlSource) -> DoctorReport:
    """Add the mesh files that the description names and that were not read.

    Of MJCF and SDF the reader refuses those on which a mass depends. No other is needed; where one of SDF is
    missing, an engine may refuse the file.
    """
    if report.format == "mjcf":
        return report
    named = list(named_meshes(source))
    parts = parts_with_meshes(source)
    kinds = {each.engine: loader_class(each.engine) for each in report.engines}
    unread = []
    for link, mesh, file in named:
        found = is_found(file, source.source)
        reason = None if found and report.format == "sdf" else reason_unread(file, source.source)
        if reason is not None:
            lacking = set() if found else parts[file]
            above = is_found_above(file, source.source)
            refusing = tuple(
                name
                for name, kind in kinds.items()
                if lacking & {*kind.refuses_without} and not (above and kind.searches_above)
            )
            unread.append(UnreadMesh(file, link.attributes.get("name", ""), mesh.line, reason, refusing))
    return replace(report, meshes=len(named), unread_meshes=tuple(unread))


def with_after(
    report: DoctorReport, after: Examination, proved: Examination, known: Collection[str] = ()
) -> DoctorReport:
    """Add the errors of the engines on the mended file, and the largest one once all causes are removed, but
    for the engines in which a `known` cause remains."""
    engines = tuple(
        replace(
            each,
            refused_after=after.outputs[each.engine].refused,
            not_used_after=after.outputs[each.engine].not_used,
            after=after.errors(each.engine),
        )
        for each in report.engines
    )
    outputs = {name: each for name, each in proved.outputs.items() if name not in known}
    return replace(report, engines=engines, residual=_residual(replace(proved, outputs=outputs)))


def variant_result(
    case: Case, name: str, before: Examination, after: Examination, findings: Sequence[Finding]
) -> VariantResult:
    """Report a loading variant that is examined beside its engine."""
    result = replace(
        _engine_result(case, name, before),
        refused_after=after.outputs[name].refused,
        not_used_after=after.outputs[name].not_used,
        after=after.errors(name),
    )
    return VariantResult(**vars(result), findings=tuple(findings))


def _residual(examination: Examination) -> float:
    """Return the largest error of the engines that load the file."""
    errors = [examination.errors(engine) for engine in examination.outputs]
    return max((error for of_engine in errors for error in of_engine.values()), default=0.0)


def _engine_result(case: Case, name: str, before: Examination) -> EngineResult:
    kind = loader_class(name)
    errors, output = before.errors(name), before.outputs[name]
    moves = before.reference.model.nv and not before.reference.kinematics_only
    return EngineResult(
        engine=name,
        version=kind.engine_version(),
        call=_load_call(kind, case, before.reference.model.root),
        refused=output.refused,
        refused_after=output.refused,
        not_used=output.not_used,
        not_used_after=output.not_used,
        before=errors,
        after=errors,
        step_defaults=kind.STEP_DEFAULTS if moves and output.no_results is None else {},
    )


def _load_call(kind: type[LoadedRobot], case: Case, root: str) -> str:
    floating = case.base == "floating"
    # Engines of other packages, which load URDF alone, need not know of formats.
    return (
        kind.load_call(floating, root) if case.form == "urdf" else kind.load_call(floating, root, case.form)
    )


def _pairs(examination: Examination) -> tuple[PairError, ...]:
    loaded = [name for name, each in examination.outputs.items() if each.no_results is None]
    return tuple(
        PairError(
            (one, other),
            quantity,
            examination.pair_error(one, other, quantity),
            examination.joint_errors(one, other) if quantity == TORQUE else {},
        )
        for one, other in combinations(loaded, 2)
        for quantity in QUANTITIES
        if quantity in examination.errors(one)
    )


def all_findings(
    found: Sequence[tuple[Rule, Detection]],
    proofs: Sequence[AttributedCause],
    mended: Mending,
    engines: Collection[str],
    refusing: Collection[Rule] = (),
) -> tuple[Finding, ...]:
    """Report everything detected, with the effect where one was measured, or is known in all `engines`; texts
    name these engines only. Where no engine is affected by a cause of the `refusing` rules, for which dynx
    refuses the file, the effect is on dynx."""
    proved: dict[Place, list[AttributedCause]] = {}
    for each in proofs:
        proved.setdefault(place_of(each.rule, each.detection), []).append(each)
    done = {rule.id: remedy.changed for rule, remedy in mended.applied}
    findings = []
    for rule, detection in found:
        # A place that was found twice (for example in two attributes of one link) has its proofs in the same
        # order.
        of_place = proved.get(place_of(rule, detection), [])
        attribution = of_place.pop(0) if of_place else None
        finding = Finding(
            rule.id,
            rule.name,
            rule.kind,
            detection.link,
            detection.joint,
            detection.line,
            detection.sentence(engines),
        )
        if rule.undefined:
            effect = Effect(rule.undefined, float("inf"))
            effects = dict.fromkeys(engines, effect)
            finding = replace(finding, engines=tuple(effects), effect=effect, effects=effects, proved=True)
        elif attribution is not None and attribution.effects:
            finding = replace(
                finding,
                message=finding.message + _condition(attribution),
                engines=tuple(attribution.effects),
                effect=attribution.largest_effect,
                effects=dict(attribution.effects),
                proved=attribution.proved,
                remedy=done.get(rule.id),
            )
        elif rule in refusing:
            effect = Effect("loading", float("inf"))
            finding = replace(
                finding,
                engines=("dynx",),
                effect=effect,
                effects={"dynx": effect},
                proved=True,
                remedy=done.get(rule.id),
            )
        findings.append(finding)
    return tuple(sorted(findings, key=lambda finding: finding.kind))


def with_original_names(findings: Iterable[Finding], given: XmlSource) -> tuple[Finding, ...]:
    """Name each link and joint as the `given` text does, where a remedy renamed or added the one that was
    found: the part that stands at its line."""
    return tuple(_with_original_names(finding, given) for finding in findings)


def _with_original_names(finding: Finding, given: XmlSource) -> Finding:
    if format_of_root(given.root.tag) != "urdf":
        return finding
    found = {"link": finding.link, "joint": finding.joint}
    known = {tag: {part.attributes.get("name") for part in given.root.all(tag)} for tag in found}
    known["link"] |= {end_of(each, end) for each in given.root.all("joint") for end in ("parent", "child")}
    foreign = [name for tag, name in found.items() if name is not None and name not in known[tag]]
    if not foreign:
        return finding
    above = [part for part in given.root.children if part.line <= (finding.line or 0)]
    part = above[-1] if above else given.root
    own, message = part.attributes.get("name"), finding.message
    for name in foreign if own else ():
        message = message.replace(name, str(own))
    link, joint = (own if part.tag == tag else None for tag in found)
    return replace(finding, link=link, joint=joint, message=message)


def _condition(attribution: AttributedCause) -> str:
    """Write in which variants the effect is measured with the remedy of another cause, that of the call."""
    behind = {name: rule for name, rule in attribution.behind.items() if name in attribution.effects}
    return "".join(f"; measured in {name} with the remedy of {rule}" for name, rule in behind.items())


def changes_of(case: Case, full: Mending, mended: Mending) -> tuple[Change, ...]:
    """List the changes that `mended` makes in the text of the case, then those that only `full` makes."""
    made = {change.rule: change for change in _changes(case, mended)}
    left = []
    for change in _changes(case, full):
        done = made.get(change.rule, Change(change.rule, "safe", ""))
        rest = replace(
            change,
            links=tuple(name for name in change.links if name not in done.links),
            joints=tuple(name for name in change.joints if name not in done.joints),
            others=tuple(name for name in change.others if name not in done.others),
            made=False,
        )
        if rest.links or rest.joints or rest.others or change.rule not in made:
            left.append(rest)
    return (*made.values(), *left)


def _changes(case: Case, mended: Mending) -> list[Change]:
    """List the changes by the remedies of a mending, one for each rule."""
    found: dict[str, Change] = {}
    before = case
    for rule, remedy in mended.applied:
        parts = changed_parts(before.source, remedy.case.source)
        if parts or differs(before, remedy.case):
            links, joints = (tuple(n for tag, n in parts if tag == kind) for kind in ("link", "joint"))
            others = tuple(f"{tag} {n}".rstrip() for tag, n in parts if tag not in ("link", "joint"))
            known = found.get(rule.id, Change(rule.id, "safe", remedy.changed))
            found[rule.id] = Change(
                rule.id,
                max(known.level, level_of(rule, before, remedy), key=LEVELS.index),
                known.change if remedy.changed in known.change else f"{known.change}; {remedy.changed}",
                tuple(dict.fromkeys((*known.links, *links))),
                tuple(dict.fromkeys((*known.joints, *joints))),
                tuple(dict.fromkeys((*known.others, *others))),
            )
        before = remedy.case
    return list(found.values())


def run_time_calls(case: Case, examiner: Examiner) -> tuple[RunTimeCall, ...]:
    """Collect the code of the run-time remedies that the mended case requires."""
    known = [(name, kind.CALLS) for name, kind in examiner.engines.items()]
    compared = {call for rule in all_rules() if isinstance(rule, CallingRule) for call in rule.calls}
    return tuple(
        RunTimeCall(engine, calls[call], comparison=call in compared)
        for engine, calls in known
        for call in calls
        if call in case.calls
    )


# Loading variants that are common, examined beside their engine: each has one cause, which is the call.
#
# A variant is examined apart from the engines. What it shares with its engine is in the findings about
# that; what its call adds is proved here: the remedy of the call alone changes the result, and together
# with those of all other causes it makes the variant right.


def variants_as_loaded(
    case: Case, reference: ReferenceValues, examiner: Examiner
) -> tuple[VariantResult, ...]:
    """Measure the variants as they load the file, without a search for causes."""
    before = examiner.examine(case, reference=reference)
    return tuple(variant_result(case, name, before, before, ()) for name in examiner.engines)


def diagnosed_variants(
    case: Case,
    reference: ReferenceValues,
    mended: Case,
    mended_reference: ReferenceValues,
    rules: Sequence[Rule],
    examiner: Examiner,
    tolerance: float,
) -> tuple[VariantResult, ...]:
    """Measure the variants, and prove what their calls change.

    `mended` is the case without the causes that the `rules` about the engines find.
    """
    before = examiner.examine(case, reference=reference)
    if all(before.max_error(name) <= tolerance for name in examiner.engines):
        return tuple(variant_result(case, name, before, before, ()) for name in examiner.engines)
    own = [rule for rule in all_rules() if examiner.engines.keys() & rule.engines.keys()]
    full = mend(mended, own)
    after = examiner.examine(full.case, reference=mended_reference)
    proofs = _proofs(case, own, [*rules, *own], examiner, before, after, tolerance)
    detected = [(each.rule, each.detection) for each in proofs]
    found = all_findings(detected, proofs, full, examiner.engines)
    return tuple(
        variant_result(case, name, before, after, [each for each in found if name in each.engines])
        for name in examiner.engines
    )


def _proofs(
    case: Case,
    own: Sequence[Rule],
    rules: Sequence[Rule],
    examiner: Examiner,
    before: Examination,
    after: Examination,
    tolerance: float,
) -> list[AttributedCause]:
    slim = case.with_source(examiner.without_unused(case.source))
    sound = readable(slim).case
    readably = before if sound is slim else examiner.examine(sound, reference=before.reference)
    attributor = CauseAttributor(examiner, sound, rules, readably, after, tolerance, lambda step: None)
    return [
        proof
        for rule in own
        for proof in attributor.attribute(rule, [each for _, each in detections(slim, [rule])])
    ]


DEFAULT_SAMPLES = 5

COUNTEREXAMPLE_SECONDS = 20.0
"""Time limit [s] of the search for one smallest counterexample."""

Progress = Callable[[str], None]
Robot = str | os.PathLike[str] | bytes | Model


@checks_types
def diagnose(
    robot: Robot,
    *,
    base: Base | None = None,
    engines: Sequence[str] | None = None,
    samples: int = DEFAULT_SAMPLES,
    seed: int = 0,
    tolerance: float = BAR,
    fix_tolerance: float | None = None,
    choose: Mapping[str, str] | None = None,
    level: Level = "physics",
    ignore: Sequence[str] = (),
    only: Sequence[str] = (),
    counterexamples: bool = True,
    progress: Progress | None = None,
) -> DoctorReport:
    """Find and prove why engines that load a robot file differ, and mend the file.

    Each engine loads the file by its documented call. dynx compares the engine with reference values at
    random states, in tilted gravity.

    - `robot`: any argument of `dynx.load`
    - `base`: the base of a robot in URDF, ``"fixed"`` by default; files in MJCF and SDF state their base
    - `engines`: names of `dynx.loaded.ENGINES` and of `dynx.loaded.VARIANTS`; by default all engines that are
      installed and load files of this format. A variant is another common call of an engine. By default
      dynx also examines variants (`DoctorReport.variants`). No change of the file can mend a call. So the
      differences of a variant count only if `engines` names the variant
    - `samples`, `seed`: the number of states, and the seed from which they follow
    - `tolerance`: the relative error above which an engine differs
    - `fix_tolerance`: the largest effect that a cause has in the mended file. New numbers have the fewest
      digits that keep every engine within a tenth of this limit. By default the limit is `tolerance`, and new
      numbers have all digits
    - `choose`: maps rule ids to one of the rule's `choices`
    - `level`: the largest change of the mended file. ``safe`` changes nothing that a reader of the file
      notices, ``rounding`` changes the equations of motion only by rounding, and ``physics`` makes every
      change that the causes require
    - `ignore`, `only`: ids or names of rules. Findings of the rules in `ignore`, and of all rules that are
      not in `only`, make no check fail. Such findings stay in `findings`, count in `DoctorReport.ignored`,
      and are mended
    - `counterexamples`: whether dynx searches for the smallest robot with a difference that no rule explains
    - `progress`: called with the name of each step

    If dynx cannot read the robot, the report has `error` set, and its `findings` are the places without a
    remedy. Raises ArgumentError, UnknownBackendError, NotInstalledError and UnknownNameError for arguments
    that are invalid for any robot.
    """
    started = time.perf_counter()
    examiner, variants = _examiners(engines, samples, seed, tolerance)
    choices = checked_choices((choose or {}).items())
    not_counted = ignored_rules(ignore, only)
    if base is not None:
        checked_base(base)
    if fix_tolerance is not None and not (is_real(fix_tolerance) and 0.0 < fix_tolerance < 1.0):
        raise ArgumentError(
            f"fix_tolerance is {shown(fix_tolerance)}; wanted a relative error between 0 and 1"
        )
    if level not in LEVELS:
        raise UnknownNameError(f"no level {shown(level)}{nearest(level, LEVELS)}")
    progress = progress or _ignore_progress
    case = None
    try:
        case = open_case(robot, base, choices)
        examiner, variants = _of_format(case, examiner, variants, engines)
        report = _diagnosis_of(
            case, examiner, variants, tolerance, fix_tolerance, counterexamples, seed, level, progress
        )
    except DynxError as error:
        report = refused_report(str(_label(robot)), error, base=base or "fixed")
        if case is not None:
            left = all_findings(left_undone(case), [], Mending(case), examiner.engines)
            report = replace(report, findings=left)
    finally:
        examiner.close()
    seconds = time.perf_counter() - started
    tolerance = max(report.tolerance, tolerance)
    ignored = Counter(each.rule for each in report.findings if each.rule in not_counted)
    return replace(
        report,
        samples=samples,
        seed=seed,
        tolerance=tolerance,
        ignored=dict(sorted(ignored.items())),
        seconds=seconds,
    )


@checks_types
def compare_as_loaded(
    robot: Robot,
    *,
    base: Base | None = None,
    engines: Sequence[str] | None = None,
    samples: int = DEFAULT_SAMPLES,
    seed: int = 0,
    tolerance: float = BAR,
) -> DoctorReport:
    """Compare engines that load the file themselves, without a search for causes.

    The states are the same as in `diagnose`. If engines differ, `explained` of the report is False.
    """
    started = time.perf_counter()
    examiner, variants = _examiners(engines, samples, seed, tolerance)
    if base is not None:
        checked_base(base)
    try:
        case = open_case(robot, base, {})
        examiner, variants = _of_format(case, examiner, variants, engines)
        _, before, report = _loaded(case, examiner, tolerance)
        beside = variants_as_loaded(case, before.reference, variants)
        report = replace(report, variants=beside, causes_searched=False)
    except DynxError as error:
        report = refused_report(str(_label(robot)), error, base=base or "fixed")
    finally:
        examiner.close()
    seconds = time.perf_counter() - started
    tolerance = max(report.tolerance, tolerance)
    return replace(report, samples=samples, seed=seed, tolerance=tolerance, seconds=seconds)


def _of_format(
    case: Case, examiner: Examiner, variants: Examiner, engines: Sequence[str] | None
) -> tuple[Examiner, Examiner]:
    """Leave out the engines that load no file of the format of the case, or no ball joints if it has some,
    unless the user named them; raise UnsupportedFeatureError if a named engine takes no ball joints."""
    if case.form == "urdf":
        return examiner, variants
    if engines is None:
        examiner = examiner.for_format(case.form)
        if not examiner.engines:
            raise ArgumentError(f"no engine that is installed loads {format_name(case.form)}")
    variants = variants.for_format(case.form)
    model = model_without_mimics(readable(case).case.source, case.base)
    if model.ball_joints:
        taking = examiner.for_ball_joints()
        for name in examiner.engines:
            if name not in taking.engines and (engines is not None or not taking.engines):
                what = f"the comparison of files as {shown(name)} loads them"
                taker = "'mujoco' and 'drake' load" if case.form == "mjcf" else "'drake' loads"
                refuse_ball_joints(model, what, f"that as {taker} them does")
        examiner, variants = taking, variants.for_ball_joints()
    return examiner, variants


def open_case(robot: Robot, base: Base | None, choices: Mapping[str, str]) -> Case:
    """Read the document of a robot as a case; raises the errors of `dynx.load` that no remedy of a rule about
    the text removes, and DescriptionError for a document larger than is examined.

    The base of MJCF and SDF is that of the file.
    """
    if isinstance(robot, Model):
        document = XmlSource(bare_urdf(robot), robot.source)
    else:
        data, source, _ = read_description(robot)
        document = XmlSource(data, source)
    require_bounded(document)
    case = Case(document, base or "fixed", choices=choices)
    if case.form == "urdf":
        return case
    try:
        model = read_model(document.text_with_lines_before, document.source, base=base)
    except DescriptionError:
        bases: Sequence[Base] = ("fixed", "floating") if base is None else (base,)
        for each in bases:
            stated = replace(case, base=each)
            if readable(stated).case.readable:
                return stated
        raise
    return replace(case, base=model.base)


def refused_report(robot: str, error: DynxError, *, base: str | None = None) -> DoctorReport:
    """Make the report of a robot that could not be examined."""
    place = error if isinstance(error, DescriptionError) else None
    source, line = (None, None) if place is None else (place.source, place.line)
    return DoctorReport(
        robot,
        source=source,
        base=base,
        residual=math.inf,
        referee=math.inf,
        error=_failure(error),
        error_line=line,
    )


def _diagnosis_of(
    case: Case,
    examiner: Examiner,
    variants: Examiner,
    tolerance: float,
    fix_tolerance: float | None,
    counterexamples: bool,
    seed: int,
    level: Level,
    progress: Progress,
) -> DoctorReport:
    progress("loading")
    examiner, before, report = _loaded(case, examiner, tolerance)
    tolerance = report.tolerance
    reference, report = before.reference, with_meshes(report, case.source)
    rules = _rules_for(examiner)
    found = with_original_lines(detections(case, rules), case.source, readable(case).case.source)
    if report.alike and not _chosen_practice(case, found):
        return replace(
            report,
            findings=all_findings(found, [], Mending(case), examiner.engines),
            variants=diagnosed_variants(case, reference, case, reference, rules, variants, tolerance),
        )
    progress("mending")
    full = mend(case, rules)
    after = examiner.examine(full.case)
    proofs = Proofs(case, rules, examiner, before, full.case, after, tolerance, progress)
    attributions = proofs.attributions()
    if after.reference.kinematics_only and any(each.no_results for each in after.outputs.values()):
        attributions = with_refusals(attributions, case, rules, examiner, before, tolerance, progress)
    best = smallest_mending(
        case,
        rules,
        SelectedPlaces(full, after, attributions),
        examiner,
        tolerance,
        lambda rule: proofs.measure(rule, minor=True),
    )
    found = _with_contacts(found, best, case, case.with_source(full.case.source), seed)
    left = _engines_without_remedy(best.mending.case, rules, examiner.engines)
    stated = _stated_effects(best, rules, examiner.engines, tolerance)
    known = {engine for effects in stated.values() for engine in effects}
    unexplained = tuple(
        each for each in _unexplained(best.examination, tolerance, left) if each.engine not in known
    )
    # Smaller robots are made of URDF.
    if unexplained and counterexamples and case.form == "urdf":
        unexplained = _with_counterexamples(
            best.mending.case, unexplained, examiner, tolerance, seed, progress
        )
    written, sentence = best, None
    if fix_tolerance is not None:
        written, sentence = coarsest_mending(case, rules, best, examiner, fix_tolerance)
    mended, last = written.mending, written.examination
    if level != "physics":
        mended = mend(case, rules, all_except(written.omitted), level)
        last = examiner.examine(mended.case, reference=examiner.reference(readable(mended.case).case))
    withheld = reading_change(case, mended)
    return replace(
        with_after(report, last, best.examination, known),
        findings=_with_stated(
            with_original_names(
                all_findings(found, best.proofs, mended, examiner.engines, refusing_rules(case)), case.source
            ),
            stated,
        ),
        unexplained=unexplained,
        choices=(*mended.choices, *filter(None, [sentence])),
        calls=run_time_calls(mended.case, examiner),
        level=level,
        changes=changes_of(case, written.mending, mended),
        variants=diagnosed_variants(
            case,
            reference,
            best.mending.case,
            best.examination.reference,
            rules,
            variants,
            tolerance,
        ),
        mended=mended.case.source.text if differs(mended.case, case) and withheld is None else None,
        withheld=withheld,
        form=mended.case.source.form,
    )


def _reference_of(case: Case, examiner: Examiner) -> ReferenceValues:
    """Compute the reference values; where dynx refuses the text, raise the first error without a remedy."""
    try:
        return examiner.reference(case)
    except DynxError as error:
        # Reference values are computed from an edited text, whose line numbers differ.
        raise (refusal(case) or error) from None


def _loaded(case: Case, examiner: Examiner, tolerance: float) -> tuple[Examiner, Examination, DoctorReport]:
    """Measure the engines on the file. Where they are alike, a state at which links touch is added, in an
    engine that adds the forces."""
    sound = readable(case).case
    before = examiner.examine(case, reference=_reference_of(sound, examiner), describe=True)
    report = first_report(case, before, tolerance)
    touching = _rare_contact(case, sound, examiner) if report.alike else None
    if touching is None:
        return examiner, before, report
    examiner = examiner.at(touching)
    before = examiner.examine(case, reference=examiner.reference(sound), describe=True)
    return examiner, before, first_report(case, before, tolerance)


def _rare_contact(case: Case, sound: Case, examiner: Examiner) -> Mapping[str, float] | None:
    """Find positions at which links touch, in engines that add the forces; None where none touch."""
    found = detections(case, [rule for rule in _rules_for(examiner) if rule.present_as])
    rules = dict.fromkeys(rule for rule, _ in found)
    engines = dict.fromkeys(engine for rule in rules for engine in rule.named_of(examiner.engines))
    return deepest_contact(sound, engines, examiner.seed) if engines else None


def _chosen_practice(case: Case, found: Sequence[tuple[Rule, Detection]]) -> bool:
    """Check whether the user chose a remedy for bad practice that was found."""
    return any(rule.kind == "practice" and rule.id in (case.choices or {}) for rule, _ in found)


def _rules_for(examiner: Examiner) -> list[Rule]:
    """Select the rules that concern one of the examined engines, and those about practice."""
    versions = {name: kind.engine_version() for name, kind in examiner.engines.items()}
    return [rule for rule in all_rules() if rule.kind == "practice" or rule.holds_for(versions)]


def _with_contacts(
    found: Sequence[tuple[Rule, Detection]], best: SelectedPlaces, case: Case, mended: Case, seed: int
) -> list[tuple[Rule, Detection]]:
    """Name the links in contact where contacts have an effect, as the file names them."""
    touching = {each.rule: engine for each in best.proofs if each.rule.present_as for engine in each.effects}
    gone, new = case.links.keys() - mended.links.keys(), mended.links.keys() - case.links.keys()
    names = dict(zip(new, gone, strict=True)) if len(gone) == len(new) == 1 else {}
    texts = {rule: describe_contacts(mended, engine, seed, names) for rule, engine in touching.items()}
    return [
        (rule, replace(each, message=f"{each.message}: {texts[rule]}") if texts.get(rule) else each)
        for rule, each in found
    ]


def _stated_effects(
    best: SelectedPlaces, rules: Sequence[Rule], engines: Collection[str], tolerance: float
) -> dict[str, dict[str, Effect]]:
    """Return what remains of the difference in each engine, by the rules that state an omission of it.

    A cause accounts for no more than its bound. Of several causes in one engine each may be the one.
    """
    found: dict[str, dict[str, Effect]] = {}
    examination = best.examination
    for rule in rules:
        if not rule.stated or not rule.detect(best.mending.case):
            continue
        for engine in rule.named_of(engines):
            output = examination.outputs[engine]
            errors = examination.errors(engine)
            quantity = max(errors, key=lambda name: errors[name], default=None)
            if output.refused is not None and not rule.stated_refusal:
                continue
            if output.no_results is not None and rule.stated_numbers:
                continue
            if output.no_results is not None:
                effect = Effect(output.missing, float("inf"))
            elif quantity is not None and errors[quantity] > tolerance:
                effect = Effect(quantity, errors[quantity])
            else:
                continue
            if effect.relative_error <= rule.stated_bound:
                found.setdefault(rule.id, {})[engine] = effect
    return found


def _with_stated(
    findings: Iterable[Finding], stated: Mapping[str, Mapping[str, Effect]]
) -> tuple[Finding, ...]:
    """Give the findings of stated omissions their effects."""
    changed = []
    for finding in findings:
        effects = stated.get(finding.rule)
        if effects:
            largest = max(effects.values(), key=lambda effect: effect.relative_error)
            finding = replace(finding, engines=tuple(effects), effect=largest, effects=dict(effects))
        changed.append(finding)
    return tuple(changed)


def _engines_without_remedy(mended: Case, rules: Sequence[Rule], engines: Collection[str]) -> set[str]:
    """Find the engines for which a cause remains that has no remedy or that the user chose to keep."""
    # What a stated omission accounts for is known apart (`_stated_effects`): it may be no refusal.
    causes = [rule for rule in rules if rule.kind == "difference" and not rule.stated]
    left = detections(mended, causes)
    return {
        engine
        for rule, each in left
        if remedy_of(mended, rule, [each]) is None
        for engine in rule.named_of(engines)
    }


def _unexplained(after: Examination, tolerance: float, known: Collection[str]) -> tuple[Unexplained, ...]:
    """Collect the differences that remain above the tolerance: the quantity of the largest error of each
    engine, or ``loading`` where an engine refuses even the mended file for no `known` cause (``result`` where
    it is not used on that)."""
    remaining = []
    for engine, output in after.outputs.items():
        if output.no_results is not None and engine not in known:
            remaining.append(Unexplained(engine, output.missing, float("inf")))
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
    examiner: Examiner,
    tolerance: float,
    seed: int,
    progress: Progress,
) -> tuple[Unexplained, ...]:

    found = []
    for each in unexplained:
        progress(f"counterexample for {each.engine}")
        difference = difference_of(examiner, each.engine, each.quantity)
        example = smallest_counterexample(
            case, difference, tolerance=tolerance, seed=seed, budget=COUNTEREXAMPLE_SECONDS
        )
        found.append(replace(each, counterexample=example))
    return tuple(found)


def _examiners(
    engines: Sequence[str] | None, samples: int, seed: int, tolerance: float
) -> tuple[Examiner, Examiner]:
    """Return the examiner of the engines, and that of the variants to examine beside them."""
    whole_number("samples", samples, 1)
    checked_seed("seed", seed)
    if not (is_real(tolerance) and 0.0 < tolerance < 1.0):
        raise ArgumentError(f"tolerance is {shown(tolerance)}; wanted a relative error between 0 and 1")
    chosen = installed_engines() if engines is None else tuple(dict.fromkeys(engines))
    if isinstance(engines, str) or not chosen:
        raise ArgumentError(
            f"engines is {shown(engines)}; wanted names out of {', '.join([*ENGINES, *VARIANTS])}"
        )
    beside = [name for name in COMMON_VARIANTS if engines is None and engine_of(name) in chosen]
    examiner = Examiner(chosen, samples, seed)
    return examiner, examiner.of_engines(beside)


def _label(robot: object) -> str:
    text = robot.name if isinstance(robot, Model) else str(robot)
    return text if len(text) <= 200 and "\n" not in text else "<string>"


def _ignore_progress(step: str) -> None:
    """Progress callback that does nothing."""
