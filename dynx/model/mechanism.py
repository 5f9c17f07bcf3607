"""Mechanism: the moving bodies of a model after fixed-joint merging, with their inertias and frames.

The algorithms of `dynx.rbd` work on it. It is generic in the scalar type: inertias are merged in float64 for
the backend `reference` and in 50 digits for the referee.

A mechanism has its own *tree coordinates*: one for each moving joint, mimic joints included, after the six of
a floating base. `Coupling` maps the coordinates of the model to them.

A ball joint is three bodies at one place, of which the last is its child and the others have no mass. The
first has the whole rotation of the joint, and body k rotates about axis k of the child with entry k of its
angular velocity. Axes, velocities and inertias are then those of three revolute joints, and algorithms treat
them so, with one exception: the axes of all three move with the child (`Mechanism.axis_carriers`), so
accelerations differ by `rate_products`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from dynx.argument_types import checks_types
from dynx.model.elements import IDENTITY, JointSprings, Pose, Vector
from dynx.model.tree import Tree
from dynx.spatial.inertia import RigidInertia, inertia_about_origin
from dynx.spatial.scalar import Array, Floats, equal, select, sqrt
from dynx.spatial.so3 import rotate, rotation_about, rotation_from_quat, rotation_from_rpy

ScalarConverter = Callable[[object], Array]
"""Function that converts nested floats to an array of the scalar type in use."""

ROOT = -1
"""Index of the root body: the world for a fixed base, the base link for a floating one."""


def float64(numbers: object) -> Array:
    """Convert nested floats to a float64 array."""
    return np.asarray(numbers, dtype=np.float64)


@dataclass(frozen=True)
class Body:
    """A rigid body and the joint of one degree of freedom that connects it to its parent.

    The body frame is that of the joint's child link. (R, p) is the pose of the joint frame, at position 0, in
    the body frame of the parent; `axis` is the unit axis in the joint frame. `ball` is the number, 0 to 2,
    of the axis among those of a ball joint.
    """

    joint: str
    parent: int
    revolute: bool
    R: Array
    p: Array
    axis: Array
    inertia: RigidInertia
    ball: int | None = None

    @property
    def about_z(self) -> bool:
        """True if the body rotates about the z axis of its joint frame; False if `axis` is a stack of axes of
        several bodies."""
        return self.revolute and self.ball is None and self.axis.ndim == 1 and all(self.axis == (0, 0, 1))


@dataclass(frozen=True)
class BodyFrame:
    """A named frame: its pose (R, p) in the frame of body number `body` (ROOT for the root body)."""

    name: str
    body: int
    R: Array
    p: Array


@dataclass(frozen=True)
class RigidLink:
    """A link as it is described: the number of its parent (ROOT for the root link), and its own inertia about
    the origin of its frame, in the axes of its frame."""

    parent: int
    inertia: RigidInertia


@dataclass(frozen=True)
class Coupling:
    """Mimic joints as an affine map: tree position = scale * model position[index] + offset.

    Velocities and accelerations use the map without the offset, torques its transpose (virtual work). Indices
    count joints, without the base.
    """

    index: tuple[int, ...]
    scale: tuple[float, ...]
    offset: tuple[float, ...]
    n_joints: int
    floating: bool

    def matrix(self) -> Floats:
        """Return S (nv of the tree, nv of the model) with v_tree = S v."""
        base = 6 if self.floating else 0
        S = np.zeros((base + len(self.index), base + self.n_joints))
        S[:base, :base] = np.eye(base)
        for row, (column, scale) in enumerate(zip(self.index, self.scale, strict=True)):
            S[base + row, base + column] = scale
        return S

    def affine_map(self) -> tuple[Floats, Floats]:
        """Return A (nq of the tree, nq of the model) and b with q_tree = A q + b, for one sample."""
        base = 7 if self.floating else 0
        A = np.zeros((base + len(self.index), base + self.n_joints))
        A[:base, :base] = np.eye(base)
        A[base:, base:] = self.matrix()[-len(self.index) :, -self.n_joints :]
        return A, np.concatenate([np.zeros(base), self.offset])

    def expand_q(self, q: Floats) -> Floats:
        """Convert a model configuration (..., nq) to a tree configuration."""
        index, scale, offset = self._arrays
        if not self.floating:
            return np.asarray(q.take(index, axis=-1) * scale + offset)
        joints = q[..., 7:].take(index, axis=-1) * scale + offset
        return np.concatenate([q[..., :7], joints], axis=-1)

    @cached_property
    def _arrays(self) -> tuple[np.ndarray[Any, np.dtype[np.intp]], Floats, Floats]:
        return np.array(self.index, dtype=np.intp), np.array(self.scale), np.array(self.offset)


@dataclass(frozen=True)
class Mechanism:
    """Bodies in depth-first order (a parent precedes its children), frames, gravity and coupling.

    `links` are the links of the description before merging, in depth-first order. Joint k of the description,
    of any type, carries link k + 1, and the frame of link k is frame k.
    """

    name: str
    floating: bool
    gravity: Array
    root: RigidInertia
    bodies: tuple[Body, ...]
    frames: tuple[BodyFrame, ...]
    coupling: Coupling | None
    links: tuple[RigidLink, ...] = ()

    @cached_property
    def body_frames(self) -> tuple[int, ...]:
        """Number of the base frame, which is fixed to the root, and of each body's own frame."""
        first: dict[int, int] = {}
        for number, frame in enumerate(self.frames):
            first.setdefault(frame.body, number)
        return tuple(first[body] for body in (ROOT, *self.axis_carriers))

    @cached_property
    def axis_carriers(self) -> tuple[int, ...]:
        """Number of the body with which the axis of each body's joint moves: the body itself, or the child of
        a ball joint."""
        return tuple(k if body.ball is None else k + 2 - body.ball for k, body in enumerate(self.bodies))

    @cached_property
    def balls(self) -> tuple[int, ...]:
        """Number of the first of the three bodies of each ball joint."""
        return tuple(k for k, body in enumerate(self.bodies) if body.ball == 0)

    @cached_property
    def ball_places(self) -> tuple[int, ...]:
        """Index in q at which the quaternion of each ball joint begins."""
        base = 6 if self.floating else 0
        return tuple(self.places[base + ball] for ball in self.balls)

    @cached_property
    def has_mass(self) -> bool:
        """True if any body has mass."""
        return any(inertia.mass != 0 for inertia in (self.root, *(b.inertia for b in self.bodies)))

    @cached_property
    def places(self) -> tuple[int, ...]:
        """Index in q of each tree coordinate; for a ball joint where its quaternion begins, for a base an
        index not to be used."""
        places, at = [*range(6)] if self.floating else [], 7 if self.floating else 0
        for body in self.bodies:
            places.append(at)
            at += 1 if body.ball is None else 4 * (body.ball == 2)
        return tuple(places)

    @property
    def root_center(self) -> Array:
        """Centre of mass (3,) of a floating root in the base frame [m]; zero without mass or with a fixed
        base."""
        if not self.floating:
            return np.zeros(3)
        mass = np.asarray(self.root.mass)[()]  # may be a symbol
        absent = equal(mass, 0.0)
        return np.asarray(select(absent, 0.0, 1.0) * (self.root.first_moment / select(absent, 1.0, mass)))

    @property
    def nv(self) -> int:
        """Number of tree velocities."""
        return len(self.bodies) + (6 if self.floating else 0)

    @property
    def nq(self) -> int:
        """Number of tree positions."""
        return len(self.bodies) + len(self.balls) + (7 if self.floating else 0)

    def tree_q(self, q: Floats) -> Floats:
        """Convert a model configuration (..., nq) to a tree configuration: with the mimic joints."""
        return q if self.coupling is None else self.coupling.expand_q(q)


