"""Proof of a cause by ablation: it is removed alone, or all others are, and the engines are measured again.

For every place where a rule applies, its cause is removed there and nowhere else, and each engine that the
rule names loads the file again. The change in the engine's deviation from the reference values is the
*effect*. Two causes can hide each other (an engine that refuses a file for two reasons); then all other
causes are removed, and the effect is the deviation that this one cause leaves.

A cause is *proved* for an engine where it has an effect above the tolerance, and the engine agrees with the
reference once all causes are removed.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass

from dynx.doctor.examine.examination import LOADING, QUANTITIES, Examination, Examiner, max_change
from dynx.doctor.examine.reference_values import ReferenceValues
from dynx.doctor.prove.mending import Mending, mend, readable, remedy_of
from dynx.doctor.prove.reinsertion import reinserted_text
from dynx.doctor.report import Effect
from dynx.rules import Case, Detection, Remedy, Rule

NO_EFFECT = Effect("", 0.0)

STATES_PER_PLACE = 2
"""Number of states for the effect at each place, once the effect at all places together is known."""


@dataclass(frozen=True)
class Attribution:
    """The effect of one rule at one place on each engine where it has one above the tolerance."""

    rule: Rule
    detection: Detection
    effects: Mapping[str, Effect]
    proved: bool

    @property
    def largest_effect(self) -> Effect | None:
        """Largest effect, if there is any."""
        return max(self.effects.values(), key=lambda effect: effect.relative_error, default=None)


@dataclass(frozen=True, eq=False)
class Attributor:
    """Proves the causes in one case from its examinations `before` and `after` mending."""

    examiner: Examiner
    case: Case
    rules: Sequence[Rule]
    before: Examination
    after: Examination
    tolerance: float
    progress: Callable[[str], None]

    def attribute(self, rule: Rule, found: Sequence[Detection]) -> list[Attribution]:
        """Measure the effect of the rule at each of the places where it was found."""
        self.progress(f"{rule.id} {rule.name}")
        named = [engine for engine in self.examiner.engines if engine in rule.engines]
        affected = self._effects_of_removal(rule, found, named)
        loading = [name for name, effect in affected.items() if effect.quantity == LOADING]
        unaffected = [name for name in named if name not in affected and self._has_error(name)]
        if unaffected:
            affected |= self._effects_of_reinsertion(rule, found, unaffected)
        if len(found) == 1 or not affected:
            return [self._attribution(rule, each, affected) for each in found]
        proofs = []
        for each in found:
            effects = self._effects_of_removal(rule, [each], affected, STATES_PER_PLACE)
            others = [other for other in found if other is not each]
            # Where each of several places makes an engine refuse the file, removing one alone shows nothing.
            refusing = [engine for engine in loading if engine not in effects]
            effects |= self._refused_with(rule, others, refusing)
            for engine, effect in affected.items():
                refused = self.before.outputs[engine].refused is not None
                if refused and engine not in effects and engine not in loading:
                    effects[engine] = effect
            proofs.append(self._attribution(rule, each, effects))
        return proofs

    def _refused_with(
        self, rule: Rule, others: Sequence[Detection], engines: Sequence[str]
    ) -> dict[str, Effect]:
        """Find the engines that refuse the file when the cause is left at one place only."""
        remedy = remedy_of(self.case, rule, others) if engines else None
        if remedy is None:
            return {}
        reference = self._reference_of(remedy).first(1)
        found = self.examiner.examine(remedy.case, engines, reference=reference).outputs
        return {
            engine: Effect(LOADING, float("inf")) for engine in engines if found[engine].refused is not None
        }

    def _effects_of_removal(
        self, rule: Rule, found: Sequence[Detection], engines: Collection[str], states: int | None = None
    ) -> dict[str, Effect]:
        """Return the effects on each engine of removing the cause at these places and nothing else."""
        if not engines:
            return {}
        remedy = remedy_of(self.case, rule, found)
        if remedy is None:
            return {}
        before = self.before if states is None else self.before.first(states)
        reference = self._reference_of(remedy)
        after = self.examiner.examine(
            remedy.case, engines, reference=reference if states is None else reference.first(states)
        )
        return self._effects(engines, before, after)

    def _effects_of_reinsertion(
        self, rule: Rule, found: Sequence[Detection], engines: Sequence[str]
    ) -> dict[str, Effect]:
        """Return the effects on each engine of reinserting the cause into the mended file."""
        rest: Mending = mend(self.case, [other for other in self.rules if other is not rule])
        if not rest.case.readable:
            return {}
        if all(applied is not rule for applied, _ in rest.applied):
            return self._effects(engines, self.examiner.examine(rest.case, engines), self.after)
        # Without this rule dynx itself could not read the file.
        remedy = remedy_of(self.case, rule, found)
        mended = mend(self.case, self.rules).case
        if remedy is None:
            return {}
        source = reinserted_text(self.case.source, remedy.case.source, mended.source)
        if source is None:
            return {}
        with_cause = self.examiner.examine(
            mended.with_source(source), engines, reference=self.after.reference
        )
        return self._effects(engines, with_cause, self.after)

    def _has_error(self, engine: str) -> bool:
        return self.before.max_error(engine) > self.tolerance

    def _effects(
        self, engines: Iterable[str], with_cause: Examination, without: Examination
    ) -> dict[str, Effect]:
        """Return the effects above the tolerance."""
        found = {name: self._effect(name, with_cause, without) for name in engines}
        return {name: effect for name, effect in found.items() if effect is not NO_EFFECT}

    def _effect(self, engine: str, with_cause: Examination, without: Examination) -> Effect:
        """Change of the engine's output, in the quantity in which it is largest."""
        one, other = with_cause.outputs[engine], without.outputs[engine]
        if other.refused is not None:
            return NO_EFFECT
        if one.refused is not None:
            return Effect(LOADING, float("inf"))
        largest = NO_EFFECT
        for quantity in QUANTITIES:
            if quantity in other.failed:
                continue
            if quantity in one.failed:
                return Effect(quantity, float("inf"))
            gap = max_change(one.deviation.get(quantity, {}), other.deviation.get(quantity, {}))
            error = gap / without.scale(quantity, engine)
            if error > max(largest.relative_error, self.tolerance):
                largest = Effect(quantity, error)
        return largest

    def _attribution(self, rule: Rule, each: Detection, effects: Mapping[str, Effect]) -> Attribution:
        right = all(self.after.max_error(engine) <= self.tolerance for engine in effects)
        return Attribution(rule, each, dict(effects), bool(effects) and right)

    def _reference_of(self, remedy: Remedy) -> ReferenceValues:
        """Return the reference values of the file after a remedy: the known ones where the robot is the
        same."""
        if not remedy.changes_physics and _coordinates(remedy.case) == _coordinates(self.case):
            return self.before.reference
        # Other places may still hold text that dynx refuses, whose meaning is known too.
        return self.examiner.reference(readable(remedy.case).case)


def _coordinates(case: Case) -> tuple[object, ...]:
    joints = case.source.root.all("joint")
    links = case.source.root.all("link")
    return (
        tuple(link.attributes.get("name") for link in links),
        tuple((joint.attributes.get("name"), joint.attributes.get("type")) for joint in joints),
    )
