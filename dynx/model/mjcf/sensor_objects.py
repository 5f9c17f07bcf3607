"""Parts of a robot that sensors of MJCF may sense."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass

from dynx.model.elements import INFINITY, Joint
from dynx.model.geometry.links import Collision, Geometry, Visual
from dynx.model.stated_parts import StatedSensor
from dynx.model.tree import Description, Tree

WORLD = "world"
"""MJCF's name of the body that does not move, which every document has."""


@dataclass(frozen=True)
class SensorObjects:
    """Names of the parts that sensors may sense, by kinds of objects; joints by what is sensed of them."""

    names: Mapping[str, Collection[str]]

    @classmethod
    def of(cls, robot: Tree | Description, geoms: Iterable[str] | None = None) -> SensorObjects:
        """Return the parts of a robot; `geoms` are the names of its shapes, if others than in `robot`."""
        frames = robot.frames if isinstance(robot, Description) else robot.extra_frames
        moving = [each for each in robot.joints if each.moves]
        known = {each.name for each in moving}
        bodies = {WORLD, *(each.name for each in robot.links)}
        tendons = {each.name for each in robot.tendons or () if each.name and known.issuperset(each.joints)}
        return cls(
            {
                "site": {each.name for each in frames},
                "body": bodies,
                "xbody": bodies,
                "geom": set(_shape_names(robot.geometry) if geoms is None else geoms),
                "joint": {each.name for each in moving if each.type != "ball"},
                "ball joint": {each.name for each in moving if each.type == "ball"},
                "joint with a range": {each.name for each in moving if _has_range(each)},
                "tendon": set(tendons),
                "actuator": {
                    each.name
                    for each in robot.actuators or ()
                    if each.joint in known or (each.tendon and each.tendon in tendons)
                },
            }
        )

    def missing(self, sensor: StatedSensor, ignored: Collection[str] = ()) -> str | None:
        """Return the kind of an object that is no part of the robot; None if all are but those of `ignored`
        kinds."""
        for kind, name in sensor.objects:
            wanted = kind
            if kind == "joint":
                wanted = "ball joint" if sensor.type.startswith("ball") else wanted
                wanted = "joint with a range" if sensor.type.startswith("jointlimit") else wanted
            if kind not in ignored and name not in self.names.get(wanted, ()):
                return wanted
        return None


def _shape_names(geometry: Geometry) -> Iterator[str]:
    for each in geometry.links.values():
        shapes: tuple[Visual | Collision, ...] = (*each.visuals, *each.collisions)
        yield from (shape.name for shape in shapes if shape.name)


def _has_range(joint: Joint) -> bool:
    above = joint.limits.upper < INFINITY
    return joint.type != "continuous" and (above or (joint.type != "ball" and joint.limits.lower > -INFINITY))
