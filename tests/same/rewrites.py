"""Rewrites of a robot that keep it the same, and differences planted into one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from dynx.model import Model
from dynx.model.elements import Inertial, Joint, JointDynamics, Limits, Link, Mimic, Pose
from dynx.spatial.scalar import Floats
from dynx.spatial.se3 import homogeneous, inverse
from dynx.spatial.so3 import rotation_about, skew


def rebuilt(model: Model, links: Sequence[Link], joints: Sequence[Joint]) -> Model:
    """Return the model with other links and joints."""
    return Model.build(model.name, links, joints, base=model.base, gravity=model.gravity)


def random_rotation(rng: np.random.Generator, largest: float = 3.0) -> Floats:
    """Return a rotation (3, 3) about a random axis by up to `largest` [rad]."""
    axis = rng.standard_normal(3)
    return rotation_about(axis / np.linalg.norm(axis), np.asarray(rng.uniform(-largest, largest)))


def pose(T: Floats) -> Pose:
    return Pose.from_matrix(T)


def with_moved_frames(
    model: Model, rng: np.random.Generator, shift: float = 0.3, angle: float = 3.0
) -> Model:
    """Give every link another frame: turned by up to `angle` [rad], and moved by up to `shift` [m] along each
    axis where its joint lets it be."""
    frames = {model.root: np.eye(4)}
    if model.floating:
        frames[model.root] = homogeneous(random_rotation(rng, angle), rng.uniform(-shift, shift, 3))
    for joint in model.joints:
        move = rng.uniform(-shift, shift, 3)
        if joint.type in ("revolute", "continuous"):
            move = np.array(joint.axis) * move[0]
        if joint.type == "ball":
            move = np.zeros(3)
        frames[joint.child] = homogeneous(random_rotation(rng, angle), move)
    joints = []
    for joint in model.joints:
        X, Y = frames[joint.parent], frames[joint.child]
        x, y, z = (Y[:3, :3].T @ np.array(joint.axis)).tolist()
        origin = pose(inverse(X) @ joint.origin.matrix @ Y)
        joints.append(replace(joint, origin=origin, axis=(x, y, z)))
    links = [
        link
        if link.inertial is None
        else replace(
            link,
            inertial=replace(
                link.inertial, origin=pose(inverse(frames[link.name]) @ link.inertial.origin.matrix)
            ),
        )
        for link in model.links
    ]
    return rebuilt(model, links, joints)


def with_flipped_axes(model: Model, rng: np.random.Generator) -> Model:
    """Reverse the axes of some joints."""
    signs = {joint.name: rng.choice((-1.0, 1.0)) for joint in model.joints}
    joints = []
    for joint in model.joints:
        sign = signs[joint.name]
        if not joint.moves or joint.type == "ball":
            joints.append(joint)
            continue
        limits, mimic = joint.limits, joint.mimic
        if sign < 0:
            limits = replace(limits, lower=-limits.upper, upper=-limits.lower)
        if mimic is not None:
            mimic = Mimic(mimic.joint, sign * signs[mimic.joint] * mimic.multiplier, sign * mimic.offset)
        x, y, z = (sign * np.array(joint.axis)).tolist()
        joints.append(replace(joint, axis=(x, y, z), limits=limits, mimic=mimic))
    return rebuilt(model, model.links, joints)


def with_turned_inertias(model: Model, rng: np.random.Generator) -> Model:
    """Write every inertia in other axes."""
    links = []
    for link in model.links:
        inertial = link.inertial
        if inertial is not None:
            Q = random_rotation(rng)
            origin = pose(inertial.origin.matrix @ homogeneous(Q, np.zeros(3)))
            inertial = inertial_of(inertial.mass, origin, Q.T @ inertial.tensor @ Q)
        links.append(replace(link, inertial=inertial))
    return rebuilt(model, links, model.joints)


def inertial_of(mass: float, origin: Pose, tensor: Floats) -> Inertial:
    xx, xy, xz, yy, yz, zz = tensor[np.triu_indices(3)].tolist()
    return Inertial(mass, origin, xx, xy, xz, yy, yz, zz)


def with_split_links(model: Model, rng: np.random.Generator) -> Model:
    """Take a part of the mass of each link to a new link, which a fixed joint joins to it."""
    links, joints = [], list(model.joints)
    for link in model.links:
        inertial = link.inertial
        if inertial is None or inertial.mass == 0.0:
            links.append(link)
            continue
        share = float(rng.uniform(0.2, 0.8))
        part, rest = (
            inertial_of(each * inertial.mass, inertial.origin, each * inertial.tensor)
            for each in (share, 1.0 - share)
        )
        place = homogeneous(random_rotation(rng), rng.uniform(-0.2, 0.2, 3))
        name = f"{link.name}_part"
        links += [replace(link, inertial=rest)]
        links.append(Link(name, replace(part, origin=pose(inverse(place) @ inertial.origin.matrix))))
        joints.append(Joint(f"{name}_joint", "fixed", link.name, name, pose(place)))
    return rebuilt(model, links, joints)


def with_merged_links(model: Model) -> Model:
    """Merge the inertias of links below fixed joints with those of their parents; drop them where nothing
    else is attached to them."""
    links = {link.name: link for link in model.links}
    joints = list(model.joints)
    for joint in reversed(model.joints):
        if joint.moves or any(each.parent == joint.child for each in joints):
            continue
        joints.remove(joint)
        child = links.pop(joint.child)
        if child.inertial is not None:
            parent = links[joint.parent]
            moved = replace(child.inertial, origin=pose(joint.origin.matrix @ child.inertial.origin.matrix))
            links[joint.parent] = replace(parent, inertial=merged(parent.inertial or Inertial(), moved))
    return rebuilt(model, list(links.values()), joints)


def merged(one: Inertial, other: Inertial) -> Inertial:
    """Return the inertial of two bodies in one frame."""
    mass = one.mass + other.mass
    centers = [np.array(each.origin.xyz) for each in (one, other)]
    moments = one.mass * centers[0] + other.mass * centers[1]
    center = moments / mass if mass else np.zeros(3)
    tensor = np.zeros((3, 3))
    for each, at in zip((one, other), centers, strict=True):
        R, C = each.origin.matrix[:3, :3], skew(at - center)
        tensor += R @ each.tensor @ R.T - each.mass * (C @ C)
    x, y, z = center.tolist()
    return inertial_of(mass, Pose((x, y, z)), tensor)


def with_other_order(model: Model, rng: np.random.Generator) -> Model:
    """List joints and links in another order."""
    links, joints = list(model.links), list(model.joints)
    return rebuilt(
        model,
        [links[k] for k in rng.permutation(len(links))],
        [joints[k] for k in rng.permutation(len(joints))],
    )


def with_other_names(model: Model) -> Model:
    """Rename every link and joint."""
    joints = [
        replace(
            joint,
            name=f"j_{joint.name}",
            parent=f"l_{joint.parent}",
            child=f"l_{joint.child}",
            mimic=None if joint.mimic is None else replace(joint.mimic, joint=f"j_{joint.mimic.joint}"),
        )
        for joint in model.joints
    ]
    return rebuilt(model, [replace(link, name=f"l_{link.name}") for link in model.links], joints)


def with_other_joint_attributes(model: Model) -> Model:
    """Give joints other limits and joint dynamics, which do not belong to the verdict."""
    joints = [
        replace(
            joint,
            limits=Limits(joint.limits.lower - 1.0, joint.limits.upper + 1.0, 3.0, 4.0),
            dynamics=JointDynamics(0.7, 0.1, 0.2),
        )
        if joint.moves
        else joint
        for joint in model.joints
    ]
    return rebuilt(model, model.links, joints)
