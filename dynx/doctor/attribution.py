"""Proofs of causes by ablation: remove one alone, or all others, and measure the engines again.

For every place where a rule applies, its cause is removed there and nowhere else, and each engine that the
rule names loads the file again. The change in the engine's deviation from the reference values is the
*effect*. Causes can hide each other (an engine that refuses a file for two reasons, or at two places); then
all others are removed, and the effect is the deviation that this one place leaves.

A loading variant whose own call is a cause may not use what another cause is about: PyBullet's plain call
uses no tensor, but it does use the inertial frame, which a remedy turns. So there the effects of other causes
are measured with that call mended.

A cause is *proved* for an engine where it has an effect above the tolerance, and the engine agrees with the
reference once all causes are removed.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache, cached_property
from math import inf, isfinite

from dynx.doctor.examination import (
    LOADING,
    QUANTITIES,
    RESULT,
    Examination,
    Examiner,
    ReferenceValues,
    deepest_contact,
    max_change,
)
from dynx.doctor.mending import (
    Mending,
    Place,
    all_except,
    appearances,
    detections,
    mend,
    place_of,
    readable,
    reading_change,
    remedy_of,
)
from dynx.doctor.report import Effect
from dynx.errors import DescriptionError
from dynx.files.lines import line_opcodes
from dynx.loaded import engine_of
from dynx.model.xml.source import SourceElement, XmlSource
from dynx.rules import CallingRule, Case, Detection, Remedy, Rule
from dynx.rules.numbers_in_text import LARGEST, decimal, is_number, numeric_attributes
from dynx.spatial.scalar import FLOAT64_EPS

# Reinsertion of one cause into a mended file that dynx cannot read with that cause.
#
# Remedies about the robot need a file that dynx reads. Where one cause prevents that, all causes are
# removed from the file, and then the lines of that cause are restored.


Lines = tuple[int, int, int, int]
"""Range of equal lines: first and end in one text, first and end in the other."""


def reinserted_text(given: XmlSource, without: XmlSource, mended: XmlSource) -> XmlSource | None:
    """Return the `mended` text with the lines of one cause as they are `given`.

    `without` is the given text with the cause alone removed. None where other remedies changed the same
    lines, the cause changes no line, or the changes overlap.
    """
    texts = (given.text, without.text, mended.text)
    old, base, new = ([*text.splitlines(keepends=True)] for text in texts)
    kept = [each[1:] for each in line_opcodes(base, new) if each[0] == "equal"]
    parts: list[str] = []
    done = 0
    for tag, first, last, start, end in line_opcodes(base, old):
        if tag == "equal":
            continue
        at = _counterpart(kept, first, last)
        if at is None or at < done:
            return None
        parts += [*new[done:at], *old[start:end]]
        done = at + (last - first)
    if not parts:
        return None
    try:
        return XmlSource("".join([*parts, *new[done:]]), given.source)
    except DescriptionError:
        # Where lines repeat, the matches of the two changes can overlap.
        return None


def _counterpart(kept: Sequence[Lines], first: int, last: int) -> int | None:
    """Find where lines of one text start in the other, if they are there unchanged."""
    for begin, end, start, _ in kept:
        if begin <= first and last <= end:
            return start + first - begin
    return None


NO_EFFECT = Effect("", 0.0)

NOISE_SHARE = 0.01
"""Largest rounding error of an engine's errors, over the tolerance, with which their differences are still
taken for effects."""

MINOR_SHARE = 1e-3
"""Smallest effect that is more than rounding, as a share of the tolerance."""


@dataclass(frozen=True)
class AttributedCause:
    """The effect of one rule at one place on each engine where it has one above the tolerance.

    `minor` has the effects that are smaller, which may add up; None where they were not measured place by
    place. `behind` has, by loading variant, the rule about its call with whose remedy effects were measured.
    """

    rule: Rule
    detection: Detection
    effects: Mapping[str, Effect]
    proved: bool
    minor: Mapping[str, Effect] | None = None
    behind: Mapping[str, str] = field(default_factory=dict)

    @property
    def largest_effect(self) -> Effect | None:
        """Largest effect, if there is any."""
        return max(self.effects.values(), key=lambda effect: effect.relative_error, default=None)


@dataclass(frozen=True, eq=False)
class CauseAttributor:
    """Proves the causes in one case from its examinations `before` and `after` mending."""

    examiner: Examiner
    case: Case
    rules: Sequence[Rule]
    before: Examination
    after: Examination
    tolerance: float
    progress: Callable[[str], None]

    def attribute(
        self, rule: Rule, found: Sequence[Detection], *, minor: bool = False
    ) -> list[AttributedCause]:
        """Measure the effect of the rule at each of the places where it was found.

        Places are measured one by one if together they have an effect above the tolerance, or `minor` effects
        are wanted.
        """
        self.progress(f"{rule.id} {rule.name}")
        named = rule.named_of(self.examiner.engines)
        wrong = [name for name in named if self.before.max_error(name) > self.tolerance]
        rest = cache(lambda: mend(self.case, [other for other in self.rules if other is not rule]))
        whole = self._effects_at(rule, found, named, wrong, rest)
        affected = whole if minor else self._large(whole)
        if len(found) == 1:
            return [self._attribution(rule, each, whole) for each in found]
        if not affected:
            return [AttributedCause(rule, each, {}, False) for each in found]
        places: dict[Place, list[Detection]] = {}
        for each in found:
            places.setdefault(place_of(rule, each), []).append(each)
        measured: dict[Detection, dict[str, Effect]] = {}
        for faults in places.values():
            if len(faults) > 1:
                measured |= {each: self._effects_at(rule, [each], affected, (), rest) for each in faults}
            # Each of several faults of one place can be enough for an engine to refuse the file.
            unclear = {
                name
                for name in affected
                if all(name not in self._large(measured.get(each, {})) for each in faults)
            }
            shared = self._effects_at(rule, faults, unclear, (), rest) if len(places) > 1 else affected
            behind = self._behind(rule)
            blocked = [name for name in unclear if name not in {*self._large(shared), *behind}]
            shared = shared | self._effects_of_last(rule, faults, found, blocked)
            for each in faults:
                own = {name: effect for name, effect in shared.items() if name in unclear}
                measured[each] = measured.get(each, {}) | own
        # The remedy at one place can mend the others too, so that each seems to have no effect.
        joint = {name for name in self._large(whole) if not any(name in each for each in measured.values())}
        for each in found:
            measured[each] |= {name: whole[name] for name in joint}
        return [self._attribution(rule, each, measured[each]) for each in found]

    def _effects_at(
        self,
        rule: Rule,
        found: Sequence[Detection],
        engines: Collection[str],
        wrong: Collection[str],
        rest: Callable[[], Mending],
    ) -> dict[str, Effect]:
        """Return the effects of the rule at these places: by removal, or by reinsertion in engines where
        other causes obscure them, and in those of `wrong` where removal shows nothing."""
        behind = self._behind(rule)
        obscured = [name for name in engines if name in behind or self._is_obscured(name)]
        effects = self._effects_of_reinsertion(rule, found, obscured, rest()) if obscured else {}
        # An engine that computed nothing and does without the cause shows more than a mended file does.
        blocked = {name for name in obscured if not isfinite(self.before.max_error(name))}
        settled = {*effects.keys() - (blocked - self._large(effects).keys()), *behind}
        effects |= self._effects_of_removal(rule, found, [name for name in engines if name not in settled])
        large = self._large(effects)
        missing = [name for name in engines if name in wrong and name not in {*large, *obscured}]
        if missing:
            effects |= self._effects_of_reinsertion(rule, found, missing, rest())
        return effects

    def _is_obscured(self, engine: str) -> bool:
        """Check whether other causes obscure an effect: the engine computes nothing as long as one of them is
        left, or rounding of its errors would pass for an effect.

        Where shapes overlap by design, for example, MuJoCo's torques are 1e18 times too large.
        """
        error = self.before.max_error(engine)
        return not error * FLOAT64_EPS <= NOISE_SHARE * self.tolerance

    def _behind(self, rule: Rule) -> Mapping[str, str]:
        """Return the rule about the call of each loading variant behind which other effects are measured."""
        return {name: each for name, each in self._call_rules.items() if each != rule.id}

    @cached_property
    def _call_rules(self) -> Mapping[str, str]:
        """The rule that names a loading variant itself and is found here, by variant."""
        variants = [name for name in self.examiner.engines if engine_of(name) != name]
        found = {
            name: rule
            for name in variants
            for rule in self.rules
            if isinstance(rule, CallingRule) and name in rule.engines
        }
        return {name: rule.id for name, rule in found.items() if rule.detect(self._sound)}

    @cached_property
    def _sound(self) -> Case:
        return readable(self.case).case

    def _effects_of_removal(
        self, rule: Rule, found: Sequence[Detection], engines: Collection[str]
    ) -> dict[str, Effect]:
        """Return the effects on each engine of removing the cause at these places and nothing else."""
        remedy = remedy_of(self.case, rule, found) if engines else None
        if remedy is None:
            return {}
        after = self.examiner.examine(remedy.case, engines, reference=self._reference_of(remedy))
        return self._effects(engines, self.before, after)

    def _effects_of_last(
        self, rule: Rule, faults: Sequence[Detection], found: Sequence[Detection], engines: Sequence[str]
    ) -> dict[str, Effect]:
        """Return the effects on each engine of these faults once the rule's other places are mended.

        This shows faults of which one alone blocks an engine and which the remedy of another rule removes.
        """
        rest = remedy_of(self.case, rule, [each for each in found if each not in faults]) if engines else None
        remedy = remedy_of(self.case, rule, found) if rest is not None else None
        if rest is None or remedy is None:
            return {}
        last, without = (
            self.examiner.examine(each.case, engines, reference=self._reference_of(each))
            for each in (rest, remedy)
        )
        return self._effects(engines, last, without)

    def _effects_of_reinsertion(
        self, rule: Rule, found: Sequence[Detection], engines: Sequence[str], rest: Mending
    ) -> dict[str, Effect]:
        """Return the effects on each engine of leaving the cause at these places of the mended file.

        `rest` is the case without the causes of all other rules.
        """
        if not rest.case.readable:
            return {}
        places = {place_of(rule, each) for each in found}
        if isinstance(rule, CallingRule):
            others = [each for each in rule.detect(rest.case) if place_of(rule, each) not in places]
            remedy = remedy_of(rest.case, rule, others)
            left = rest if remedy is None else Mending(remedy.case)
        else:
            left = mend(rest.case, self.rules, all_except(places))
        if places.intersection(place_of(rule, each) for each in rule.detect(left.case)):
            return self._effects(engines, self.examiner.examine(left.case, engines), self.after)
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

    def _effects(
        self, engines: Iterable[str], with_cause: Examination, without: Examination
    ) -> dict[str, Effect]:
        """Return the effects that are more than rounding."""
        found = {name: self._effect(name, with_cause, without) for name in engines}
        return {name: effect for name, effect in found.items() if effect is not NO_EFFECT}

    def _large(self, effects: Mapping[str, Effect]) -> dict[str, Effect]:
        """Return the effects above the tolerance."""
        return {name: each for name, each in effects.items() if each.relative_error > self.tolerance}

    def _effect(self, engine: str, with_cause: Examination, without: Examination) -> Effect:
        """Return the change of the engine's output, in the quantity in which it is largest."""
        one, other = with_cause.outputs[engine], without.outputs[engine]
        if other.no_results is not None:
            # The engine loads the file without the cause, and another cause hides its results.
            loads = one.refused is not None and other.refused is None
            return Effect(LOADING, float("inf")) if loads else NO_EFFECT
        if one.no_results is not None:
            return Effect(one.missing, float("inf"))
        largest = NO_EFFECT
        for quantity in QUANTITIES:
            if quantity in other.failed or not isfinite(without.error(engine, quantity)):
                continue
            if quantity in one.failed:
                return Effect(quantity, float("inf"))
            gap = max_change(one.deviation.get(quantity, {}), other.deviation.get(quantity, {}))
            error = gap / without.scale(quantity, engine)
            if error > max(largest.relative_error, MINOR_SHARE * self.tolerance):
                largest = Effect(quantity, error)
        return largest

    def _attribution(self, rule: Rule, each: Detection, measured: Mapping[str, Effect]) -> AttributedCause:
        measured = {name: measured[name] for name in self.examiner.engines if name in measured}
        effects = self._large(measured)
        if rule.present_as:
            effects = {name: Effect(rule.present_as, inf) for name in effects}
        right = all(self.after.max_error(engine) <= self.tolerance for engine in effects)
        minor = {name: effect for name, effect in measured.items() if name not in effects}
        return AttributedCause(rule, each, effects, bool(effects) and right, minor, self._behind(rule))

    def _reference_of(self, remedy: Remedy) -> ReferenceValues:
        """Return the reference values of the file after a remedy: those of the file before it where the robot
        is the same."""
        if not remedy.changes_physics and _coordinates(remedy.case) == _coordinates(self.case):
            return self.before.reference
        # Text that dynx refuses may be left at other places; `readable` corrects it.
        return self.examiner.reference(readable(remedy.case).case)


