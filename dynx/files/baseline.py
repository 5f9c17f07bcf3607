"""Accepted differences of robots in JSON files, with which a check fails only on new ones.

A difference is identified by robot, base, rule, link or joint, and engines; not by its line, nor by its
magnitude. A difference that no rule explains has the rule ``unexplained``, and a quantity instead of a link
or joint; one of two descriptions has the description `other` with which the robot is compared. A difference
is known if the file names it and all its engines, so that nothing is new where fewer engines are installed.
"""

from __future__ import annotations

import math
import os
from collections.abc import Collection, Iterable
from dataclasses import dataclass, field
from pathlib import PurePath
from typing import Any, TypeVar

from dynx._version import __version__
from dynx.errors import ArgumentError, shown
from dynx.files.documents import read_document, to_json_values
from dynx.files.reading import read_file

SCHEMA = 1

SUFFIXES = (".urdf", ".xacro", ".xml", ".mjcf", ".sdf", ".world")
"""Endings of the files of robots."""


@dataclass(frozen=True)
class Place:
    """Identity of a difference, except for its engines."""

    robot: str
    base: str
    rule: str
    link: str | None = None
    joint: str | None = None
    quantity: str | None = None
    other: str | None = None

    def __str__(self) -> str:
        where = [f"link {shown(self.link)}"] if self.link is not None else []
        where += [f"joint {shown(self.joint)}"] if self.joint is not None else []
        where += [self.quantity.replace("_", " ")] if self.quantity is not None else []
        return f"{self.rule} {', '.join(where)}".strip()


@dataclass(frozen=True)
class KnownDifference(Place):
    """One entry of the JSON document; `relative_error` is null where it is not a number."""

    engines: tuple[str, ...] = field(kw_only=True, default=())
    relative_error: float | None = None


@dataclass(frozen=True)
class BaselineDocument:
    """The JSON document that ``--write-baseline`` writes and ``--baseline`` reads."""

    schema: int
    known: tuple[KnownDifference, ...]
    dynx: str = ""
    """Version of dynx that wrote it."""


@dataclass(frozen=True)
class PlacedDifference:
    """A difference with its engines; `relative_error` is shown, and not compared."""

    place: Place
    engines: frozenset[str] = frozenset()
    relative_error: float = field(default=0.0, compare=False)

    def __str__(self) -> str:
        return f"{self.place} ({', '.join(sorted(self.engines))})" if self.engines else str(self.place)


@dataclass(frozen=True)
class BaselineComparison:
    """Differences of a report that are new, known or of ignored rules, and known ones that have vanished."""

    new: tuple[PlacedDifference, ...]
    known: tuple[PlacedDifference, ...]
    vanished: tuple[PlacedDifference, ...]
    ignored: tuple[PlacedDifference, ...] = ()


Kind = TypeVar("Kind", bound="KnownDifferences")


@dataclass(frozen=True)
class KnownDifferences:
    """The known differences. Robots given as paths are relative to `folder`, where their file is, so that a
    checkout elsewhere has the same baseline."""

    folder: str = ""
    known: tuple[PlacedDifference, ...] = ()

    def compare_differences(
        self,
        found: Iterable[PlacedDifference],
        subject: tuple[str, str, str | None],
        engines: Collection[str] | None = None,
        ignored: Collection[str] = (),
    ) -> BaselineComparison:
        """Compare the differences of a report on robot, base and other description, the `subject`.

        A difference of an engine that is not among `engines` has not vanished. `ignored` are rules.
        """
        allowed: dict[Place, frozenset[str]] = {}
        for each in self.known:
            allowed[each.place] = allowed.get(each.place, frozenset()) | each.engines
        every = list(found)
        new: list[PlacedDifference] = []
        known: list[PlacedDifference] = []
        left_out: list[PlacedDifference] = []
        for each in every:
            accepted = each.place in allowed and each.engines <= allowed[each.place]
            (left_out if each.place.rule in ignored else known if accepted else new).append(each)
        gone = allowed.keys() - {each.place for each in every}
        vanished = tuple(
            each
            for each in self.known
            if each.place in gone
            and (each.place.robot, each.place.base, each.place.other) == subject
            and (engines is None or each.engines & set(engines))
        )
        return BaselineComparison(tuple(new), tuple(known), vanished, tuple(left_out))

    @classmethod
    def read(cls: type[Kind], text: str, path: str) -> Kind:
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
                Place(each.robot, each.base, each.rule, each.link, each.joint, each.quantity, each.other),
                frozenset(each.engines),
                math.inf if each.relative_error is None else each.relative_error,
            )
            for each in document.known
        )
        return cls(os.path.dirname(path), known)

    @classmethod
    def load(cls: type[Kind], path: str) -> Kind:
        """Read a baseline from a file; RobotNotFoundError without it, ArgumentError where it is none."""
        return cls.read(read_file(path).decode("utf-8", "replace"), path)


def document_of_differences(found: Iterable[PlacedDifference]) -> dict[str, Any]:
    """Make the document that accepts these differences."""
    known = []
    for each in sorted(found, key=lambda each: [str(value or "") for value in vars(each.place).values()]):
        place = {name: value for name, value in vars(each.place).items() if value is not None}
        engines = {"engines": sorted(each.engines)} if each.engines else {}
        known.append({**place, **engines, "relative_error": each.relative_error})
    document: dict[str, Any] = to_json_values({"schema": SCHEMA, "dynx": __version__, "known": known})
    return document


def relative_key(robot: str, file: str, folder: str) -> str:
    """Return the name of a robot, or its path from the folder of the baseline, with forward slashes.

    `file` is its path without arguments of xacro.
    """
    looks_like_path = any(sep in robot for sep in (os.sep, "/")) or PurePath(file).suffix in SUFFIXES
    if not looks_like_path or robot.lstrip().startswith("<"):
        return robot
    try:
        return PurePath(os.path.relpath(robot, folder or ".")).as_posix()
    except ValueError:  # another drive, or a null character
        return robot
