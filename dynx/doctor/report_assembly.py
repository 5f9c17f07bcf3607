"""Assembly of a report from examinations and proofs."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace
from itertools import combinations

from dynx.doctor.examine.examination import (
    QUANTITIES,
    TORQUE,
    Examination,
    Examiner,
    ReferenceValues,
    referee_error,
)
from dynx.doctor.prove.attribution import AttributedCause, CauseAttributor
from dynx.doctor.prove.mending import (
    Mending,
    Place,
    changed_parts,
    detections,
    differs,
    level_of,
    mend,
    place_of,
    readable,
)
from dynx.doctor.report import (
    Change,
    DoctorReport,
    Effect,
    EngineResult,
    Finding,
    PairError,
    RunTimeCall,
    UnreadMesh,
    VariantResult,
)
from dynx.loaded import loader_class
from dynx.loaded.difference import model_difference
from dynx.model.xml.source import XmlSource
from dynx.rules import LEVELS, CallingRule, Case, Detection, Rule, all_rules
from dynx.rules.geometry import is_found, is_found_above, named_meshes, parts_with_meshes, reason_unread

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
    return DoctorReport(
        robot=model.name,
        source=case.source.source,
        base=case.base,
        total_mass=sum(link.inertial.mass for link in model.links if link.inertial is not None),
        kinematics_only=before.reference.kinematics_only,
        engines=tuple(_engine_result(case, name, before) for name in before.outputs),
        residual=_residual(before),
        tolerance=max(tolerance, min(REFERENCE_MARGIN * referee, MAX_RAISED_TOLERANCE)),
        pairs=_pairs(before),
        referee=referee,
        model_difference=tuple(model_difference(model, descriptions)),
        text=case.source.text,
        form=case.source.form,
    )


def with_meshes(report: DoctorReport, source: XmlSource) -> DoctorReport:
    """Add the mesh files that the description names and that were not read."""
    named = list(named_meshes(source))
    parts = parts_with_meshes(source)
    kinds = {each.engine: loader_class(each.engine) for each in report.engines}
    unread = []
    for link, mesh in named:
        file = mesh.attributes["filename"]
        reason = reason_unread(file, source.source)
        if reason is not None:
            lacking = set() if is_found(file, source.source) else parts[file]
            above = is_found_above(file, source.source)
            refusing = tuple(
                name
                for name, kind in kinds.items()
                if lacking & {*kind.refuses_without} and not (above and kind.searches_above)
            )
            unread.append(UnreadMesh(file, link.attributes.get("name", ""), mesh.line, reason, refusing))
    return replace(report, meshes=len(named), unread_meshes=tuple(unread))


def with_after(report: DoctorReport, after: Examination, proved: Examination) -> DoctorReport:
    """Add the errors of the engines on the mended file, and the largest one once all causes are removed."""
    engines = tuple(
        replace(
            each,
            refused_after=after.outputs[each.engine].refused,
            not_used_after=after.outputs[each.engine].not_used,
            after=after.errors(each.engine),
        )
        for each in report.engines
    )
    return replace(report, engines=engines, residual=_residual(proved))


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
    return EngineResult(
        engine=name,
        version=kind.engine_version(),
        call=kind.load_call(case.base == "floating"),
        refused=output.refused,
        refused_after=output.refused,
        not_used=output.not_used,
        not_used_after=output.not_used,
        before=errors,
        after=errors,
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
) -> tuple[Finding, ...]:
    """Report everything detected, with the effect where one was measured, or is known in all `engines`; texts
    name these engines only."""
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
        findings.append(finding)
    return tuple(sorted(findings, key=lambda finding: finding.kind))


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
