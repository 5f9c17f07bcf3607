"""Saved states of a world, in memory and in files.

A file begins with `MAGIC`, then the SHA-256 of all that follows, the length of the header (8 bytes, least
significant first), the header in JSON and the engine's own bytes. Everything is checked before the engine
sees a byte, because engines end the process on a damaged state.
"""

from __future__ import annotations

import hashlib
import json
import os
from dataclasses import dataclass
from typing import Any

from dynx.errors import ArgumentError, shown
from dynx.files.writing import write_bytes

MAGIC = b"dynx world 1\n"
MAX_BYTES = 1 << 30
"""Largest file that is read."""

Memory = tuple[tuple[tuple[float, ...], tuple[float, ...]] | None, ...]
"""What each robot's motors keep from one step to the next (see `RobotLoads.memory`)."""


@dataclass(frozen=True)
class Snapshot:
    """The state of a world at one time: everything that determines its later steps."""

    engine: str
    version: str
    """Version of the engine."""
    identity: str
    """Hash of the scene, the step and the settings of the world."""
    steps: int
    time: float
    """Time [s]."""
    memory: Memory
    data: bytes
    """State of the engine, in the engine's own format."""

    def __repr__(self) -> str:
        return f"<Snapshot of a {self.engine} world at {self.time:.6g} s, {len(self.data)} bytes>"

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


def write_snapshot(path: str | os.PathLike[str], snapshot: Snapshot, world: dict[str, Any]) -> None:
    """Write a snapshot, and the document of its world, to a file (see the module)."""
    header = {
        "world": world,
        "engine": snapshot.engine,
        "version": snapshot.version,
        "identity": snapshot.identity,
        "steps": snapshot.steps,
        "time": snapshot.time.hex(),
        "memory": [
            None if pair is None else [[x.hex() for x in numbers] for numbers in pair]
            for pair in snapshot.memory
        ],
    }
    text = json.dumps(header, ensure_ascii=True, allow_nan=False).encode("ascii")
    content = len(text).to_bytes(8, "little") + text + snapshot.data
    write_bytes(path, MAGIC + hashlib.sha256(content).digest() + content)


def read_snapshot(path: str | os.PathLike[str], data: bytes) -> tuple[Snapshot, dict[str, Any]]:
    """Return the snapshot in the content of a file, and the document of its world.

    Raises ArgumentError for a file that is not one, or that was damaged or cut.
    """
    name = shown(os.fspath(path), 300)
    start = len(MAGIC) + 32
    if not data.startswith(MAGIC):
        raise ArgumentError(f"{name} is no file that World.write wrote, or is of another version of it")
    content = data[start:]
    if hashlib.sha256(content).digest() != data[len(MAGIC) : start]:
        raise ArgumentError(f"{name} is damaged: its content does not match its checksum")
    length = int.from_bytes(content[:8], "little")
    header = json.loads(content[8 : 8 + length])
    memory = tuple(
        None if pair is None else tuple(tuple(map(float.fromhex, numbers)) for numbers in pair)
        for pair in header["memory"]
    )
    snapshot = Snapshot(
        header["engine"],
        header["version"],
        header["identity"],
        header["steps"],
        float.fromhex(header["time"]),
        memory,  # type: ignore[arg-type]
        content[8 + length :],
    )
    return snapshot, header["world"]
