"""What engines hold beside what the file says, link by link, number by number."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

from dynx.doctor.formats import wording
from dynx.doctor.formats.causes import ROUNDING
from dynx.doctor.formats.html_elements import cell, escape, folded, name
from dynx.doctor.report import DoctorReport
from dynx.loaded.difference import Deviation

_OPEN_VALUES = 25
"""Values that are seen at once; more are folded away."""

_SHOWN_ROWS = 200
"""Rows of a table; the JSON document has all."""

_COMPONENTS = {
    "center": ("center x", "center y", "center z"),
    "position": ("x", "y", "z"),
    "rotation": ("roll", "pitch", "yaw"),
    "axis": ("axis x", "axis y", "axis z"),
    "default": ("x", "y", "z"),
    "inertia": ("ixx", "ixy", "ixz", "iyy", "iyz", "izz"),
}
"""What the numbers of a property are called."""

Owner = tuple[str, str]
"""Part and name, such as link tool0."""

Row = tuple[str, Any, Mapping[str, Any]]
"""What it is, the file's value, and by engine the values that are not the file's."""


def model_tables(report: DoctorReport) -> str:
    """The deviations, large ones to see; those of rounding size are folded away."""
    engines = [each.engine for each in report.engines if each.refused is None]
    engines += sorted({each.engine for each in report.model_difference} - set(engines))
    large = [each for each in report.model_difference if _large(each)]
    small = [each for each in report.model_difference if not _large(each)]
    parts = [_table(_rows(large), engines)] if large else []
    if len(large) > _OPEN_VALUES:
        parts = [folded(f"{len(large)} values", *parts)]
    if small:
        said = f"{len(small)} {'value' if len(small) == 1 else 'values'} off by rounding (to {ROUNDING:g})"
        parts.append(folded(escape(said), _table(_rows(small), engines)))
    return "\n".join(parts)


def _rows(deviations: Iterable[Deviation]) -> dict[Owner, list[Row]]:
    """A row for each number that some engine holds otherwise, by what it belongs to."""
    gathered: dict[Owner, dict[str, tuple[Any, dict[str, Any]]]] = {}
    for each in deviations:
        rows = gathered.setdefault((each.part, each.name), {})
        for title, file, value in _components(each):
            rows.setdefault(title, (file, {}))[1][each.engine] = value
    return {
        owner: [(title, file, held) for title, (file, held) in rows.items()]
        for owner, rows in gathered.items()
    }


def _components(each: Deviation) -> Iterator[tuple[str, Any, Any]]:
    """The single numbers of a deviation that differ, with their names."""
    file, value = _unrolled(each.file), _unrolled(each.engine_value)
    titles = _COMPONENTS.get(each.property, ())
    if not titles or len(file) != len(titles) or len(value) != len(titles):
        yield each.property, _word(each.file), _word(each.engine_value)
        return
    limit = ROUNDING * _scale(file, value) if _large(each) else 0.0
    for title, one, other in zip(titles, file, value, strict=True):
        if not abs(one - other) <= limit:
            yield title, one, other


def _table(owners: Mapping[Owner, Sequence[Row]], engines: Sequence[str]) -> str:
    heads = ["what", "in the file", *engines]
    head = "".join(
        f'<th scope="col"{" class=number" if number else ""}>{name(title)}</th>'
        for number, title in enumerate(heads)
    )
    bodies, left = [], _SHOWN_ROWS
    for (part, owner), rows in owners.items():
        lines = [_line(row, engines) for row in rows[: max(left, 0)]]
        left -= len(rows)
        if lines:
            whose = escape(part) if part == owner else f"{escape(part)} {name(owner)}"
            title = f'<th scope="rowgroup" colspan="{len(heads)}">{whose}</th>'
            title = f'<tr class="group">{title}</tr>'
            bodies.append(f"<tbody>{title}\n" + "\n".join(lines) + "</tbody>")
    note = f'<p class="faint">and {-left} more values: see the JSON document.</p>' if left < 0 else ""
    inside = f"<thead><tr>{head}</tr></thead>{''.join(bodies)}"
    return f'<div class="scroll" tabindex="0"><table class="model">{inside}</table></div>{note}'


def _line(row: Row, engines: Sequence[str]) -> str:
    title, file, held = row
    texts = wording.values([file, *held.values()])
    said = dict(zip(held, texts[1:], strict=True))
    cells = [cell(escape(texts[0]), "number")]
    for engine in engines:
        if engine in said:
            cells.append(cell(escape(said[engine]), "number off"))
        else:
            cells.append(cell("as the file", "number faint"))
    return f'<tr><th scope="row">{name(title)}</th>{"".join(cells)}</tr>'


def _large(each: Deviation) -> bool:
    """Whether two values differ by more than rounding, each number relative to the largest there."""
    file, engine = _flat(each.file), _flat(each.engine_value)
    if file is None or engine is None or len(file) != len(engine):
        return True
    limit = ROUNDING * _scale(file, engine)
    return not all(abs(a - b) <= limit for a, b in zip(file, engine, strict=True))


def _scale(one: Sequence[float], other: Sequence[float]) -> float:
    return max(map(abs, [*one, *other]), default=0.0)


def _unrolled(value: Any) -> list[float]:
    """The numbers of a vector, or the six of a symmetric matrix; none for anything else."""
    numbers = _flat(value) if isinstance(value, list | tuple) else None
    if numbers is not None and len(numbers) == 9:
        return [numbers[3 * i + k] for i in range(3) for k in range(i, 3)]
    return numbers or []


def _flat(value: Any) -> list[float] | None:
    """The numbers of a value; None where something else is in it."""
    if isinstance(value, bool) or value is None or isinstance(value, str):
        return None
    if isinstance(value, int | float):
        return [float(value)]
    found: list[float] = []
    for each in value:
        part = _flat(each)
        if part is None:
            return None
        found += part
    return found


def _word(value: Any) -> Any:
    """Whether something exists, in words."""
    if value is None or isinstance(value, bool):
        return "there" if value else "not there"
    return value
