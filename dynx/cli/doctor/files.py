"""Files of ``dynx doctor``: reports, counterexamples, mended descriptions; none replaces an input unasked."""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import count
from pathlib import PurePath

import click

from dynx.cli.shell.output import check_writable, echo_json, make_folder, require_apart
from dynx.cli.shell.reports import OutputFiles
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
from dynx.files.links import refuse_links
from dynx.files.reading import read_file
from dynx.files.writing import write_bytes, write_text
from dynx.model.expansion import RobotInput, is_library_name
from dynx.model.loading import split_arguments
from dynx.model.tree import Base
from dynx.model.xml.source import XmlSource


@dataclass(frozen=True)
class ReportFiles(OutputFiles):
    """Files of the reports of ``dynx doctor``."""

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
            self.json: lambda: json_text(results_document(reports, not_done, left_out)) + "\n",
            self.html: lambda: html_page(reports, command=command, baseline=baseline, left_out=left_out),
            self.junit: lambda: junit_xml(reports, baseline, left_out),
            self.sarif: lambda: json_text(sarif_document(reports, baseline, not_done, left_out)) + "\n",
            self.baseline: lambda: self._baseline_text(reports),
        }

        return self.write_texts(texts)

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


MAX_STEM = 60
"""Largest number of characters of a robot's name in the name of a file."""


def save_counterexamples(
    folder: str, report: DoctorReport, taken: set[str] | None = None
) -> Mapping[int, str]:
    """Write the counterexamples of a report into a directory; return their files by index in
    `report.unexplained`.

    `taken` are the files that other reports of the run have written; the new ones are added to it.
    """
    taken = set() if taken is None else taken
    saved: dict[int, str] = {}
    written: dict[str, str] = {}
    for number, each in enumerate(report.unexplained):
        found = each.counterexample
        if found is None:
            continue
        if found.urdf not in written:
            stem = os.path.basename(report.robot).removesuffix(".urdf")
            ending = _file_name(f"{report.base}-{each.engine}-{each.quantity}")
            path = _free_path(folder, f"{_file_name(stem, MAX_STEM)}-{ending}", taken)
            refuse_links(os.path.dirname(path), [os.path.basename(path)])
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


def _free_path(folder: str, name: str, taken: set[str]) -> str:
    """Return the path of a counterexample, numbered if it is `taken`, and add it to these."""
    for number in count(1):
        ending = "" if number == 1 else f"-{number}"
        path = os.path.normpath(os.path.join(folder, f"{name}{ending}.counterexample.urdf"))
        if os.path.normcase(path) not in taken:
            taken.add(os.path.normcase(path))
            return path
    raise AssertionError


def _file_name(text: str, size: int = 100) -> str:
    """Return a text with characters that every file system takes, `size` of them at most."""
    return re.sub(r"[^A-Za-z0-9._-]+", "_", text)[:size].lstrip(".-") or "robot"


def planned_targets(
    inputs: Sequence[RobotInput], out: str | None, *, in_place: bool, bases: Sequence[Base | None]
) -> list[str | None]:
    """Return the file for the mended description of each input on each base, or None."""
    if out is not None and in_place:
        raise ArgumentError("--fix and --in-place exclude each other")
    if in_place and len(bases) > 1:
        raise ArgumentError("--in-place mends a file for one base; choose --base fixed or --base floating")
    if in_place:
        return [*in_place_targets(inputs)]
    if out is None:
        return [None] * (len(inputs) * len(bases))
    return [*targets(inputs, out, bases)]


