"""Configurations that a robot description names, as data."""

from __future__ import annotations

from dataclasses import dataclass, field


@dataclass(frozen=True)
class NamedConfiguration:
    """A configuration that a robot description names, such as a keyframe of MJCF.

    `positions` are the positions of joints by name: one number [rad or m], or the unit quaternion (x, y, z,
    w) of a ball joint. `base` is the pose of a floating base in the world: position [m] and unit quaternion
    (x, y, z, w). Joints without an entry, and a base without a pose, are neutral.
    """

    name: str
    positions: tuple[tuple[str, tuple[float, ...]], ...] = ()
    base: tuple[float, ...] | None = None
    line: int | None = field(default=None, compare=False)
