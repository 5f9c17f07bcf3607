"""What acts on the robots and bodies of a scene in one call of a stepper."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import NamedTuple, TypeVar

from dynx.model.model import Model
from dynx.spatial.scalar import Floats

Self = TypeVar("Self", bound="EngineCommand")


class EngineCommand(ABC):
    """A command to an engine's own motors of one robot, which its solver moves during a step."""

    @abstractmethod
    def checked(self: Self, model: Model) -> Self:
        """Return the command with one number per joint in each of its lists.

        Raises ArgumentError (and its kinds) for invalid numbers, UnsupportedFeatureError for a robot without
        such motors.
        """


NO_COMMANDS: Mapping[int, EngineCommand] = MappingProxyType({})


class Forces(NamedTuple):
    """Everything that acts in the steps of one call: what is not given does not act.

    The arrays may change after the call.
    """

    torques: Sequence[tuple[int, Floats]] = ()
    """Numbers of robots, each with a generalised force (nv,) on it [N m or N]. The first six entries of a
    floating base are force and moment at the base frame, in its axes; the caller takes one step at a time
    where they are not zero, so that they may be converted to other axes once a call."""
    wrenches: Floats | None = None
    """Force [N], and moment about the centre of mass [N m], on every body of the scene (n_bodies, 6), in
    world axes."""
    commands: Mapping[int, EngineCommand] = NO_COMMANDS
    """Commands to the engine's own motors by number of the robot, of classes in `Stepper.commands`. A mapping
    that is the same object as in the call before has the same commands."""


NO_FORCES = Forces()
