"""Recorded motions: named channels of numbers at the times of a record."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from dynx.argument_types import checks_types
from dynx.errors import DTypeError, ShapeError, UnknownNameError, nearest, shown
from dynx.model import Model
from dynx.model.numbers import checked_entries, is_real, real_array
from dynx.spatial.scalar import Floats

SAME_TIME = 1e-6
"""Largest difference of two times that count as one, relative to the step between records."""

BASE_COORDINATES = ("base x", "base y", "base z", "base rx", "base ry", "base rz")
"""Names of the coordinates of a floating base."""


@dataclass(frozen=True, eq=False)
class Channel:
    """Values of one quantity at the times of a record, each of which is a part of its own."""

    rows: Floats
    """Values (n, m)."""
    names: tuple[str, ...]
    """Name of each part."""
    units: tuple[str, ...]
    """Unit of each part."""

    def between(self, begin: Floats, end: Floats, share: Floats) -> Floats:
        """Return the rows at the fractions `share` (n, 1) of the way from `begin` to `end`."""
        return np.asarray(begin + share * (end - begin))

    def distances(self, ours: Floats, theirs: Floats) -> Floats:
        """Return the distance (n, parts) of rows of this channel from rows of another."""
        return np.asarray(np.abs(ours - theirs))


class PositionChannel(Channel):
    """Positions (n, 3) [m] of one part; their distance is that of the points."""

    def distances(self, ours: Floats, theirs: Floats) -> Floats:
        """Return the distance (n, 1) of two positions (n, 3) [m]."""
        return np.asarray(np.linalg.norm(ours - theirs, axis=1)[:, None])


@dataclass(frozen=True, eq=False)
class ConfigurationChannel(Channel):
    """Configurations (n, nq) of a robot; its parts are the coordinates of v."""

    model: Model

    def between(self, begin: Floats, end: Floats, share: Floats) -> Floats:
        """Return the configurations along the difference of `begin` and `end`."""
        return self.model.integrate(begin, share * self.model.difference(begin, end))

    def distances(self, ours: Floats, theirs: Floats) -> Floats:
        """Return the magnitude (n, nv) of the difference of two configurations [rad or m]."""
        return np.asarray(np.abs(self.model.difference(ours, theirs)))


def checked_times(times: Floats) -> Floats:
    """Return times (n,) [s]; raise the errors of `checked_entries` and ShapeError for anything else."""
    checked = checked_entries("times", real_array("times", times))
    if checked.ndim != 1:
        raise ShapeError(f"times has shape {checked.shape}; wanted (n,)")
    return checked


def position_channel(name: str, rows: Floats) -> PositionChannel:
    """Return the channel of the positions (n, 3) [m] of one part."""
    return PositionChannel(rows, (name,), ("m",))


def configuration_channel(model: Model, q: Floats) -> ConfigurationChannel:
    """Return the channel of the configurations q (n, nq) of a robot."""
    return ConfigurationChannel(q, coordinate_names(model), coordinate_units(model), model)


def coordinate_names(model: Model) -> tuple[str, ...]:
    """Return the names of the coordinates of v: those of the joints, after the six of a floating base."""
    return (*(BASE_COORDINATES if model.floating else ()), *model.coordinate_names)


def coordinate_units(model: Model) -> tuple[str, ...]:
    """Return the unit of each coordinate of v: rad or m."""
    base = ("m", "m", "m", "rad", "rad", "rad") if model.floating else ()
    return (*base, *(joint.unit for joint in model.coordinate_joints for _ in range(joint.n_rates)))


@dataclass(frozen=True, eq=False)
class Record:
    """A motion: rows of channels at n times."""

    name: str
    times: Floats
    """Times (n,) [s], ascending."""
    channels: Mapping[str, Channel]
    """Channels by name: ``arm/q`` for configurations, ``cube`` or ``arm/link1`` for positions."""

    @property
    def step(self) -> float:
        """Mean time between two rows [s]."""
        return float(self.times[-1] - self.times[0]) / max(len(self.times) - 1, 1)

    @checks_types
    def times_within(self, begin: float, end: float) -> Floats:
        """Return the times of the record from `begin` to `end` [s]."""
        for name, time in (("begin", begin), ("end", end)):
            if not is_real(time):
                raise DTypeError(f"{name} is {shown(time)}; wanted a number of seconds")
        slack = SAME_TIME * self.step
        return self.times[(self.times >= begin - slack) & (self.times <= end + slack)]

    @checks_types
    def at(self, channel: str, times: Floats) -> Floats:
        """Return the rows of a channel at some times [s], interpolated between the two rows around each.

        Rows at the times themselves are returned to the last bit; before the first time they equal the first
        row, after the last time the last row.
        """
        if channel not in self.channels:
            raise UnknownNameError(f"no channel {shown(channel)}{nearest(channel, self.channels)}")
        times = checked_times(times)
        found, last = self.channels[channel], len(self.times) - 1
        before = np.clip(np.searchsorted(self.times, times, side="right") - 1, 0, max(last - 1, 0))
        after = np.minimum(before + 1, last)
        step = self.times[after] - self.times[before]
        share = np.divide(times - self.times[before], step, out=np.zeros(len(times)), where=step > 0.0)
        share = np.where(share < SAME_TIME, 0.0, np.where(share > 1.0 - SAME_TIME, 1.0, share))[:, None]
        begin, end = found.rows[before], found.rows[after]
        return np.where(share == 0.0, begin, np.where(share == 1.0, end, found.between(begin, end, share)))