def _coordinates(case: Case) -> tuple[object, ...]:
    if case.form != "urdf":
        model = case.model if case.readable else None
        return () if model is None else (tuple(link.name for link in model.links), model.joint_names)
    joints = case.source.root.all("joint")
    links = case.source.root.all("link")
    return (
        tuple(link.attributes.get("name") for link in links),
        tuple((joint.attributes.get("name"), joint.attributes.get("type")) for joint in joints),
    )


# Selection of what is mended: places where the cause has an effect, and no more of them than needed.


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
        other = reading_change(case, least) is not None
        errors = {name: result.max_error(name) for name in examiner.engines}
        return least, result, {name for name, error in errors.items() if other or error > allowed(name)}

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


def coarsest_mending(
    case: Case,
    rules: Sequence[Rule],
    best: SelectedPlaces,
    examiner: Examiner,
    tolerance: float,
) -> tuple[SelectedPlaces, str | None]:
    """Leave also the places whose effects are at most `tolerance` as they are, and write new numbers with the
    fewest digits with which every engine stays within a tenth of it; also return a sentence on what was left.

    `best` is the mending without any effect above the tolerance of the examination.
    """
    bound = NEGLIGIBLE_SHARE * tolerance
    chosen, left = best, set[Place]()
    for share in _LARGE_SHARES:
        left = {
            place_of(each.rule, each.detection)
            for each in best.proofs
            if each.effects
            and not isinstance(each.rule, CallingRule)
            and all(effect.relative_error <= share * tolerance for effect in each.effects.values())
        }
        attempt = mend(case, rules, all_except(best.omitted | left)) if left else best.mending
        if not left or reading_change(case, attempt) is not None:
            continue
        result = examiner.examine(attempt.case)
        if _is_within(result, best.examination, examiner, bound):
            chosen = SelectedPlaces(attempt, result, best.proofs, best.omitted | left)
            break
    kept = sorted({rule for rule, _, _ in left}) if chosen is not best else []
    sentence = f"left {', '.join(kept)} where the effect is at most {tolerance:g}" if kept else None
    short = _with_fewest_digits(case, chosen, examiner, bound)
    if short is not chosen:
        digits = f"wrote new numbers with the fewest digits that keep every engine within {bound:g}"
        sentence = digits if sentence is None else f"{sentence}; {digits}"
    return short, sentence


