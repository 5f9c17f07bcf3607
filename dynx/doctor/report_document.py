"""The JSON document of several reports (schema 1, docs/schemas/doctor.json)."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any, get_args

from dynx._version import __version__
from dynx.doctor.report import DoctorEntry, DoctorReport, Status
from dynx.files.documents import to_json_values

SCHEMA = 1


@dataclass(frozen=True)
class DoctorSummary:
    """Number of robots examined, and of those with each verdict."""

    robots: int
    alike: int
    explained: int
    massless: int
    """Robots without inertial data whose kinematics is alike, or differs with every cause proved."""
    unexplained: int
    refused: int
    not_done: int


@dataclass(frozen=True)
class DoctorDocument:
    """The JSON document of ``dynx doctor`` and ``dynx agree --as-loaded``."""

    schema: int
    dynx: str
    results: tuple[DoctorEntry, ...]
    summary: DoctorSummary
    not_done: tuple[str, ...]
    """The robots that an interrupted run left out."""
    left_out: tuple[str, ...]
    """The robots in xacro below a directory, which are not examined."""


def results_document(
    reports: Iterable[DoctorReport], not_done: Sequence[str] = (), left_out: Sequence[str] = ()
) -> dict[str, Any]:
    """Make the JSON document of reports; `not_done` names the robots that an interrupted run left out,
    `left_out` those in xacro below a directory."""
    reports = list(reports)
    statuses = Counter(report.status for report in reports)
    counts = {word: statuses[word] for word in get_args(Status)}
    summary = DoctorSummary(robots=len(reports), **counts, not_done=len(not_done))
    return {
        "schema": SCHEMA,
        "dynx": __version__,
        "results": [report.to_dict() for report in reports],
        "summary": to_json_values(summary),
        "not_done": list(not_done),
        "left_out": list(left_out),
    }
