"""From the ROBOT arguments to the robots they mean: names, files, directories and ``all``."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass

from dynx.errors import DynxError, ModelError, RobotNotFoundError, shown

ALL = "all"
"""The argument that means every robot of example-robot-data; ``./all`` is a file of that name."""


@dataclass(frozen=True)
class RobotInput:
    """One robot to work on: what `dynx.load` takes, or why there is none.

    `folder` is the directory argument below which it was found, None where it was named itself.
    """

    robot: str
    refusal: DynxError | None = None
    folder: str | None = None


def expand(arguments: Sequence[str]) -> list[RobotInput]:
    """The robots that the arguments mean, in order; nothing is opened yet.

    A directory means every .urdf below it, sorted by path; as in `dynx.load`, a name of the library
    wins over a directory of that name. A directory that has none, or cannot be read, is an input
    with a refusal, so that the others are still done.
    """
    found: list[RobotInput] = []
    for argument in arguments:
        if argument == ALL:
            found += _library()
        elif _is_directory(argument) and not is_library_name(argument):
            found += _below(argument)
        else:
            found.append(RobotInput(argument))
    return found


def _library() -> list[RobotInput]:
    from dynx.model.library import EXAMPLE_ROBOT_DATA, robots

    found = [RobotInput(entry.name) for entry in robots() if entry.source == EXAMPLE_ROBOT_DATA]
    return found or [
        RobotInput(
            ALL, RobotNotFoundError("'all' means the robots of example-robot-data, which is not installed")
        )
    ]


def _below(directory: str) -> list[RobotInput]:
    paths: list[str] = []
    refusals: list[RobotInput] = []

    def refuse(error: OSError) -> None:
        where = os.fspath(error.filename or directory)
        refusals.append(RobotInput(where, ModelError(f"{shown(where, 300)}: {error.strerror}")))

    for folder, _, names in os.walk(directory, onerror=refuse):
        paths += [os.path.join(folder, name) for name in names if name.lower().endswith(".urdf")]
    if not paths and not refusals:
        error = RobotNotFoundError(
            f"the directory {shown(directory, 300)} has no .urdf file in it or below it"
        )
        return [RobotInput(directory, error)]
    # A bare file name could be read as a name of the library; a path with a separator never is.
    return [RobotInput(path, folder=directory) for path in sorted(paths)] + refusals


def _is_directory(argument: str) -> bool:
    try:
        return os.path.isdir(argument)
    except ValueError:  # a null character
        return False


def is_library_name(argument: str) -> bool:
    """Whether `dynx.load` would look this up in the library, and find it."""
    from dynx.model.library import find

    if os.sep in argument or "/" in argument:
        return False
    try:
        find(argument)
    except RobotNotFoundError:
        return False
    return True
