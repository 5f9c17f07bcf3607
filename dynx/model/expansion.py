"""Expansion of ROBOT arguments (names, files, directories and ``all``) into single robots."""

from __future__ import annotations

import os
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from dynx.errors import DynxError, ModelError, RobotNotFoundError, shown
from dynx.files.reading import read_file
from dynx.model.library import EXAMPLE_ROBOT_DATA, find, robots
from dynx.model.xml.reading import Element, read_xml

_SHOWN_FILES = 5
"""Largest number of files that `left_out_note` names."""

_DEFINITIONS = frozenset({"arg", "include", "insert_block", "macro", "property"})
"""Elements of xacro that add no link by themselves; other elements of its namespace call a macro or
branch."""

_FIND = re.compile(r"^\$\(find [^)]*\)[/\\]*")


def xacro_robots(paths: Iterable[str]) -> list[str]:
    """Return those of the xacro files that describe a robot, in the order given.

    A robot is a ``<robot>`` with links, joints or calls of macros that no other of the files includes. A file
    that cannot be read as XML counts as a robot: nothing shows that it is none.
    """
    roots = {path: _root(path) for path in paths}
    included = {
        os.path.realpath(other)
        for path, root in roots.items()
        if root is not None
        for name in _included(root)
        for other in _targets(path, name, roots)
    }
    return [
        path
        for path, root in roots.items()
        if root is None or (_builds_robot(root) and os.path.realpath(path) not in included)
    ]


def left_out_note(paths: Sequence[str]) -> str:
    """Write the sentence about robots in xacro that were found in folders and not examined."""
    more = len(paths) - _SHOWN_FILES
    named = ", ".join(paths[:_SHOWN_FILES]) + (f" and {more} more" if more > 0 else "")
    robots = "1 robot in xacro was" if len(paths) == 1 else f"{len(paths)} robots in xacro were"
    return f"{robots} not examined, as expansion runs code of the file; name those that you trust: {named}"


def _root(path: str) -> Element | None:
    try:
        return read_xml(read_file(path), path, [])
    except DynxError:
        return None


def _builds_robot(root: Element) -> bool:
    return root.tag == "robot" and any(_adds_links(child) for child in root.children)


def _adds_links(element: Element) -> bool:
    """Check whether an element below the root adds links or joints, or could by calling a macro."""
    prefix, _, name = element.tag.rpartition(":")
    if not prefix:
        return name in ("link", "joint")
    if prefix != "xacro" or name in _DEFINITIONS:
        return False
    if name in ("if", "unless"):
        return any(_adds_links(child) for child in element.children)
    return True


def _included(element: Element) -> Iterable[str]:
    for child in element.children:
        if child.tag in ("xacro:include", "include"):
            yield child.attributes.get("filename", "")
        yield from _included(child)


def _targets(path: str, name: str, files: Iterable[str]) -> Iterable[str]:
    """Yield the files that an include of `path` names: relative to it, or below ``$(find PACKAGE)``."""
    below_package = _FIND.sub("", name)
    if below_package == name:
        yield os.path.join(os.path.dirname(path), name)
        return
    tail = os.path.join(os.sep, below_package)
    yield from (other for other in files if os.path.realpath(other).endswith(tail) and other != path)


ALL = "all"
"""Argument that stands for every robot of example-robot-data; ``./all`` is a file of that name."""


@dataclass(frozen=True)
class RobotInput:
    """One robot: the argument for `dynx.load`, or an error.

    `folder` is the directory argument in which the file was found; None if the robot itself was the argument.
    """

    robot: str
    refusal: DynxError | None = None
    folder: str | None = None


@dataclass(frozen=True)
class Expansion:
    """The robots that arguments stand for, and the robots in xacro below directories that were `left_out`."""

    robots: tuple[RobotInput, ...]
    left_out: tuple[str, ...] = ()


def expand(arguments: Sequence[str]) -> Expansion:
    """List the robots that the arguments stand for, in order.

    A directory stands for every .urdf below it, sorted by path, but for no .xacro, whose expansion runs code:
    those that are robots, and no macros of others, are listed in `Expansion.left_out`. As in `dynx.load`, a
    name of the library takes precedence over a directory of that name. A directory without a .urdf, or that
    cannot be read, becomes an input with a refusal, so that the others are still processed.
    """
    found: list[RobotInput] = []
    left_out: list[str] = []
    for argument in arguments:
        if argument == ALL:
            found += _library()
        elif _is_directory(argument) and not is_library_name(argument):
            below = _below(argument)
            found += below.robots
            left_out += below.left_out
        else:
            found.append(RobotInput(argument))
    named = {each.robot for each in found}
    return Expansion(tuple(found), tuple(path for path in dict.fromkeys(left_out) if path not in named))


def refusals(inputs: Sequence[RobotInput]) -> dict[int, DynxError]:
    """Return the errors of the inputs that have no robot, by their position."""
    return {index: each.refusal for index, each in enumerate(inputs) if each.refusal is not None}


def _library() -> list[RobotInput]:
    found = [RobotInput(entry.name) for entry in robots() if entry.source == EXAMPLE_ROBOT_DATA]
    return found or [
        RobotInput(
            ALL, RobotNotFoundError("'all' means the robots of example-robot-data, which is not installed")
        )
    ]


def _below(directory: str) -> Expansion:
    paths: list[str] = []
    xacro: list[str] = []
    refusals: list[RobotInput] = []

    def refuse(error: OSError) -> None:
        where = os.fspath(error.filename or directory)
        refusals.append(RobotInput(where, ModelError(f"{shown(where, 300)}: {error.strerror}")))

    for folder, _, names in os.walk(directory, onerror=refuse):
        paths += [os.path.join(folder, name) for name in names if name.lower().endswith(".urdf")]
        xacro += [os.path.join(folder, name) for name in names if name.lower().endswith(".xacro")]
    left_out = tuple(xacro_robots(sorted(xacro)))
    if not paths and not refusals:
        robots = left_out or xacro
        hint = f"; name one of its {len(robots)} .xacro files, whose expansion runs code" if robots else ""
        error = RobotNotFoundError(
            f"the directory {shown(directory, 300)} has no .urdf file in it or below it{hint}"
        )
        return Expansion((RobotInput(directory, error),))
    # A bare file name could be read as a name of the library; a path with a separator never is.
    return Expansion((*(RobotInput(path, folder=directory) for path in sorted(paths)), *refusals), left_out)


def _is_directory(argument: str) -> bool:
    try:
        return os.path.isdir(argument)
    except ValueError:  # a null character
        return False


def is_library_name(argument: str) -> bool:
    """Check whether `dynx.load` would find the argument in the library."""
    if os.sep in argument or "/" in argument:
        return False
    try:
        find(argument)
    except RobotNotFoundError:
        return False
    return True
