"""Distance of two motions over time, part by part."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from dynx.argument_types import checks_types
from dynx.errors import ArgumentError, ShapeError, shown
from dynx.model.numbers import is_real
from dynx.spatial.scalar import Floats

if TYPE_CHECKING:
    from dynx.world.record import Record


@dataclass(frozen=True, eq=False, repr=False)
class Separation:
    """Distance of two records at the times that both have."""

    records: tuple[str, str]
    """Names of the two records, such as those of two engines."""
    times: Floats
    """Times (n,) [s]."""
    names: tuple[str, ...]
    """Parts that both records have: coordinates of a robot, bodies, links, entries of an observation."""
    units: tuple[str, ...]
    """Unit of each distance."""
    distances: Floats
    """Distance of each part (n, len(names)): of positions [m], the magnitude of the difference of coordinates
    [rad or m]; infinite where one of the records is not a number."""

    def __repr__(self) -> str:
        ours, theirs = self.records
        head = f"{type(self).__name__} of {ours} and {theirs}"
        if not self.distances.size:
            return f"<{head}: nothing compared>"
        k, column = self.farthest
        where = f"{self.names[column]} at {self.times[k]:.6g} s"
        return f"<{head}: at most {self.largest:.3g} {self.units[column]}, {where}, {len(self.times)} times>"

    @property
    def largest(self) -> float:
        """Largest distance of any part at any time."""
        return float(self.distances.max(initial=0.0))

    @property
    def distance(self) -> Floats:
        """Largest distance (n,) of any part at each time."""
        return np.asarray(self.distances.max(axis=1, initial=0.0))

    @property
    def parts(self) -> tuple[str, ...]:
        """Name of the part that is farthest apart at each time; empty without parts."""
        if not self.names:
            return ("",) * len(self.times)
        return tuple(self.names[k] for k in self.distances.argmax(axis=1).tolist())

    @property
    def farthest(self) -> tuple[int, int]:
        """Index of the time, and of the name, of the largest distance. Raises ArgumentError where nothing was
        compared."""
        if not self.distances.size:
            raise ArgumentError(f"{' and '.join(self.records)} have no part in common, so none is farthest")
        k, column = np.unravel_index(int(np.argmax(self.distances)), self.distances.shape)
        return int(k), int(column)

    def first_beyond(self, distance: float) -> tuple[float, str] | None:
        """Return the first time at which a part is farther apart than `distance`, and its name; None if none
        is."""
        if not is_real(distance):
            raise ArgumentError(f"distance is {shown(distance)}; wanted a number")
        beyond = np.flatnonzero(self.distance > distance)
        if not beyond.size or not self.names:
            return None
        k = int(beyond[0])
        return float(self.times[k]), self.names[int(np.argmax(self.distances[k]))]


@checks_types
def separation(ours: Record, theirs: Record, times: Floats | None = None) -> Separation:
    """Measure how far apart two records are over time, in the channels that both have.

    `times` are compared as far as both records last. By default they are the times of the record with the
    longer steps. If only one of these is in the common time, they are the times of the other record. Where a
    record has no row at a time it is interpolated between two. Raises ArgumentError for records without a
    common channel or time.
    """
    # Imported here, because most worlds are compared with no other.
    from dynx.world.record import Record, checked_times

    common = [name for name in ours.channels if name in theirs.channels]
    if not common and (ours.channels or theirs.channels):
        raise ArgumentError(
            f"{ours.name} and {theirs.name} have no part in common: {_some(ours)}; {_some(theirs)}"
        )
    begin = max(float(ours.times[0]), float(theirs.times[0]))
    end = min(float(ours.times[-1]), float(theirs.times[-1]))
    fine, coarse = sorted((theirs, ours), key=lambda record: record.step)
    if times is not None:
        times = checked_times(times)
        if not times.size:
            raise ShapeError(f"times has shape {times.shape}; wanted (n,), at least one time")
        coarse = fine = Record("", times, {})
    compared = coarse.times_within(begin, end)
    if compared.size < 2:
        # One state tells nothing of a motion: a log in ms would be like any simulation from the same start.
        compared = max(compared, fine.times_within(begin, end), key=len)
    if not compared.size:
        chosen = "" if times is None else f"times is {shown(times)}; "
        raise ArgumentError(
            f"{chosen}{ours.name} and {theirs.name} have no common time at which to be compared: one "
            f"is from {ours.times[0]:.12g} to {ours.times[-1]:.12g} s, the other from {theirs.times[0]:.12g} "
            f"to {theirs.times[-1]:.12g} s"
        )
    channels = [ours.channels[name] for name in common]
    with np.errstate(invalid="ignore", over="ignore"):
        apart = [
            channel.distances(ours.at(name, compared), theirs.at(name, compared))
            for name, channel in zip(common, channels, strict=True)
        ]
    distances = np.concatenate([np.zeros((len(compared), 0)), *apart], axis=1)
    return Separation(
        (ours.name, theirs.name),
        compared,
        tuple(name for channel in channels for name in channel.names),
        tuple(unit for channel in channels for unit in channel.units),
        np.where(np.isnan(distances), np.inf, distances),
    )


def _some(record: Record) -> str:
    """List the first channels of a record."""
    listed = list(record.channels)[:3]
    return (", ".join(listed) or "nothing") + (", ..." if len(record.channels) > 3 else "")
