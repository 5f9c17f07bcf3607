"""The only import of Drake: the few classes of pydrake that dynx uses.

Importing pydrake.multibody takes about half a second, most of it for geometry and systems that
`MultibodyPlant` needs. pydrake sends Drake's log to Python's logger ``drake`` and adds no handler, so
warnings and infos about a file are captured with `captured_log` and shown nowhere else.

The classes are of type Any, because the stubs of some versions of pydrake reject NumPy arrays that the
functions accept.
"""

from __future__ import annotations

import logging
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from importlib.metadata import PackageNotFoundError, version
from typing import Any

from dynx.errors import escaped, importing

with importing(
    "the engine 'drake' needs Drake: pip install 'dynx[drake]' (wheels exist for Linux and macOS, 64 bit) "
    "({error})",
    OSError,
):
    _math: Any = import_module("pydrake.math")
    _tree: Any = import_module("pydrake.multibody.tree")
    _plant: Any = import_module("pydrake.multibody.plant")
    _parsing: Any = import_module("pydrake.multibody.parsing")
    _framework: Any = import_module("pydrake.systems.framework")
    geometry: Any = import_module("pydrake.geometry")
    """Drake's module of geometry: shapes, their properties, and queries."""

AddMultibodyPlantSceneGraph: Any = _plant.AddMultibodyPlantSceneGraph
ContactModel: Any = _plant.ContactModel
CoulombFriction: Any = _plant.CoulombFriction
DiagramBuilder: Any = _framework.DiagramBuilder
DiscreteContactApproximation: Any = _plant.DiscreteContactApproximation
FixedOffsetFrame: Any = _tree.FixedOffsetFrame
JacobianWrtVariable: Any = _tree.JacobianWrtVariable
ModelInstanceIndex: Any = _tree.ModelInstanceIndex
MultibodyForces: Any = _tree.MultibodyForces
MultibodyPlant: Any = _plant.MultibodyPlant
Parser: Any = _parsing.Parser
PrismaticJoint: Any = _tree.PrismaticJoint
PrismaticSpring: Any = _tree.PrismaticSpring
QuaternionFloatingJoint: Any = _tree.QuaternionFloatingJoint
RevoluteJoint: Any = _tree.RevoluteJoint
RevoluteSpring: Any = _tree.RevoluteSpring
RigidTransform: Any = _math.RigidTransform
RotationMatrix: Any = _math.RotationMatrix
SpatialInertia: Any = _tree.SpatialInertia
UnitInertia: Any = _tree.UnitInertia

DRAKE_FAILURES = (Exception, SystemExit)
"""Exceptions of engine calls; pydrake raises ``SystemExit`` for a failed internal check, on which C++ would
end the process."""

__all__ = [
    "DRAKE_FAILURES",
    "AddMultibodyPlantSceneGraph",
    "ContactModel",
    "CoulombFriction",
    "DiagramBuilder",
    "DiscreteContactApproximation",
    "FixedOffsetFrame",
    "JacobianWrtVariable",
    "ModelInstanceIndex",
    "MultibodyForces",
    "MultibodyPlant",
    "Parser",
    "PrismaticJoint",
    "PrismaticSpring",
    "QuaternionFloatingJoint",
    "RevoluteJoint",
    "RevoluteSpring",
    "RigidTransform",
    "RotationMatrix",
    "SpatialInertia",
    "UnitInertia",
    "captured_log",
    "drake_version",
    "error_message",
    "geometry",
]


def drake_version() -> str:
    """Return the version of the distribution, such as ``1.51.1``; ``unknown`` if pip did not install it."""
    try:
        return version("drake")
    except PackageNotFoundError:
        return "unknown"


def error_message(error: BaseException) -> str:
    """Return Drake's message on one line: the type of the exception, then at most 400 characters."""
    words = " ".join(str(error).split())
    return f"{type(error).__name__}: {escaped(words, 400) if words else 'no message'}"


@contextmanager
def captured_log() -> Iterator[list[str]]:
    """Capture Drake's log messages in a list, without passing them to the user's own handlers.

    The process has one logger for Drake, so messages caused by other threads are captured too.
    """
    logger = logging.getLogger("drake")
    captured = _MessageList()
    kept = logger.handlers[:], logger.propagate
    logger.handlers[:], logger.propagate = [captured], False
    try:
        yield captured.messages
    finally:
        logger.handlers[:], logger.propagate = kept


class _MessageList(logging.Handler):
    """Handler that keeps every message."""

    def __init__(self) -> None:
        super().__init__()
        self.messages: list[str] = []

    def emit(self, record: logging.LogRecord) -> None:
        """Add the message to the list."""
        self.messages.append(record.getMessage())
