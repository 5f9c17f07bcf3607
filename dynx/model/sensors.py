"""Sensors that a robot description states, as data."""

from __future__ import annotations

from dataclasses import dataclass, field


@dataclass(frozen=True)
class StatedSensor:
    """Sensor of a robot, as its description states it. It is only data: dynx simulates only the sensors of
    scenes and simulations (`dynx.world.sensors`).

    `type` is MuJoCo's name of the type, such as ``"gyro"``. `object` names the object of the sensor, and
    `object_type` the kind of this object: ``"site"`` (a frame of the model), ``"xbody"`` (a link), ``"body"``
    (a link; MuJoCo senses the frame of its inertia), ``"geom"``, ``"joint"``, ``"tendon"``, ``"actuator"``,
    ``"camera"``, or ``""`` for nothing. `reference` and `reference_type` are the second object of a sensor
    with two objects. `cutoff` bounds the absolute value, unless it is 0, and `noise` is a standard deviation,
    both in the unit of the reading. `name` may be empty.
    """

    name: str
    type: str
    object_type: str = ""
    object: str = ""
    reference_type: str = ""
    reference: str = ""
    cutoff: float = 0.0
    noise: float = 0.0
    line: int | None = field(default=None, compare=False)

    @property
    def objects(self) -> tuple[tuple[str, str], ...]:
        """Kind and name of each object."""
        both = (self.object_type, self.object), (self.reference_type, self.reference)
        return tuple(each for each in both if each[0])
