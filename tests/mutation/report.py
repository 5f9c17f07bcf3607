"""Score of a mutation run, and what is known of mutants that no test can catch."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

from tests.mutation.population import room_of
from tests.mutation.trial import BROKEN, CAUGHT, Outcome

EQUIVALENT = Path(__file__).with_name("equivalent.json")
"""Mutants that change nothing that dynx promises: path, function, before, after, reason."""

Known = list[dict[str, str]]


def reason(outcome: Outcome, equivalent: Known) -> str | None:
    """Return why no test can catch the mutant, or None."""
    for each in equivalent:
        if (each["path"], each["function"], each["before"], each["after"]) == (
            outcome.path,
            outcome.function,
            outcome.before,
            outcome.after,
        ):
            return each["reason"]
    return None


def percentage(part: int, whole: int) -> str:
    return f"{part} of {whole} ({100 * part / whole:.1f} %)" if whole else "0 of 0"


def summary(outcomes: list[Outcome], places: int, equivalent: Known) -> str:
    """Return the score by room and the survivors."""
    lines = [f"\n{len(outcomes)} mutants of {places} places"]
    for title, groups in (
        ("room", Counter(room_of(each.path) for each in outcomes)),
        ("operator", Counter(each.operator for each in outcomes)),
    ):
        lines.append(f"\n{title:30} mutants  equivalent  caught  at first")
        for name, count in groups.most_common():
            group = [each for each in outcomes if name in (room_of(each.path), each.operator)]
            none = sum(each.status != CAUGHT and reason(each, equivalent) is not None for each in group)
            caught = sum(each.status == CAUGHT for each in group)
            first = sum(each.first_status == CAUGHT for each in group)
            lines.append(f"{name:30} {count:7}  {none:10}  {caught:6}  {first:8}")
    survivors = [each for each in outcomes if each.status != CAUGHT]
    lines.append("\nsurvivors")
    for each in sorted(survivors, key=lambda each: (each.path, each.line)):
        why = reason(each, equivalent)
        lines.append(f"{each.path}:{each.line} {each.function} ({each.status}, {each.tests} tests)")
        lines += [f"    - {each.before}", f"    + {each.after}"]
        lines += [f"    equivalent: {why}"] if why else []
        lines += [f"    {each.caught_by}"] if each.status == BROKEN else []
    none = sum(reason(each, equivalent) is not None for each in survivors)
    caught = len(outcomes) - len(survivors)
    first = sum(each.first_status == CAUGHT for each in outcomes)
    lines.append(f"\ncaught: {percentage(caught, len(outcomes) - none)} of those not equivalent")
    lines.append(f"caught at first: {percentage(first, len(outcomes))}")
    return "\n".join(lines)
