"""`Sensor`: name, place, rate and delay of an instrument, and the channels that it measures."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import KW_ONLY, dataclass
from typing import TYPE_CHECKING, ClassVar, NamedTuple

from dynx.argument_types import is_listed
from dynx.errors import ArgumentError, shown
from dynx.model.numbers import checked_seed, is_real
from dynx.model.xml.values import name_fault
from dynx.spatial.scalar import Floats
from dynx.world.sensors.errors import SensorErrors
from dynx.world.sensors.places import SensedParts, SensorPlace

if TYPE_CHECKING:
    from dynx.steppers.layout import SensorLayout
    from dynx.world.sensors.motion import SensedMotion


class SensorChannel(NamedTuple):
    """One vector that a sensor measures; its errors are the field of the sensor called `errors`."""

    name: str
    errors: str
    components: tuple[str, ...]
    """Names of the components; one empty name for a number."""
    unit: str


AXES = ("x", "y", "z")


@dataclass(frozen=True)
class Sensor(ABC):
    """A sensor. `on` names its place: ``robot/frame``, ``robot/joint`` or a body. In a simulation, and in a
    scene of one robot, the name of the frame or joint suffices.

    `rate` [Hz] is the number of samples per second; by default the sensor takes a sample in each step. For
    each multiple of ``1 / rate``, it takes a sample at the beginning of the first step at or after this time.
    A program can read the sample `delay` [s] later. The random numbers of the sensor depend only on its
    `seed`, its name, the number of the rollout and the number of the sample.
    """

    name: str
    on: str
    _: KW_ONLY
    rate: float | None = None
    delay: float = 0.0
    seed: int = 0

    channels: ClassVar[tuple[SensorChannel, ...]]
    """Measured quantities, in the order of the values of a reading."""
    kind: ClassVar[str]
    """Name of the class in documents."""
    touches: ClassVar[bool] = False
    """Whether readings depend on contacts."""

    def __post_init__(self) -> None:
        if not isinstance(self.name, str) or not isinstance(self.on, str):
            raise ArgumentError(
                f"a sensor is called {shown(self.name)} on {shown(self.on)}; wanted two names"
            )
        fault = name_fault(self.name)
        if fault is not None:
            raise ArgumentError(f"the name of a sensor {fault}; wanted a text of visible characters")
        if self.rate is not None and not (is_real(self.rate) and 0.0 < self.rate < math.inf):
            raise ArgumentError(
                f"rate of {self} is {shown(self.rate)}; wanted a positive number [Hz] or None"
            )
        if not is_real(self.delay) or not 0.0 <= self.delay < math.inf:
            raise ArgumentError(f"delay of {self} is {shown(self.delay)}; wanted seconds of at least 0")
        checked_seed(f"seed of {self}", self.seed)
        for channel in self.channels:
            errors = getattr(self, channel.errors)
            if not isinstance(errors, SensorErrors):
                raise ArgumentError(
                    f"{channel.errors} of {self} is {shown(errors)}; wanted SensorErrors(...)"
                )
            errors.require(f"{channel.errors} of {self}", len(channel.components))

    @property
    def errors(self) -> dict[str, SensorErrors]:
        """Errors of each channel."""
        return {channel.name: getattr(self, channel.errors) for channel in self.channels}

    @property
    def size(self) -> int:
        """Number of values of a reading."""
        return sum(len(channel.components) for channel in self.channels)

    @property
    def value_names(self) -> tuple[str, ...]:
        """Name of each value of a reading, such as ``acceleration:x``."""
        return tuple(
            f"{channel.name}:{each}" if each else channel.name
            for channel in self.channels
            for each in channel.components
        )

    def period(self, h: float) -> float:
        """Return the time [s] between two samples in steps of `h` [s].

        Raises ArgumentError if the sensor has a higher rate than the steps.
        """
        if self.rate is None:
            return h
        if self.rate * h > 1.0 + 1e-9:
            raise ArgumentError(
                f"rate of {self} is {self.rate:g} Hz; wanted at most {1.0 / h:g} Hz, that of the steps"
            )
        return 1.0 / self.rate

    def place(self, parts: SensedParts) -> SensorPlace:
        """Return the place of the sensor among `parts`; UnknownNameError without one."""
        return parts.place(self.on, str(self))

    @abstractmethod
    def require(self, parts: SensedParts) -> None:
        """Raise UnknownNameError or ArgumentError unless the sensor can be on its place among `parts`."""

    @abstractmethod
    def layout(self, parts: SensedParts) -> SensorLayout:
        """Return the sensor for an engine with sensors of its own; its place was checked by `require`."""

    @abstractmethod
    def measure(self, motion: SensedMotion) -> tuple[Floats, ...]:
        """Return the true values (n, m) of each channel at each instant of a motion.

        Raises UnsupportedFeatureError, naming the sensor, for what the motion does not tell.
        """

    def __str__(self) -> str:
        return f"the {self.kind.replace('_', ' ')} sensor {shown(self.name)}"


MAX_SENSORS = 10_000
"""Largest number of sensors of a scene; each takes a part of a millisecond in every step."""


def checked_sensors(sensors: object, parts: SensedParts) -> tuple[Sensor, ...]:
    """Return sensors as a tuple.

    Raises ArgumentError for anything else and for two of one name, and the errors of `Sensor.require`.
    """
    given = (sensors,) if isinstance(sensors, Sensor) else sensors
    if not is_listed(given):
        raise ArgumentError(f"sensors is {shown(sensors)}; wanted a sequence of sensors")
    found = tuple(given)
    if len(found) > MAX_SENSORS:
        raise ArgumentError(f"sensors has {len(found)} sensors; wanted at most {MAX_SENSORS}")
    names: set[str] = set()
    for each in found:
        if not isinstance(each, Sensor):
            raise ArgumentError(
                f"sensors has {shown(each)}; wanted a sensor, such as Imu('imu', 'robot/link')"
            )
        if each.name in names:
            raise ArgumentError(f"two sensors are called {shown(each.name)}; wanted different names")
        names.add(each.name)
        each.require(parts)
    return found
