"""Extents of rigid groups: the shapes over which the mass of a link may be spread."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from dynx.model import Link
from dynx.rules.case import Case
from dynx.rules.geometry.extent import Extent
from dynx.rules.geometry.shapes import link_extent
from dynx.rules.inertia.rigid_groups import RigidGroup, rigid_groups
from dynx.spatial.scalar import Floats
from dynx.spatial.se3 import homogeneous, inverse


def body_extents(case: Case) -> Iterator[tuple[RigidGroup, Extent]]:
    """Yield each rigid group with mass, and the extent of all its shapes in the frame of its head.

    A group is left out where it has no shape, only shapes of size zero, or a shape of unknown size (a missing
    mesh).
    """
    for group in dict.fromkeys(rigid_groups(case).values()):
        if not any(case.model.inertial(name).mass > 0.0 for name in group.links):
            continue
        extent = _group_extent(case, group)
        if extent is not None and not extent.empty and extent.diagonal() > 0.0:
            yield group, extent


def group_extents(case: Case) -> Iterator[tuple[Link, Extent]]:
    """Yield each link with mass, and the extent of all shapes of its rigid group, in its link frame.

    Descriptions often put the shape of a part in one link and its mass in another on a fixed joint, so every
    shape of the group counts.
    """
    groups = rigid_groups(case)
    known = {group.head: extent for group, extent in body_extents(case)}
    for link in case.model.links:
        if link.inertial is None or link.inertial.mass == 0.0:
            continue
        group = groups[link.name]
        extent = known.get(group.head)
        if extent is not None:
            yield link, extent.transform(inverse(_pose(group, link.name)))


def _group_extent(case: Case, group: RigidGroup) -> Extent | None:
    """Return the extent of all shapes of the group in the frame of its head; None where a size is unknown."""
    parts = []
    for name in group.links:
        extent = link_extent(case.links[name], case.source.source)
        if extent is None:
            return None
        parts.append(extent.transform(_pose(group, name)))
    return Extent.union(parts)


def _pose(group: RigidGroup, link: str) -> Floats:
    """Return T_head_link (4, 4)."""
    R, p = group.poses[link]
    return homogeneous(R.astype(np.float64), p.astype(np.float64))
