"""Heat maps: each error is a number on a colour, which follows the logarithm of the error in steps.

Each colour comes with the colour of the number on it, for light and for dark pages; a test checks
the contrast that WCAG 2.1 requires of text (4.5). No information is in the colour alone.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from dynx.doctor.formats import wording
from dynx.doctor.report import DoctorReport

SHOWN_JOINTS = 60
"""Largest number of joints in a heat map: those with the largest errors are shown, the others counted."""


@dataclass(frozen=True)
class Step:
    """A step of the scale: errors up to `limit`, background and text on a light and on a dark page."""

    limit: float
    label: str
    light: tuple[str, str]
    dark: tuple[str, str]
    css: str

    def is_shown(self, tolerance: float) -> bool:
        """Check whether the legend shows the step; one below the tolerance cannot occur."""
        return self in (SAME, NONE) or self.limit > tolerance


SAME = Step(0.0, "within tolerance", ("#e6f4ea", "#1a4d2b"), ("#14281a", "#b4e0c1"), "heat-same")
STEPS = (
    Step(1e-9, "to 1e-9", ("#fff4d2", "#4d3800"), ("#2f2a17", "#e8d9a8"), "heat-0"),
    Step(1e-6, "to 1e-6", ("#ffe3a8", "#4d3000"), ("#4a3a10", "#ffe7a6"), "heat-1"),
    Step(1e-3, "to 0.1 %", ("#ffc785", "#402000"), ("#6b420c", "#ffeccc"), "heat-2"),
    Step(1e-2, "to 1 %", ("#fba163", "#331400"), ("#87400f", "#fff1e0"), "heat-3"),
    Step(1e-1, "to 10 %", ("#ef7350", "#260800"), ("#a33a1f", "#ffffff"), "heat-4"),
    Step(1.0, "to 100 %", ("#bd2f2f", "#ffffff"), ("#c9403a", "#ffffff"), "heat-5"),
    Step(math.inf, "above", ("#7d1128", "#ffffff"), ("#ff8a80", "#2b0505"), "heat-6"),
)
NONE = Step(math.nan, "no value", ("#3b3f45", "#ffffff"), ("#c7ccd3", "#16191d"), "heat-none")
ALL_STEPS = (SAME, *STEPS, NONE)


@dataclass(frozen=True)
class HeatMap:
    """Errors by row and column; a column head has several lines, and a missing error is an empty cell."""

    corner: str
    heads: tuple[tuple[str, ...], ...] = ()
    rows: tuple[tuple[str, tuple[float | None, ...]], ...] = ()
    note: str = ""

    @classmethod
    def of(
        cls, corner: str, rows: Sequence[str], columns: Mapping[tuple[str, ...], Mapping[str, float]]
    ) -> HeatMap:
        """Make the map from the errors of each column by row."""
        label = wording.quantity if corner == "quantity" else wording.name
        errors = [(label(row), tuple(column.get(row) for column in columns.values())) for row in rows]
        return cls(corner, tuple(columns), tuple(errors))


def step_of(error: float, tolerance: float) -> Step:
    """Find the step of an error."""
    if not math.isfinite(error):
        return NONE
    if error <= tolerance:
        return SAME
    return next(step for step in STEPS if error <= step.limit)


def engine_map(report: DoctorReport) -> HeatMap:
    """Map the errors of each engine by quantity, as loaded and mended."""
    rows = list(dict.fromkeys(key for each in report.engines for key in (*each.before, *each.after)))
    changed = (each.after and dict(each.after) != dict(each.before) for each in report.engines)
    mended = any(changed) or bool(report.undone)
    nothing = dict.fromkeys(rows, math.inf)
    columns: dict[tuple[str, ...], Mapping[str, float]] = {}
    for each in report.engines:
        columns[each.engine, "as loaded"] = each.before if each.no_results is None else nothing
        if mended:
            columns[each.engine, "mended"] = each.after if each.no_results_after is None else nothing
    return HeatMap.of("quantity", rows, columns)


def pair_map(report: DoctorReport) -> HeatMap:
    """Map the errors of each pair of engines by quantity, as loaded."""
    columns: dict[tuple[str, ...], dict[str, float]] = {}
    for pair in report.pairs:
        columns.setdefault(pair.engines, {})[pair.quantity] = pair.relative_error
    return HeatMap.of("quantity", list(dict.fromkeys(pair.quantity for pair in report.pairs)), columns)


def joint_map(report: DoctorReport) -> HeatMap:
    """Map the errors of each pair of engines by joint: the largest over the quantities."""
    columns: dict[tuple[str, ...], dict[str, float]] = {}
    largest: dict[str, float] = {}
    for pair in report.pairs:
        column = columns.setdefault(pair.engines, {})
        for joint, error in pair.joints.items():
            column[joint] = max(column.get(joint, 0.0), math.inf if math.isnan(error) else error)
            largest[joint] = max(largest.get(joint, 0.0), column[joint])
    if not largest:
        return HeatMap("joint")
    differing = [joint for joint, error in largest.items() if error > report.tolerance]
    ranked = sorted(differing, key=lambda joint: -largest[joint])
    shown = [joint for joint in differing if joint in set(ranked[:SHOWN_JOINTS])]
    measured = dict.fromkeys(wording.quantity(pair.quantity) for pair in report.pairs if pair.joints)
    note = f"{', '.join(measured)}, relative to the joint's largest reference value. "
    if len(differing) > len(shown):
        note += f"{len(differing) - len(shown)} further joints differ less. "
    if len(largest) > len(differing):
        same = len(largest) - len(differing)
        note += f"{same} of {len(largest)} joints are within the tolerance everywhere."
    found = HeatMap.of("joint", shown, columns)
    return HeatMap(found.corner, found.heads, found.rows, note[:1].upper() + note[1:])
