"""Accepted differences: those of the rules that the user ignores, and those in baselines, JSON files with
which a check fails only on new ones.

A difference is identified by robot, base, rule, link or joint, and engines; not by its line, nor by its
magnitude. A difference that no rule explains has the rule ``unexplained``, and a quantity instead of a link
or joint. A difference is known if the file names all its engines, so that nothing is new where fewer engines
are installed.
"""

from __future__ import annotations

import math
import os
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import PurePath
from typing import Any

from dynx._version import __version__
from dynx.doctor.report import DoctorReport
from dynx.errors import ArgumentError, shown
from dynx.files.documents import read_document, to_json_values
from dynx.files.reading import read_file
from dynx.model.loading import split_arguments

SCHEMA = 1

UNEXPLAINED = "unexplained"
"""Name in place of a rule for a difference that no rule explains."""


@dataclass(frozen=True)
class Place:
    """Identity of a difference, except for its engines."""

    robot: str
    base: str
    rule: str
    link: str | None = None
    joint: str | None = None
    quantity: str | None = None

    def __str__(self) -> str:
        where = [f"link {shown(self.link)}"] if self.link is not None else []
        where += [f"joint {shown(self.joint)}"] if self.joint is not None else []
        where += [self.quantity.replace("_", " ")] if self.quantity is not None else []
        return f"{self.rule} {', '.join(where)}".strip()


@dataclass(frozen=True)
class KnownDifference(Place):
    """One entry of the JSON document; `relative_error` is null where an engine gives no number."""

    engines: tuple[str, ...] = field(kw_only=True)
    relative_error: float | None = None


@dataclass(frozen=True)
class BaselineDocument:
    """The JSON document that ``dynx doctor --write-baseline`` writes and ``--baseline`` reads."""

    schema: int
    known: tuple[KnownDifference, ...]
    dynx: str = ""
    """Version of dynx that wrote it."""


@dataclass(frozen=True)
class PlacedDifference:
    """A difference with its engines; `relative_error` is shown, and not compared."""

    place: Place
    engines: frozenset[str]
    relative_error: float = field(default=0.0, compare=False)


@dataclass(frozen=True)
class BaselineComparison:
    """Differences of a report that are new, known or of ignored rules, and known ones that have vanished."""

    new: tuple[PlacedDifference, ...]
    known: tuple[PlacedDifference, ...]
    vanished: tuple[PlacedDifference, ...]
    ignored: tuple[PlacedDifference, ...] = ()


@dataclass(frozen=True)
class Baseline:
    """The known differences. Robots given as paths are relative to `folder`, where their file is, so that a
    checkout elsewhere has the same baseline."""

    folder: str = ""
    known: tuple[PlacedDifference, ...] = ()

    def compare(self, report: DoctorReport) -> BaselineComparison:
        """Compare a report. A difference of an engine that did not take part has not vanished."""
        allowed: dict[Place, frozenset[str]] = {}
        for each in self.known:
            allowed[each.place] = allowed.get(each.place, frozenset()) | each.engines
        every = differences(report, self.folder)
        ignored = tuple(each for each in every if each.place.rule in report.ignored)
        found = [each for each in every if each not in ignored]
        new = tuple(each for each in found if not each.engines <= allowed.get(each.place, frozenset()))
        known = tuple(each for each in found if each not in new)
        robot = (robot_key(report, self.folder), report.base or "")
        present = {"dynx", *(each.engine for each in report.engines)}
        gone = allowed.keys() - {each.place for each in every}
        vanished = tuple(
            each
            for each in self.known
            if each.place in gone and (each.place.robot, each.place.base) == robot and each.engines & present
        )
        return BaselineComparison(new, known, vanished, ignored)


def accepted_by(report: DoctorReport, baseline: Baseline | None) -> Baseline | None:
    """Return the baseline, or an empty one where only rules are ignored; None where nothing is accepted."""
    return Baseline() if baseline is None and report.ignored else baseline


