"""Selection of what is mended: places where the cause has an effect, and no more of them than needed."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, replace

from dynx.doctor.examine.examination import Examination, Examiner
from dynx.doctor.prove.attribution import AttributedCause
from dynx.doctor.prove.mending import Mending, Place, all_except, mend, place_of
from dynx.rules import CallingRule, Case, Rule

NEGLIGIBLE_SHARE = 0.1
"""Largest error of a mended file from places left as they are, as a share of the tolerance: their sum may be
larger at other states."""

_SHARES = (0.3, 0.1, 0.03, 0.01, 0.003, 0.0)
"""Effects, as shares of the tolerance, up to which places are left as they are, one after the other."""

MeasureMinor = Callable[[Rule], Sequence[AttributedCause]]
"""Measurement of a rule place by place, with the effects that are smaller than the tolerance."""


@dataclass(frozen=True)
class SelectedPlaces:
    """A mending, its examination, the proofs of causes, and the places that it leaves as they are."""

    mending: Mending
    examination: Examination
    proofs: Sequence[AttributedCause]
    omitted: frozenset[Place] = frozenset()


def smallest_mending(
    case: Case,
    rules: Sequence[Rule],
    full: SelectedPlaces,
    examiner: Examiner,
    tolerance: float,
    measure: MeasureMinor,
) -> SelectedPlaces:
    """Leave the places without effect as they are, if that reduces the errors as far as `full` does.

    Effects below the tolerance can add up to more than that. Then the largest of them count as effects.
    """

    def allowed(engine: str) -> float:
        return max(NEGLIGIBLE_SHARE * tolerance, full.examination.max_error(engine))

    def attempt(omitted: set[Place]) -> tuple[Mending, Examination, set[str]]:
        least = mend(case, rules, all_except(omitted))
        result = examiner.examine(least.case)
        return least, result, {name for name in examiner.engines if result.max_error(name) > allowed(name)}

    right = {name for name in examiner.engines if full.examination.max_error(name) <= tolerance}
    proofs = full.proofs
    if not (idle := _idle_places(proofs)):
        return full
    least, result, wrong = attempt(idle)
    if not wrong:
        return SelectedPlaces(least, result, proofs, frozenset(idle))
    unknown = {each.rule.id: each.rule for each in proofs if each.minor is None and each.rule.named_of(wrong)}
    measured = {name: list(measure(rule)) for name, rule in unknown.items()}
    proofs = [measured[each.rule.id].pop(0) if each.rule.id in measured else each for each in proofs]
    for share in _SHARES:
        grown = [_with_minor(each, share * tolerance, right) for each in proofs]
        least, result, wrong = attempt(_idle_places(grown))
        if not wrong:
            return SelectedPlaces(least, result, grown, frozenset(_idle_places(grown)))
    return replace(full, proofs=grown)


def _idle_places(proofs: Sequence[AttributedCause]) -> set[Place]:
    """Find the places without effect. Calls that change no file are made on the whole robot or not at all."""
    places = {place_of(each.rule, each.detection) for each in proofs}
    effective = {place_of(each.rule, each.detection) for each in proofs if each.effects}
    called = {each.rule.id for each in proofs if each.effects and isinstance(each.rule, CallingRule)}
    return {place for place in places - effective if place[0] not in called}


def _with_minor(each: AttributedCause, bound: float, right: Collection[str]) -> AttributedCause:
    """Count the minor effects above the bound as effects, proved if all their engines end up `right`."""
    larger = {name: minor for name, minor in (each.minor or {}).items() if minor.relative_error > bound}
    effects = {**each.effects, **larger}
    return replace(each, effects=effects, proved=effects.keys() <= set(right)) if larger else each
