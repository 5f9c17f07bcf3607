"""Distance of two rollouts of one robot over time."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dynx.errors import ArgumentError
from dynx.sim.record.rollout import Rollout
from dynx.sim.record.rollout_data import BASE_COORDINATES
from dynx.spatial.scalar import Floats

SAME_TIME = 1e-6
"""Largest difference of two times that count as one, relative to the step between records."""


@dataclass(frozen=True, eq=False)
class Separation:
    """Distance of two rollouts at the times that both have."""

    times: Floats
    """Times (n,) [s]: those of the rollout with the longer steps, up to the end of the shorter one; those of
    the other where only one of them is in the common time."""
    names: tuple[str, ...]
    """The coordinates of v, then the bodies of a scene that both rollouts have."""
    units: tuple[str, ...]
    distances: Floats
    """Magnitude of the difference of each coordinate [rad or m], and distance of the positions of each
    body [m] (n, len(names))."""

    @property
    def largest(self) -> float:
        """Largest distance of any coordinate or body at any time [rad or m]."""
        return float(self.distances.max(initial=0.0))

    @property
    def farthest(self) -> tuple[int, int]:
        """Index of the time, and of the name, of the largest distance."""
        k, column = np.unravel_index(int(np.argmax(self.distances)), self.distances.shape)
        return int(k), int(column)

    def first_beyond(self, distance: float) -> tuple[float, str] | None:
        """Return the first time at which something is farther apart than `distance`, and its name."""
        beyond = (self.distances > distance).any(axis=1)
        if not beyond.any():
            return None
        k = int(np.argmax(beyond))
        return float(self.times[k]), self.names[int(np.argmax(self.distances[k]))]


def separation(ours: Rollout, theirs: Rollout) -> Separation:
    """Measure how far apart two rollouts are over time.

    Where their times differ, states are interpolated between two records, along the difference of their
    configurations. Raises ArgumentError for rollouts of robots with other coordinates, or without a common
    time.
    """
    one, other = ours.model, theirs.model
    if (one.base, one.joint_names) != (other.base, other.joint_names):
        raise ArgumentError(
            "the rollouts have other coordinates: "
            f"{one.base} base and joints {', '.join(one.joint_names) or 'none'}; "
            f"{other.base} base and joints {', '.join(other.joint_names) or 'none'}"
        )
    begin, end = max(ours.t[0], theirs.t[0]), min(ours.t[-1], theirs.t[-1])
    fine, coarse = sorted((theirs, ours), key=_step)
    times = _times_within(coarse, begin, end)
    if times.size < 2:
        # One state tells nothing of a motion: a log in ms would be like any simulation from the same start.
        times = max(times, _times_within(fine, begin, end), key=len)
    if not times.size:
        raise ArgumentError(
            f"the rollouts have no common time: one is from {ours.t[0]:.12g} to {ours.t[-1]:.12g} s, "
            f"the other from {theirs.t[0]:.12g} to {theirs.t[-1]:.12g} s"
        )
    with np.errstate(invalid="ignore", over="ignore"):
        apart = np.abs(one.difference(_configurations(ours, times), _configurations(theirs, times)))
    base = BASE_COORDINATES if one.floating else ()
    units = ("m", "m", "m", "rad", "rad", "rad") if one.floating else ()
    bodies, gaps = _bodies(ours, theirs, times)
    return Separation(
        times,
        (*base, *one.joint_names, *bodies),
        (*units, *(joint.unit for joint in one.coordinate_joints), *("m" for _ in bodies)),
        np.where(np.isnan(both := np.column_stack([apart, *gaps])), np.inf, both),
    )


def _times_within(rollout: Rollout, begin: float, end: float) -> Floats:
    slack = SAME_TIME * _step(rollout)
    return rollout.t[(rollout.t >= begin - slack) & (rollout.t <= end + slack)]


def _step(rollout: Rollout) -> float:
    """Return the time between two records [s]."""
    return float(rollout.t[-1] - rollout.t[0]) / max(len(rollout.t) - 1, 1)


def _places(t: Floats, times: Floats) -> tuple[np.ndarray, Floats]:
    """Return for each time the record before it, and its fraction of the way to the next."""
    k = np.clip(np.searchsorted(t, times, side="right") - 1, 0, max(len(t) - 2, 0))
    if len(t) < 2:
        return k, np.zeros(len(times))
    share = (times - t[k]) / (t[k + 1] - t[k])
    share[np.abs(share) < SAME_TIME] = 0.0
    last = np.abs(share - 1.0) < SAME_TIME
    return k, np.where(last, 1.0, share)


def _configurations(rollout: Rollout, times: Floats) -> Floats:
    k, share = _places(rollout.t, times)
    after = np.minimum(k + 1, len(rollout.t) - 1)
    model, begin, end = rollout.model, rollout.q[k], rollout.q[after]
    between = model.integrate(begin, share[:, None] * model.difference(begin, end))
    # Records at the times themselves are taken to the last bit.
    return np.where((share == 0.0)[:, None], begin, np.where((share == 1.0)[:, None], end, between))


def _bodies(ours: Rollout, theirs: Rollout, times: Floats) -> tuple[list[str], list[Floats]]:
    """Return the names of the bodies that both rollouts have, and the distances of their positions."""
    if ours.surroundings is None or theirs.surroundings is None:
        return [], []
    names = [name for name in ours.surroundings.bodies if name in theirs.surroundings.bodies]
    gaps = []
    for name in names:
        places = []
        for each, found in ((ours, ours.surroundings), (theirs, theirs.surroundings)):
            k, share = _places(each.t, times)
            path = found.bodies[name][:, :3, 3]
            after = np.minimum(k + 1, len(path) - 1)
            places.append(path[k] + share[:, None] * (path[after] - path[k]))
        gaps.append(np.linalg.norm(places[0] - places[1], axis=1))
    return names, gaps
