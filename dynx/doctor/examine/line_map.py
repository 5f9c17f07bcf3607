"""Lines of the user's file for what was found in the file made readable, whose lines are others."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from difflib import SequenceMatcher

from dynx.model.xml.source import XmlSource
from dynx.rules import Detection, Rule


def at_given_lines(
    found: Sequence[tuple[Rule, Detection]], given: XmlSource, readable: XmlSource
) -> list[tuple[Rule, Detection]]:
    """The detections with the lines of the `given` text; rules about the text have these already."""
    if given.data == readable.data:
        return list(found)
    lines = _lines(given.text.splitlines(), readable.text.splitlines())
    return [
        (rule, replace(each, line=lines.get(each.line, each.line)))
        if rule.stage == "model" and each.line is not None
        else (rule, each)
        for rule, each in found
    ]


def _lines(given: Sequence[str], readable: Sequence[str]) -> dict[int, int]:
    """Line of the readable text -> line of the given text; for a line that is new, that where it came in."""
    lines = {}
    for _, first, last, start, end in SequenceMatcher(None, readable, given, autojunk=False).get_opcodes():
        for k in range(first, last):
            lines[k + 1] = min(start + k - first, max(end - 1, 0)) + 1
    return lines
