"""Line map from the file made readable to the user's file, in which the lines of findings are reported."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from dynx.doctor.lines import line_opcodes, lines_of
from dynx.model.xml.source import XmlSource
from dynx.rules import Detection, Rule


def with_original_lines(
    found: Sequence[tuple[Rule, Detection]], given: XmlSource, readable: XmlSource
) -> list[tuple[Rule, Detection]]:
    """Translate the lines of detections to the `given` text; rules about the text have these already."""
    if given.data == readable.data:
        return list(found)
    lines = line_map(*(lines_of(each.text_with_lines_before) for each in (given, readable)))
    return [
        (rule, replace(each, line=lines.get(each.line, each.line)))
        if rule.stage == "model" and each.line is not None
        else (rule, each)
        for rule, each in found
    ]


def line_map(given: Sequence[str], readable: Sequence[str]) -> dict[int, int]:
    """Map each line of the readable text to its line in the given text; a new line to where it was added."""
    lines = {}
    for _, first, last, start, end in line_opcodes(readable, given):
        for k in range(first, last):
            lines[k + 1] = min(start + k - first, max(end - 1, 0)) + 1
    return lines
