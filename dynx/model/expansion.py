"""Expansion of ROBOT arguments (names, files, directories and ``all``) into single robots."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass

from dynx.errors import DynxError, ModelError, RobotNotFoundError, shown
from dynx.model.library import EXAMPLE_ROBOT_DATA, find, robots
from dynx.model.xacro_robots import xacro_robots

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
