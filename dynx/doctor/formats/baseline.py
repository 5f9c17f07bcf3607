"""Differences that are known and accepted: a JSON file that makes a check fail on new ones only.

    {"schema": 1, "dynx": version, "known": [{robot, base, rule, link, joint, engines, relative_error}]}

A difference is known by robot, base, rule, link or joint, and engines; not by its line, nor by its size.
What has no rule has the rule ``unexplained``, and the quantity stands in its place. A difference is
known where the file names all its engines, so that fewer engines at hand make nothing new.
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

SCHEMA = 1

UNEXPLAINED = "unexplained"
"""In the place of a rule, for a difference that no rule accounts for."""


@dataclass(frozen=True)
class Place:
    """Where a difference is known: everything about it but the engines."""

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
class Difference:
    """A difference as a baseline knows it; `relative_error` is told, and not compared."""

    place: Place
    engines: frozenset[str]
    relative_error: float = field(default=0.0, compare=False)


@dataclass(frozen=True)
class Comparison:
    """A report against a baseline: what is new, what was known, and what was known and is gone."""

    new: tuple[Difference, ...]
    known: tuple[Difference, ...]
    vanished: tuple[Difference, ...]


@dataclass(frozen=True)
class Baseline:
    """The known differences; `folder` is where their file lies, to which robots given as paths are
    relative, so that a checkout elsewhere has the same baseline."""

    folder: str
    known: tuple[Difference, ...] = ()

    def compare(self, report: DoctorReport) -> Comparison:
        """What of a report is new. A difference of an engine that did not take part is not gone."""
        allowed: dict[Place, frozenset[str]] = {}
        for each in self.known:
            allowed[each.place] = allowed.get(each.place, frozenset()) | each.engines
        found = differences(report, self.folder)
        new = tuple(each for each in found if not each.engines <= allowed.get(each.place, frozenset()))
        known = tuple(each for each in found if each not in new)
        return Comparison(new, known, self._vanished(report, {each.place for each in found}))

    def _vanished(self, report: DoctorReport, found: set[Place]) -> tuple[Difference, ...]:
        if report.error is not None:
            return ()
        key = (robot_key(report, self.folder), report.base or "")
        present = {each.engine for each in report.engines}
        return tuple(
            each
            for each in self.known
            if (each.place.robot, each.place.base) == key
            and each.engines & present
            and each.place not in found
        )


def differences(report: DoctorReport, folder: str) -> tuple[Difference, ...]:
    """What makes a report one of differing engines: each cause with an effect, and what has none."""
    robot, base = robot_key(report, folder), report.base or ""
    merged: dict[Place, Difference] = {}

    def add(place: Place, engines: Iterable[str], size: float) -> None:
        old = merged.get(place, Difference(place, frozenset()))
        merged[place] = Difference(place, old.engines | set(engines), max(old.relative_error, size))

    for finding in report.differences:
        assert finding.effect is not None
        place = Place(robot, base, finding.rule, finding.link, finding.joint)
        add(place, finding.engines, finding.effect.relative_error)
    for each in report.unexplained:
        place = Place(robot, base, UNEXPLAINED, None, each.joint, each.quantity)
        add(place, (each.engine,), each.relative_error)
    named = {engine for each in merged.values() for engine in each.engines}
    for engine in report.engines:
        # Nothing that makes the report say "differ" may be missing here.
        far = {key: error for key, error in engine.before.items() if not error <= report.tolerance}
        if engine.engine not in named and engine.refused is not None:
            add(Place(robot, base, UNEXPLAINED, None, None, "loading"), (engine.engine,), float("inf"))
        elif engine.engine not in named:
            for key, error in far.items():
                add(Place(robot, base, UNEXPLAINED, None, None, key), (engine.engine,), error)
    return tuple(merged.values())


def robot_key(report: DoctorReport, folder: str) -> str:
    """The robot's name, or its path from the folder of the baseline, with forward slashes."""
    path = report.robot
    looks_like_path = any(sep in path for sep in (os.sep, "/")) or PurePath(path).suffix in (
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
    """The document in which everything that differs in these reports is known."""
    found = [each for report in reports for each in differences(report, folder)]
    found.sort(key=lambda each: tuple(str(value or "") for value in vars(each.place).values()))
    known = []
    for each in found:
        place = {name: value for name, value in vars(each.place).items() if value is not None}
        known.append({**place, "engines": sorted(each.engines), "relative_error": each.relative_error})
    document: dict[str, Any] = to_json_values({"schema": SCHEMA, "dynx": __version__, "known": known})
    return document


def read_baseline(text: str, path: str) -> Baseline:
    """The baseline in a file's text; ArgumentError, naming `path`, where it is none."""
    where = shown(path, 300)
    try:
        document = read_document(text, BaselineDocument)
    except ArgumentError as error:
        raise ArgumentError(f"{where} is no baseline: {error}") from None
    if document.schema != SCHEMA:
        raise ArgumentError(
            f"{where} has schema {document.schema}; this version of dynx reads schema {SCHEMA}"
        )
    known = tuple(
        Difference(
            Place(each.robot, each.base, each.rule, each.link, each.joint, each.quantity),
            frozenset(each.engines),
            math.inf if each.relative_error is None else each.relative_error,
        )
        for each in document.known
    )
    return Baseline(os.path.dirname(path), known)


def load_baseline(path: str) -> Baseline:
    """Read the baseline in a file; ArgumentError where it is none, or RobotNotFoundError without one."""
    return read_baseline(read_file(path).decode("utf-8", "replace"), path)
