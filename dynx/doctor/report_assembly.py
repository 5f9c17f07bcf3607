"""Assembly of a report from examinations and proofs."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace
from itertools import combinations

from dynx.doctor.examine.examination import QUANTITIES, TORQUE, Examination, Examiner
from dynx.doctor.examine.reference_values import referee_error
from dynx.doctor.prove.attribution import Attribution
from dynx.doctor.prove.mending import Mending, Place, place_of
from dynx.doctor.report import (
    DoctorReport,
    Effect,
    EngineResult,
    Finding,
    PairError,
    RunTimeCall,
    VariantResult,
)
from dynx.loaded import loader_class
from dynx.loaded.difference import model_difference
from dynx.rules import Case, Detection, Rule


def first_report(case: Case, before: Examination, tolerance: float) -> DoctorReport:
    """Report a case as engines load it, before any search for causes."""
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
        tolerance=tolerance,
        pairs=_pairs(before),
        referee=referee_error(before.reference),
        model_difference=tuple(model_difference(model, descriptions)),
        text=case.source.text,
        form=case.source.form,
    )


def with_after(report: DoctorReport, after: Examination) -> DoctorReport:
    """Add the errors of the engines on the mended file."""
    engines = tuple(
        replace(each, refused_after=after.outputs[each.engine].refused, after=after.errors(each.engine))
        for each in report.engines
    )
    return replace(report, engines=engines, residual=_residual(after))


def variant_result(
    case: Case, name: str, before: Examination, after: Examination, findings: Sequence[Finding]
) -> VariantResult:
    """Report a loading variant that is examined beside its engine."""
    result = replace(
        _engine_result(case, name, before),
        refused_after=after.outputs[name].refused,
        after=after.errors(name),
    )
    return VariantResult(**vars(result), findings=tuple(findings))


def _residual(examination: Examination) -> float:
    """Return the largest error of the engines that load the file."""
    errors = [examination.errors(engine) for engine in examination.outputs]
    return max((error for of_engine in errors for error in of_engine.values()), default=0.0)


def _engine_result(case: Case, name: str, before: Examination) -> EngineResult:
    kind = loader_class(name)
    errors, refused = before.errors(name), before.outputs[name].refused
    return EngineResult(
        engine=name,
        version=kind.engine_version(),
        call=kind.load_call(case.base == "floating"),
        refused=refused,
        refused_after=refused,
        before=errors,
        after=errors,
    )


def _pairs(examination: Examination) -> tuple[PairError, ...]:
    loaded = [name for name, each in examination.outputs.items() if each.refused is None]
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
    proofs: Sequence[Attribution],
    mended: Mending,
    engines: Collection[str],
) -> tuple[Finding, ...]:
    """Report everything detected, with the effect where one was measured, or is known in all `engines`; texts
    name these engines only."""
    proved: dict[Place, list[Attribution]] = {}
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
                engines=tuple(attribution.effects),
                effect=attribution.largest_effect,
                effects=dict(attribution.effects),
                proved=attribution.proved,
                remedy=done.get(rule.id),
            )
        findings.append(finding)
    return tuple(sorted(findings, key=lambda finding: finding.kind))


def run_time_calls(case: Case, examiner: Examiner) -> tuple[RunTimeCall, ...]:
    """Collect the code of the run-time remedies that the mended case requires."""
    known = [(name, kind.CALLS) for name, kind in examiner.engines.items()]
    return tuple(
        RunTimeCall(engine, calls[call]) for engine, calls in known for call in calls if call in case.calls
    )
