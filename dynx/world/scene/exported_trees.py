"""Trees of bodies that `scene_to_mjcf` wrote, as the robots and bodies of its scene.

In such a document a robot is a body that holds its links, named ``robot/link``, and nothing else but, where
the robot moves freely, the joint and the inertia. The shapes of a link that is fixed to another one are in
a body ``robot/link/shapes``. A free body is at its centre of mass, named ``body/center``, with the body
``body`` fixed to it. Trees of other documents that have these forms and names are read alike; no mass, joint
or shape is lost by it.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from dynx.model.elements import Frame, Inertial, Joint, Pose
from dynx.model.geometry import Geometry, LinkGeometry
from dynx.model.mjcf.reader import MjcfBody, MjcfTree
from dynx.model.mjcf.shapes import Geom
from dynx.spatial.scalar import Floats
from dynx.spatial.se3 import inverse

_CENTER, _SHAPES = "/center", "/shapes"


def as_exported(tree: MjcfTree) -> MjcfTree:
    """Return the tree with the links and names that it had before `scene_to_mjcf` wrote it, or as it is."""
    names = [body.name for body in tree.bodies]
    first = tree.first
    if len(names) < 2 or (first.jointed and not tree.free):
        return tree
    second = tree.bodies[1]
    if second.parent != first.name or second.jointed:
        return tree
    if tree.free and names == [f"{second.name}{_CENTER}", second.name]:
        return _without_first(tree)
    prefix = f"{first.name}/"
    if first.geoms or not all(name.startswith(prefix) for name in names[1:]):
        return tree
    return _without_prefix(_without_shape_bodies(_without_first(tree)), prefix)


def _without_first(tree: MjcfTree) -> MjcfTree:
    """Make the second body, which is fixed to the first one, the root, with the inertia of both."""
    first, second = tree.first, tree.bodies[1]
    content = tree.description
    T = inverse(first.T_world_body) @ second.T_world_body
    back = inverse(T)
    links = {link.name: link for link in content.links}
    inertial = links[first.name].inertial
    if inertial is not None and inertial.mass:
        if _has_mass(links[second.name].inertial):
            return tree
        root = replace(links[second.name], inertial=_moved(inertial, back))
    else:
        root = links[second.name]
    joints = [
        replace(joint, parent=second.name, origin=_pose(back @ joint.origin.matrix))
        if joint.parent == first.name
        else joint
        for joint in content.joints
        if joint.child != second.name
    ]
    others = [link for link in content.links if link.name not in (first.name, second.name)]
    geometry = dict(content.geometry.links)
    geometry[second.name] = _joined(geometry[second.name], geometry.pop(first.name), back)
    bodies = [
        replace(body, parent=second.name) if body.parent == first.name else body for body in tree.bodies[2:]
    ]
    geoms = second.geoms + _placed(first, back)
    new_first = replace(second, parent=None, jointed=first.jointed, geoms=geoms)
    description = replace(
        content,
        name=second.name,
        links=[root, *others],
        joints=joints,
        frames=[_reattached(each, first.name, second.name, back) for each in content.frames],
        geometry=Geometry(geometry),
        base_pose=content.base_pose if tree.free else _pose(second.T_world_body),
    )
    return replace(tree, description=description, bodies=(new_first, *bodies))


def _without_shape_bodies(tree: MjcfTree) -> MjcfTree:
    """Give the shapes of bodies ``LINK/shapes`` to the links that they are named for."""
    content = tree.description
    poses = {body.name: body.T_world_body for body in tree.bodies}
    parents = {joint.parent for joint in content.joints}
    fixed = {joint.child for joint in content.joints if not joint.moves}
    inertials = {link.name: link.inertial for link in content.links}
    geometry = dict(content.geometry.links)
    owners: dict[str, str] = {}
    frames = content.frames
    for name in poses:
        owner = name.removesuffix(_SHAPES)
        if owner == name or owner not in poses or name not in fixed or name in parents:
            continue
        if _has_mass(inertials[name]):
            continue
        T = inverse(poses[owner]) @ poses[name]
        geometry[owner] = _joined(geometry[owner], geometry.pop(name), T)
        frames = [_reattached(each, name, owner, T) for each in frames]
        owners[name] = owner
    description = replace(
        content,
        links=[link for link in content.links if link.name not in owners],
        joints=[joint for joint in content.joints if joint.child not in owners],
        frames=frames,
        geometry=Geometry(geometry),
    )
    kept = {body.name: body for body in tree.bodies if body.name not in owners}
    for body in tree.bodies:
        if body.name in owners:
            own = kept[owners[body.name]]
            T = inverse(own.T_world_body) @ body.T_world_body
            kept[own.name] = replace(own, geoms=own.geoms + _placed(body, T))
    return replace(tree, description=description, bodies=tuple(kept.values()))


def _without_prefix(tree: MjcfTree, prefix: str) -> MjcfTree:
    """Remove the name of the robot from those of its links and joints."""
    content = tree.description

    def short(name: str) -> str:
        return name.removeprefix(prefix)

    def shorter(joint: Joint) -> Joint:
        return replace(joint, name=short(joint.name), parent=short(joint.parent), child=short(joint.child))

    description = replace(
        content,
        name=prefix[:-1],
        links=[replace(link, name=short(link.name)) for link in content.links],
        joints=[shorter(joint) for joint in content.joints],
        frames=[Frame(short(each.name), short(each.link), each.placement) for each in content.frames],
        geometry=Geometry({short(name): each for name, each in content.geometry.links.items()}),
        actuators=tuple(
            replace(each, name=short(each.name), joint=short(each.joint)) for each in content.actuators or ()
        ),
    )
    return replace(
        tree,
        description=description,
        bodies=tuple(
            replace(body, name=short(body.name), parent=None if body.parent is None else short(body.parent))
            for body in tree.bodies
        ),
        positions=tuple((short(name), position) for name, position in tree.positions),
    )


def _placed(body: MjcfBody, T: Floats) -> tuple[Geom, ...]:
    """Return the geoms of a body in a frame in which the body is at T (4, 4)."""
    return tuple(replace(geom, pose=T @ geom.pose) for geom in body.geoms)


def _reattached(frame: Frame, link: str, to: str, T_to_link: Floats) -> Frame:
    """Return a frame of a link as one of the link `to`."""
    if frame.link != link:
        return frame
    return Frame(frame.name, to, _pose(T_to_link @ frame.placement.matrix))


def _has_mass(inertial: Inertial | None) -> bool:
    return inertial is not None and bool(inertial.mass or np.any(inertial.tensor))


def _moved(inertial: Inertial, T: Floats) -> Inertial:
    return replace(inertial, origin=_pose(T @ inertial.origin.matrix))


def _joined(own: LinkGeometry, added: LinkGeometry, T: Floats) -> LinkGeometry:
    return LinkGeometry(
        own.visuals + tuple(replace(each, origin=_pose(T @ each.origin.matrix)) for each in added.visuals),
        own.collisions
        + tuple(replace(each, origin=_pose(T @ each.origin.matrix)) for each in added.collisions),
        own.visual_fault or added.visual_fault,
        own.collision_fault or added.collision_fault,
    )


def _pose(T: Floats) -> Pose:
    return Pose.from_matrix(T)
