"""Run of ``dynx same``: both descriptions compared, with the mended file, reports and exit code."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Callable, Sequence
from itertools import takewhile
from pathlib import PurePath
from typing import TYPE_CHECKING

import click
from rich.console import Console

from dynx.cli.shell.exits import exit_code, failure_of, one_line, short_line
from dynx.cli.shell.output import (
    Entry,
    check_writable,
    command_line,
    console,
    echo_json,
    require_apart,
)
from dynx.cli.shell.reports import OutputFiles, show_comparison
from dynx.cli.shell.tables import MAX_ROWS, Table, print_rest
from dynx.errors import ArgumentError, shown
from dynx.files.documents import json_text
from dynx.files.writing import write_bytes
from dynx.model.document_format import SUFFIXES, format_of_root
from dynx.model.loading import read_description, split_arguments
from dynx.model.tree import Base
from dynx.model.xml.source import XmlSource
from dynx.same import SameReport, same_robot
from dynx.same.comparison import TOLERANCE

if TYPE_CHECKING:
    from dynx.same.formats.baseline import SameBaseline

MAX_CELL = 40
"""Largest number of characters of a value in a table; ``--json`` has all of it."""

MAX_MESSAGE = 60
"""Largest number of characters of a message in a table."""


def same(
    first: str,
    second: str,
    base: Base | None,
    tolerance: float | None,
    fix: str | None,
    json_path: str | None,
    html: str | None,
    junit: str | None,
    sarif: str | None,
    github: bool,
    baseline_path: str | None,
    write_baseline: str | None,
) -> int:
    """Compare two descriptions; return the exit code."""
    outputs = OutputFiles(json_path, html, junit, sarif, write_baseline, github)
    outputs.check()
    if fix is not None:
        check_writable(fix)
        if json_path is not None and os.path.realpath(json_path) == os.path.realpath(fix):
            raise ArgumentError(f"--json {shown(json_path, 300)} is also that of --fix; wanted another file")
    if fix is not None or outputs.paths:
        read = _files_read(first, second)
        outputs.keep_apart(read, [fix], baseline_path, "a file that is read")
        if fix is not None:
            require_apart([fix], read, "a file that is read")
            _check_suffix(fix, second)
    known = None if baseline_path is None else _load_baseline(baseline_path)
    report = same_robot(first, second, base=base, tolerance=TOLERANCE if tolerance is None else tolerance)
    written = [] if fix is None else [failure_of(_write_mended, report, fix)]
    document = report.to_dict()
    if fix is not None and report.mended_text is not None and not written[0]:
        document["mended_file"] = fix
    written += outputs.write_texts(_texts(outputs, report, known, first, second, document))
    if github:
        _echo_annotations(report, known)
    if outputs.on_stdout:
        echo_json(document)
    else:
        out = console()
        show(out, document)
        if fix is not None and report.same and report.mended_text is None:
            kept = " (other differences are not mended)" if report.attributes else ""
            out.print(f"nothing to mend{kept}: {one_line(fix)} is not written")
        if document["mended_file"] is not None:
            out.print(f"mended file: {one_line(document['mended_file'])}")
        if known is not None:
            who = f"{one_line(report.first)} and {one_line(report.second)}"
            show_comparison(out, who, known.compare(report))
    accepted = write_baseline is not None if known is None else not known.compare(report).new
    return exit_code(*written, negative=not (report.same or accepted))


def _load_baseline(path: str) -> SameBaseline:
    from dynx.same.formats.baseline import SameBaseline

    return SameBaseline.load(path)


def _echo_annotations(report: SameReport, known: SameBaseline | None) -> None:
    from dynx.files.annotations import github_annotations
    from dynx.same.formats.sarif import sarif_document

    for line in github_annotations(sarif_document(report, known)):
        click.echo(line)


def _texts(
    outputs: OutputFiles,
    report: SameReport,
    known: SameBaseline | None,
    first: str,
    second: str,
    document: Entry,
) -> dict[str | None, Callable[[], str]]:
    """Return what makes the text of each file. A format is imported where it is written."""

    def page() -> str:
        from dynx.same.formats.html import description_text, html_page

        texts = description_text(first), description_text(second)
        return html_page(report, texts=texts, command=command_line(), baseline=known)

    def tests() -> str:
        from dynx.same.formats.junit import junit_xml

        return junit_xml(report, known)

    def results() -> str:
        from dynx.same.formats.sarif import sarif_document

        return json_text(sarif_document(report, known)) + "\n"

    def accepted() -> str:
        from dynx.same.formats.baseline import baseline_document

        return json_text(baseline_document(report, os.path.dirname(outputs.baseline or ""))) + "\n"

    return {
        outputs.json: lambda: json_text(document) + "\n",
        outputs.html: page,
        outputs.junit: tests,
        outputs.sarif: results,
        outputs.baseline: accepted,
    }


def _files_read(first: str, second: str) -> list[str]:
    """Return the files of both robots, and those that they include."""
    read: list[str] = []
    for robot in (first, second):
        data, source, _ = read_description(robot)
        root = XmlSource(data, source).root
        folder = os.path.dirname(source)
        included = [each.attributes.get("file", "") for each in root.walk() if each.tag == "include"]
        read += [split_arguments(robot)[0], source, *(os.path.join(folder, name) for name in included)]
    return read


def _check_suffix(path: str, second: str) -> None:
    """Raise ArgumentError for a file that has the suffix of another format than the second robot."""
    data, source, _ = read_description(second)
    format_ = format_of_root(XmlSource(data, source).root.tag)
    wanted = SUFFIXES[format_]
    if PurePath(path).suffix.lower() not in wanted:
        raise ArgumentError(
            f"--fix {shown(path, 300)}: {one_line(second)} is {format_.upper()}, and so is the mended file; "
            f"wanted a file in {' or '.join(wanted)}"
        )


def _write_mended(report: SameReport, path: str) -> None:
    """Write the mended file; there is none where nothing that can be mended differs."""
    if report.mended_text is None and report.same:
        return
    if report.mended_text is None:
        raise ArgumentError(f"{shown(path, 300)} is not written: {report.not_mended}")
    write_bytes(path, report.mended_text)


def show(out: Console, report: Entry) -> None:
    """Print the verdict, the elements that differ, the other differences and the allowed differences."""
    names = f"{one_line(report['first'])} and {one_line(report['second'])}"
    out.print(f"{names}: {report['verdict']}", style="bold")
    for note in report["notes"]:
        out.print(f"note: {one_line(note)}", style="yellow")
    _show_differences(out, report)
    for each in report["unmatched"]:
        out.print(f"{_places(each)}{one_line(each['message'])}", style="red")
    if report["not_mended"] is not None:
        out.print(f"not mended: {one_line(report['not_mended'])}", style="yellow")
    _show_attributes(out, report["attributes"])
    _show_freedoms(out, report["freedoms"])
    _show_coordinates(out, report["coordinates"])
    if report["bounds"] is not None:
        size = report["bounds"]
        out.print(
            f"bounds over all states within limits at |v|, |a| <= 1: {_size(size['position'])} m, "
            f"{_size(size['rotation'])} rad, mass matrix {_size(size['mass_matrix'])}, "
            f"torque {_size(size['torque'])}"
        )


def _show_differences(out: Console, report: Entry) -> None:
    differences: Sequence[Entry] = report["differences"]
    if not differences:
        return
    numbers = ("line A", "line B", "size", "moves [m]", "mass matrix", "torque")
    table = Table("element of B", *numbers, "difference", right=numbers, keys=1)
    for each in differences[:MAX_ROWS]:
        effect = each["effect"] or {}
        table.add_row(
            one_line(f"{each['tag']} {each['theirs']}, {each['part']}"),
            _line(each, "first"),
            _line(each, "second"),
            _size(each["size"]),
            *(_size(effect.get(name)) for name in ("position", "mass_matrix", "torque")),
            _cell(each["message"], MAX_MESSAGE),
        )
    out.print("\nelements of B that make it the same robot when replaced by those of A")
    out.print(table)
    print_rest(out, len(differences) - MAX_ROWS)
    for each in differences[:MAX_ROWS]:
        out.print(
            f"{one_line(each['theirs'])}, {each['part']}: {short_line(each['first'])} in A, "
            f"{short_line(each['second'])} in B; wanted in B: {short_line(each['wanted'])}"
        )


def _show_attributes(out: Console, attributes: Sequence[Entry]) -> None:
    """Print one line for each kind, with the first of its differences."""
    if not attributes:
        return
    table = Table("other differences", "count", "first", "in A", "in B", right=("count",), keys=1)
    counts = Counter(each["kind"] for each in attributes)
    for kind, count in counts.items():
        each = next(each for each in attributes if each["kind"] == kind)
        table.add_row(
            kind,
            str(count),
            f"{one_line(each['theirs'] or each['ours'])}{_lines(each)}",
            *_cells(each["first"], each["second"]),
        )
    out.print("")
    out.print(table)
    effects = [(each, effect) for each in attributes for effect in each["effects"] if effect["size"]]
    for each, effect in effects[:MAX_ROWS]:
        name = one_line(each["theirs"])
        size = f"{_size(effect['size'])} {effect['unit']}"
        out.print(f"{each['kind']} {name}: {effect['quantity']} changes by up to {size}")
    print_rest(out, len(effects) - MAX_ROWS)


def _show_freedoms(out: Console, freedoms: Sequence[Entry]) -> None:
    if not freedoms:
        return
    out.print("\nallowed differences")
    for each in freedoms[:MAX_ROWS]:
        out.print(f"  {one_line(each['message'])}")
    print_rest(out, len(freedoms) - MAX_ROWS)


def _show_coordinates(out: Console, coordinates: Sequence[Entry]) -> None:
    """Print how coordinates correspond, where they do not one by one."""
    rows = [
        each
        for each in coordinates
        if each["sign"] < 0 or each["first_index"] != each["second_index"] or each["ours"] != each["theirs"]
    ]
    if not rows:
        return
    table = Table("q of A", "joint of A", "q of B", "joint of B", "sign", right=("q of A", "q of B", "sign"))
    for each in rows[:MAX_ROWS]:
        table.add_row(
            str(each["first_index"]),
            one_line(each["ours"]),
            str(each["second_index"]),
            one_line(each["theirs"]),
            "-" if each["sign"] < 0 else "+",
        )
    out.print("\ncoordinates that correspond otherwise than by number and name")
    out.print(table)
    print_rest(out, len(rows) - MAX_ROWS)


def _cell(text: str, length: int = MAX_CELL) -> str:
    """Make one line of at most `length` characters: a cell can list a hundred meshes."""
    line = one_line(text)
    return line if len(line) <= length else f"{line[: length - 4].rstrip(' ,')} ..."


def _cells(first: str, second: str) -> tuple[str, str]:
    """Make cells of two values that differ; where their beginnings are equal, these are left out."""
    cells = _cell(first), _cell(second)
    if cells[0] == cells[1] and first != second:
        equal = sum(1 for _ in takewhile(lambda pair: pair[0] == pair[1], zip(first, second, strict=False)))
        start = first.rfind(" ", 0, equal) + 1
        return _cell(f"... {first[start:]}"), _cell(f"... {second[start:]}")
    return cells


def _places(each: Entry) -> str:
    lines = [
        f"line {each[f'{key}_line']} of {each[f'{key}_file'] or name}"
        for key, name in (("first", "A"), ("second", "B"))
        if each[f"{key}_line"] is not None
    ]
    return f"{', '.join(lines)}: " if lines else ""


def _lines(each: Entry) -> str:
    lines = [_line(each, key) for key in ("first", "second")]
    return f" ({lines[0] or '-'}, {lines[1] or '-'})" if any(lines) else ""


def _line(each: Entry, which: str) -> str:
    """Write a line, with the name of its file if another file includes that."""
    line, file = each[f"{which}_line"], each[f"{which}_file"]
    if line is None:
        return ""
    return str(line) if file is None else f"{one_line(PurePath(file).name)}:{line}"


def _size(value: float | None) -> str:
    return "-" if value is None else "0" if value == 0.0 else f"{value:.2g}"
