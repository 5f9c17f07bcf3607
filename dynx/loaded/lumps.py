"""The inertia of links that fixed joints hold together, in the frame of one of them."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass

import numpy as np

from dynx.loaded.description import LoadedInertial
from dynx.model import Model
from dynx.spatial.scalar import Array, Floats
from dynx.spatial.se3 import inverse


@dataclass(frozen=True)
class Lump:
    """Mass [kg], centre of mass (3,) [m] and central inertia (3, 3) [kg m^2], in a link's frame."""

    mass: float
    center: Array
    inertia: Array


def welds(model: Model) -> dict[str, tuple[str, Floats]]:
    """For each link, the first of those that it is welded to, and its pose (4, 4) in that link's frame."""
    here = {model.root: (model.root, np.eye(4))}
    for joint in model.joints:
        if joint.moves:
            here[joint.child] = (joint.child, np.eye(4))
        else:
            first, T = here[joint.parent]
            here[joint.child] = (first, np.asarray(T @ joint.origin.matrix))
    return here


def lumped(
    model: Model,
    places: Mapping[str, tuple[str, Floats]],
    link: str,
    fused: Collection[str],
    instead: Mapping[str, LoadedInertial],
) -> Lump:
    """What the file says of `link` and of those of `fused` that are welded to it, in its frame.

    `places` is `welds` of the model. For a link in `instead` that inertial is taken, not the file's.
    """
    first, T_first_link = places[link]
    parts = [_placed(model, link, np.eye(4), instead)]
    for name in fused:
        if name in places and places[name][0] == first:
            T_link_other = inverse(T_first_link) @ places[name][1]
            parts.append(_placed(model, name, T_link_other, instead))
    if len(parts) == 1:
        return parts[0]
    mass = sum(part.mass for part in parts)
    center = sum((part.mass * part.center for part in parts), np.zeros(3))
    center = center / mass if mass else center
    # About the common centre from the start, so that nothing large cancels.
    inertia = np.zeros((3, 3))
    for part in parts:
        arm = part.center - center
        inertia += part.inertia + part.mass * ((arm @ arm) * np.eye(3) - np.outer(arm, arm))
    return Lump(mass, center, inertia)


def _placed(model: Model, link: str, T: Floats, instead: Mapping[str, LoadedInertial]) -> Lump:
    R, p = T[:3, :3], T[:3, 3]
    if link in instead:
        held = instead[link]
        return Lump(held.mass, p + R @ held.center, R @ held.inertia @ R.T)
    inertial = model.inertial(link)
    origin = inertial.origin.matrix
    axes = R @ origin[:3, :3]
    return Lump(inertial.mass, p + R @ origin[:3, 3], axes @ inertial.tensor @ axes.T)