def targets(inputs: Sequence[RobotInput], out: str, bases: Sequence[Base | None] = ("fixed",)) -> list[str]:
    """Return the file in `out` for each input on each base; ArgumentError where it is an input or not
    writable.

    A single robot goes to the file `out`, or into it where it is a directory; several go into the
    directory `out`, those found below a directory under the same relative path. Inputs of the same name go
    into folders named as theirs. With several bases the name of a file ends in that of the base.
    """
    several = len(inputs) > 1 or any(each.folder is not None for each in inputs)
    if several or os.path.isdir(out) or out.endswith(("/", os.sep)):
        if os.path.lexists(out) and not os.path.isdir(out):
            raise ArgumentError(f"--fix {shown(out, 300)} is a file; several robots need a directory")
        names = _distinct_names(inputs)
        refuse_links(out, names)
        paths = [os.path.join(out, name) for name in names]
    else:
        paths = [out]
        check_writable(out)
    taken: dict[str, str] = {}
    for path, each in zip(paths, inputs, strict=True):
        other = taken.setdefault(os.path.normcase(path), each.robot)
        if other != each.robot:
            both = f"{shown(other, 200)} and {shown(each.robot, 200)}"
            raise ArgumentError(f"{both} would both be written to {shown(path, 300)}")
    read = [each.robot for each in inputs]
    require_other_files(paths, read)
    if len(bases) == 1:
        return paths
    ends = map(os.path.splitext, paths)
    found = [f"{stem}-{base}{suffix}" for stem, suffix in ends for base in bases]
    for path in found:
        refuse_links(os.path.dirname(path), [os.path.basename(path)])
    require_other_files(found, read)
    return found


def in_place_targets(inputs: Sequence[RobotInput]) -> list[str]:
    """Return the inputs as the files to write; ArgumentError for an input that is no file of the user."""
    for each in inputs:
        if split_arguments(each.robot)[0].endswith(".xacro"):
            raise ArgumentError(
                f"{shown(each.robot, 200)} is xacro source; --fix writes the URDF that it expands to"
            )
        if each.refusal is None and (not os.path.isfile(each.robot) or is_library_name(each.robot)):
            raise ArgumentError(
                f"--in-place needs files, and {shown(each.robot, 200)} is none (--fix writes a new one)"
            )
        if each.refusal is None:
            check_writable(each.robot)
    return [each.robot for each in inputs]


def require_other_files(paths: Sequence[str], read: Sequence[str]) -> None:
    """Raise ArgumentError where one of the `paths` of --fix is a file that is read."""
    try:
        require_apart(paths, read, "the file that is read")
    except ArgumentError as error:
        raise ArgumentError(f"--fix: {error}; --in-place overwrites it") from None


def write_mended(path: str, report: DoctorReport, *, over_input: bool) -> bool:
    """Write the mended description of a report; return False where there is none.

    A description that needs no change is written as it was read, unless it is the input. Encoding,
    byte-order mark and line ends are preserved. Raises ArgumentError for an input that changed meanwhile, and
    for a robot that its remedies would make another one.
    """
    if report.withheld is not None:
        raise ArgumentError(f"{shown(path, 300)} is not written: {report.withheld}")
    text = report.mended
    if text is None and not over_input:
        text = report.text
    if text is None or report.error is not None:
        return False
    if not over_input and report.source is not None:
        require_other_files([path], [report.source])
    if over_input:
        _require_unchanged(path, report)
    make_folder(path)
    write_bytes(path, (report.form or XmlSource(text, path).form).encode(text))
    return True


def _require_unchanged(path: str, report: DoctorReport) -> None:
    if XmlSource(read_file(path), path).text != report.text:
        raise ArgumentError(
            f"{shown(path, 300)} was changed by another program during the examination and is not overwritten"
        )


def _distinct_names(inputs: Sequence[RobotInput]) -> list[str]:
    """Return the path of each input in the output directory; robots of the same name keep as many of the
    folders above them as tell them apart."""
    names = [_name(each) for each in inputs]
    folders = [PurePath(os.path.realpath(split_arguments(each.robot)[0])).parent.parts for each in inputs]
    depth = 0
    while (twice := {k for k, name in enumerate(names) if names.count(name) > 1}) and depth < max(
        map(len, folders)
    ):
        depth += 1
        for k in twice:
            if inputs[k].folder is None:
                names[k] = os.path.join(*folders[k][-depth:], _name(inputs[k])).lstrip(os.sep)
    return names


def _name(each: RobotInput) -> str:
    if each.folder is not None:
        return os.path.relpath(each.robot, each.folder)
    name = PurePath(split_arguments(each.robot)[0]).name
    if PurePath(name).suffix in (".xml", ".mjcf", ".sdf", ".world"):
        return name
    stem = name.removesuffix(".xacro").removesuffix(".urdf")
    return f"{stem or 'robot'}.urdf"
