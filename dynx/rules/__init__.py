"""Why engines differ on a file: a catalogue of causes, each with its detection and its remedy.

One module of `dynx.rules.catalogue` is one rule; its docstring is the page that ``dynx explain`` prints.
"""

from dynx.rules.case import Case
from dynx.rules.registry import all_rules, find_rule
from dynx.rules.rule import Detection, Remedy, Rule

__all__ = ["Case", "Detection", "Remedy", "Rule", "all_rules", "find_rule"]
