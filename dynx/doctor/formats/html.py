"""HTML page for people: one self-contained file without scripts, for screen and paper.

The templates beside this module hold the markup of the report, those of `dynx.files.pages` the frame.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np

from dynx._version import __version__
from dynx.doctor.formats import wording
from dynx.doctor.formats.baseline import Baseline
from dynx.doctor.formats.causes import ROUNDING, causes, largest_error
from dynx.doctor.report import DoctorReport
from dynx.files.excerpts import TextChanges, excerpt_of, text_changes
from dynx.files.pages import page_environment, page_text
from dynx.loaded.difference import Deviation
from dynx.model.expansion import left_out_note

if TYPE_CHECKING:
    from dynx.files.pages import Environment


# Heat maps: each error is a number on a colour, which follows the logarithm of the error in steps.
#
# Each colour comes with the colour of the number on it, for light and for dark pages; a test checks
# the contrast that WCAG 2.1 requires of text (4.5). No information is in the colour alone.


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


# Tables of the values of engines that differ from the file, link by link, number by number.


SHOWN_ROWS = 200
"""Largest number of rows of a table; the JSON document has all."""

_COMPONENTS = {
    "center": ("center x", "center y", "center z"),
    "position": ("x", "y", "z"),
    "rotation": ("roll", "pitch", "yaw"),
    "axis": ("axis x", "axis y", "axis z"),
    "default": ("x", "y", "z"),
    "inertia": ("ixx", "ixy", "ixz", "iyy", "iyz", "izz"),
}
"""Names of the numbers of a property."""


@dataclass(frozen=True)
class ModelTableRow:
    """One number of the file and, by engine, the values that differ from it, as text."""

    title: str
    file: str
    engine_values: Mapping[str, str]


@dataclass(frozen=True)
class ModelTable:
    """Rows by their owner, such as ``link tool0``; `count` is the number of deviations in the table."""

    engines: tuple[str, ...]
    owners: tuple[tuple[str, tuple[ModelTableRow, ...]], ...]
    left_out: int
    count: int


def model_tables(report: DoctorReport) -> tuple[ModelTable, ModelTable]:
    """Tabulate the deviations of the engines from the file: those above rounding, and the others."""
    engines = [each.engine for each in report.engines if each.no_results is None]
    engines += sorted({each.engine for each in report.model_difference} - set(engines))
    large = [each for each in report.model_difference if _is_large(each)]
    small = [each for each in report.model_difference if not _is_large(each)]
    return _table(large, engines), _table(small, engines)


def _table(deviations: Sequence[Deviation], engines: Iterable[str]) -> ModelTable:
    """Make a row for each number that differs in some engine, by owner."""
    gathered: dict[tuple[str, str], dict[str, tuple[Any, dict[str, Any]]]] = {}
    for each in deviations:
        rows = gathered.setdefault((each.part, each.name), {})
        for title, file, value in _components(each):
            rows.setdefault(title, (file, {}))[1][each.engine] = value
    count = sum(map(len, gathered.values()))
    left = iter(range(SHOWN_ROWS))
    owners = []
    for (part, owner), rows in gathered.items():
        shown = [_row(title, *values) for (title, values), _ in zip(rows.items(), left, strict=False)]
        if shown:
            owners.append((part if part == owner else f"{part} {wording.name(owner)}", tuple(shown)))
    return ModelTable(tuple(engines), tuple(owners), max(count - SHOWN_ROWS, 0), len(deviations))


def _row(title: str, file: Any, engine_values: Mapping[str, Any]) -> ModelTableRow:
    texts = wording.values([file, *engine_values.values()])
    return ModelTableRow(title, texts[0], dict(zip(engine_values, texts[1:], strict=True)))


def _components(each: Deviation) -> Iterator[tuple[str, Any, Any]]:
    """Split a deviation into the single numbers that differ, with their names."""
    file, value = _components_of(each.file), _components_of(each.engine_value)
    titles = _COMPONENTS.get(each.property, ())
    if not titles or len(file) != len(titles) or len(value) != len(titles):
        yield each.property, _word(each.file), _word(each.engine_value)
        return
    limit = ROUNDING * max(map(abs, [*file, *value])) if _is_large(each) else 0.0
    for title, one, other in zip(titles, file, value, strict=True):
        if not abs(one - other) <= limit:
            yield title, one, other


def _is_large(each: Deviation) -> bool:
    """Check whether two values differ by more than rounding, relative to their largest number."""
    file, engine = _numbers(each.file), _numbers(each.engine_value)
    if file is None or engine is None or file.shape != engine.shape:
        return True
    limit = ROUNDING * max(np.abs(file).max(initial=0.0), np.abs(engine).max(initial=0.0))
    return not bool((np.abs(file - engine) <= limit).all())


def _components_of(value: Any) -> list[float]:
    """Return the numbers of a vector, or the six of a symmetric matrix; none for anything else."""
    numbers = _numbers(value)
    if numbers is None or numbers.ndim == 0:
        return []
    flat = numbers.reshape(3, 3)[np.triu_indices(3)] if numbers.size == 9 else numbers
    return [float(number) for number in flat.flat]


def _numbers(value: Any) -> Any:
    """Return a value as an array of numbers; None where it contains anything else."""
    if isinstance(value, bool) or not isinstance(value, int | float | list | tuple):
        return None
    try:
        numbers = np.asarray(value)
    except ValueError:
        return None
    return numbers.astype(float) if numbers.dtype.kind in "if" else None


def _word(value: Any) -> Any:
    """Write None and truth values as words."""
    if value is None or isinstance(value, bool):
        return "there" if value else "not there"
    return value


def changes(report: DoctorReport) -> TextChanges | None:
    """Compare the file with the mended one; None where nothing was mended."""
    if report.text is None or report.mended is None:
        return None
    return text_changes(report.text, report.mended)


def excerpt(report: DoctorReport, line: int | None, around: int = 2) -> list[tuple[int, str]]:
    """Return the lines about `line` with their numbers; none where the text or the line is unknown."""
    if report.text is None or line is None:
        return []
    return excerpt_of(report.text if report.form is None else report.form.front + report.text, line, around)


LIMITS = {"SHOWN_RULES": 6, "OPEN_PLACES": 2, "SHOWN_PLACES": 40, "OPEN_VALUES": 25}
"""Largest numbers of rules in a robot's row of the overview, of expanded and of listed places of a cause,
and of engine values in an expanded table."""

LOWEST_BAR = -16
"""Power of ten at which the bar of an error starts: the last digit of a double; it is full at 100 %."""


def html_page(
    reports: Sequence[DoctorReport],
    *,
    command: str | None = None,
    baseline: Baseline | None = None,
    left_out: Sequence[str] = (),
) -> str:
    """Make the HTML page, in ASCII. It states the `command` line that reproduces it, and the robots
    `left_out`: files in xacro below a directory."""
    entries = {cause.rule: cause.entry for report in reports for cause in causes(report) if cause.entry}
    page = template_environment().get_template("doctor.html.j2")
    return page_text(
        page,
        reports=reports,
        titles=wording.titles([report.robot for report in reports]),
        counts=Counter(report.status for report in reports),
        rules=[entries[rule] for rule in sorted(entries)],
        baseline=baseline,
        left_out=left_out_note([wording.name(robot) for robot in left_out]) if left_out else "",
        command=command,
        footer=_footer(reports),
    )


@cache
def template_environment() -> Environment:
    """Return the templates with the functions that they use."""
    environment = page_environment("dynx.doctor.formats")
    words = (wording.name, wording.relative, wording.quantity, wording.effect, wording.part)
    more = (wording.unexplained, wording.finding_effect, wording.variant, wording.change, wording.message)
    filters = (
        *words,
        *more,
        wording.unread_meshes,
        wording.loads_mended,
        wording.refusal,
        wording.step_defaults,
        wording.ignored,
    )
    environment.filters.update({each.__name__: each for each in filters})
    views: tuple[Callable[..., Any], ...] = (causes, step_of, bar_position, largest_error)
    views += (wording.difference, engine_map, pair_map, joint_map, model_tables, changes, excerpt)
    environment.globals.update({each.__name__: each for each in views}, steps=ALL_STEPS, **LIMITS)
    return environment


def bar_position(error: float) -> float:
    """Return the position of an error on its bar [%]; an error that is not finite fills it."""
    if not math.isfinite(error):
        return 100.0
    power = math.log10(max(error, 10.0**LOWEST_BAR))
    return 100.0 * (1.0 - min(power, 0.0) / LOWEST_BAR)


def _footer(reports: Sequence[DoctorReport]) -> str:
    found = {each.engine: each.version for report in reports for each in report.engines}
    engines = [f"{wording.name(engine)} {wording.name(version)}" for engine, version in found.items()]
    settings = ""
    for one in [report for report in reports if report.error is None][:1]:
        settings = f" {one.samples} random states, seed {one.seed}, tolerance {one.tolerance:g}."
    seconds = math.fsum(report.seconds for report in reports)
    return f"{', '.join([f'dynx {__version__}', *engines])}.{settings} {seconds:.1f} s."
