"""`Readings`: the samples of a sensor along a motion, with its errors."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from dynx.argument_types import checks_types
from dynx.errors import ArgumentError, ShapeError, UnknownNameError, nearest, shown
from dynx.model.numbers import real_array
from dynx.registry import door
from dynx.spatial.scalar import Floats
from dynx.world.sensors.errors import Integers, SampleNumbers, apply_errors
from dynx.world.sensors.motion import SensedMotion
from dynx.world.sensors.sensor import Sensor

SAME_SAMPLE = 1e-6
"""Part of a step within which a time counts as that of a sample."""


@dataclass(frozen=True, eq=False)
class SensorReading:
    """One sample of a sensor."""

    sensor: Sensor
    t: float
    """Time [s] at which it was taken."""
    channels: Mapping[str, Floats]
    """Values (size,) of each channel."""

    def __getitem__(self, channel: str) -> Any:
        """Return the value of a channel: (size,), or a float of one that is a number."""
        rows = _of_channel(self.sensor, self.channels, channel)
        return rows if rows.ndim else float(rows)

    @property
    def values(self) -> Floats:
        """Values (size,) of all channels one after the other, called `Sensor.value_names`."""
        return np.concatenate(list(self.channels.values()))

    def __repr__(self) -> str:
        pairs = zip(self.sensor.value_names, self.values.tolist(), strict=True)
        return f"<Reading of {self.sensor} at {self.t:.6g} s: {', '.join(f'{n} {x:.6g}' for n, x in pairs)}>"


@dataclass(frozen=True, eq=False)
class Readings:
    """m samples of a sensor."""

    sensor: Sensor
    t: Floats
    """Times (m,) [s] at which the samples were taken."""
    channels: Mapping[str, Floats]
    """Values (m, size) of each channel."""
    period: float
    """Time [s] between two samples; if it is no multiple of the step, samples are up to a step late."""

    def __len__(self) -> int:
        """Return the number of samples."""
        return len(self.t)

    def __getitem__(self, channel: str) -> Floats:
        """Return the values of a channel: (m, size), or (m,) of one that is a number."""
        return _of_channel(self.sensor, self.channels, channel)

    @property
    def last(self) -> SensorReading:
        """The last sample; ArgumentError if there is none."""
        if not len(self):
            raise ArgumentError(f"{self.sensor} has taken no sample")
        return SensorReading(
            self.sensor, float(self.t[-1]), {name: rows[-1] for name, rows in self.channels.items()}
        )

    @property
    def available(self) -> Floats:
        """Times (m,) [s] from which the samples can be read."""
        return self.t + self.sensor.delay

    @property
    def values(self) -> Floats:
        """Values (m, size) of all channels side by side, called `Sensor.value_names`."""
        return np.concatenate(list(self.channels.values()), axis=1)

    @checks_types
    def held(self, times: ArrayLike) -> Floats:
        """Return the values (n, size) that can be read at some times (n,) [s]: those of the last sample that
        is available then, NaN before the first."""
        times = real_array("times", times)
        if times.ndim != 1:
            raise ShapeError(f"times has shape {times.shape}; wanted (n,)")
        slack = SAME_SAMPLE * float(np.min(np.diff(self.t), initial=1.0))
        last = np.searchsorted(self.available, times + slack, side="right") - 1
        found = self.values[np.maximum(last, 0)] if len(self) else np.zeros((len(last), self.sensor.size))
        return np.where((last >= 0)[:, None], found, np.nan)

    @door("dynx.world.sensors.plot:plot")
    def plot(self, path: str | os.PathLike[str] | None = None) -> Any:
        """Plot the samples; return the `matplotlib.figure.Figure`."""
        raise NotImplementedError

    def __repr__(self) -> str:
        return f"<Readings of {self.sensor}: {len(self)} samples of {', '.join(self.channels)}>"


def _of_channel(sensor: Sensor, channels: Mapping[str, Floats], name: str) -> Floats:
    """Return the values (..., size) of a channel, (...,) of one that is a number."""
    if name not in channels:
        raise UnknownNameError(f"{sensor} has no channel {shown(name)}{nearest(name, channels)}")
    number = next(each for each in sensor.channels if each.name == name).components == ("",)
    return channels[name][..., 0] if number else channels[name]


def sample_numbers(sensor: Sensor, t: Floats, h: float) -> tuple[Integers, Integers]:
    """Return the rows of the instants `t` (n,), steps of `h` [s] apart, at which a sensor takes samples, and
    the numbers of the samples, which depend on the time alone."""
    period, slack = sensor.period(h), SAME_SAMPLE * h
    if sensor.rate is None:
        # In each step, also where the steps of a log are not alike.
        first = np.maximum(np.floor((t[:1] + slack) / period).astype(np.int64), 0)
        return np.arange(len(t)), first + np.arange(len(t))
    before = np.concatenate([t[:1] - h, t[:-1]])
    number, previous = (np.floor((times + slack) / period).astype(np.int64) for times in (t, before))
    rows = np.flatnonzero(number != previous)
    return rows, np.maximum(number[rows], 0)


def read_sensor(
    sensor: Sensor, motion: SensedMotion, rollout: int = 0, numbers: SampleNumbers | None = None
) -> Readings:
    """Return the readings of a sensor along a motion.

    `rollout` is the number of the rollout, on which the random numbers depend; `numbers` are those of an
    earlier call for the same sensor, which are continued. Raises ArgumentError for a rate above that of the
    steps, UnknownNameError for its place, UnsupportedFeatureError for what the motion does not tell.
    """
    sensor.require(motion.parts)
    rows, samples = sample_numbers(sensor, motion.t, motion.h)
    values = (each[rows] for each in sensor.measure(motion))
    true = {channel.name: each for channel, each in zip(sensor.channels, values, strict=True)}
    if numbers is None:
        numbers = SampleNumbers(sensor.name, sensor.seed, rollout, sensor.size)
    found = apply_errors(sensor.errors, true, samples, sensor.period(motion.h), numbers)
    return Readings(sensor, motion.t[rows], found, sensor.period(motion.h))