_LARGE_SHARES = (1.0, 0.1, 0.01)
"""Effects, as shares of the tolerance of a mended file, up to which places are left as they are."""

_DIGITS = range(6, 17)
"""Numbers of significant digits that are tried for a new number; 17 are exact."""


def _is_within(result: Examination, other: Examination, examiner: Examiner, bound: float) -> bool:
    """Check that no engine has an error above the bound, unless it has that in the other examination."""
    return all(result.max_error(name) <= max(bound, other.max_error(name)) for name in examiner.engines)


def _with_fewest_digits(
    case: Case, chosen: SelectedPlaces, examiner: Examiner, bound: float
) -> SelectedPlaces:
    mended = chosen.mending
    if any(rule.kind == "practice" for rule, _ in mended.applied):
        return chosen  # the user chose the number of digits, too
    for digits in _DIGITS:
        source = _with_digits(case.source, mended.case.source, digits)
        trial = mended.case.with_source(source)
        if source.data == mended.case.source.data or not trial.readable:
            continue
        result = examiner.examine(trial, reference=chosen.examination.reference)
        if _is_within(result, chosen.examination, examiner, bound):
            return replace(chosen, mending=Mending(trial, mended.applied), examination=result)
    return chosen


def _with_digits(given: XmlSource, mended: XmlSource, digits: int) -> XmlSource:
    """Write the numbers that only the mended text has with so many significant digits."""
    known: dict[tuple[str, str | None], set[str]] = {}
    for each in numeric_attributes(given):
        known.setdefault(_part_of(each.element), {LARGEST}).update(each.text_in(given).split())
    edits = []
    for each in numeric_attributes(mended):
        words = each.text_in(mended).split()
        old = known.get(_part_of(each.element), {LARGEST})
        short = [
            word if word in old or not is_number(word) else decimal(float(f"{float(word):.{digits}g}"))
            for word in words
        ]
        if short != words:
            edits.append(mended.attribute_edit(each.element, each.name, " ".join(short)))
    return mended.apply(*edits)


def _part_of(element: SourceElement) -> tuple[str, str | None]:
    """Return the tag and the name of the link or joint that an element belongs to."""
    while element.parent is not None and element.parent.parent is not None:
        element = element.parent
    return element.tag, element.attributes.get("name")


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
