"""Differences of two descriptions as SARIF 2.1.0: a result is at a line of the second, related to one of the
first."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from typing import Any

from dynx.errors import escaped
from dynx.files.sarif import KNOWN, physical_location, sarif_result, sarif_rule, sarif_run, suppression
from dynx.model.xml.several_files import file_of_line
from dynx.same.formats.baseline import SameBaseline, place_of
from dynx.same.formats.findings import RULES, findings
from dynx.same.report import SameReport

MESSAGE_LENGTH = 1000
"""Largest number of characters of a message."""


def sarif_document(report: SameReport, baseline: SameBaseline | None = None) -> dict[str, Any]:
    """Make the document. Differences in the baseline are marked as suppressed."""
    results = list(_results(report, baseline))
    met = {result["ruleId"] for result in results}
    return sarif_run(
        [sarif_rule(rule, rule, text) for rule, text in RULES.items() if rule in met],
        results,
        [escaped(note, MESSAGE_LENGTH) for note in report.notes],
        category=f"dynx-same/{escaped(report.first)}/{escaped(report.second)}",
    )


def _results(report: SameReport, baseline: SameBaseline | None) -> Iterator[dict[str, Any]]:
    new = None if baseline is None else {each.place for each in baseline.compare(report).new}
    folder = "" if baseline is None else baseline.folder
    before: Counter[tuple[str, str | None, str | None]] = Counter()
    for each in findings(report):
        key = (each.rule, each.ours, each.theirs)
        repetition, before[key] = before[key], before[key] + 1
        message = escaped(each.message, MESSAGE_LENGTH)
        identity = (each.ours, each.theirs, report.first, str(repetition))
        result = sarif_result(
            file_of_line(each.second_line) or report.second_source,
            each.rule,
            each.level,
            message,
            each.second_line,
            *identity,
        )
        result["relatedLocations"] = [
            {
                "physicalLocation": physical_location(
                    file_of_line(each.first_line) or report.first_source, each.first_line
                ),
                "message": {"text": f"the element of {escaped(report.first)}"},
            }
        ]
        if new is not None:
            known = each.level == "error" and place_of(report, each, folder) not in new
            result["suppressions"] = suppression(KNOWN if known else None)
        yield result
