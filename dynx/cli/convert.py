"""Body of ``dynx convert``: robots written in another format."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path, PurePath
from typing import Any, Literal, TypedDict

import click

from dynx.cli.shell.exits import DONE, NEGATIVE_RESULT, complain, one_line, remark
from dynx.cli.shell.inputs import load_robot
from dynx.cli.shell.output import (
    check_json,
    check_writable,
    console,
    counted,
    is_quiet,
    require_apart,
    write_json,
)
from dynx.errors import ArgumentError, nearest, shown
from dynx.files.links import refuse_links
from dynx.model.conversion import (
    Conversion,
    holds,
    without_collision_faults,
    without_shapes,
)
from dynx.model.conversion import convert as convert_model
from dynx.model.document_format import SUFFIXES, Format
from dynx.model.geometry import Mesh
from dynx.model.loading import split_arguments
from dynx.model.model import Model
from dynx.same import same_robot


class ConvertDocument(TypedDict):
    """A robot written in another format; `text` is the document where it is in no file, `source_notes` what
    was not read of the robot, `notes` what the format cannot say, `differences` the reasons why nothing is
    written, `shape_differences` the shapes that the document lacks."""

    schema: Literal["dynx.convert/1"]
    robot: str
    source: str
    format: Format
    same: bool
    written: list[str]
    text: str | None
    source_notes: list[str]
    notes: list[str]
    differences: list[str]
    shape_differences: list[str]


def convert(
    to: Format | None,
    out: str | None,
    overwrite: bool,
    json_path: str | None,
    **robot: Any,
) -> int:
    """Write a robot in another format; return the exit code."""
    target = _format(to, out)
    check_json(json_path)
    model = load_robot(**robot)
    if out is not None:
        check_writable(out)
        require_apart([out], [split_arguments(robot["robot"])[0], model.source, *_asset_files(model)], _KEPT)
    found = _certified(model, convert_model(model, target, "robot" if out is None else PurePath(out).stem))
    _keep_json_apart(json_path, out, found, model)
    written: list[str] = []
    if out is not None and not found.differences:
        _check_free(out, found, model, overwrite=overwrite)
        written = found.write(out)
    document: ConvertDocument = {
        "schema": "dynx.convert/1",
        "robot": model.name,
        "source": model.source,
        "format": target,
        "same": not found.differences,
        "written": written,
        "text": _plain_text(model, target) if out is None and not found.differences else None,
        "source_notes": list(dict.fromkeys(map(str, model.notes))),
        "notes": list(found.notes),
        "differences": list(found.differences),
        "shape_differences": list(found.shape_differences),
    }
    if not write_json(document, json_path):
        _show(document, out)
    return NEGATIVE_RESULT if found.differences else DONE


_KEPT = "a file that is read"


def _certified(model: Model, found: Conversion) -> Conversion:
    """Return a conversion with what differs in some state as differences, if no part differs by itself."""
    if found.robot is None or found.differences:
        return found
    report = same_robot(without_shapes(model), found.robot)
    missing = [each.message for each in report.unmatched]
    differences = (*missing, *(each.message for each in report.differences))
    return found if report.same else replace(found, differences=differences)


def _format(to: Format | None, out: str | None) -> Format:
    """Return the format of the document: that of ``--to``, else that of the suffix of the output file."""
    if out is None:
        if to is None:
            raise ArgumentError(
                "--to is missing; wanted mjcf, sdf or urdf, or an output file in .xml, .sdf or .urdf"
            )
        return to
    suffix = PurePath(out).suffix.lower()
    by_suffix = {each: name for name, suffixes in SUFFIXES.items() for each in suffixes}
    if suffix not in by_suffix:
        wanted = ", ".join(SUFFIXES[to] if to is not None else by_suffix)
        raise ArgumentError(f"--out {shown(out, 300)}: wanted a file in {wanted}{nearest(suffix, by_suffix)}")
    if to is not None and by_suffix[suffix] != to:
        raise ArgumentError(
            f"--out {shown(out, 300)} has the suffix of {by_suffix[suffix]}, and --to is {to}; wanted "
            f"{' or '.join(SUFFIXES[to])}"
        )
    return by_suffix[suffix]


def _asset_files(model: Model) -> list[str]:
    links = model.geometry.links.values()
    shapes = [each.shape for link in links for each in link.visuals]
    shapes += [each.shape for link in links for each in link.collisions]
    return [shape.file for shape in shapes if isinstance(shape, Mesh) and shape.file]


def _keep_json_apart(json_path: str | None, out: str | None, found: Conversion, model: Model) -> None:
    """Raise ArgumentError for a file of ``--json`` that is read, or is one of those that are written."""
    if json_path is None or json_path == "-":
        return
    require_apart([json_path], [model.source, *_asset_files(model)], _KEPT)
    targets = {os.path.realpath(path) for path in _paths(out, found)}
    if os.path.realpath(json_path) in targets:
        raise ArgumentError(f"--json {shown(json_path, 300)} is also a file of --out; wanted another file")


def _paths(out: str | None, found: Conversion) -> list[str]:
    """Return the paths of the document and of its files; none where it is printed."""
    return [] if out is None else [out, *(str(Path(out).parent / name) for name in found.files)]


def _check_free(out: str, found: Conversion, model: Model, *, overwrite: bool) -> None:
    """Raise ArgumentError for files that exist, and for those of the robot even with ``--overwrite``.

    Meshes and images that exist with the same content are left as they are.
    """
    refuse_links(Path(out).parent, found.files)
    equal = {
        path
        for path, content in zip(_paths(out, found)[1:], found.files.values(), strict=True)
        if holds(path, content)
    }
    paths = [path for path in _paths(out, found) if path not in equal]
    require_apart(paths, [model.source, *_asset_files(model)], _KEPT)
    existing = [path for path in paths if os.path.lexists(path)]
    if existing and not overwrite:
        raise ArgumentError(f"{shown(existing[0], 300)} exists already; --overwrite replaces it")


def _plain_text(model: Model, to: Format) -> str:
    if to == "urdf":
        return without_collision_faults(model).to_urdf(geometry=True)
    return model.to_mjcf() if to == "mjcf" else model.to_sdf()


def _show(document: ConvertDocument, out: str | None) -> None:
    source = PurePath(document["source"]).name
    if not is_quiet():
        for note in document["source_notes"]:
            remark(f"{source}, {note}")
        for note in (*document["notes"], *document["shape_differences"]):
            remark(note)
    for difference in document["differences"]:
        complain(f"not written, because {difference}")
    if document["text"] is not None and not is_quiet():
        click.echo(document["text"], nl=False)
    if document["written"]:
        files = len(document["written"]) - 1
        more = f" and {counted(files, 'file')} of meshes and images" if files else ""
        console().print(f"{one_line(out)} is written{more}; {_result(document, one_line(source))}")


def _result(document: ConvertDocument, source: str) -> str:
    """Return a clause on what the document, read back, is, and on what it is without."""
    notes, shapes = len(document["source_notes"]), document["shape_differences"]
    differ = "" if not shapes else ", but for shapes that are named above"
    if not notes:
        return f"read back, it is the same robot{differ}"
    return (
        f"read back, it is the same robot as dynx loads from {source}{differ}; "
        f"{counted(notes, 'note')} on reading {source} above"
    )
