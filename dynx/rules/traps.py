"""Traps: small robots, one for each rule, that show its cause and nothing else."""

from __future__ import annotations

import inspect
from pathlib import Path

from dynx.errors import RobotNotFoundError
from dynx.model.library import TRAPS, own_roots
from dynx.model.xml.source import XmlSource
from dynx.rules.case import Case
from dynx.rules.registry import find_rule
from dynx.rules.rule import Rule


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
