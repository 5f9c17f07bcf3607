"""Removing causes from a file: all of them, some of them, or all but one rule's."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass

from dynx.rules import Case, Detection, Remedy, Rule, all_rules

ROUNDS = 4
"""One remedy may bring up another (an explicit zero inertial makes a massless root); more rounds than
this means that two rules undo each other."""

Place = tuple[str, "str | None", "str | None"]
"""Rule, link and joint: what a detection is about, wherever in the text it stands."""

Wanted = Callable[[Rule, Detection], bool]


@dataclass(frozen=True)
class Mending:
    """A case after remedies, and what was applied, in order."""

    case: Case
    applied: tuple[tuple[Rule, Remedy], ...] = ()

    @property
    def choices(self) -> tuple[str, ...]:
        """What was decided, one sentence each, and which remedies changed the physics of the robot."""
        said = [remedy.choice for _, remedy in self.applied if remedy.choice]
        said += [
            f"{rule.id} changed the physics of the robot: {remedy.changed}"
            for rule, remedy in self.applied
            if remedy.changes_physics
        ]
        return tuple(dict.fromkeys(said))


def place(rule: Rule, detection: Detection) -> Place:
    """What the detection is about."""
    return rule.id, detection.link, detection.joint


def readable(case: Case) -> Mending:
    """The case with the doubtful text mended that dynx refuses; unchanged where dynx can read it.

    Where the remedies do not make it readable, the case comes back as it was.
    """
    mended = Mending(case)
    for rule in _rules("reading"):
        if mended.case.readable:
            break
        mended = _with(mended, rule, rule.detect(mended.case))
    return mended if mended.case.readable else Mending(case)


def detections(case: Case, rules: Sequence[Rule]) -> list[tuple[Rule, Detection]]:
    """Each of the rules at every place where it applies.

    Rules about the text see it as it is; rules about the robot see it made readable.
    """
    sound = readable(case).case
    found = [(rule, each) for rule in rules if rule.stage == "reading" for each in rule.detect(case)]
    if sound.readable:
        found += [(rule, each) for rule in rules if rule.stage == "model" for each in rule.detect(sound)]
    return found


def mend(case: Case, rules: Sequence[Rule] | None = None, wanted: Wanted | None = None) -> Mending:
    """Apply the remedies of rules about differences, and of those about practice for which the user chose
    one, in the order of their numbers and those about the text first, until none is left to apply.

    `rules` are those to choose from (default: the whole catalogue; text that dynx cannot read otherwise
    is mended by any rule), `wanted` says which detections to act on (default: all).
    """
    chosen_rules = all_rules() if rules is None else rules
    ordered = [rule for stage in ("reading", "model") for rule in chosen_rules if rule.stage == stage]
    mended = Mending(case)
    for _ in range(ROUNDS):
        before = mended.case
        for rule in ordered:
            if not _is_asked_for(rule, case) or (rule.stage == "model" and not mended.case.readable):
                continue
            chosen = [each for each in rule.detect(mended.case) if wanted is None or wanted(rule, each)]
            mended = _with(mended, rule, chosen)
        if not mended.case.readable:
            then = readable(mended.case)
            mended = Mending(then.case, mended.applied + then.applied)
        if mended.case is before:
            break
    return mended


def all_but(places: Collection[Place]) -> Wanted:
    """Act on every detection but those about these places."""
    return lambda rule, detection: place(rule, detection) not in places


def treated(case: Case, rule: Rule, chosen: Sequence[Detection]) -> Remedy | None:
    """The case with one rule's cause removed in the chosen places, and nothing else."""
    return rule.remedy(case, chosen) if chosen else None


def _is_asked_for(rule: Rule, case: Case) -> bool:
    return rule.kind == "difference" or rule.id in (case.choices or {})


def _with(mended: Mending, rule: Rule, chosen: Sequence[Detection]) -> Mending:
    remedy = treated(mended.case, rule, chosen)
    if remedy is None:
        return mended
    same = remedy.case.source.data == mended.case.source.data and remedy.case.calls == mended.case.calls
    if same:
        return mended
    return Mending(remedy.case, (*mended.applied, (rule, remedy)))


def _rules(stage: str) -> list[Rule]:
    return [rule for rule in all_rules() if rule.stage == stage]
