"""Folder of finished parts, from which a run that was killed continues.

The file of a part is named by the hash of its scenario and its inputs. Files are written atomically.
"""

from __future__ import annotations

import os
import pickle
import zipfile
from hashlib import sha256
from pathlib import Path

import numpy as np

from dynx.errors import ArgumentError, shown
from dynx.files.reading import checked_path
from dynx.files.writing import atomic_file
from dynx.sim.batch.part import Part, PartOutcome
from dynx.sim.scenario.scenario import Scenario


class Store:
    """Folder of outcomes; runs with different arguments may share it."""

    def __init__(self, folder: str | os.PathLike[str], scenario: Scenario) -> None:
        """Raises ArgumentError if the folder cannot be made."""
        self._folder = Path(checked_path(folder))
        self._scenario = scenario.with_defaults().to_json()
        try:
            self._folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise ArgumentError(f"keep is {shown(folder)}, where no folder can be made: {error}") from error

    def read(self, part: Part) -> PartOutcome | None:
        """Return the outcome of a part, or None if it is not stored or incomplete."""
        try:
            with np.load(self._path(part), allow_pickle=False) as file:
                return PartOutcome(*(file[name] for name in PartOutcome._fields))
        except (OSError, ValueError, KeyError, zipfile.BadZipFile):
            return None

    def write(self, part: Part, outcome: PartOutcome) -> None:
        """Store the outcome. Raises ArgumentError if it cannot be written."""
        with atomic_file(self._path(part)) as file:
            np.savez(file, **outcome._asdict())

    def _path(self, part: Part) -> Path:
        digest = sha256(self._scenario.encode())
        # The key has what a kernel computes and not its machine code, which differs between processors.
        arrays = (part.start, part.fixed, tuple(part.setpoints), part.references, part.wrenches, part.noise)
        code = [(which, kernel.image) for which, kernel in sorted(part.kernels.items())]
        digest.update(pickle.dumps((part.record_every, arrays, code), protocol=4))
        return self._folder / f"{digest.hexdigest()[:32]}.npz"
