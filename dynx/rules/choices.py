"""What a user decides where a rule leaves several ways to mend: rule to choice, checked."""

from __future__ import annotations

from collections.abc import Iterable

from dynx.errors import ArgumentError, UnknownNameError, nearest, shown
from dynx.rules.registry import find_rule


def checked_choices(given: Iterable[tuple[str, str]]) -> dict[str, str]:
    """The choices by rule id, from pairs of a rule's id or name and one of its `choices`.

    Raises UnknownNameError for a rule or a choice that there is not, ArgumentError for a rule that leaves
    no choice or is decided twice.
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
