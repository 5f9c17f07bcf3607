"""Mending of a file: the removal of all causes, of some, or of all but those of one rule."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from dynx.agreement.tolerances import BAR
from dynx.doctor.examination import (
    ReferenceValues,
    draw_states,
    line_map,
    model_without_mimics,
    reference_values,
)
from dynx.errors import DescriptionError, DynxError
from dynx.model import Model
from dynx.model.elements import Inertial
from dynx.model.xml.source import SourceElement, XmlSource
from dynx.rules import LEVELS, Case, Detection, Level, Remedy, Rule, all_rules
from dynx.spatial.scalar import Floats

# Level of a remedy: how much of a robot it changes, measured by reading the file before and after it.
#
# ``safe``: dynx reads the same numbers, bit for bit, and so does every engine that read the file right.
# ``rounding``: links, joints and limits stay, and the equations of motion change by rounding only:
# principal axes, moments raised by their last digits, inertia moved between rigidly connected links.
# ``physics``: everything else that a reader of the file may notice: other numbers or names, and text that
# can be read in more than one way.


Part = tuple[str, str]
"""Tag and name of an element of the robot; the robot itself has its own tag."""

_STATES, _SEED = 2, 0
"""Number of states at which equations of motion are compared, and their seed."""


def level_of(rule: Rule, before: Case, remedy: Remedy) -> Level:
    """Return the level of the remedy of a rule for the case `before`."""
    after = remedy.case
    if before.source.data == after.source.data:
        return "safe"
    if remedy.changes_physics:
        return "physics"
    if not (before.readable and after.readable):
        return "safe" if rule.unambiguous else "physics"
    if _parts_of(before.model) != _parts_of(after.model) or _rest(before.source) != _rest(after.source):
        return "physics"
    if _numbers(before.model) == _numbers(after.model):
        return "safe"
    return "rounding" if _moves_alike(before, after) else "physics"


def changed_parts(before: XmlSource, after: XmlSource) -> tuple[Part, ...]:
    """Name the elements of the robot whose text differs, in document order; those that are new come last."""
    old, new = _texts(before), _texts(after)
    return tuple(
        dict.fromkeys(
            part for part, number in (*old, *new) if old.get((part, number)) != new.get((part, number))
        )
    )


def _texts(source: XmlSource) -> dict[tuple[Part, int], bytes]:
    """Return the text of each element of the robot, numbered where names repeat, and of the start tag."""
    root = source.root
    texts = {((root.tag, ""), 0): source.data[root.start_tag.start : root.start_tag.end]}
    numbers: Counter[Part] = Counter([(root.tag, "")])
    for element in root.children:
        part = (element.tag, element.attributes.get("name", ""))
        texts[part, numbers[part]] = source.data[element.span.start : element.span.end]
        numbers[part] += 1
    return texts


def _parts_of(model: Model) -> Any:
    """Return what a reader tells apart by name or kind."""
    return (
        model.name,
        {link.name for link in model.links},
        {
            joint.name: (joint.type, joint.parent, joint.child, joint.limits, joint.dynamics, joint.mimic)
            for joint in model.joints
        },
    )


def _numbers(model: Model) -> Any:
    """Return the numbers of links and joints; a link without mass and moments has no centre of mass."""
    none = Inertial()
    return (
        {link.name: _without_place(link.inertial or none) for link in model.links},
        {joint.name: replace(joint, line=None) for joint in model.joints},
    )


def _without_place(inertial: Inertial) -> Inertial:
    return inertial if inertial.mass or inertial.tensor.any() else Inertial()


def _rest(source: XmlSource) -> list[Any]:
    """Return what dynx does not read and other readers do: shapes, and elements beside links and joints."""
    rest: list[Any] = [source.root.attributes.get("name")]
    for element in source.root.children:
        if element.tag in ("link", "joint"):
            rest += [_words(shape) for tag in ("visual", "collision") for shape in element.all(tag)]
        else:
            rest.append(_words(element))
    return rest


def _words(element: SourceElement) -> tuple[Any, ...]:
    words = {name: value.split() for name, value in element.attributes.items()}
    return element.tag, words, [_words(child) for child in element.children]


def _moves_alike(before: Case, after: Case, tolerance: float = BAR) -> bool:
    """Check whether the equations of motion are those of before to `tolerance`, also if the base floats."""
    try:
        one, other = _values(before.source), _values(after.source)
    except DynxError:
        return False
    if before.form != "urdf":
        # A remedy may put a body into another one, which the file does not have.
        names = [[link.name for link in values.model.links] for values in (one, other)]
        common = [name for name in names[0] if name in names[1]]
        one, other = (
            replace(values, poses=values.poses[:, [each.index(name) for name in common]])
            for values, each in zip((one, other), names, strict=True)
        )
    pairs = zip(_compared(one), _compared(other), strict=True)
    return all(_near(first, second, tolerance) for first, second in pairs)


def _values(source: XmlSource) -> ReferenceValues:
    model = model_without_mimics(source, "floating")
    return reference_values(model, draw_states(model, _STATES, _SEED))


def _compared(values: ReferenceValues) -> Iterator[Floats]:
    yield from (values.poses, values.mass_matrix, values.torque)


def _near(one: Floats, other: Floats, tolerance: float) -> bool:
    size = float(np.max(np.abs(one), initial=0.0))
    return one.shape == other.shape and bool(np.all(np.abs(one - other) <= tolerance * size))


_SAME = 1e-9
"""Largest relative difference of total masses, mass matrices and torques of one robot."""

_ADDED_MASS = 1e-13
"""Largest mass [kg] that remedies add to a robot whose links may have none."""


def reading_change(case: Case, mended: Mending) -> str | None:
    """Describe how the robot of a mended file differs from that of the file; None where it is the same.

    Numbers of coordinates and total masses are compared, and the equations of motion where no remedy states
    that it changes them. A file that dynx cannot read without its remedies is compared with its text made
    readable.
    """
    before, after = readable(case).case, mended.case
    if not (before.readable and after.readable) or before.source.data == after.source.data:
        return None
    one, other = before.model, after.model
    free = [model_without_mimics(each.source, each.base).nv for each in (before, after)]
    if one.nv != other.nv and free[0] != free[1]:
        return f"its robot would have {other.nv} coordinates instead of {one.nv}"
    masses = [sum(link.inertial.mass for link in each.links if link.inertial) for each in (one, other)]
    if abs(masses[1] - masses[0]) > _SAME * abs(masses[0]) + _ADDED_MASS:
        return f"its robot would weigh {masses[1]:g} kg instead of {masses[0]:g} kg"
    stated = any(remedy.changes_physics for _, remedy in mended.applied)
    if free[0] == free[1] and not stated and not _moves_alike(before, after, _SAME):
        return "the equations of motion of its robot would be others"
    return None


MAX_ROUNDS = 4
"""Largest number of repetitions of all remedies. One remedy may require another one (an explicit zero
inertial makes a massless root); more repetitions would mean that two rules undo each other."""

Place = tuple[str, "str | None", "str | None"]
"""Rule, link and joint of a detection, wherever in the text it is."""

DetectionFilter = Callable[[Rule, Detection], bool]


@dataclass(frozen=True)
class Mending:
    """A case after remedies, and the remedies that were applied, in order."""

    case: Case
    applied: tuple[tuple[Rule, Remedy], ...] = ()

    @property
    def choices(self) -> tuple[str, ...]:
        """Sentences on the decisions taken and on the remedies that changed the physics of the robot."""
        sentences = [remedy.choice for _, remedy in self.applied if remedy.choice]
        sentences += [
            f"{rule.id} changed the physics of the robot: {remedy.changed}"
            for rule, remedy in self.applied
            if remedy.changes_physics
        ]
        return tuple(dict.fromkeys(sentences))


def differs(case: Case, other: Case) -> bool:
    """Check whether two cases have different text, or the same text in different encodings."""
    return case.source.data != other.source.data or case.source.form != other.source.form


def place_of(rule: Rule, detection: Detection) -> Place:
    """Return the place of a detection."""
    return rule.id, detection.link, detection.joint


def readable(case: Case, level: Level = "physics") -> Mending:
    """Mend text that dynx refuses; return the case unchanged if dynx can read it, or if no remedy helps."""
    mended = _after_reading_rules(case, level)
    return mended if mended.case.readable else Mending(case)


def refusal(case: Case) -> DynxError | None:
    """Return the error that remains after all remedies of rules about text, with its line in the text as it
    is; None where dynx can then read the case."""
    mended = _after_reading_rules(case, "physics").case
    error = mended.reading
    if isinstance(error, DescriptionError) and error.line is not None:
        texts = map(_lines, (case, mended))
        line = line_map(*texts).get(error.line, error.line)
        return type(error)(error.message, source=error.source, line=line)
    return error if isinstance(error, DynxError) else None


def left_undone(case: Case) -> list[tuple[Rule, Detection]]:
    """List the causes for which dynx refuses the text and that have no remedy, with their lines in the text
    as it is."""
    mended = _after_reading_rules(case, "physics").case
    if mended.readable:
        return []
    lines = line_map(*map(_lines, (case, mended)))
    return [
        (rule, each if each.line is None else replace(each, line=lines.get(each.line, each.line)))
        for rule in _rules("reading")
        if rule.kind == "difference"
        for each in rule.detect(mended)
        if remedy_of(mended, rule, [each]) is None
    ]


def refusing_rules(case: Case) -> list[Rule]:
    """List the rules whose causes make dynx refuse the text: with all others mended it still does."""
    return [
        rule
        for rule in dict.fromkeys(rule for rule, _ in readable(case).applied)
        if not _after_reading_rules(case, "physics", without=rule).case.readable
    ]


def _after_reading_rules(case: Case, level: Level, without: Rule | None = None) -> Mending:
    mended = Mending(case)
    for rule in _rules("reading"):
        if mended.case.readable:
            break
        if rule is without:
            continue
        mended = _after_remedy(mended, rule, rule.detect(mended.case), level)
    return mended


@dataclass(frozen=True)
class TextCause:
    """A cause in the text that shows only in `case`, after the remedies of other rules about the text.

    `line` is that of the detection in the text as it is.
    """

    rule: Rule
    detection: Detection
    case: Case
    line: int | None


def appearances(case: Case, rules: Sequence[Rule]) -> list[TextCause]:
    """Find the causes that hide behind others in text that dynx refuses."""
    known = {place_of(rule, each) for rule in rules if rule.stage == "reading" for each in rule.detect(case)}
    found: list[TextCause] = []
    here = case
    for rule, remedy in readable(case).applied:
        lines: dict[int, int] | None = None
        for each in rule.detect(here) if rule in rules else ():
            if place_of(rule, each) in known:
                continue
            known.add(place_of(rule, each))
            lines = lines or line_map(*(_lines(one) for one in (case, here)))
            line = None if each.line is None else lines.get(each.line, each.line)
            found.append(TextCause(rule, each, here, line))
        here = remedy.case
    return found


def _lines(case: Case) -> list[str]:
    return case.source.text_with_lines_before.splitlines()


def detections(case: Case, rules: Sequence[Rule]) -> list[tuple[Rule, Detection]]:
    """Detect each of the rules at every place.

    Rules about the text examine it as it is, rules about the robot the text made readable.
    """
    sound = readable(case).case
    found = [(rule, each) for rule in rules if rule.stage == "reading" for each in rule.detect(case)]
    found += [(each.rule, replace(each.detection, line=each.line)) for each in appearances(case, rules)]
    if sound.readable:
        found += [(rule, each) for rule in rules if rule.stage == "model" for each in rule.detect(sound)]
    return found


def mend(
    case: Case,
    rules: Sequence[Rule] | None = None,
    wanted: DetectionFilter | None = None,
    level: Level = "physics",
) -> Mending:
    """Apply the remedies of rules about differences, and of those about practice for which the user chose
    one: those about the text first, in the order of their numbers, until none is left to apply.

    `rules` are those to choose from (default: the whole catalogue; text that dynx cannot read otherwise
    is mended by any rule), `wanted` selects the detections to act on (default: all). Remedies above `level`
    (`dynx.doctor.mending`) are left undone.
    """
    chosen_rules = all_rules() if rules is None else rules
    ordered = [rule for stage in ("reading", "model") for rule in chosen_rules if rule.stage == stage]
    mended = Mending(case)
    for _ in range(MAX_ROUNDS):
        before = mended.case
        for rule in ordered:
            if not _applies(rule, case) or (rule.stage == "model" and not mended.case.readable):
                continue
            chosen = [each for each in rule.detect(mended.case) if wanted is None or wanted(rule, each)]
            mended = _after_remedy(mended, rule, chosen, level)
        if not mended.case.readable:
            then = readable(mended.case, level)
            mended = Mending(then.case, mended.applied + then.applied)
        if mended.case is before:
            break
    return mended


def all_except(places: Collection[Place]) -> DetectionFilter:
    """Select every detection except those at these places."""
    return lambda rule, detection: place_of(rule, detection) not in places


def remedy_of(case: Case, rule: Rule, chosen: Sequence[Detection]) -> Remedy | None:
    """Remove the cause of one rule at the chosen places; None without places or remedy."""
    return rule.remedy(case, chosen) if chosen else None


def _applies(rule: Rule, case: Case) -> bool:
    return rule.kind == "difference" or rule.id in (case.choices or {})


def _after_remedy(mended: Mending, rule: Rule, chosen: Sequence[Detection], level: Level) -> Mending:
    remedy = remedy_of(mended.case, rule, chosen)
    if remedy is None:
        return mended
    if not differs(remedy.case, mended.case) and remedy.case.calls == mended.case.calls:
        return mended
    if rule.stage == "model" and not remedy.case.readable:
        # A cause that was left in the text forbids this remedy: mending the text anew makes another robot.
        return mended
    if level == "physics" or _within(level, rule, mended.case, remedy):
        return Mending(remedy.case, (*mended.applied, (rule, remedy)))
    if len({place_of(rule, each) for each in chosen}) == 1:
        return mended
    for place in dict.fromkeys(place_of(rule, each) for each in chosen):
        # An edit can have moved the lines of places that follow.
        here = [each for each in rule.detect(mended.case) if place_of(rule, each) == place]
        mended = _after_remedy(mended, rule, here, level)
    return mended


def _within(level: Level, rule: Rule, case: Case, remedy: Remedy) -> bool:
    return LEVELS.index(level_of(rule, case, remedy)) <= LEVELS.index(level)


def _rules(stage: str) -> list[Rule]:
    return [rule for rule in all_rules() if rule.stage == stage]
