"""Differences planted into a robot: each changes one element by a given part of its scale."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from dynx.model import Model
from dynx.model.elements import Inertial, Joint, Pose
from dynx.spatial.se3 import homogeneous
from dynx.spatial.so3 import rotation_about
from tests.same.rewrites import rebuilt


@dataclass(frozen=True)
class Planted:
    """A robot with a difference, and the part and name of the element that has it."""

    model: Model
    part: str
    name: str


def heavy(model: Model, link: str) -> bool:
    """Check whether a link moves and has a proper inertia."""
    inertial = model.inertial(link)
    return inertial.mass > 0.0 and bool(np.all(np.linalg.eigvalsh(inertial.tensor) > 0.0))


def with_joint(model: Model, joint: Joint) -> Model:
    joints = [joint if each.name == joint.name else each for each in model.joints]
    return rebuilt(model, model.links, joints)


def with_inertial(model: Model, link: str, inertial: Inertial) -> Model:
    links = [replace(each, inertial=inertial) if each.name == link else each for each in model.links]
    return rebuilt(model, links, model.joints)


def moved_origin(model: Model, joint: Joint, size: float, reach: float, rng: np.random.Generator) -> Planted:
    """Move the place of a joint, not along its axis."""
    axis = np.array(joint.axis)
    across = np.cross(axis, rng.standard_normal(3))
    across *= size * reach / np.linalg.norm(across)
    T = joint.origin.matrix @ homogeneous(np.eye(3), across)
    return Planted(with_joint(model, replace(joint, origin=Pose.from_matrix(T))), "origin", joint.name)


def turned_origin(model: Model, joint: Joint, size: float, reach: float, rng: np.random.Generator) -> Planted:
    """Turn the place of a joint about its axis, or another one."""
    axis = rng.standard_normal(3) if rng.random() < 0.5 else np.array(joint.axis)
    R = rotation_about(axis / np.linalg.norm(axis), np.asarray(size))
    T = joint.origin.matrix @ homogeneous(R, np.zeros(3))
    return Planted(with_joint(model, replace(joint, origin=Pose.from_matrix(T))), "origin", joint.name)


def turned_axis(model: Model, joint: Joint, size: float, reach: float, rng: np.random.Generator) -> Planted:
    """Turn the axis of a joint."""
    axis = np.array(joint.axis)
    across = np.cross(axis, rng.standard_normal(3))
    R = rotation_about(across / np.linalg.norm(across), np.asarray(size))
    x, y, z = (R @ axis).tolist()
    return Planted(with_joint(model, replace(joint, axis=(x, y, z))), "axis", joint.name)


def other_mass(model: Model, link: str, size: float) -> Planted:
    """Change the mass of a link."""
    inertial = model.inertial(link)
    return Planted(
        with_inertial(model, link, replace(inertial, mass=inertial.mass * (1.0 + size))), "inertial", link
    )


def moved_center(model: Model, link: str, size: float, rng: np.random.Generator) -> Planted:
    """Move the centre of mass by a part of the larger of its distance and the radius of gyration."""
    inertial = model.inertial(link)
    center = np.array(inertial.origin.xyz)
    gyration = float(np.sqrt(np.max(np.abs(inertial.tensor)) / inertial.mass))
    direction = rng.standard_normal(3)
    direction *= size * max(float(np.linalg.norm(center)), gyration) / np.linalg.norm(direction)
    x, y, z = (center + direction).tolist()
    moved = replace(inertial, origin=Pose((x, y, z), inertial.origin.rpy))
    return Planted(with_inertial(model, link, moved), "inertial", link)


def other_moment(model: Model, link: str, size: float, rng: np.random.Generator) -> Planted:
    """Change a moment or product of inertia by a part of the largest entry."""
    inertial = model.inertial(link)
    name = str(rng.choice(["ixx", "iyy", "izz", "ixy", "ixz", "iyz"]))
    change = size * float(np.max(np.abs(inertial.tensor)))
    other = replace(inertial, **{name: getattr(inertial, name) + change})
    return Planted(with_inertial(model, link, other), "inertial", link)


def plantings(model: Model, size: float, rng: np.random.Generator) -> Iterator[Planted]:
    """Yield a difference of each kind, at random joints and links."""
    reach = sum(float(np.linalg.norm(joint.origin.xyz)) for joint in model.joints) or 1.0
    moving = [joint for joint in model.joints if joint.moves]
    links = [joint.child for joint in moving if heavy(model, joint.child)]
    for plant in (moved_origin, turned_origin, turned_axis):
        yield plant(model, moving[int(rng.integers(len(moving)))], size, reach, rng)
    if links:
        link = links[int(rng.integers(len(links)))]
        yield other_mass(model, link, size)
        yield moved_center(model, link, size, rng)
        yield other_moment(model, link, size, rng)
