"""Tables of the values of engines that differ from the file, link by link, number by number."""

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
