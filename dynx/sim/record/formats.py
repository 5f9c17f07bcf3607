"""Files of rollouts: the format follows from the suffix; `load` reads NumPy's ``.npz``."""

from __future__ import annotations

import json
import os
import struct
import tokenize
import zipfile
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from dynx.errors import ArgumentError, ModelError, shown
from dynx.files.reading import checked_path
from dynx.files.writing import atomic_file
from dynx.model.documents import robot_document, robot_from_document
from dynx.sim.record.csv_file import write_csv
from dynx.sim.record.mcap_file import write_mcap
from dynx.sim.record.rollout_data import RolloutData
from dynx.sim.scenario.scenario import Scenario
from dynx.trajectory.base import Setpoint

SCHEMA = "dynx.rollout/2"
"""Name and version of the layout of the file."""

ARRAYS = ("t", "q", "v", "a", "tau", "saturated", "rotors")
REFERENCE = ("reference_q", "reference_v", "reference_a")

DAMAGED = (
    *(OSError, EOFError, ValueError, KeyError, RuntimeError, MemoryError),
    *(zipfile.BadZipFile, zlib.error, struct.error, tokenize.TokenError, SyntaxError),
)
"""Exceptions of zipfile and NumPy for a missing or damaged file."""


def save(rollout: RolloutData, path: str | os.PathLike[str]) -> None:
    """Write the record to a file atomically, in the format of its suffix.

    - ``.npz``: complete; `Rollout.load` reads it, and so does `numpy.load`
    - ``.csv``: a table for spreadsheets; `dynx.sim.record.csv_file` describes its columns
    - ``.mcap``: ROS 2 messages for PlotJuggler, Foxglove and ``ros2 bag``; `dynx.sim.record.ros_topics`
      describes the topics

    All three keep every bit of the numbers. Raises ArgumentError for another format or a file that
    cannot be written, NotInstalledError for ``.mcap`` without mcap (``pip install 'dynx[mcap]'``).
    """
    path = checked_path(path)
    write = WRITERS.get(Path(path).suffix.lower())
    if write is None:
        formats = " or ".join([", ".join([*WRITERS][:-1]), [*WRITERS][-1]])
        raise ArgumentError(f"a rollout is saved as {formats}, not as {shown(Path(path).name)}")
    with atomic_file(path) as file:
        write(rollout, file)


def load(path: str | os.PathLike[str]) -> dict[str, Any]:
    """Read the fields of a rollout from a ``.npz`` of `save`. Raises ArgumentError for any other file.

    The model is read from the URDF text in the file; no array is unpickled.
    """
    name = checked_path(path)
    entries = _entries(path)
    if str(entries.get("schema")) != SCHEMA:
        raise ArgumentError(
            f"{name} does not have the schema {SCHEMA!r}, so it is not a rollout of this version"
        )
    missing = [entry for entry in (*ARRAYS, "robot") if entry not in entries]
    if missing:
        raise ArgumentError(f"{name} lacks {', '.join(missing)}")
    reference = None
    if all(entry in entries for entry in REFERENCE):
        reference = Setpoint(*(entries[entry] for entry in REFERENCE))
    try:
        robot: dict[str, Any] = json.loads(str(entries["robot"]))
        model = robot_from_document(robot)
        scenario = None if robot["scenario"] is None else Scenario.from_dict(robot["scenario"])
        executor, departures = str(robot["executor"]), tuple(robot["departures"])
    except (ValueError, KeyError, TypeError, ModelError) as error:
        raise ArgumentError(f"the robot in {name} cannot be read: {error}") from error
    n = len(entries["tau"]) if entries["tau"].ndim else 0
    shapes = {"t": (n + 1,), "q": (n + 1, model.nq), "rotors": (model.nv, model.nv)}
    shapes |= {"v": (n + 1, model.nv)} | dict.fromkeys(("a", "tau", "saturated"), (n, model.nv))
    shapes |= zip(REFERENCE, ((n + 1, model.nq), (n + 1, model.nv), (n + 1, model.nv)), strict=True)
    for entry, shape in shapes.items():
        array, kind = entries.get(entry), np.dtype(bool if entry == "saturated" else float)
        if array is not None and (array.shape != shape or array.dtype != kind):
            raise ArgumentError(
                f"{entry} in {name} is {array.dtype} {array.shape}; wanted {kind} {shape} as n is {n}"
            )
    arrays = {entry: entries[entry] for entry in ARRAYS}
    return {
        "model": model,
        **arrays,
        "reference": reference,
        "scenario": scenario,
        "executor": executor,
        "departures": departures,
    }


def _entries(path: str | os.PathLike[str]) -> dict[str, Any]:
    """Read all arrays of a ``.npz``."""
    problem = "it is not a .npz file, or it is truncated"
    try:
        with open(path, "rb") as raw:
            if zipfile.is_zipfile(raw):
                raw.seek(0)
                file = np.load(raw, allow_pickle=False)
                if isinstance(file, np.lib.npyio.NpzFile):
                    with file:
                        return {name: file[name] for name in file.files}
    except DAMAGED as error:
        problem = str(error) or type(error).__name__
    raise ArgumentError(f"{os.fspath(path)} cannot be read as a rollout: {problem}")


def _write_npz(rollout: RolloutData, file: BinaryIO) -> None:
    model = rollout.model
    robot = {
        **robot_document(model),
        "scenario": None if rollout.scenario is None else rollout.scenario.to_dict(),
        "executor": rollout.executor,
        "departures": list(rollout.departures),
    }
    arrays: dict[str, Any] = {name: getattr(rollout, name) for name in ARRAYS}
    if rollout.reference is not None:
        arrays.update(zip(REFERENCE, rollout.reference, strict=True))
    # The energy is for programs without dynx; `load` computes it again.
    np.savez(file, schema=SCHEMA, robot=json.dumps(robot), energy=rollout.energy, **arrays)


WRITERS: dict[str, Callable[[RolloutData, BinaryIO], None]] = {
    ".npz": _write_npz,
    ".csv": write_csv,
    ".mcap": write_mcap,
}
"""Writers by suffix."""
