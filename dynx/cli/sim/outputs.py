"""Files that ``dynx sim`` writes, checked before the simulation."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass
from importlib.util import find_spec

from dynx.cli.shell.exits import failure_of
from dynx.cli.shell.output_file import check_writable
from dynx.errors import ArgumentError, DynxError, NotInstalledError, shown
from dynx.files.figures import picture_format
from dynx.sim import Rollout
from dynx.sim.record.formats import WRITERS


@dataclass(frozen=True)
class Outputs:
    """Files for the record, each in the format of its suffix, and for the plot (None for none)."""

    save: tuple[str, ...] = ()
    plot: str | None = None

    @property
    def files(self) -> list[str]:
        """All files."""
        return [*self.save, *([] if self.plot is None else [self.plot])]

    def check(self) -> None:
        """Raise ArgumentError for a file that cannot be written or has an unknown format.

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

    def write(self, rollout: Rollout) -> dict[str, DynxError]:
        """Write all files; return the errors of those that cannot be written, by path."""
        calls: list[tuple[str, Callable[[str], object]]] = [(path, rollout.save) for path in self.save]
        if self.plot is not None:
            calls.append((self.plot, rollout.plot))
        errors = {path: failure_of(call, path) for path, call in calls}
        return {path: error for path, error in errors.items() if error is not None}


def check_record(path: str) -> None:
    """Raise ArgumentError for a name without the suffix of a record format.

    NotInstalledError where the format needs a package that is missing.
    """
    suffix = os.path.splitext(path)[1].lower()
    if suffix not in WRITERS:
        raise ArgumentError(
            f"--save {shown(path, 300)} has no suffix of a record format; wanted one of {', '.join(WRITERS)}"
        )
    if suffix == ".mcap" and find_spec("mcap") is None:
        raise NotInstalledError("--save with .mcap needs mcap: pip install 'dynx[mcap]'")
