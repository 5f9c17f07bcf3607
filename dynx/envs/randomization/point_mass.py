"""A point mass as part of the inertia of a link, for worlds, whose links have shapes and cannot be added."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from dynx.model import Inertial, Model, Pose
from dynx.spatial.scalar import Floats


def with_point_mass(model: Model, frame: str, mass: float, center: Sequence[float]) -> Model:
    """Return the robot with a point mass [kg] at a place (3,) [m] of a frame, in the inertia of its link.

    The total has the centre of mass and the tensor of both (Steiner's theorem).
    """
    if mass == 0.0:
        return model
    place = model.frames[model.frame_index(frame)]
    T_link_frame = place.placement.matrix
    point = T_link_frame[:3, :3] @ np.asarray(center, dtype=np.float64) + T_link_frame[:3, 3]
    own = model.inertial(place.link)
    T_link_center = own.origin.matrix
    R, own_center = T_link_center[:3, :3], T_link_center[:3, 3]
    total = own.mass + mass
    common = (own.mass * own_center + mass * point) / total
    tensor = R @ own.tensor @ R.T + own.mass * _steiner(own_center - common) + mass * _steiner(point - common)
    (xx, xy, xz), (_, yy, yz), (_, _, zz) = tensor.tolist()
    x, y, z = common.tolist()
    inertial = Inertial(total, Pose((x, y, z)), xx, xy, xz, yy, yz, zz)
    links = [replace(each, inertial=inertial) if each.name == place.link else each for each in model.links]
    return replace(model, links=tuple(links))


def _steiner(offset: Floats) -> Floats:
    """Return the tensor (3, 3) of a unit point mass at an offset (3,)."""
    return np.asarray(offset @ offset * np.eye(3) - np.outer(offset, offset))
