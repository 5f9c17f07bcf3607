"""Files of the reports of ``dynx doctor`` and ``dynx same``, and how a baseline is shown."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass

from rich.console import Console

from dynx.cli.shell.exits import failure_of
from dynx.cli.shell.output import check_writable, require_apart
from dynx.errors import ArgumentError, DynxError, shown
from dynx.files.baseline import BaselineComparison
from dynx.files.writing import write_text

STDOUT = "-"


MAX_DIFFERENCES = 6
"""Number of differences listed for each robot against a baseline."""


@dataclass(frozen=True)
class OutputFiles:
    """The file of each format, or None; JSON can go to `STDOUT`."""

    json: str | None = None
    html: str | None = None
    junit: str | None = None
    sarif: str | None = None
    baseline: str | None = None
    github: bool = False
    """True if the command also prints the findings as annotations of GitHub Actions."""

    def check(self) -> None:
        """Raise ArgumentError for a path that cannot be written, or that is given twice."""
        if self.github and self.on_stdout:
            raise ArgumentError("--github and --json - both write to standard output; give --json a file")
        paths = [path for path in vars(self).values() if isinstance(path, str)]
        for path in paths:
            if path != STDOUT or path is not self.json:
                check_writable(path)
            if paths.count(path) > 1:
                raise ArgumentError(f"two formats would be written to {path!r}")

    @property
    def paths(self) -> list[str]:
        """All files, without standard output."""
        found = (self.json, self.html, self.junit, self.sarif, self.baseline)
        return [path for path in found if path is not None and path != STDOUT]

    def keep_apart(
        self,
        read: Iterable[str],
        mended: Iterable[str | None],
        baseline: str | None,
        what: str = "a robot that is read",
    ) -> None:
        """Raise ArgumentError for a path that is also among the files `read`, a mended file, or the baseline.

        Only a new baseline can replace the baseline that was read, which accepts all new differences. `what`
        describes the files that are read.
        """
        every, known = self.paths, [] if baseline is None else [baseline]
        paths = [path for path in every if path is not self.baseline]
        require_apart(every, read, what)
        require_apart(paths, known, "the baseline")
        targets = {os.path.realpath(path) for path in mended if path is not None}
        for path in every:
            if os.path.realpath(path) in targets:
                raise ArgumentError(f"{shown(path, 300)} is also the file of a mended description")

    @property
    def on_stdout(self) -> bool:
        """True if standard output carries JSON, so that tables go elsewhere."""
        return self.json == STDOUT

    def write_texts(self, texts: Mapping[str | None, Callable[[], str]]) -> list[DynxError]:
        """Write the text of each file but standard output; return the errors of those that cannot be
        written."""

        def write(path: str) -> None:
            write_text(path, texts[path]())

        written = [path for path in texts if path is not None and path != STDOUT]
        errors = [failure_of(write, path) for path in written]
        return [error for error in errors if error is not None]


def show_comparison(out: Console, who: str, found: BaselineComparison) -> None:
    """Print how a report compares with a baseline."""
    if found.known or found.new or found.vanished:
        out.print(
            f"{who}: {len(found.known)} known, {len(found.new)} new, {len(found.vanished)} gone",
            style="bold red" if found.new else "bold",
        )
    for word, style, group in (("new", "red", found.new), ("gone", "green", found.vanished)):
        for each in group[:MAX_DIFFERENCES]:
            out.print(f"  {word}: {each}", style=style)
        if len(group) > MAX_DIFFERENCES:
            out.print(f"  {word}: and {len(group) - MAX_DIFFERENCES} more", style=style)
