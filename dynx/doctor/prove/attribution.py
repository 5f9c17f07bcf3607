"""The proof of a cause: take it away alone, or everything but it, and see what the engines then say.

For every place where a rule applies, the file is treated there and nowhere else, and each engine that
the rule names loads it again. What changes in an engine's distance from the right answer is the
*effect*. Two causes can hide each other (an engine that refuses a file for two reasons); then the file
is mended of everything else, and the effect is what this one cause brings back.

A cause is *proved* for an engine where it has an effect above the tolerance, and the engine is right
once all causes are taken away.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass

from dynx.doctor.examine.examination import LOADING, QUANTITIES, Examination, Laboratory, change
from dynx.doctor.examine.right_answers import Truth
from dynx.doctor.prove.mending import Mending, mend, readable, treated
from dynx.doctor.prove.reinsertion import put_back
from dynx.doctor.report import Effect
from dynx.rules import Case, Detection, Remedy, Rule

NOTHING = Effect("", 0.0)

STATES_AT_A_PLACE = 2
"""States at which a rule is tried place by place, after it was tried everywhere at once at all states."""


@dataclass(frozen=True)
class Attribution:
    """The effect of one rule at one place on each engine where it has one above the tolerance."""

    rule: Rule
    detection: Detection
    effects: Mapping[str, Effect]
    proved: bool

    @property
    def worst(self) -> Effect | None:
        """The largest effect, if there is any."""
        return max(self.effects.values(), key=lambda effect: effect.relative_error, default=None)


class Attributor:
    """Proves the causes in one case; `before` and `after` are its examinations as it is and mended."""

    def __init__(
        self,
        laboratory: Laboratory,
        case: Case,
        rules: Sequence[Rule],
        before: Examination,
        after: Examination,
        tolerance: float,
        progress: Callable[[str], None],
    ) -> None:
        self._laboratory = laboratory
        self._case = case
        self._rules = rules
        self._before = before
        self._after = after
        self._tolerance = tolerance
        self._progress = progress

    def attribute(self, rule: Rule, found: Sequence[Detection]) -> list[Attribution]:
        """What the rule does at each of the places where it was found."""
        self._progress(f"{rule.id} {rule.name}")
        named = [engine for engine in self._laboratory.engines if engine in rule.engines]
        touched = self._alone(rule, found, named)
        loading = [name for name, effect in touched.items() if effect.quantity == LOADING]
        untouched = [name for name in named if name not in touched and self._is_wrong(name)]
        if untouched:
            touched |= self._among_the_mended(rule, found, untouched)
        if len(found) == 1 or not touched:
            return [self._attribution(rule, each, touched) for each in found]
        proofs = []
        for each in found:
            effects = self._alone(rule, [each], touched, STATES_AT_A_PLACE)
            others = [other for other in found if other is not each]
            # Of places that each make an engine refuse the file, none shows while another is there.
            refusing = [engine for engine in loading if engine not in effects]
            effects |= self._refused_with(rule, others, refusing)
            for engine, effect in touched.items():
                refused = self._before.answers[engine].refused is not None
                if refused and engine not in effects and engine not in loading:
                    effects[engine] = effect
            proofs.append(self._attribution(rule, each, effects))
        return proofs

    def _refused_with(
        self, rule: Rule, others: Sequence[Detection], engines: Sequence[str]
    ) -> dict[str, Effect]:
        """The engines that refuse the file for the one place left when the rule is gone from all others."""
        remedy = treated(self._case, rule, others) if engines else None
        if remedy is None:
            return {}
        truth = self._truth_of(remedy).take(1)
        found = self._laboratory.examine(remedy.case, engines, truth=truth).answers
        return {
            engine: Effect(LOADING, float("inf")) for engine in engines if found[engine].refused is not None
        }

    def _alone(
        self, rule: Rule, found: Sequence[Detection], engines: Collection[str], states: int | None = None
    ) -> dict[str, Effect]:
        """What changes in each engine when the rule is taken away in these places and nothing else is."""
        if not engines:
            return {}
        remedy = treated(self._case, rule, found)
        if remedy is None:
            return {}
        before = self._before if states is None else self._before.take(states)
        truth = self._truth_of(remedy)
        after = self._laboratory.examine(
            remedy.case, engines, truth=truth if states is None else truth.take(states)
        )
        return self._effects(engines, before, after)

    def _among_the_mended(
        self, rule: Rule, found: Sequence[Detection], engines: Sequence[str]
    ) -> dict[str, Effect]:
        """What changes in each engine when the rule comes back into the mended file."""
        rest: Mending = mend(self._case, [other for other in self._rules if other is not rule])
        if not rest.case.readable:
            return {}
        if all(applied is not rule for applied, _ in rest.applied):
            return self._effects(engines, self._laboratory.examine(rest.case, engines), self._after)
        # Without this rule dynx itself could not read the file.
        remedy = treated(self._case, rule, found)
        mended = mend(self._case, self._rules).case
        if remedy is None:
            return {}
        source = put_back(self._case.source, remedy.case.source, mended.source)
        if source is None:
            return {}
        with_it = self._laboratory.examine(mended.with_source(source), engines, truth=self._after.truth)
        return self._effects(engines, with_it, self._after)

    def _is_wrong(self, engine: str) -> bool:
        return self._before.worst(engine) > self._tolerance

    def _effects(
        self, engines: Iterable[str], with_it: Examination, without: Examination
    ) -> dict[str, Effect]:
        """The effects that are above the tolerance."""
        found = {name: self._effect(name, with_it, without) for name in engines}
        return {name: effect for name, effect in found.items() if effect is not NOTHING}

    def _effect(self, engine: str, with_it: Examination, without: Examination) -> Effect:
        """How far the engine's answers move, in the quantity where they move most."""
        one, other = with_it.answers[engine], without.answers[engine]
        if other.refused is not None:
            return NOTHING
        if one.refused is not None:
            return Effect(LOADING, float("inf"))
        worst = NOTHING
        for quantity in QUANTITIES:
            if quantity in other.failed:
                continue
            if quantity in one.failed:
                return Effect(quantity, float("inf"))
            gap = change(one.deviation.get(quantity, {}), other.deviation.get(quantity, {}))
            size = gap / without.scale(quantity, engine)
            if size > max(worst.relative_error, self._tolerance):
                worst = Effect(quantity, size)
        return worst

    def _attribution(self, rule: Rule, each: Detection, effects: Mapping[str, Effect]) -> Attribution:
        right = all(self._after.worst(engine) <= self._tolerance for engine in effects)
        return Attribution(rule, each, dict(effects), bool(effects) and right)

    def _truth_of(self, remedy: Remedy) -> Truth:
        """The right answers for the treated file: the known ones where the robot meant is the same."""
        if not remedy.changes_physics and _coordinates(remedy.case) == _coordinates(self._case):
            return self._before.truth
        # Other places may still hold text that dynx refuses: what is meant there is known too.
        return self._laboratory.truth(readable(remedy.case).case)


def _coordinates(case: Case) -> tuple[object, ...]:
    joints = case.source.root.all("joint")
    links = case.source.root.all("link")
    return (
        tuple(link.attributes.get("name") for link in links),
        tuple((joint.attributes.get("name"), joint.attributes.get("type")) for joint in joints),
    )
