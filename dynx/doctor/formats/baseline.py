"""Differences that are known and accepted: a JSON file that makes a check fail on new ones only.

    {"schema": 1, "dynx": version, "known": [{robot, base, rule, link, joint, engines, relative_error}]}

A difference is known by robot, base, rule, link or joint, and engines; not by its line, nor by its size.
What has no rule has the rule ``unexplained``, and the quantity stands in its place. A difference is
known where the file names all its engines, so that fewer engines at hand make nothing new.
"""

from __future__ import annotations

import json
import os
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import PurePath
from typing import Any

from dynx._version import __version__
from dynx.doctor.report import DoctorReport
from dynx.errors import ArgumentError, shown

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
    known = [each for report in reports for each in differences(report, folder)]
    known.sort(key=lambda each: tuple(str(value or "") for value in vars(each.place).values()))
    return {
        "schema": SCHEMA,
        "dynx": __version__,
        "known": [
            {
                **{name: value for name, value in vars(each.place).items() if value is not None},
                "engines": sorted(each.engines),
                "relative_error": each.relative_error if each.relative_error < float("inf") else None,
            }
            for each in known
        ],
    }


def read_baseline(text: str, path: str) -> Baseline:
    """The baseline in a file's text; ArgumentError, naming `path`, where it is none."""
    where = shown(path, 300)
    try:
        document = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise ArgumentError(f"{where} is no baseline: {error}") from None
    if not isinstance(document, dict) or not isinstance(document.get("known"), list):
        raise ArgumentError(f"{where} is no baseline: wanted an object with a list 'known'")
    if document.get("schema") != SCHEMA:
        got = shown(document.get("schema"))
        raise ArgumentError(f"{where} has schema {got}; this version of dynx reads schema {SCHEMA}")
    return Baseline(os.path.dirname(path), tuple(_known(each, where) for each in document["known"]))


def _known(entry: Any, where: str) -> Difference:
    names = ("robot", "base", "rule", "link", "joint", "quantity")
    if not isinstance(entry, dict):
        raise ArgumentError(f"{where}: wanted an object in 'known', got {shown(entry)}")
    values = {name: entry.get(name) for name in names}
    engines = entry.get("engines")
    texts = all(value is None or isinstance(value, str) for value in values.values())
    if not texts or not isinstance(engines, list) or any(values[name] is None for name in names[:3]):
        raise ArgumentError(
            f"{where}: an entry of 'known' needs robot, base, rule and a list of engines, got {shown(entry)}"
        )
    robot, base, rule = (str(values[name]) for name in names[:3])
    place = Place(robot, base, rule, values["link"], values["joint"], values["quantity"])
    return Difference(place, frozenset(map(str, engines)))
