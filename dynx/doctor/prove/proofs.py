"""Proofs of all causes in one case: for each rule the effect at every place."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

from dynx.doctor.examine.contacts import deepest_contact
from dynx.doctor.examine.examination import LOADING, RESULT, Examination, Examiner
from dynx.doctor.prove.attribution import AttributedCause, CauseAttributor
from dynx.doctor.prove.mending import appearances, detections, mend, place_of, readable
from dynx.rules import Case, Rule

RARE_STATES = 40
"""Number of states for a cause that shows at some states only, where it does not at the first."""


class Proofs:
    """Measurement of the effects of causes in one case, which is examined `before` and `after` mending.

    The causes of rules about the text are removed from the text as it is, those of rules about the robot from
    the text made readable. Meshes are removed from both texts first. A cause in the text that shows only
    after the remedy of another (a second root, once the world is declared) is removed from that text.
    """

    def __init__(
        self,
        case: Case,
        rules: Sequence[Rule],
        examiner: Examiner,
        before: Examination,
        mended: Case,
        after: Examination,
        tolerance: float,
        progress: Callable[[str], None],
    ) -> None:
        self._text = case.with_source(examiner.without_unused(case.source))
        self._robot = readable(self._text).case
        self._mended = mended
        self._rules = [rule for rule in rules if rule.kind == "difference"]
        self._examiner, self._tolerance, self._progress = examiner, tolerance, progress
        self._hidden = appearances(self._text, self._rules)
        hidden = {place_of(each.rule, each.detection) for each in self._hidden}
        found = detections(self._text, self._rules)
        self._found = [(rule, each) for rule, each in found if place_of(rule, each) not in hidden]
        readably = before
        if self._robot is not self._text:
            readably = examiner.examine(self._robot, reference=before.reference)
        self._before, self._after = before, after
        self._by_text = self._attributor(self._text, examiner, before, after)
        self._by_robot = self._attributor(self._robot, examiner, readably, after)

    def attributions(self) -> list[AttributedCause]:
        """Measure the effect of every rule about differences at every place."""
        rules = dict.fromkeys([*(rule for rule, _ in self._found), *(each.rule for each in self._hidden)])
        return [each for rule in rules for each in self.measure(rule)]

    def measure(self, rule: Rule, *, minor: bool = False) -> list[AttributedCause]:
        """Measure the effect of one rule at every place; see `CauseAttributor.attribute`."""
        places = [each for other, each in self._found if other is rule]
        by = self._by_text if rule.stage == "reading" else self._by_robot
        found = by.attribute(rule, places, minor=minor) if places else []
        if places and rule.depends_on_state and not any(each.effects for each in found):
            found = self._at_more_states(rule).attribute(rule, places, minor=minor)
        return [*found, *self._measure_hidden(rule, minor=minor)]

    def _measure_hidden(self, rule: Rule, *, minor: bool) -> list[AttributedCause]:
        """Measure the effect of one rule at the places that show only after other remedies, in that text."""
        hidden = [each for each in self._hidden if each.rule is rule]
        if not hidden:
            return []
        case = hidden[0].case
        before = self._examiner.examine(case, reference=self._before.reference)
        by = self._attributor(case, self._examiner, before, self._after)
        return by.attribute(rule, [each.detection for each in hidden], minor=minor)

    def _at_more_states(self, rule: Rule) -> CauseAttributor:
        more = self._examiner.with_samples(RARE_STATES)
        engines = rule.named_of(more.engines)
        if rule.present_as and (touching := deepest_contact(self._robot, engines, more.seed)) is not None:
            more = more.at(touching)
        case = self._text if rule.stage == "reading" else self._robot
        before = more.examine(case, engines, reference=more.reference(self._robot))
        return self._attributor(case, more, before, more.examine(self._mended, engines))

    def _attributor(
        self, case: Case, examiner: Examiner, before: Examination, after: Examination
    ) -> CauseAttributor:
        return CauseAttributor(examiner, case, self._rules, before, after, self._tolerance, self._progress)


# Causes for which engines refuse a file without inertial data, which they refuse for that as well.
#
# No remedy of another cause shows there that an engine then loads the file. So each is measured with the
# least mass and moments on every moving body (DX118), and of the effects only those on loading count: no
# dynamics of such a robot means anything.


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
