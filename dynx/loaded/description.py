"""What an engine holds after loading a file, in one form for all engines."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from dynx.spatial.scalar import Floats

Bounds = tuple[float, float]


@dataclass(frozen=True, eq=False)
class LoadedInertial:
    """The inertia an engine holds for a link, with that of the links fused into it.

    `center` (3,) [m] is the centre of mass in the link frame, `inertia` (3, 3) [kg m^2] the tensor
    about it in the axes of the link frame. `fused` names the other links whose inertia is in it,
    because the engine welds what fixed joints hold together.
    """

    mass: float
    center: Floats
    inertia: Floats
    fused: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class LoadedJoint:
    """What an engine holds for a joint that moves; None where it does not say.

    `placement` (4, 4) is the pose of the joint frame at value 0 in the frame of the URDF parent link,
    `axis` (3,) the axis in the joint frame, as the engine holds it (it may not be unit).
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
    """Everything an engine says it has loaded.

    `links` has an entry for each link that still exists in the engine, `joints` for each joint that
    moves there. `base_frame` (4, 4) is the pose of the root link in the world at the neutral
    configuration, `gravity` (3,) what the engine uses unless it is told.
    """

    engine: str
    links: Mapping[str, LoadedInertial]
    joints: Mapping[str, LoadedJoint]
    base_frame: Floats
    gravity: Floats
    missing_links: tuple[str, ...] = ()
    remarks: tuple[str, ...] = field(default=())
