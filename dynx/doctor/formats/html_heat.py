"""Heat maps: an error is a number on a colour, by steps of its logarithm.

Each colour comes with the colour of the number on it, for light and for dark pages; a test holds every
pair to the contrast that WCAG 2.1 asks of text (4.5). Nothing is said by colour alone.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from dynx.doctor.formats import wording
from dynx.doctor.formats.html_elements import cell, escape, name, table
from dynx.doctor.report import DoctorReport

_SHOWN_JOINTS = 60
"""Joints in a heat map, the worst ones; the rest is counted."""


@dataclass(frozen=True)
class Step:
    """A step of the scale: errors up to `limit`, background and text on a light and on a dark page."""

    limit: float
    label: str
    light: tuple[str, str]
    dark: tuple[str, str]


STEPS = (
    Step(1e-9, "to 1e-9", ("#fff4d2", "#4d3800"), ("#2f2a17", "#e8d9a8")),
    Step(1e-6, "to 1e-6", ("#ffe3a8", "#4d3000"), ("#4a3a10", "#ffe7a6")),
    Step(1e-3, "to 0.1 %", ("#ffc785", "#402000"), ("#6b420c", "#ffeccc")),
    Step(1e-2, "to 1 %", ("#fba163", "#331400"), ("#87400f", "#fff1e0")),
    Step(1e-1, "to 10 %", ("#ef7350", "#260800"), ("#a33a1f", "#ffffff")),
    Step(1.0, "to 100 %", ("#bd2f2f", "#ffffff"), ("#c9403a", "#ffffff")),
    Step(math.inf, "above", ("#7d1128", "#ffffff"), ("#ff8a80", "#2b0505")),
)
NONE = Step(math.nan, "no answer", ("#3b3f45", "#ffffff"), ("#c7ccd3", "#16191d"))
SAME = Step(0.0, "within tolerance", ("#e6f4ea", "#1a4d2b"), ("#14281a", "#b4e0c1"))


def step_of(error: float, tolerance: float) -> Step:
    """The step that an error falls into."""
    if not math.isfinite(error):
        return NONE
    if error <= tolerance:
        return SAME
    return next(step for step in STEPS if error <= step.limit)


def heat_style() -> str:
    """The style sheet of the steps."""
    light = "\n".join(_rule(step, step.light) for step in (SAME, *STEPS, NONE))
    dark = "\n".join(_rule(step, step.dark) for step in (SAME, *STEPS, NONE))
    return f"{light}\n@media screen and (prefers-color-scheme: dark) {{\n{dark}\n}}"


def legend(tolerance: float) -> str:
    """The scale as a line of samples."""
    shown = [(SAME, f"{SAME.label} ({tolerance:g})")]
    shown += [(step, step.label) for step in STEPS if step.limit > tolerance]
    samples = "".join(
        f'<span class="{_css(step)}">{escape(label)}</span>' for step, label in [*shown, (NONE, NONE.label)]
    )
    return f'<div class="legend"><span class="title">relative error</span>{samples}</div>'


def heat_cell(error: float | None, tolerance: float, title: str = "") -> str:
    """One cell: the number on its colour; empty where nothing was compared."""
    if error is None:
        return cell("", title=title)
    return cell(escape(wording.relative(error)), f"number {_css(step_of(error, tolerance))}", title)


def engine_map(report: DoctorReport) -> str:
    """Each engine against what the file says, quantity by quantity, as loaded and mended."""
    asked = report.engines
    rows = list(dict.fromkeys(key for each in asked for key in (*each.before, *each.after)))
    mended = any(each.after and dict(each.after) != dict(each.before) for each in asked)
    heads: list[str] = []
    columns: list[Mapping[str, float]] = []
    for each in asked:
        heads.append(f"{name(each.engine)}<br>as loaded")
        columns.append(each.before if each.refused is None else dict.fromkeys(rows, math.inf))
        if mended:
            heads.append(f"{name(each.engine)}<br>mended")
            columns.append(each.after if each.refused_after is None else dict.fromkeys(rows, math.inf))
    return _map("quantity", rows, heads, columns, report.tolerance) if rows else ""


def pair_map(report: DoctorReport) -> str:
    """Each engine against each other, quantity by quantity, as loaded."""
    columns = _by_pair(report)
    rows = list(dict.fromkeys(pair.quantity for pair in report.pairs))
    return _map("quantity", rows, list(columns), list(columns.values()), report.tolerance) if rows else ""


def joint_map(report: DoctorReport) -> str:
    """Each engine against each other, joint by joint: the largest error over the quantities."""
    columns: dict[str, dict[str, float]] = {}
    for pair in report.pairs:
        column = columns.setdefault(_pair_head(pair.engines), {})
        for joint, error in pair.joints.items():
            column[joint] = max(column.get(joint, 0.0), math.inf if math.isnan(error) else error)
    joints = list(dict.fromkeys(joint for column in columns.values() for joint in column))
    if not joints:
        return ""
    largest = {joint: max(column.get(joint, 0.0) for column in columns.values()) for joint in joints}
    far = [joint for joint in joints if largest[joint] > report.tolerance]
    if len(far) > _SHOWN_JOINTS:
        kept = set(sorted(far, key=lambda joint: -largest[joint])[:_SHOWN_JOINTS])
        far = [joint for joint in far if joint in kept]
    rest = len(joints) - len(far)
    more = [joint for joint in joints if joint not in set(far) and largest[joint] > report.tolerance]
    said = f"{len(more)} further joints differ less. " if more else ""
    if rest - len(more):
        said += f"{rest - len(more)} of {len(joints)} joints are within the tolerance everywhere."
    measured = dict.fromkeys(wording.quantity(pair.quantity) for pair in report.pairs if pair.joints)
    said = f"{', '.join(measured)}, relative to the joint's largest right answer. {said}"
    note = f'<p class="faint">{escape(said[:1].upper() + said[1:])}</p>'
    if not far:
        return note
    return _map("joint", far, list(columns), list(columns.values()), report.tolerance) + note


def _by_pair(report: DoctorReport) -> dict[str, dict[str, float]]:
    columns: dict[str, dict[str, float]] = {}
    for pair in report.pairs:
        columns.setdefault(_pair_head(pair.engines), {})[pair.quantity] = pair.relative_error
    return columns


def _pair_head(engines: Sequence[str]) -> str:
    return "<br>".join(map(name, engines))


def _map(
    corner: str,
    rows: Sequence[str],
    heads: Sequence[str],
    columns: Sequence[Mapping[str, float]],
    tolerance: float,
) -> str:
    shown = [
        (
            escape(wording.quantity(row)) if corner == "quantity" else name(row),
            [heat_cell(column.get(row), tolerance) for column in columns],
        )
        for row in rows
    ]
    return table([corner, *(f">{head}" for head in heads)], shown, "heat")


def _css(step: Step) -> str:
    if step is NONE:
        return "heat-none"
    return "heat-same" if step is SAME else f"heat-{STEPS.index(step)}"


def _rule(step: Step, colours: tuple[str, str]) -> str:
    # More specific than a plain cell, whose colour is that of the page.
    return f".{_css(step)} {{ background: {colours[0]}; color: {colours[1]}; }}"
