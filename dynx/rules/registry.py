"""The rules by number; every module of `dynx.rules.catalogue` is one."""

from __future__ import annotations

import pkgutil
from functools import cache
from importlib import import_module

from dynx.errors import UnknownNameError, nearest, shown
from dynx.rules import catalogue
from dynx.rules.rule import Rule


@cache
def all_rules() -> tuple[Rule, ...]:
    """One of each rule, in the order of their numbers, which is the order of application."""
    found = []
    for module in pkgutil.iter_modules(catalogue.__path__):
        members = vars(import_module(f"{catalogue.__name__}.{module.name}")).values()
        found += [each for each in members if _is_rule_of(each, f"{catalogue.__name__}.{module.name}")]
    return tuple(sorted((kind() for kind in found), key=lambda rule: rule.id))


def find_rule(name: str) -> Rule:
    """The rule of that id or name, in any case; UnknownNameError with the nearest otherwise."""
    for rule in all_rules():
        if name.lower() in (rule.id.lower(), rule.name):
            return rule
    known = [word for rule in all_rules() for word in (rule.id, rule.name)]
    raise UnknownNameError(f"no rule {shown(name)}{nearest(name, known)}")


def _is_rule_of(member: object, module: str) -> bool:
    return isinstance(member, type) and issubclass(member, Rule) and member.__module__ == module