def pose_arrays(pose: Pose, convert: ScalarConverter) -> tuple[Array, Array]:
    """Return (R, p) of a pose, in the scalar type of `convert`."""
    return rotation_from_rpy(convert(pose.rpy)), convert(pose.xyz)


def stacked_poses(poses: Sequence[Pose], convert: ScalarConverter) -> tuple[Array, Array]:
    """Return rotations (n, 3, 3) and positions (n, 3) of poses, in the scalar type of `convert`."""
    rpy, xyz = convert([pose.rpy for pose in poses]), convert([pose.xyz for pose in poses])
    return rotation_from_rpy(rpy.reshape(-1, 3)), xyz.reshape(-1, 3)


def rate_products(mechanism: Mechanism, v: Array) -> Array:
    """Return by how much accelerations (..., nv) of ball joints exceed those of three joints in a row
    with the same motion, at the tree velocity v (..., nv); zero for other coordinates.

    It is the sum of e_i x e_j w_i w_j over i < j, with the angular velocity w of a ball joint in the axes
    e of its child: of three joints in a row, joint i carries the axis of joint j.
    """
    columns = [0 * v[..., k] for k in range(v.shape[-1])]
    for ball in mechanism.balls:
        first = v.shape[-1] - len(mechanism.bodies) + ball
        x, y, z = (v[..., first + k] for k in range(3))
        columns[first : first + 3] = [y * z, -(x * z), x * y]
    return np.stack(columns, axis=-1)


