"""Files that `dynx doctor` writes."""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass

import click

from dynx.cli.shell.exits import failure_of
from dynx.cli.shell.output_file import check_writable, make_folder, require_apart
from dynx.cli.shell.terminal import echo_json
from dynx.doctor.formats import (
    baseline_document,
    github_annotations,
    html_page,
    junit_xml,
    sarif_document,
    wording,
)
from dynx.doctor.formats.baseline import Baseline
from dynx.doctor.report import Counterexample, DoctorReport, Unexplained, results_document
from dynx.errors import ArgumentError, DynxError, shown
from dynx.files.documents import json_text
from dynx.files.writing import write_text

STDOUT = "-"


@dataclass(frozen=True)
class ReportFiles:
    """The file of each format, or None; JSON can go to `STDOUT`."""

    json: str | None = None
    html: str | None = None
    junit: str | None = None
    sarif: str | None = None
    baseline: str | None = None
    github: bool = False
    """Whether standard output has the findings as annotations of GitHub Actions, too."""

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

    def keep_apart(self, read: Iterable[str], mended: Iterable[str | None], baseline: str | None) -> None:
        """Raise ArgumentError for a path that is also a robot, a mended file, or the baseline.

        Only a new baseline can replace the baseline that was read, which accepts all new differences.
        """
        paths = [
            path for path in (self.json, self.html, self.junit, self.sarif) if path not in (None, STDOUT)
        ]
        known = [] if baseline is None else [baseline]
        every = paths if self.baseline is None else [*paths, self.baseline]
        require_apart(every, read, "a robot that is read")
        require_apart(paths, known, "the baseline")
        targets = {os.path.realpath(path) for path in mended if path is not None}
        for path in every:
            if os.path.realpath(path) in targets:
                raise ArgumentError(f"{shown(path, 300)} is also the file of a mended description")

    @property
    def on_stdout(self) -> bool:
        """True if standard output carries JSON, so that tables go elsewhere."""
        return self.json == STDOUT

    def write(
        self,
        reports: Sequence[DoctorReport],
        not_done: Sequence[str],
        left_out: Sequence[str] = (),
        baseline: Baseline | None = None,
        command: str | None = None,
    ) -> list[DynxError]:
        """Write all files; return the errors of those that cannot be written.

        `not_done` and `left_out` are the robots without a report: of an interrupted run, and those in xacro
        below a directory. `command` is the command line that the HTML page shows.
        """
        texts: dict[str | None, Callable[[], str]] = {
            None if self.on_stdout else self.json: lambda: (
                json_text(results_document(reports, not_done, left_out)) + "\n"
            ),
            self.html: lambda: html_page(reports, command=command, baseline=baseline, left_out=left_out),
            self.junit: lambda: junit_xml(reports, baseline, left_out),
            self.sarif: lambda: json_text(sarif_document(reports, baseline, not_done, left_out)) + "\n",
            self.baseline: lambda: self._baseline_text(reports),
        }

        def write(path: str) -> None:
            write_text(path, texts[path]())

        errors = [failure_of(write, path) for path in texts if path is not None]
        return [error for error in errors if error is not None]

    def echo(
        self,
        reports: Sequence[DoctorReport],
        not_done: Sequence[str],
        left_out: Sequence[str] = (),
        baseline: Baseline | None = None,
    ) -> None:
        """Write annotations and the JSON document to standard output where they go there."""
        if self.github:
            for line in github_annotations(sarif_document(reports, baseline)):
                click.echo(line)
        if self.on_stdout:
            echo_json(results_document(reports, not_done, left_out))

    def _baseline_text(self, reports: Sequence[DoctorReport]) -> str:
        return json_text(baseline_document(reports, os.path.dirname(self.baseline or ""))) + "\n"


def save_counterexamples(folder: str, report: DoctorReport) -> Mapping[int, str]:
    """Write the counterexamples of a report into a directory; return their files by number."""
    saved: dict[int, str] = {}
    written: dict[str, str] = {}
    for number, each in enumerate(report.unexplained):
        found = each.counterexample
        if found is None:
            continue
        if found.urdf not in written:
            stem = os.path.basename(report.robot).removesuffix(".urdf")
            name = _file_name(f"{stem}-{report.base}-{each.engine}-{each.quantity}")
            path = os.path.normpath(os.path.join(folder, f"{name}.counterexample.urdf"))
            make_folder(path)
            write_text(path, _with_state(found, each))
            written[found.urdf] = path
        saved[number] = written[found.urdf]
    return saved


def _with_state(found: Counterexample, each: Unexplained) -> str:
    """Return the URDF in ASCII, followed by a comment with the state at which the difference occurs."""
    lines = [
        f"{symbol} = {list(values)}" for symbol, values in (("q", found.q), ("v", found.v), ("a", found.a))
    ]
    what = wording.difference(each.quantity, found.relative_error)
    clean = re.sub(r"[^\w %+.-]|--+", "_", f"{each.engine}: {what}", flags=re.ASCII)
    comment = "\n".join([f"{clean} at", *lines])
    text = re.sub(r"""encoding\s*=\s*("[^"]*"|'[^']*')""", 'encoding="UTF-8"', found.urdf, count=1)
    return f"{text.rstrip()}\n<!-- {comment} -->\n".encode("ascii", "xmlcharrefreplace").decode("ascii")


def _file_name(text: str) -> str:
    return re.sub(r"[^A-Za-z0-9._-]+", "_", text)[:100].lstrip(".-") or "robot"
