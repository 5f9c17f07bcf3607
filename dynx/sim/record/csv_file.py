"""Rollouts as tables of text, written and read, for spreadsheets and programs without NumPy's formats.

The first line names the columns, in this order; ``c`` stands for each coordinate:

| columns | content | unit |
|---|---|---|
| `t` | time | s |
| `q:c`, `v:c` | position, velocity | rad or m; rad/s or m/s |
| `q*:c`, `v*:c` | position and velocity of the reference, if any | rad or m; rad/s or m/s |
| `a*:c` | acceleration of the reference, if any | rad/s^2 or m/s^2 |
| `error:c` | tracking error, if there is a reference | rad or m |
| `energy` | sum of kinetic and potential energy | J |
| `a:c`, `tau:c` | acceleration and torque in the step that starts at this time | rad/s^2 or m/s^2; N m or N |
| `saturated:c` | 1 if the motor was at its limit in the step that starts at this time, otherwise 0 | |
| `contact:NAME:x`, `:y`, `:z` | contact force on the body or link NAME in that step, in world axes | N |
| `sensor:NAME:...` | sample of the sensor NAME; empty without a sample at this time | as in the sensor |

Coordinates have the names of their joints. A floating base comes first: `x y z qx qy qz qw` in positions (of
the base frame in the world, quaternion xyzw) and `vx vy vz wx wy wz` in rates (in the base frame). No step
begins at the last state, so its last columns are empty. Numbers are the shortest text that reads back as the
same float64. Text is UTF-8, and a name with a comma or a quote in it stands in quotes (RFC 4180).
"""

from __future__ import annotations

import csv
import io
import math
import os
import re
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, BinaryIO, TextIO

import numpy as np

from dynx.errors import ArgumentError, nearest, shown
from dynx.files.reading import checked_path, open_regular, require_size
from dynx.model import Model
from dynx.model.configuration import checked_q
from dynx.sim.record.rollout import Rollout
from dynx.spatial.scalar import Floats

if TYPE_CHECKING:
    from dynx.world.sensors.readings import Readings

Block = tuple[str, list[str], Any]
"""Kind of a quantity, the names of its coordinates, and its rows (n, len(names))."""


def write_csv(rollout: Rollout, file: BinaryIO) -> None:
    """Write one row for each state, with the torque and acceleration of the step that begins there."""
    states, steps = _blocks(rollout)
    if rollout.surroundings is not None:
        contacts = rollout.surroundings.contacts
        steps += [(f"contact:{name}", [*"xyz"], contacts.force_on(name)) for name in contacts.touching]
    samples: list[Block] = [
        (f"sensor:{name}", [*readings.sensor.value_names], _in_rows(rollout, readings))
        for name, readings in rollout.sensors.items()
    ]
    header = ["t", *_header(states), "energy", *_header(steps), *_header(samples)]
    file.write((",".join(_quoted(column) for column in header) + "\n").encode())
    columns = [rollout.t[:, None], *(rows for *_, rows in states), rollout.energy[:, None]]
    acting = [rows.tolist() for *_, rows in steps] + [rows for *_, rows in samples]
    nothing = [""] * len([*_header(steps), *_header(samples)])
    for k, state in enumerate(np.concatenate(columns, axis=1).tolist()):
        cells = [repr(x) for x in state]
        cells += nothing if k == len(rollout) else [_cell(x) for rows in acting for x in rows[k]]
        file.write((",".join(cells) + "\n").encode())


def _in_rows(rollout: Rollout, readings: Readings) -> list[list[float | None]]:
    """Return the values (n, size) of samples in the rows of the steps in which they were taken, else None."""
    rows: list[list[float | None]] = [[None] * readings.sensor.size for _ in range(len(rollout))]
    for k, values in zip(np.searchsorted(rollout.t, readings.t).tolist(), readings.values, strict=True):
        rows[k] = values.tolist()
    return rows


def _cell(x: float | None) -> str:
    return "" if x is None else repr(x)