def differences(report: DoctorReport, folder: str) -> tuple[PlacedDifference, ...]:
    """Collect the differences of a report: each cause with an effect, and each unexplained difference."""
    robot, base = robot_key(report, folder), report.base or ""
    merged: dict[Place, PlacedDifference] = {}

    def add(place: Place, engines: Iterable[str], error: float) -> None:
        old = merged.get(place, PlacedDifference(place, frozenset()))
        merged[place] = PlacedDifference(place, old.engines | set(engines), max(old.relative_error, error))

    def add_unexplained(engine: str, quantity: str, error: float, joint: str | None = None) -> None:
        add(Place(robot, base, UNEXPLAINED, None, joint, quantity), (engine,), error)

    for finding in report.differences:
        assert finding.effect is not None
        place = Place(robot, base, finding.rule, finding.link, finding.joint)
        add(place, finding.engines, finding.effect.relative_error)
    for each in report.unexplained:
        add_unexplained(each.engine, each.quantity, each.relative_error, each.joint)
    named = {engine for each in merged.values() for engine in each.engines}
    # Every engine that makes the report differ must have an entry.
    for engine in report.engines:
        if engine.engine in named:
            continue
        if engine.no_results is not None:
            add_unexplained(engine.engine, "result" if engine.refused is None else "loading", math.inf)
        for quantity, error in engine.before.items():
            if engine.no_results is None and not error <= report.tolerance:
                add_unexplained(engine.engine, quantity, error)
    if report.refusal is not None and not merged:
        add_unexplained("dynx", "loading", math.inf)
    return tuple(merged.values())


def robot_key(report: DoctorReport, folder: str) -> str:
    """Return the robot's name, or its path from the folder of the baseline, with forward slashes."""
    path = report.robot
    looks_like_path = any(sep in path for sep in (os.sep, "/")) or PurePath(
        split_arguments(path)[0]
    ).suffix in (
        ".urdf",
        ".xacro",
    )
    if not looks_like_path or path.lstrip().startswith("<"):
        return path
    try:
        return PurePath(os.path.relpath(path, folder or ".")).as_posix()
    except ValueError:  # another drive, or a null character
        return path


def baseline_document(reports: Iterable[DoctorReport], folder: str) -> dict[str, Any]:
    """Make the document that accepts all differences of these reports but those of ignored rules."""
    found = [
        each
        for report in reports
        for each in differences(report, folder)
        if each.place.rule not in report.ignored
    ]
    found.sort(key=lambda each: tuple(str(value or "") for value in vars(each.place).values()))
    known = []
    for each in found:
        place = {name: value for name, value in vars(each.place).items() if value is not None}
        known.append({**place, "engines": sorted(each.engines), "relative_error": each.relative_error})
    document: dict[str, Any] = to_json_values({"schema": SCHEMA, "dynx": __version__, "known": known})
    return document


def read_baseline(text: str, path: str) -> Baseline:
    """Read a baseline from the text of a file; ArgumentError names `path` where it is none."""
    where = shown(path, 300)
    try:
        document = read_document(text, BaselineDocument)
    except ArgumentError as error:
        raise ArgumentError(f"{where} is not a baseline: {error}") from None
    if document.schema != SCHEMA:
        raise ArgumentError(
            f"{where} has schema {document.schema}; this version of dynx reads schema {SCHEMA}"
        )
    known = tuple(
        PlacedDifference(
            Place(each.robot, each.base, each.rule, each.link, each.joint, each.quantity),
            frozenset(each.engines),
            math.inf if each.relative_error is None else each.relative_error,
        )
        for each in document.known
    )
    return Baseline(os.path.dirname(path), known)


def load_baseline(path: str) -> Baseline:
    """Read a baseline from a file; RobotNotFoundError without it, ArgumentError where it is none."""
    return read_baseline(read_file(path).decode("utf-8", "replace"), path)
