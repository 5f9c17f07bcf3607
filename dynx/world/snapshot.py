"""Saved states of a world or of a simulation; those of a world also in files.

A file begins with `MAGIC`, then the SHA-256 of all that follows, the length of the header (8 bytes, least
significant first), the header in JSON and the engine's own bytes. Everything is checked before the engine
sees a byte, because engines end the process on a damaged state.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from typing import TYPE_CHECKING, Any

import numpy as np

from dynx.argument_types import checks_types
from dynx.errors import ArgumentError, shown
from dynx.files.arrays import WORLD_FILE
from dynx.files.documents import parse_json
from dynx.files.reading import checked_path, open_regular, printable, require_size
from dynx.files.writing import write_bytes
from dynx.spatial.scalar import Floats

if TYPE_CHECKING:
    from dynx.world.sensors.sensor import Sensor

MAGIC = WORLD_FILE + b"1\n"
SUFFIX = ".world"
_OTHER_SUFFIXES: dict[tuple[str, ...], str] = {
    (".toml", ".json"): "; dynx.world.write_scene writes a scene to .toml and .json",
    (".npz", ".mcap", ".csv"): "; Rollout.save writes the record of a simulation to .npz, .mcap and .csv",
    (".html", ".png", ".gif", ".mp4"): "; World.view(...).export writes pages and pictures to .html and .png",
}
MAX_STATE = 1 << 28
"""Largest file that is read [bytes]; a world of a thousand bodies takes under 2 MiB."""


@dataclass(frozen=True, eq=False)
class Snapshot:
    """State of a world or of a simulation at one time: everything that determines its later steps."""

    engine: str
    """Name of the engine; for a simulation, the name of its plant."""
    version: str
    """Version of the engine; empty for a simulation without a world."""
    identity: str
    """Hash of what later steps depend on besides the state: of a world its scene, step and settings, of a
    simulation its coordinates, base and step."""
    time: float
    """Time [s]."""
    start: float
    """Time [s] at which `steps` was 0."""
    steps: int
    arrays: Mapping[str, Floats]
    """Numbers that are kept between steps outside the engine, by name. Of a world: velocity and generalised
    force (2, nv) of the step before, by the robots whose motors depend on it. Of a simulation: ``q``, ``v``
    and the torque ``tau`` of the last control step."""
    data: bytes
    """State of the engine, in the engine's own format; empty for an engine that keeps none."""
    record: Any = None
    """What a simulation recorded until then, and the state of its controller; None for a world."""
    torques: Mapping[str, Floats] = field(default_factory=dict)
    """Torque (nv,) of each robot of a world in the step before (`WorldState.torques`), on which no later step
    depends; empty in files of earlier versions."""
    samples: Mapping[Sensor | str, Floats] = field(default_factory=dict)
    """Held and delayed samples (k, 1 + size) of each sensor of a world: time, then values. No later step
    depends on them. Their keys are names if they were read from a file. Empty in files of earlier
    versions."""
    rollout: int = 0
    """Number of the rollout of a world (`World.rollout`)."""
    constraints: tuple[Floats | None, ...] = ()
    """Pose (4, 4) of the first anchor of each constraint in its owner, None for one that is not active; empty
    where none was switched since the start."""

    def _content(self) -> tuple[Any, ...]:
        arrays = tuple((name, x.shape, x.tobytes()) for name, x in self.arrays.items())
        constraints = tuple(None if each is None else each.tobytes() for each in self.constraints)
        state = self.time, self.start, self.steps, arrays, self.data, constraints
        return self.engine, self.version, self.identity, *state

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Snapshot):
            return NotImplemented
        return self._content() == other._content() and self.record is other.record

    def __hash__(self) -> int:
        return hash(self._content())

    def __setstate__(self, state: dict[str, Any]) -> None:
        if state.keys() != {each.name for each in fields(self)}:
            raise ArgumentError(
                "the snapshot was pickled by another version of dynx; World.write writes files that later "
                "versions read"
            )
        vars(self).update(state)

    def __repr__(self) -> str:
        what = "world" if self.record is None else "simulation"
        return f"<Snapshot of a {self.engine} {what} at {self.time:.6g} s, {len(self.data)} bytes>"

    @checks_types
    def require(self, engine: str, version: str, identity: str) -> None:
        """Raise ArgumentError unless it is one of a world with the same engine, scene and options."""
        for what, own, other in (
            ("the engine", self.engine, engine),
            ("the version of the engine", self.version, version),
        ):
            if own != other:
                raise ArgumentError(
                    f"{what} of the snapshot is {shown(own)}, that of this world {shown(other)}; "
                    "only the same one continues it exactly"
                )
        if self.identity != identity:
            raise ArgumentError(
                "the snapshot belongs to another scene, step or setting; restore it in a world of the same"
            )


def check_world_suffix(path: str | os.PathLike[str]) -> None:
    """Raise ArgumentError for a file whose suffix belongs to another kind of file than a world's."""
    name = printable(checked_path(path))
    suffix = os.path.splitext(name)[1].lower()
    if suffix in ("", SUFFIX):
        return
    other = next((use for suffixes, use in _OTHER_SUFFIXES.items() if suffix in suffixes), "")
    raise ArgumentError(
        f"{name}: a world with its state is written to {SUFFIX} or to a file without a suffix, which "
        f"World.read reads{other}"
    )


