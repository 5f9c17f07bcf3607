"""What two robots sense, as their descriptions state it."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from dynx.model import Model
from dynx.model.mechanism import BodyFrame
from dynx.model.mjcf.sensor_objects import WORLD
from dynx.model.stated_parts import StatedSensor
from dynx.same.attributes import Attribute, number_text
from dynx.same.decimals import decimals, rounded
from dynx.same.fit import Fit, angle_of
from dynx.same.limits import differs
from dynx.same.skeleton import Skeleton
from dynx.same.stated import counterparts, part_differences
from dynx.spatial.se3 import homogeneous, inverse


def sensor_differences(ours: Model, theirs: Model, found: Fit, tolerance: float) -> Iterator[Attribute]:
    """Yield the sensors that differ, that one description has alone, or that have other names; nothing where
    a description leaves sensors open. Readings have the sign of the joint's position.

    A sensor has the counterpart of its name; one without has the first that is equal.
    """
    if ours.sensors is None or theirs.sensors is None:
        return
    objects = _Objects(ours, theirs, found, tolerance)
    pairs = counterparts(ours.sensors, theirs.sensors, objects.are_equal, _kind)
    yield from part_differences(pairs, "sensor", "sensor", sensor_text, lambda each: each.type)


def _kind(sensor: StatedSensor) -> tuple[str, str, str]:
    return sensor.type, sensor.object_type, sensor.reference_type


def sensor_text(sensor: StatedSensor) -> str:
    """Write a sensor, without what it has by default."""
    words = " from ".join(f"{kind} {name}" for kind, name in sensor.objects)
    numbers = (("cutoff", sensor.cutoff), ("noise", sensor.noise))
    stated = [f"{what} {number_text(value)}" for what, value in numbers if value]
    return ", ".join([f"{sensor.type} {words}".rstrip(), *stated])


class _Objects:
    """The objects of the sensors of two robots: joints by their counterparts, frames by their places."""

    def __init__(self, ours: Model, theirs: Model, found: Fit, tolerance: float) -> None:
        self._found, self._tolerance = found, tolerance
        self._fits = {each.theirs: each for each in found.bodies}
        self._frames = [_frames(each) for each in (found.ours, found.theirs)]
        self._driven = [
            {each.name: each.joint for each in model.actuators or () if each.name} for model in (ours, theirs)
        ]

    def are_equal(self, one: StatedSensor, other: StatedSensor) -> bool:
        """Check whether two sensors are equal but for their names."""
        return (
            _kind(one) == _kind(other)
            and self._is_same(one.object_type, one.object, other.object)
            and self._is_same(one.reference_type, one.reference, other.reference)
            and not differs(one.cutoff, other.cutoff, self._tolerance)
            and not differs(one.noise, other.noise, self._tolerance)
        )

    def _is_same(self, kind: str, mine: str, theirs: str) -> bool:
        if kind == "joint":
            return self._joint(theirs) == mine
        if kind in ("site", "body", "xbody"):
            return self._is_same_place(kind, mine, theirs)
        driven, other = self._driven
        if kind == "actuator" and mine in driven and theirs in other and mine not in other:
            return self._joint(other[theirs]) == driven[mine]
        return mine == theirs

    def _joint(self, theirs: str) -> str:
        """Return the name of our joint that corresponds to one of theirs."""
        each = self._found.of_joint(theirs)
        return theirs if each is None else self._found.ours.joints[each.ours].name

    def _is_same_place(self, kind: str, mine: str, theirs: str) -> bool:
        """Check whether two frames are in one place; of a ``body``, the centres of mass."""
        one, other = self._frames[0].get(mine), self._frames[1].get(theirs)
        each = None if other is None else self._fits.get(other.body)
        if one is None or other is None or each is None or one.body != each.ours:
            return mine == theirs and (one is None) == (other is None) and each is None
        places = homogeneous(one.R, one.p), each.D @ homogeneous(other.R, other.p)
        size = self._tolerance * self._found.ours.reach
        if kind == "body" and WORLD not in (mine, theirs):
            links = self._found.ours.model.inertial(mine), self._found.theirs.model.inertial(theirs)
            ends = [
                T[:3, :3] @ decimals(link.origin.xyz) + T[:3, 3]
                for T, link in zip(places, links, strict=True)
            ]
            return float(np.linalg.norm(rounded(ends[1] - ends[0]))) <= size
        off = inverse(places[0]) @ places[1]
        return angle_of(off) <= self._tolerance and float(np.linalg.norm(rounded(off[:3, 3]))) <= size


def _frames(skeleton: Skeleton) -> dict[str, BodyFrame]:
    return {frame.name: frame for frame in skeleton.frames}
