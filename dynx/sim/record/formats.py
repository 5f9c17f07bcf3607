"""Files of rollouts: the format follows from the suffix."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from dynx.errors import ArgumentError, shown
from dynx.files.arrays import ArrayFile, read_arrays
from dynx.files.documents import parse_json
from dynx.files.reading import checked_path
from dynx.files.writing import atomic_file
from dynx.model import Model
from dynx.model.documents import robot_document, robot_from_document
from dynx.model.model import refuse_other_than_model
from dynx.sim.record.csv_file import load_csv, write_csv
from dynx.sim.record.mcap_file import load_mcap, write_mcap
from dynx.sim.record.rollout import Rollout
from dynx.sim.scenario.scenario import Scenario
from dynx.trajectory.base import Setpoint
from dynx.world.surroundings import from_document, to_document

SCHEMA = "dynx.rollout/2"
"""Name and version of the layout of the file."""

ARRAYS = ("t", "q", "v", "a", "tau", "saturated", "rotors")
REFERENCE = ("reference_q", "reference_v", "reference_a")


def save(rollout: Rollout, path: str | os.PathLike[str]) -> None:
    """Write the record to a file atomically, in the format of its suffix.

    - ``.npz``: complete; `Rollout.load` reads it, and so does `numpy.load`
    - ``.csv``: a table for spreadsheets; `dynx.sim.record.csv_file` describes its columns
    - ``.mcap``: ROS 2 messages for PlotJuggler, Foxglove and ``ros2 bag``; `dynx.sim.record.ros_messages`
      describes the topics

    All three keep every bit of the numbers. Raises ArgumentError for another format or a file that
    cannot be written, NotInstalledError for ``.mcap`` without mcap (extra ``mcap``).
    """
    path = checked_path(path)
    write = WRITERS.get(Path(path).suffix.lower())
    if write is None:
        formats = " or ".join([", ".join([*WRITERS][:-1]), [*WRITERS][-1]])
        raise ArgumentError(f"a rollout is saved as {formats}, not as {shown(Path(path).name)}")
    with atomic_file(path) as file:
        write(rollout, file)


def load(kind: type[Rollout], path: str | os.PathLike[str], model: Model | None = None) -> Rollout:
    """Read a file of `save`: ``.npz`` to the last bit, or ``.mcap``, which has times in whole nanoseconds
    and neither scenario nor surroundings.

    A ``.csv`` of `save`, or the log of a robot from elsewhere, is read as a rollout of `model`. Its columns
    are ``t`` and ``q:JOINT``, and, if they are known, ``v:JOINT``, ``a:JOINT`` and ``tau:JOINT``
    (`dynx.sim.record.csv_file.load_csv`). The other formats contain the model, as URDF text. dynx unpickles
    no array.

    Raises ArgumentError for any other file, NotInstalledError for ``.mcap`` without mcap.
    """
    return kind(**_fields(path, model))


def _fields(path: str | os.PathLike[str], model: Model | None) -> dict[str, Any]:
    suffix = Path(checked_path(path)).suffix.lower()
    if suffix == ".csv":
        if model is None:
            raise ArgumentError(
                f"{shown(path, 300)} does not have its robot: give it as model=, or save the rollout as .npz"
            )
        refuse_other_than_model(model)
        return load_csv(path, model)
    if model is not None:
        raise ArgumentError(f"{shown(path, 300)} has its robot; model= is for .csv files")
    if suffix == ".mcap":
        return load_mcap(path)
    file = read_arrays(path, "a rollout", SCHEMA)
    with _reading("the robot", file):
        robot: dict[str, Any] = parse_json(file.text("robot"))
        model = robot_from_document(robot)
        scenario = None if robot["scenario"] is None else Scenario.from_dict(robot["scenario"])
        executor, departures = str(robot["executor"]), tuple(map(str, robot["departures"]))
    nq, nv = model.nq, model.nv
    around = robot.get("surroundings")
    tau = file.array("tau", (None, nv))
    n = len(tau)
    surroundings = None
    if around is not None:
        with _reading("the record of the scene", file):
            surroundings = from_document(around, file, n)
    reference = None
    if all(entry in file.arrays for entry in REFERENCE):
        q, v, a = REFERENCE
        reference = Setpoint(file.array(q, (n + 1, nq)), *(file.array(each, (n + 1, nv)) for each in (v, a)))
    return {
        "model": model,
        "t": file.array("t", (n + 1,)),
        "q": file.array("q", (n + 1, nq)),
        "v": file.array("v", (n + 1, nv)),
        "a": file.array("a", (n, nv)),
        "tau": tau,
        "saturated": file.array("saturated", (n, nv), bool),
        "rotors": file.array("rotors", (nv, nv)),
        "reference": reference,
        "scenario": scenario,
        "executor": executor,
        "departures": departures,
        "surroundings": surroundings,
    }


@contextmanager
def _reading(part: str, file: ArrayFile) -> Iterator[None]:
    """Turn the errors of a part of the file into ArgumentError."""
    try:
        yield
    # The errors of dynx are among them; the others are those of JSON in another form.
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
        raise ArgumentError(f"{part} in {file.path} cannot be read: {error}") from error


def _write_npz(rollout: Rollout, file: BinaryIO) -> None:
    model = rollout.model
    robot = {
        **robot_document(model),
        "scenario": None if rollout.scenario is None else rollout.scenario.to_dict(),
        "executor": rollout.executor,
        "departures": list(rollout.departures),
    }
    arrays: dict[str, Any] = {name: getattr(rollout, name) for name in ARRAYS}
    if rollout.surroundings is not None:
        robot["surroundings"], of_scene = to_document(rollout.surroundings)
        arrays |= of_scene
    if rollout.reference is not None:
        arrays.update(zip(REFERENCE, rollout.reference, strict=True))
    for name, readings in rollout.sensors.items():
        arrays |= {f"sensor:{name}:t": readings.t}
        arrays |= {f"sensor:{name}:{channel}": rows for channel, rows in readings.channels.items()}
    # Readings and the energy are for programs without dynx; `load` computes them again.
    np.savez(file, schema=SCHEMA, robot=json.dumps(robot), energy=rollout.energy, **arrays)


WRITERS: dict[str, Callable[[Rollout, BinaryIO], None]] = {
    ".npz": _write_npz,
    ".csv": write_csv,
    ".mcap": write_mcap,
}
"""Writers by suffix."""
