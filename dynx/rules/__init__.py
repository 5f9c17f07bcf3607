"""Catalogue of the causes for which engines differ on a file, each with its detection and its remedy.

One class in `dynx.rules.catalogue` is one rule; its docstring is the page that ``dynx explain`` prints.
Other packages offer rules of their own in the entry-point group ``dynx.rules``.
"""

from typing import TYPE_CHECKING

from dynx.registry import moved_names
from dynx.rules.case import Case
from dynx.rules.registry import all_rules, find_rule
from dynx.rules.rule import (
    EVERY_ENGINE,
    LEVELS,
    CallingRule,
    Correction,
    Detection,
    EditingRule,
    Level,
    Remedy,
    Rule,
    correction,
    found_at,
    links_of,
    measured_on,
)

__all__ = [
    "EVERY_ENGINE",
    "LEVELS",
    "CallingRule",
    "Case",
    "Correction",
    "Detection",
    "EditingRule",
    "Level",
    "Remedy",
    "Rule",
    "all_rules",
    "correction",
    "find_rule",
    "found_at",
    "links_of",
    "measured_on",
]

if not TYPE_CHECKING:
    __getattr__ = moved_names(
        __name__, {"OptionalEditingRule": 'dynx.rules.EditingRule with kind = "practice" and a choice "keep"'}
    )
