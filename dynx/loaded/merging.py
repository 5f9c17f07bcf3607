"""The inertia of links that fixed joints connect rigidly, in the frame of one of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from dynx.loaded.description import LoadedInertial
from dynx.model import Model
from dynx.spatial.scalar import Floats
from dynx.spatial.se3 import inverse

Placements = Mapping[str, tuple[str, Floats]]
"""For each link, the first link of its rigid group, and its pose (4, 4) in that link's frame."""


def rigid_placements(model: Model) -> Placements:
    """Return the placement of each link in its rigid group."""
    placements = {model.root: (model.root, np.eye(4))}
    for joint in model.joints:
        if joint.moves:
            placements[joint.child] = (joint.child, np.eye(4))
        else:
            first, T = placements[joint.parent]
            placements[joint.child] = (first, np.asarray(T @ joint.origin.matrix))
    return placements


def merged_inertial(
    model: Model,
    placements: Placements,
    link: str,
    others: Sequence[str],
    instead: Mapping[str, LoadedInertial],
) -> LoadedInertial:
    """Return the inertia, by the file, of `link` and those of `others` that are rigidly connected to it.

    `placements` is `rigid_placements` of the model. An inertial in `instead` replaces that of the file.
    """
    first, T_first_link = placements[link]
    T_link_first = inverse(T_first_link)
    parts = [_in_frame(model, link, np.eye(4), instead)]
    parts += [
        _in_frame(model, name, T_link_first @ placements[name][1], instead)
        for name in others
        if name in placements and placements[name][0] == first
    ]
    if len(parts) == 1:
        return parts[0]
    mass = sum(part.mass for part in parts)
    center = sum((part.mass * part.center for part in parts), np.zeros(3))
    center = center / mass if mass else center
    # The sum is formed about the common centre of mass, so that no large terms cancel.
    inertia = np.zeros((3, 3))
    for part in parts:
        arm = part.center - center
        inertia += part.inertia + part.mass * ((arm @ arm) * np.eye(3) - np.outer(arm, arm))
    return LoadedInertial(mass, center, inertia)


def _in_frame(model: Model, link: str, T: Floats, instead: Mapping[str, LoadedInertial]) -> LoadedInertial:
    """Return the inertia of one link, where T (4, 4) is its pose in the frame of the result."""
    R, p = T[:3, :3], T[:3, 3]
    if link in instead:
        held = instead[link]
        return LoadedInertial(held.mass, p + R @ held.center, R @ held.inertia @ R.T)
    inertial = model.inertial(link)
    origin = inertial.origin.matrix
    axes = R @ origin[:3, :3]
    return LoadedInertial(inertial.mass, p + R @ origin[:3, 3], axes @ inertial.tensor @ axes.T)
