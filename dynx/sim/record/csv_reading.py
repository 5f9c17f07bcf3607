"""Rollouts read from tables: those that dynx writes, and logs of a robot from elsewhere."""

from __future__ import annotations

import csv
import io
import math
import os
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from dynx.errors import ArgumentError, nearest, shown
from dynx.files.reading import checked_path, irregularity
from dynx.model import Model
from dynx.spatial.scalar import Floats

TIMES = ("t", "time", "timestamp")
"""Names of the column of times [s]."""

POSE = ("x", "y", "z", "qx", "qy", "qz", "qw")
TWIST = ("vx", "vy", "vz", "wx", "wy", "wz")


def load_csv(path: str | os.PathLike[str], model: Model) -> dict[str, Any]:
    """Read the fields of a rollout of `model` from a table whose first line names the columns.

    Needed are times [s], in a column `t`, `time` or `timestamp`, and the position ``q:JOINT`` (or ``JOINT``)
    of every joint [rad or m], for a floating base ``q:x`` to ``q:qw`` as well. Where velocities ``v:JOINT``
    are missing they are central differences of the positions, and accelerations ``a:JOINT`` differences of
    the velocities. Torques ``tau:JOINT`` [N m or N] that are missing are NaN. Other columns are ignored.

    Raises ArgumentError for a file that cannot be read, a missing column, text that is no number, and times
    that do not increase.
    """
    name = shown(checked_path(path), 300)
    problem = irregularity(path)
    if problem:
        raise ArgumentError(f"{name} {problem}")
    try:
        with open(path, newline="", encoding="utf-8-sig") as file:
            rows = list(csv.reader(io.StringIO(file.read()), skipinitialspace=True))
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise ArgumentError(f"{name} cannot be read as a table: {error}") from None
    if not rows:
        raise ArgumentError(f"{name} is empty; wanted a line of names of columns")
    header = [each.strip() for each in rows[0]]
    body = [(number, row) for number, row in enumerate(rows[1:], start=2) if any(map(str.strip, row))]
    columns = {each: k for k, each in reversed(list(enumerate(header)))}
    table = _Table(name, columns, body)
    t = table.column(TIMES)
    if len(t) < 2 or not (np.diff(t) > 0.0).all():
        later = np.flatnonzero(np.diff(t) <= 0.0)
        place = f" at line {body[int(later[0]) + 1][0]}" if len(later) else ""
        raise ArgumentError(f"{name} has times that do not increase{place}; wanted two rows or more")
    base = model.floating
    positions = [*(POSE if base else ()), *model.joint_names]
    rates = [*(TWIST if base else ()), *model.joint_names]
    q = table.block("q", positions, plain=not base)
    v = table.block("v", rates) if table.has("v", rates) else _rates(model, t, q)
    a = table.block("a", rates)[:-1] if table.has("a", rates) else np.diff(v, axis=0) / np.diff(t)[:, None]
    unknown = np.full((len(t) - 1, model.nv), math.nan)
    tau = table.block("tau", rates)[:-1] if table.has("tau", rates) else unknown
    return {
        "model": model,
        "t": t,
        "q": q,
        "v": v,
        "a": a,
        "tau": tau,
        "saturated": np.zeros(tau.shape, bool),
        "reference": None,
        "rotors": np.zeros((model.nv, model.nv)),
    }


class _Table:
    """Columns of text by name, converted to numbers where they are read."""

    def __init__(
        self, path: str, columns: Mapping[str, int], rows: Sequence[tuple[int, Sequence[str]]]
    ) -> None:
        self._path, self._columns, self._rows = path, columns, rows

    def has(self, kind: str, names: Sequence[str]) -> bool:
        """Return True if there is a column of this kind for every name."""
        return all(f"{kind}:{name}" in self._columns for name in names)

    def column(self, names: Sequence[str], *, last: bool = True) -> Floats:
        """Return the first column of these names; without `last` its last number may be missing."""
        found = next((name for name in names if name in self._columns), None)
        if found is None:
            wanted = " or ".join(map(shown, names))
            raise ArgumentError(f"{self._path} has no column {wanted}{nearest(names[0], self._columns)}")
        k, numbers = self._columns[found], np.full(len(self._rows), math.nan)
        for row, (line, cells) in enumerate(self._rows):
            text = cells[k].strip() if k < len(cells) else ""
            try:
                numbers[row] = float(text)
            except ValueError:
                if not (text == "" and row == len(self._rows) - 1 and not last):
                    raise ArgumentError(
                        f"{self._path}:{line}: column {shown(found)} has {shown(text)}; wanted a number"
                    ) from None
                continue
            if not math.isfinite(numbers[row]) and last:
                raise ArgumentError(f"{self._path}:{line}: column {shown(found)} has {shown(text)}")
        return numbers

    def block(self, kind: str, names: Sequence[str], *, plain: bool = False) -> Floats:
        """Return the columns of this kind (rows, names); with `plain` the name alone is one, too."""
        states = kind in ("q", "v")
        wanted = ([f"{kind}:{name}", *([name] if plain else [])] for name in names)
        found = [self.column(each, last=states) for each in wanted]
        return np.column_stack(found) if found else np.zeros((len(self._rows), 0))


def _rates(model: Model, t: Floats, q: Floats) -> Floats:
    """Return velocities (n, nv) by central differences, at the ends by one-sided ones."""
    before, after = np.maximum(np.arange(len(t)) - 1, 0), np.minimum(np.arange(len(t)) + 1, len(t) - 1)
    spans = (t[after] - t[before])[:, None]
    if not model.floating:
        return model.difference(q[before], q[after]) / spans
    # Displacements are in the axes of the base where they begin: both are taken from the middle state.
    return (model.difference(q, q[after]) - model.difference(q, q[before])) / spans