def write_snapshot(path: str | os.PathLike[str], snapshot: Snapshot, world: dict[str, Any]) -> None:
    """Write a snapshot, and the document of its world, to a file (see the module)."""
    check_world_suffix(path)
    header = {
        "world": world,
        "engine": snapshot.engine,
        "version": snapshot.version,
        "identity": snapshot.identity,
        "steps": snapshot.steps,
        "start": snapshot.start.hex(),
        "time": snapshot.time.hex(),
        "memory": [
            [[x.hex() for x in row] for row in snapshot.arrays[name].tolist()]
            if name in snapshot.arrays
            else None
            for name in _robots(world)
        ],
        "torques": [[x.hex() for x in snapshot.torques[name].tolist()] for name in _robots(world)],
        "rollout": snapshot.rollout,
        "constraints": [
            None if each is None else [x.hex() for x in each.ravel().tolist()]
            for each in snapshot.constraints
        ],
        "samples": {
            each if isinstance(each, str) else each.name: [[x.hex() for x in row] for row in rows.tolist()]
            for each, rows in snapshot.samples.items()
        },
    }
    text = json.dumps(header, ensure_ascii=True, allow_nan=False).encode("ascii")
    content = len(text).to_bytes(8, "little") + text + snapshot.data
    write_bytes(path, MAGIC + hashlib.sha256(content).digest() + content)


def read_snapshot(path: str | os.PathLike[str]) -> tuple[Snapshot, dict[str, Any]]:
    """Return the snapshot of a file, and the document of its world.

    Raises ArgumentError for a file that cannot be read, is not one of `write_snapshot`, or was damaged.
    """
    name = printable(checked_path(path))
    try:
        with open_regular(path) as file:
            data = file.read(require_size(file, MAX_STATE))
    except OSError as error:
        raise ArgumentError(f"{name} cannot be read: {error.strerror or error}") from None
    except ValueError as error:
        raise ArgumentError(f"{name} cannot be read as a world: {error}") from None
    start = len(MAGIC) + hashlib.sha256().digest_size
    if not data.startswith(MAGIC):
        raise ArgumentError(f"{name} is no file that World.write wrote{_other_kind(data, name)}")
    content = data[start:]
    if hashlib.sha256(content).digest() != data[len(MAGIC) : start]:
        raise ArgumentError(f"{name} is damaged: its content does not match its checksum")
    length = int.from_bytes(content[:8], "little")
    try:
        if length > len(content) - 8:
            raise ValueError(f"its header is announced with {length} bytes")
        header = parse_json(content[8 : 8 + length])
        world = _world(header["world"])
        return _snapshot(header, _robots(world), content[8 + length :]), world
    # The header of a file that was not written by dynx may have any form.
    except (ValueError, KeyError, TypeError, AttributeError, OverflowError, RecursionError) as error:
        raise ArgumentError(f"{name} cannot be read as a world: {error}") from error


def _other_kind(data: bytes, name: str) -> str:
    """Return what a file is that `write_snapshot` did not write, for a message."""
    if data.startswith(WORLD_FILE):
        return " in this version of dynx"
    if data.startswith(b"PK"):
        return "; a record of a simulation is read by dynx.Rollout.load"
    if name.lower().endswith((".toml", ".json")):
        return "; a scene is read by dynx.world.read_scene"
    return ""


def _snapshot(header: dict[str, Any], robots: Sequence[str], data: bytes) -> Snapshot:
    arrays = {
        name: np.array([[float.fromhex(x) for x in row] for row in rows])
        for name, rows in zip(robots, header["memory"], strict=True)
        if rows is not None
    }
    # Files of earlier versions have no torques.
    torques = {
        name: np.array([float.fromhex(x) for x in row])
        for name, row in zip(robots, header.get("torques") or [()] * len(robots), strict=True)
        if row
    }
    # Nor samples.
    samples: dict[Sensor | str, Floats] = {
        str(name): np.array([[float.fromhex(x) for x in row] for row in rows])
        for name, rows in dict(header.get("samples") or {}).items()
        if rows
    }
    constraints = tuple(
        None if each is None else np.array([float.fromhex(x) for x in each]).reshape(4, 4)
        for each in header.get("constraints") or ()
    )
    engine, version, identity = (str(header[name]) for name in ("engine", "version", "identity"))
    time, start = (float.fromhex(header[name]) for name in ("time", "start"))
    steps = int(header["steps"])
    return Snapshot(
        engine,
        version,
        identity,
        time,
        start,
        steps,
        arrays,
        data,
        torques=torques,
        samples=samples,
        rollout=int(header.get("rollout", 0)),
        constraints=constraints,
    )


def _robots(world: Mapping[str, Any]) -> list[str]:
    """Return the names of the robots in the document of a world, in order."""
    return [each["name"] for each in world["scene"].get("robots") or ()]


def _world(given: dict[str, Any]) -> dict[str, Any]:
    """Check the form of the document of a world."""
    forms = {"scene": dict, "engine": str, "options": dict, "settings": dict}
    for name, form in forms.items():
        if not isinstance(given[name], form):
            raise TypeError(f"{name} is {shown(given[name])}")
    if given["options"].keys() & given["settings"].keys():
        raise ValueError("options and settings have the same names")
    return given
