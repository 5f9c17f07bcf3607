"""Loading variants that are common, examined beside their engine: each has one cause, which is the call.

A variant is examined apart from the engines. What it shares with its engine is in the findings about that;
what its call adds is proved here: the remedy of the call alone changes the result, and together with those
of all other causes it makes the variant right.
"""

from __future__ import annotations

from collections.abc import Sequence

from dynx.doctor.examine.examination import Examination, Examiner
from dynx.doctor.examine.reference_values import ReferenceValues
from dynx.doctor.prove.attribution import AttributedCause, CauseAttributor
from dynx.doctor.prove.mending import detections, mend, readable
from dynx.doctor.report import VariantResult
from dynx.doctor.report_assembly import all_findings, variant_result
from dynx.rules import Case, Rule, all_rules


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