def columns(rollout: Rollout) -> dict[str, Floats]:
    """Return the columns (n + 1,) of states and steps in the table of a rollout, for `pandas.DataFrame`.

    The columns of steps (``a:``, ``tau:``, ``saturated:``) end with NaN, because no step begins at the last
    state.
    """
    states, steps = _blocks(rollout)
    last = np.full((1, rollout.model.nv), np.nan)
    blocks = [*states, *((kind, names, np.concatenate([rows, last])) for kind, names, rows in steps)]
    rows = np.concatenate([rollout.t[:, None], *(block for *_, block in blocks)], axis=1)
    return dict(zip(("t", *_header(blocks)), rows.T, strict=True))


def _blocks(rollout: Rollout) -> tuple[list[Block], list[Block]]:
    """Return the quantities of the states, and those of the steps."""
    positions, rates = coordinate_names(rollout.model)
    states: list[Block] = [("q", positions, rollout.q), ("v", rates, rollout.v)]
    if rollout.reference is not None:
        q, v, a = rollout.reference
        states += [("q*", positions, q), ("v*", rates, v), ("a*", rates, a), ("error", rates, rollout.error)]
    flags = rollout.saturated.astype(np.int64)
    return states, [("a", rates, rollout.a), ("tau", rates, rollout.tau), ("saturated", rates, flags)]


def _header(blocks: Sequence[Block]) -> list[str]:
    return [f"{kind}:{name}" for kind, names, _ in blocks for name in names]


def coordinate_names(model: Model) -> tuple[list[str], list[str]]:
    """Return the names of the columns of positions and of rates."""
    positions, rates = (["x", "y", "z", "qx", "qy", "qz", "qw"], ["vx", "vy", "vz", "wx", "wy", "wz"])
    of_base = (positions, rates) if model.floating else ([], [])
    return [*of_base[0], *model.position_names], [*of_base[1], *model.coordinate_names]


_FORMULA = re.compile(r"[;\t]\s*[=+@-]")
"""What a spreadsheet computes, in a country where it divides cells at semicolons or tabs."""


def _quoted(text: str) -> str:
    if _FORMULA.search(text):
        raise ArgumentError(
            f"the column {shown(text)} has a part that spreadsheets compute; save it as .npz or .mcap"
        )
    return '"' + text.replace('"', '""') + '"' if any(c in text for c in ',"\n\r') else text


MAX_TABLE = 2**28
"""Largest size of a table that is read [bytes]."""

MAX_CELLS = 20_000_000
"""Largest number of cells, which take up to 65 bytes in memory each, and of rows, which count as three."""

TIMES = ("t", "time", "timestamp")
"""Names of the column of times [s]."""


def load_csv(path: str | os.PathLike[str], model: Model) -> dict[str, Any]:
    """Read the fields of a rollout of `model` from a table whose first line names the columns.

    Needed are times [s], in a column `t`, `time` or `timestamp`, and the position ``q:JOINT`` (or ``JOINT``)
    of every joint [rad or m], for a floating base ``q:x`` to ``q:qw`` as well. A velocity ``v:JOINT`` that is
    missing is the central difference of the positions, an acceleration ``a:JOINT`` the difference of the
    velocities. A torque ``tau:JOINT`` [N m or N] that is missing is NaN. Other columns are ignored.

    Raises ArgumentError for a file that cannot be read, a column that is missing or there twice, text that is
    no number, a quaternion of another length than 1, and times that do not increase.
    """
    name = shown(checked_path(path), 300)
    try:
        with open_regular(path) as file, io.TextIOWrapper(file, "utf-8-sig", newline="") as text:
            require_size(file, MAX_TABLE)
            rows = _rows(text)
    except (OSError, ValueError, csv.Error) as error:
        reason = error.strerror if isinstance(error, OSError) else error
        raise ArgumentError(f"{name} cannot be read as a table: {reason}") from None
    if not rows:
        raise ArgumentError(f"{name} is empty; wanted a line of names of columns")
    header = [each.strip() for each in rows[0]]
    body = [(number, row) for number, row in enumerate(rows[1:], start=2) if any(map(str.strip, row))]
    table = _TextColumns(name, header, body)
    t = table.column(TIMES)
    if len(t) < 2:
        raise ArgumentError(f"{name} has too few rows of numbers ({len(t)}); wanted 2 or more")
    later = np.flatnonzero(np.diff(t) <= 0.0)
    if len(later):
        k = int(later[0])
        raise ArgumentError(
            f"{name}:{body[k + 1][0]}: the time {t[k + 1]:.12g} s follows {t[k]:.12g} s; "
            "wanted times that increase"
        )
    positions, rates = coordinate_names(model)
    try:
        q = checked_q(model, table.positions(positions, plain=not model.floating))
        v = table.filled("v", rates, _rates(model, t, q))
        a = table.filled("a", rates, np.diff(v, axis=0) / np.diff(t)[:, None])
        tau = table.filled("tau", rates, np.full((len(t) - 1, model.nv), math.nan))
    except ArgumentError as error:
        # Numbers that are too large, and quaternions of another length than 1, are found by the model.
        raise (
            error if name in str(error) else ArgumentError(f"{name} has invalid positions: {error}")
        ) from None
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