def joint_entries(mechanism: Mechanism, x: Array) -> list[Array]:
    """Return the entries (...,) for each body's joint of a tree configuration or velocity (..., n); those
    of a ball joint in a configuration are a quaternion xyzw (..., 4)."""
    end, n = x.shape[-1], len(mechanism.bodies)
    if not mechanism.balls or end != mechanism.nq:
        return [np.asarray(x[..., k]) for k in range(end - n, end)]
    entries, at = [], 7 if mechanism.floating else 0
    for body in mechanism.bodies:
        if body.ball is None:
            entries.append(np.asarray(x[..., at]))
            at += 1
        else:
            entries.append(np.asarray(x[..., at : at + 4]))
            at += 4 * (body.ball == 2)
    return entries


def springs_of(mechanism: Mechanism, stiffness: Array, reference: Array) -> JointSprings:
    """Return the springs of the model's coordinates, from those of the tree (..., n), for any scalar.

    That of a mimic joint acts on its driver through its multiplier.
    """
    preload = stiffness * reference
    if mechanism.coupling is not None:
        S = mechanism.coupling.matrix()[-len(mechanism.coupling.index) :, -mechanism.coupling.n_joints :]
        preload = (preload - stiffness * np.array(mechanism.coupling.offset)) @ S
        stiffness = stiffness @ S**2
    base = np.zeros((*stiffness.shape[:-1], 6 if mechanism.floating else 0))
    stiffness, preload = (np.concatenate([base, each], axis=-1) for each in (stiffness, preload))
    return JointSprings(stiffness, preload, mechanism.places if mechanism.balls else None)


