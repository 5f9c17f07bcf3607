"""The rules by number: the modules of `dynx.rules.catalogue`, and entry points of other packages.

An installed package offers a rule in the entry-point group ``dynx.rules``; its trap lies beside the module.
"""

from __future__ import annotations

import inspect
import pkgutil
from collections.abc import Iterable
from functools import cache
from importlib import import_module
from pathlib import Path

from dynx.argument_types import checks_types
from dynx.errors import ArgumentError, DynxError, RobotNotFoundError, UnknownNameError, nearest, shown
from dynx.model.library import TRAPS, own_roots
from dynx.model.xml.source import XmlSource
from dynx.registry import ClassRegistry
from dynx.rules import catalogue
from dynx.rules.case import Case
from dynx.rules.rule import Rule

_MAX_SUGGESTIONS = 6
"""Largest number of rules that the error about an unknown one names."""

OTHERS: ClassRegistry[Rule] = ClassRegistry(
    "rule", "dynx.rules", {}, lambda: Rule, error=DynxError, unknown=UnknownNameError
)
"""The rules of other packages."""


@cache
def all_rules() -> tuple[Rule, ...]:
    """List one instance of each rule in the order of application: dynx's own by number, then others by id.

    Raises DynxError for an entry point that cannot be loaded, that is no rule, or whose id or name is taken.
    """
    others = []
    for name in OTHERS.names():
        kind = OTHERS.find(name)
        if not hasattr(kind, "id"):
            raise DynxError(
                f'the rule {shown(name)}: the docstring of its class does not begin with "ID name: Title."'
            )
        others.append(kind())
    rules = (*_own_rules(), *sorted(others, key=lambda rule: rule.id))
    taken: set[str] = set()
    for rule in rules:
        for word in (rule.id.lower(), rule.name):
            if word in taken:
                raise DynxError(f"two rules are called {word}; one is {type(rule).__module__}")
            taken.add(word)
    return rules


@checks_types
def find_rule(name: str) -> Rule:
    """Return the rule of that id or name, in upper or lower case.

    Raises UnknownNameError with the rules that have `name` in id, name or title, or else with the nearest
    names.
    """
    for rule in all_rules():
        if name.lower() in (rule.id.lower(), rule.name):
            return rule
    known = [word for rule in all_rules() for word in (rule.id, rule.name)]
    raise UnknownNameError(f"no rule {shown(name)}{_rules_with(name) or nearest(name, known)}")


def _rules_with(part: str) -> str:
    """Make a clause with the rules that have `part` in id or name, or else in the title; empty without
    any."""
    word = part.strip().lower()
    if not word:
        return ""
    by_name = [rule for rule in all_rules() if word in rule.id.lower() or word in rule.name]
    found = by_name or [rule for rule in all_rules() if word in rule.title.lower()]
    if not found:
        return ""
    listed = ", ".join(f"{rule.id} {rule.name}" for rule in found[:_MAX_SUGGESTIONS])
    more = len(found) - _MAX_SUGGESTIONS
    return f"; rules with it: {listed}{f' and {more} more' if more > 0 else ''}"


@cache
def _own_rules() -> tuple[Rule, ...]:
    names = [module.name for module in pkgutil.iter_modules(catalogue.__path__, f"{catalogue.__name__}.")]
    found = [
        member()
        for name in names
        for member in vars(import_module(name)).values()
        if isinstance(member, type) and issubclass(member, Rule) and member.__module__ == name
    ]
    return tuple(sorted(found, key=lambda rule: rule.id))


# The user's choices where a rule has several remedies.


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


# The user's selection of the rules that count.


def ignored_rules(ignore: Iterable[str] = (), only: Iterable[str] = ()) -> frozenset[str]:
    """Return the ids of the rules that do not count: those of `ignore`, and with `only` all but these.

    Both have ids or names of rules. Raises UnknownNameError for an unknown one, with the nearest.
    """
    counted = {find_rule(word).id for word in only}
    others = {rule.id for rule in all_rules() if rule.id not in counted} if counted else set()
    return frozenset({find_rule(word).id for word in ignore} | others)


# Traps: small robots, one for each rule, that show its cause and nothing else.


def find_trap(rule: Rule | str) -> Path:
    """Return the trap of a rule, or of its id or name: beside dynx's own models, or beside the rule's module.

    Raises UnknownNameError where there is no such rule, RobotNotFoundError where its trap is missing.
    """
    found = find_rule(rule) if isinstance(rule, str) else rule
    beside_module = Path(inspect.getfile(type(found))).parent
    for folder in (*(root / TRAPS for root in own_roots()), beside_module):
        path = folder / found.trap()
        if path.is_file():
            return path
    raise RobotNotFoundError(
        f"{found.id} has no trap: no file {found.trap()} in {TRAPS} of dynx's models or beside its module"
    )


def trap_case(rule: Rule | str) -> Case:
    """Return the trap of a rule as the rule sees it, on the base on which it shows the cause."""
    found = find_rule(rule) if isinstance(rule, str) else rule
    path = find_trap(found)
    return Case(XmlSource(path.read_bytes(), str(path)), base=found.trap_base)