def _rows(file: TextIO) -> list[list[str]]:
    """Return the cells of a table by row. Raises ValueError for more than `MAX_CELLS`."""
    rows, cells = [], 0
    for row in csv.reader(file, skipinitialspace=True):
        rows.append(row)
        cells += 3 + len(row)
        if cells > MAX_CELLS:
            raise ValueError(f"it has more than {MAX_CELLS:,} cells")
    return rows


class _TextColumns:
    """Columns of text by name, converted to numbers where they are read."""

    def __init__(self, path: str, header: Sequence[str], rows: Sequence[tuple[int, Sequence[str]]]) -> None:
        self._path, self._header, self._rows = path, header, rows

    def column(self, names: Sequence[str], *, last: bool = True) -> Floats:
        """Return the first column of these names; without `last` its last number may be missing."""
        found = next((name for name in names if name in self._header), None)
        if found is None:
            wanted = " or ".join(map(shown, names))
            separator = next((each for each in ";\t" if self._header and each in self._header[0]), None)
            if separator is not None and len(self._header) == 1:
                raise ArgumentError(
                    f"{self._path} is separated by {separator!r}; wanted commas between columns"
                )
            raise ArgumentError(f"{self._path} has no column {wanted}{nearest(names[0], self._header)}")
        if self._header.count(found) > 1:
            raise ArgumentError(
                f"{self._path} has {self._header.count(found)} columns {shown(found)}; wanted one"
            )
        k, numbers = self._header.index(found), np.full(len(self._rows), math.nan)
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
                raise ArgumentError(
                    f"{self._path}:{line}: column {shown(found)} has {shown(text)}; wanted a finite number"
                )
        return numbers

    def positions(self, names: Sequence[str], *, plain: bool) -> Floats:
        """Return the positions (rows, names); with `plain` a column may have the name alone."""
        found = [self.column([f"q:{name}", *([name] if plain else [])]) for name in names]
        return np.column_stack(found) if found else np.zeros((len(self._rows), 0))

    def filled(self, kind: str, names: Sequence[str], rest: Floats) -> Floats:
        """Return `rest` with the columns of this kind that there are, in as many rows."""
        found: Floats = rest.copy()
        for k, name in enumerate(names):
            if f"{kind}:{name}" in self._header:
                found[:, k] = self.column([f"{kind}:{name}"], last=kind == "v")[: len(rest)]
        return found


def _rates(model: Model, t: Floats, q: Floats) -> Floats:
    """Return velocities (n, nv) by central differences, at the ends by one-sided ones."""
    before, after = np.maximum(np.arange(len(t)) - 1, 0), np.minimum(np.arange(len(t)) + 1, len(t) - 1)
    spans = (t[after] - t[before])[:, None]
    if not model.quaternions:
        return model.difference(q[before], q[after]) / spans
    # Displacements are in the axes of the base where they begin: both are taken from the middle state.
    return (model.difference(q, q[after]) - model.difference(q, q[before])) / spans
