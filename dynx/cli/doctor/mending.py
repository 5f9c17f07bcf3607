"""Files for mended descriptions: chosen before the work, and never over an input by accident."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import PurePath

from dynx.cli.shell.output_file import check_writable, make_folder, require_apart
from dynx.doctor.report import DoctorReport
from dynx.errors import ArgumentError, shown
from dynx.files.reading import read_file
from dynx.files.writing import write_bytes
from dynx.model.expansion import RobotInput, is_library_name
from dynx.model.xacro_reading import split_arguments
from dynx.model.xml.source import XmlSource


def planned_targets(
    inputs: Sequence[RobotInput], out: str | None, *, in_place: bool, bases: int
) -> list[str | None]:
    """Return the file for each input's mended description, or None."""
    if out is not None and in_place:
        raise ArgumentError("--fix and --in-place exclude each other")
    if (out is not None or in_place) and bases > 1:
        raise ArgumentError("a file is mended for one base; choose --base fixed or --base floating")
    if in_place:
        return [*in_place_targets(inputs)]
    return [None] * len(inputs) if out is None else [*targets(inputs, out)]


def targets(inputs: Sequence[RobotInput], out: str) -> list[str]:
    """Return the file in `out` for each input; ArgumentError where it is an input or not writable.

    A single robot goes to the file `out`, or into it where it is a directory; several go into the
    directory `out`, those found below a directory under the same relative path.
    """
    several = len(inputs) > 1 or any(each.folder is not None for each in inputs)
    if several or os.path.isdir(out) or out.endswith(("/", os.sep)):
        if os.path.lexists(out) and not os.path.isdir(out):
            raise ArgumentError(f"--fix {shown(out, 300)} is a file; several robots need a directory")
        paths = [os.path.join(out, _name(each)) for each in inputs]
    else:
        paths = [out]
        check_writable(out)
    taken: dict[str, str] = {}
    for path, each in zip(paths, inputs, strict=True):
        other = taken.setdefault(os.path.normcase(path), each.robot)
        if other != each.robot:
            both = f"{shown(other, 200)} and {shown(each.robot, 200)}"
            raise ArgumentError(f"{both} would both be written to {shown(path, 300)}")
    try:
        require_apart(paths, (each.robot for each in inputs), "the file that is read")
    except ArgumentError as error:
        raise ArgumentError(f"--fix: {error}; --in-place overwrites it") from None
    return paths


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


def require_other_file(path: str, read: str) -> None:
    """Raise ArgumentError where `path` is the file that was read."""
    try:
        same = os.path.samefile(path, read)
    except (OSError, ValueError):  # one of them is not there
        same = False
    if same:
        raise ArgumentError(f"--fix {shown(path, 300)} is the file that is read; --in-place overwrites it")


def write_mended(path: str, report: DoctorReport, *, over_input: bool) -> bool:
    """Write the mended description of a report; return False where there is none.

    A description that needs no change is written as it was read, unless it is the input. Encoding,
    byte-order mark and line ends are preserved. Raises ArgumentError for an input that changed meanwhile.
    """
    text = report.mended
    if text is None and not over_input:
        text = report.text
    if text is None or report.error is not None:
        return False
    if not over_input and report.source is not None:
        require_other_file(path, report.source)
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


def _name(each: RobotInput) -> str:
    if each.folder is not None:
        return os.path.relpath(each.robot, each.folder)
    name = PurePath(split_arguments(each.robot)[0]).name
    stem = name.removesuffix(".xacro").removesuffix(".urdf")
    return f"{stem or 'robot'}.urdf"
