"""The files that ``dynx sim`` writes: refused before the simulation rather than after it."""

from __future__ import annotations

import os
from dataclasses import dataclass
from importlib.util import find_spec

from dynx.cli.shell.output_file import check_writable
from dynx.errors import ArgumentError, NotInstalledError, shown
from dynx.files.figures import picture_format
from dynx.sim import Rollout
from dynx.sim.record.formats import WRITERS


@dataclass(frozen=True)
class Outputs:
    """Where the record goes, in the format that each name ends with, and the picture (None for none)."""

    save: tuple[str, ...] = ()
    plot: str | None = None

    @property
    def files(self) -> list[str]:
        """All of them."""
        return [*self.save, *([] if self.plot is None else [self.plot])]

    def check(self) -> None:
        """Raise ArgumentError for a file that plainly cannot be written.

        NotInstalledError where a format needs a package that is missing.
        """
        for path in self.save:
            check_record(path)
        for path in self.files:
            check_writable(path)
            if self.files.count(path) > 1:
                raise ArgumentError(f"{shown(path, 300)} would be written twice")
        if self.plot is not None:
            picture_format(self.plot)

    def write(self, rollout: Rollout) -> None:
        """Write all of them. Raises ArgumentError where the system does not let it."""
        for path in self.save:
            rollout.save(path)
        if self.plot is not None:
            rollout.plot(self.plot)


def check_record(path: str) -> None:
    """Raise ArgumentError for a name that ends with no format of records.

    NotInstalledError where the format needs a package that is missing.
    """
    suffix = os.path.splitext(path)[1].lower()
    if suffix not in WRITERS:
        raise ArgumentError(
            f"--save {shown(path, 300)} ends with no format; wanted one of {', '.join(WRITERS)}"
        )
    if suffix == ".mcap" and find_spec("mcap") is None:
        raise NotInstalledError("--save with .mcap needs mcap: pip install 'dynx[mcap]'")
