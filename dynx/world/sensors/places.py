"""Where sensors are: on parts of robots, and on bodies."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

from dynx.errors import UnknownNameError, UnsupportedFeatureError, nearest, shown
from dynx.model import Model


class SensorPlace(NamedTuple):
    """Where a sensor is: on a frame or joint of a robot, or on a body."""

    sensor: str
    """The sensor, in words."""
    robot: str | None
    """None for a body."""
    name: str

    @property
    def without_scene(self) -> UnsupportedFeatureError:
        """Error for a sensor of contacts or distances outside a scene."""
        return UnsupportedFeatureError(
            f"{self.sensor} needs a scene with something to touch or to hit: simulate with "
            "plant=ScenePlant(...), or use a World"
        )


class SensedParts(NamedTuple):
    """Robots and bodies among which sensors are placed."""

    robots: Mapping[str, Model]
    bodies: tuple[str, ...] = ()
    alone: str | None = None
    """Robot in which a name without a robot is looked up; None if there are several."""

    def place(self, on: str, sensor: str) -> SensorPlace:
        """Return the place of a sensor; UnknownNameError for a robot or body that does not exist."""
        owner, slash, name = on.partition("/")
        if owner in self.robots and slash:
            return SensorPlace(sensor, owner, name)
        if on in self.bodies:
            return SensorPlace(sensor, None, on)
        if self.alone is not None:
            return SensorPlace(sensor, self.alone, on)
        known = [*self.bodies, *self.robots]
        raise UnknownNameError(
            f"{sensor} is on {shown(on)}; wanted a body, robot/frame or robot/joint{nearest(owner, known)}"
        )