@checks_types
def build_mechanism(tree: Tree, convert: ScalarConverter = float64) -> Mechanism:
    """Merge the links connected by fixed joints and their inertias, in the scalar type of `convert`.

    Poses and inertias of all links are computed together, because this is faster.
    """
    # Placement of each link: its body and its pose (R, p) in the frame of that body.
    identity = convert(np.eye(3)), convert(np.zeros(3))
    at_root = identity if tree.base_pose == IDENTITY else pose_arrays(tree.base_pose, convert)
    placed: dict[str, tuple[int, Array, Array]] = {tree.root: (ROOT, *at_root)}
    moving: list[tuple[str, int, bool, Array, Array]] = []
    axes_given: list[Vector] = []
    balls: dict[int, int] = {}
    rotations, positions = stacked_poses([joint.origin for joint in tree.joints], convert)
    for joint, R_joint, p_joint in zip(tree.joints, rotations, positions, strict=True):
        body, R_parent, p_parent = placed[joint.parent]
        R, p = R_parent @ R_joint, p_parent + rotate(R_parent, p_joint)
        if joint.moves:
            moving.append((joint.name, body, joint.type != "prismatic", R, p))
            if joint.type == "ball":
                first = len(moving) - 1
                moving += [(joint.name, first + k, True, *identity) for k in range(2)]
                balls |= {first + k: k for k in range(3)}
                axes_given += [(1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)]
            else:
                axes_given.append(joint.axis)
            placed[joint.child] = (len(moving) - 1, *identity)
        else:
            placed[joint.child] = (body, R, p)
    # An axis has unit norm only to float64 rounding; normalise it in the scalar type in use.
    axes = convert(axes_given).reshape(-1, 3)
    axes = axes / sqrt(np.sum(axes * axes, axis=-1))[:, None]

    massless = RigidInertia(convert(0.0), convert(np.zeros(3)), convert(np.zeros((3, 3))))
    merged = dict.fromkeys(range(ROOT, len(moving)), massless)
    own = dict.fromkeys((link.name for link in tree.links), massless)
    described = [(link.name, link.inertial) for link in tree.links if link.inertial is not None]
    if described:
        rotations, positions = stacked_poses([inertial.origin for _, inertial in described], convert)
        masses = convert([inertial.mass for _, inertial in described])
        tensors = convert([inertial.tensor for _, inertial in described])
        inertias = inertia_about_origin(masses, positions, rotations, tensors)
        in_bodies = inertias.transform(*_stacked([placed[name] for name, _ in described]))
        for k, (name, _) in enumerate(described):
            body = placed[name][0]
            merged[body] = merged[body] + in_bodies[k]
            own[name] = inertias[k]
    numbers = {link.name: number for number, link in enumerate(tree.links)}
    parents = {joint.child: numbers[joint.parent] for joint in tree.joints}
    links = [RigidLink(parents.get(link.name, ROOT), own[link.name]) for link in tree.links]

    on = [placed[frame.link] for frame in tree.frames]
    R_links, p_links = _stacked(on)
    rotations, positions = stacked_poses([frame.placement for frame in tree.frames], convert)
    rotations, positions = R_links @ rotations, p_links + rotate(R_links, positions)
    frames = [
        BodyFrame(frame.name, body, R, p)
        for frame, (body, _, _), R, p in zip(tree.frames, on, rotations, positions, strict=True)
    ]

    return Mechanism(
        name=tree.name,
        floating=tree.floating,
        gravity=convert(tree.gravity),
        root=merged[ROOT],
        bodies=tuple(
            Body(*fields, axis, merged[k], balls.get(k))
            for k, (fields, axis) in enumerate(zip(moving, axes, strict=True))
        ),
        frames=tuple(frames),
        coupling=_coupling(tree),
        links=tuple(links),
    )


def _stacked(placements: Sequence[tuple[int, Array, Array]]) -> tuple[Array, Array]:
    """Return rotations (n, 3, 3) and positions (n, 3) of placements in bodies."""
    return np.array([R for _, R, _ in placements]), np.array([p for _, _, p in placements])


def joint_motion(body: Body, value: Array) -> tuple[Array, Array]:
    """Return (R, p) of the body frame in its parent's body frame at joint position `value` (...,), of a ball
    joint (..., 4)."""
    value = np.asarray(value)
    if body.ball is not None:
        return (body.R @ rotation_from_quat(value), body.p) if body.ball == 0 else (body.R, body.p)
    if body.revolute:
        return body.R @ rotation_about(body.axis, value), body.p
    return body.R, body.p + rotate(body.R, body.axis * value[..., None])


def _coupling(tree: Tree) -> Coupling | None:
    moving = [joint for joint in tree.joints if joint.moves]
    if all(joint.mimic is None for joint in moving):
        return None
    position = {name: index for index, name in enumerate(tree.joint_names)}
    index, scale, offset = [], [], []
    for joint in moving:
        driver = joint.mimic
        index.append(position[joint.name if driver is None else driver.joint])
        scale.append(1.0 if driver is None else driver.multiplier)
        offset.append(0.0 if driver is None else driver.offset)
    return Coupling(tuple(index), tuple(scale), tuple(offset), len(position), tree.floating)
