"""What engines hold beside what the file says, link by link, number by number."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from dynx.doctor.formats import wording
from dynx.doctor.formats.causes import ROUNDING
from dynx.doctor.report import DoctorReport
from dynx.loaded.difference import Deviation

SHOWN_ROWS = 200
"""Rows of a table; the JSON document has all."""

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
class Row:
    """One number of the file and, by engine, the values that are not the file's."""

    title: str
    file: str
    held: Mapping[str, str]


@dataclass(frozen=True)
class ModelTable:
    """Rows by what they belong to, such as ``link tool0``; `count` is the number of deviations in it."""

    engines: tuple[str, ...]
    owners: tuple[tuple[str, tuple[Row, ...]], ...]
    left_out: int
    count: int


@dataclass(frozen=True)
class ModelTables:
    """The deviations of a report, apart from those of rounding size."""

    large: ModelTable
    small: ModelTable


def model_tables(report: DoctorReport) -> ModelTables:
    """The deviations of the engines from the file."""
    engines = [each.engine for each in report.engines if each.refused is None]
    engines += sorted({each.engine for each in report.model_difference} - set(engines))
    large = [each for each in report.model_difference if _is_large(each)]
    small = [each for each in report.model_difference if not _is_large(each)]
    return ModelTables(_table(large, engines), _table(small, engines))


def _table(deviations: Sequence[Deviation], engines: Iterable[str]) -> ModelTable:
    """A row for each number that some engine holds otherwise, by what it belongs to."""
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


def _row(title: str, file: Any, held: Mapping[str, Any]) -> Row:
    texts = wording.values([file, *held.values()])
    return Row(title, texts[0], dict(zip(held, texts[1:], strict=True)))


def _components(each: Deviation) -> Iterator[tuple[str, Any, Any]]:
    """The single numbers of a deviation that differ, with their names."""
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
    """Whether two values differ by more than rounding, each number relative to the largest there."""
    file, engine = _numbers(each.file), _numbers(each.engine_value)
    if file is None or engine is None or file.shape != engine.shape:
        return True
    limit = ROUNDING * max(np.abs(file).max(initial=0.0), np.abs(engine).max(initial=0.0))
    return not bool((np.abs(file - engine) <= limit).all())


def _components_of(value: Any) -> list[float]:
    """The numbers of a vector, or the six of a symmetric matrix; none for anything else."""
    numbers = _numbers(value)
    if numbers is None or numbers.ndim == 0:
        return []
    flat = numbers.reshape(3, 3)[np.triu_indices(3)] if numbers.size == 9 else numbers
    return [float(number) for number in flat.flat]


def _numbers(value: Any) -> Any:
    """The numbers of a value as an array; None where something else is in it."""
    if isinstance(value, bool) or not isinstance(value, int | float | list | tuple):
        return None
    try:
        numbers = np.asarray(value)
    except ValueError:
        return None
    return numbers.astype(float) if numbers.dtype.kind in "if" else None


def _word(value: Any) -> Any:
    """Whether something exists, in words."""
    if value is None or isinstance(value, bool):
        return "there" if value else "not there"
    return value
