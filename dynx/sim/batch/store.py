"""Folder of finished parts, from which a run that was killed continues.

The file of a part is named by the hash of its scenario and its inputs. A file is on the disk before it gets
its name; one that is damaged or incomplete counts as absent, and its part is computed again.
"""

from __future__ import annotations

import os
import pickle
import warnings
from hashlib import sha256
from pathlib import Path

from dynx.errors import ArgumentError, shown
from dynx.files.arrays import read_arrays, write_arrays
from dynx.files.reading import checked_path
from dynx.files.writing import clear_unfinished
from dynx.sim.batch.part import Part, PartOutcome
from dynx.sim.scenario.scenario import Scenario


class Store:
    """Folder of outcomes; runs with different arguments may share it."""

    def __init__(self, folder: str | os.PathLike[str], scenario: Scenario) -> None:
        """Raises ArgumentError if the folder cannot be made or written."""
        self._folder = Path(checked_path(folder))
        self._scenario = scenario.with_defaults().to_json()
        self._failures: list[ArgumentError] = []
        try:
            self._folder.mkdir(parents=True, exist_ok=True)
        except (OSError, ValueError) as error:
            raise ArgumentError(f"keep is {shown(folder)}, where no folder can be made: {error}") from error
        if not os.access(self._folder, os.W_OK | os.X_OK):
            raise ArgumentError(f"keep is {shown(folder)}, a folder that may not be written")
        clear_unfinished(self._folder)

    def read(self, part: Part) -> PartOutcome | None:
        """Return the outcome of a part, or None if it is not stored, incomplete or damaged."""
        count, nq, nv = part.count, part.start["q"].shape[1], part.start["v"].shape[1]
        kept = part.clock.n_steps // part.record_every if part.record_every else 0
        shapes: dict[str, tuple[int, ...]] = {"q": (count, nq), "diverged": (count,)}
        shapes |= dict.fromkeys(("v", "max_error", "rms_error", "saturated"), (count, nv))
        shapes |= {"q_record": (count, kept, nq)}
        shapes |= dict.fromkeys(("v_record", "tau_record"), (count, kept, nv))
        try:
            file = read_arrays(self._path(part), "a part of a batch")
            return PartOutcome(**{name: file.array(name, shape) for name, shape in shapes.items()})
        except ArgumentError:
            return None

    def write(self, part: Part, outcome: PartOutcome) -> None:
        """Store the outcome on the disk. Where it cannot be written, that is noted, because the outcome is
        still valid."""
        try:
            write_arrays(self._path(part), outcome._asdict())
        except ArgumentError as error:
            self._failures.append(error)

    def warn_of_failures(self) -> None:
        """Warn if outcomes could not be written, with the first reason."""
        if self._failures:
            message = (
                f"{len(self._failures)} parts of the batch could not be stored; a run that is started again "
                f"computes them again: {self._failures[0]}"
            )
            warnings.warn(message, RuntimeWarning, stacklevel=3)

    def _path(self, part: Part) -> Path:
        digest = sha256(self._scenario.encode())
        # The key has what a kernel computes and not its machine code, which differs between processors.
        arrays = (part.start, part.fixed, tuple(part.setpoints), part.references, part.wrenches, part.noise)
        code = [(which, kernel.image) for which, kernel in sorted(part.kernels.items())]
        digest.update(pickle.dumps((part.record_every, arrays, code), protocol=4))
        return self._folder / f"{digest.hexdigest()[:32]}.npz"
