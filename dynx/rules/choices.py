"""The user's choices where a rule has several remedies."""

from __future__ import annotations

from collections.abc import Iterable

from dynx.errors import ArgumentError, UnknownNameError, nearest, shown
from dynx.rules.registry import find_rule


def checked_choices(given: Iterable[tuple[str, str]]) -> dict[str, str]:
    """Return the choices by rule id, from pairs of a rule's id or name and one of its `choices`.

    Raises UnknownNameError for an unknown rule or choice, ArgumentError for a rule that has no choices or is
    given twice with different ones.
    """
    chosen: dict[str, str] = {}
    for word, choice in given:
        rule = find_rule(word)
        if not rule.choices:
            raise ArgumentError(f"{rule.id} {rule.name} leaves no choice")
        if choice not in rule.choices:
            raise UnknownNameError(
                f"{rule.id} {rule.name} has no choice {shown(choice)}{nearest(choice, rule.choices)}"
            )
        if chosen.setdefault(rule.id, choice) != choice:
            raise ArgumentError(f"{rule.id} {rule.name} is decided twice")
    return chosen
