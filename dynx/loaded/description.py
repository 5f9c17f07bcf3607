"""The model that an engine holds after loading a file, in one form for all engines."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from dynx.spatial.scalar import Floats

Bounds = tuple[float, float]


@dataclass(frozen=True, eq=False)
class LoadedInertial:
    """The inertia that an engine holds for a link, with that of the links merged into it.

    `mass` is in kg, `center` (3,) [m] is the centre of mass in the link frame, `inertia` (3, 3) [kg m^2] the
    tensor about it in the axes of the link frame. `merged` names the other links whose inertia is included,
    because the engine merges links that fixed joints connect.
    """

    mass: float
    center: Floats
    inertia: Floats
    merged: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class LoadedJoint:
    """The properties that an engine holds for a joint that moves; None where it reports none.

    `placement` (4, 4) is the pose of the joint frame at value 0 in the frame of the URDF parent link,
    `axis` (3,) the axis in the joint frame, as the engine holds it (its length may not be 1).
    """

    type: str
    placement: Floats | None = None
    axis: Floats | None = None
    limits: Bounds | None = None
    velocity: float | None = None
    effort: float | None = None
    damping: float | None = None
    friction: float | None = None
    armature: float | None = None


@dataclass(frozen=True, eq=False)
class LoadedModel:
    """The whole model as the engine reports it.

    `links` has an entry for each link that still exists in the engine, `joints` for each joint that
    moves there. `base_frame` (4, 4) is the pose of the root link in the world at the neutral
    configuration, `gravity` (3,) [m/s^2] the engine's default.
    """

    engine: str
    links: Mapping[str, LoadedInertial]
    joints: Mapping[str, LoadedJoint]
    base_frame: Floats
    gravity: Floats
    missing_links: tuple[str, ...] = ()
    remarks: tuple[str, ...] = field(default=())
