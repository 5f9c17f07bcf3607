"""Drake, as the few classes of pydrake that dynx uses; imported when this module is.

Importing pydrake.multibody takes about half a second, most of it geometry and systems that
`MultibodyPlant` cannot be had without. It sends Drake's log to Python's logger ``drake`` and adds no
handler, so what Drake has to say about a file is heard with `said` and shown by nobody else.

The classes are of type Any: the stubs that come with some versions of pydrake take no NumPy array
where the functions themselves take any.
"""

from __future__ import annotations

import logging
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from importlib.metadata import PackageNotFoundError, version
from typing import Any

from dynx.errors import NotInstalledError, escaped

try:
    _math: Any = import_module("pydrake.math")
    _tree: Any = import_module("pydrake.multibody.tree")
    _plant: Any = import_module("pydrake.multibody.plant")
    _parsing: Any = import_module("pydrake.multibody.parsing")
except (ImportError, OSError) as error:
    raise NotInstalledError(
        "the engine 'drake' needs Drake: pip install 'dynx[drake]' "
        f"(wheels exist for Linux and macOS, 64 bit) ({error})"
    ) from error

FixedOffsetFrame: Any = _tree.FixedOffsetFrame
JacobianWrtVariable: Any = _tree.JacobianWrtVariable
MultibodyForces: Any = _tree.MultibodyForces
MultibodyPlant: Any = _plant.MultibodyPlant
Parser: Any = _parsing.Parser
PrismaticJoint: Any = _tree.PrismaticJoint
QuaternionFloatingJoint: Any = _tree.QuaternionFloatingJoint
RevoluteJoint: Any = _tree.RevoluteJoint
RigidTransform: Any = _math.RigidTransform
RotationMatrix: Any = _math.RotationMatrix
SpatialInertia: Any = _tree.SpatialInertia
UnitInertia: Any = _tree.UnitInertia

DRAKE_FAILURES = (Exception, SystemExit)
"""What a call of Drake may raise: pydrake makes ``SystemExit`` of a failed internal check, on which C++
would end the process."""

__all__ = [
    "DRAKE_FAILURES",
    "FixedOffsetFrame",
    "JacobianWrtVariable",
    "MultibodyForces",
    "MultibodyPlant",
    "Parser",
    "PrismaticJoint",
    "QuaternionFloatingJoint",
    "RevoluteJoint",
    "RigidTransform",
    "RotationMatrix",
    "SpatialInertia",
    "UnitInertia",
    "drake_version",
    "gist",
    "said",
]


def drake_version() -> str:
    """The version of the distribution, such as ``1.51.1``; ``unknown`` for one that pip did not install."""
    try:
        return version("drake")
    except PackageNotFoundError:
        return "unknown"


def gist(error: BaseException) -> str:
    """What Drake says, on one line of at most 400 characters, with the kind of exception before it."""
    words = " ".join(str(error).split())
    return f"{type(error).__name__}: {escaped(words, 400) if words else 'no message'}"


@contextmanager
def said() -> Iterator[list[str]]:
    """What Drake logs meanwhile, as a list that fills; nothing of it reaches the user's own handlers.

    Drake's logger is the process's: what other threads make Drake say in the meantime is in it too.
    """
    logger = logging.getLogger("drake")
    heard = _Heard()
    kept = logger.handlers[:], logger.propagate
    logger.handlers[:], logger.propagate = [heard], False
    try:
        yield heard.messages
    finally:
        logger.handlers[:], logger.propagate = kept


class _Heard(logging.Handler):
    """Keeps every message."""

    def __init__(self) -> None:
        super().__init__()
        self.messages: list[str] = []

    def emit(self, record: logging.LogRecord) -> None:
        """Add the message to the list."""
        self.messages.append(record.getMessage())
