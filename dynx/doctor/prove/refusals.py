"""Causes for which engines refuse a file without inertial data, which they refuse for that as well.

No remedy of another cause shows there that an engine then loads the file. So each is measured with the least
mass and moments on every moving body (DX118), and of the effects only those on loading count: no dynamics of
such a robot means anything.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

from dynx.doctor.examine.examination import LOADING, RESULT, Examination, Examiner
from dynx.doctor.prove.attribution import AttributedCause
from dynx.doctor.prove.mending import mend, place_of
from dynx.doctor.prove.proofs import Proofs
from dynx.rules import Case, Rule

_LEAST = {"DX118": "least"}
"""Choice with which every moving body gets a mass."""


def with_refusals(
    attributions: Sequence[AttributedCause],
    case: Case,
    rules: Sequence[Rule],
    examiner: Examiner,
    before: Examination,
    tolerance: float,
    progress: Callable[[str], None],
) -> list[AttributedCause]:
    """Add the effects on loading that show only where every moving body has a mass."""
    massive = replace(case, choices={**(case.choices or {}), **_LEAST})
    mended = mend(massive, rules).case
    after = examiner.examine(mended)
    proofs = Proofs(massive, rules, examiner, before, mended, after, tolerance, progress)
    found: dict[tuple[object, ...], list[AttributedCause]] = {}
    for each in proofs.attributions():
        found.setdefault(place_of(each.rule, each.detection), []).append(each)
    return [_with_loading(each, found.get(place_of(each.rule, each.detection), [])) for each in attributions]


def _with_loading(each: AttributedCause, found: list[AttributedCause]) -> AttributedCause:
    if not found:
        return each
    other = found.pop(0)
    loading = {name: effect for name, effect in other.effects.items() if effect.quantity in (LOADING, RESULT)}
    effects = {**loading, **each.effects}
    proved = other.proved if loading and not each.effects else each.proved
    return replace(each, effects=effects, proved=proved) if loading else each
