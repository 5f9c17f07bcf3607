"""The rules by number: the modules of `dynx.rules.catalogue`, and entry points of other packages.

An installed package offers a rule in the entry-point group ``dynx.rules``; its trap lies beside the module.
"""

from __future__ import annotations

import pkgutil
from collections.abc import Iterator
from functools import cache
from importlib import import_module
from importlib.metadata import EntryPoint, entry_points

from dynx.errors import DynxError, UnknownNameError, nearest, shown
from dynx.rules import catalogue
from dynx.rules.rule import Rule

GROUP = "dynx.rules"
"""The entry-point group: ``name = "package.module:RuleClass"``."""


@cache
def all_rules() -> tuple[Rule, ...]:
    """One instance of each rule in the order of application: dynx's own by number, then all others by id.

    Raises DynxError for an entry point that cannot be loaded, that is no rule, or whose id or name is taken.
    """
    rules = list(_own_rules())
    taken = {word for rule in rules for word in (rule.id.lower(), rule.name)}
    for rule, provider in sorted(_provided_rules(), key=lambda pair: pair[0].id):
        for word in (rule.id.lower(), rule.name):
            if word in taken:
                raise DynxError(f"{provider} provides the rule {rule.id} {rule.name}; {word} is taken")
            taken.add(word)
        rules.append(rule)
    return tuple(rules)


def find_rule(name: str) -> Rule:
    """The rule of that id or name, in any case; raises UnknownNameError with the nearest name."""
    for rule in all_rules():
        if name.lower() in (rule.id.lower(), rule.name):
            return rule
    known = [word for rule in all_rules() for word in (rule.id, rule.name)]
    raise UnknownNameError(f"no rule {shown(name)}{nearest(name, known)}")


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


def _provided_rules() -> Iterator[tuple[Rule, str]]:
    """Rules of other packages, each with the words that name its provider."""
    for point in entry_points(group=GROUP):
        provider = _described(point)
        try:
            kind = point.load()
            rule = kind() if isinstance(kind, type) and issubclass(kind, Rule) else None
        except Exception as error:
            raise DynxError(f"{provider} cannot be loaded: {type(error).__name__}: {error}") from error
        if rule is None:
            raise DynxError(f"{provider} is {shown(kind)}, which is no subclass of dynx.rules.Rule")
        if not hasattr(rule, "id"):
            raise DynxError(f'{provider}: the docstring of its module does not begin with "ID name: Title."')
        yield rule, provider


def _described(point: EntryPoint) -> str:
    distribution = "" if point.dist is None else f" of {point.dist.name}"
    return f"the entry point {point.name} = {point.value!r}{distribution}"
