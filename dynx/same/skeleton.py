"""Skeleton of a robot: its moving bodies, with links merged across fixed joints, in 50 digits and float64."""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property
from typing import Literal

import numpy as np

from dynx.model import Model
from dynx.model.elements import IDENTITY, Inertial, Joint, Pose
from dynx.model.mechanism import ROOT, Body, BodyFrame, Mechanism, build_mechanism
from dynx.model.topology import lock_joint
from dynx.rbd.base_parameters import rotation_to_axis, split_inertia
from dynx.same.decimals import decimals, fifty_digits, rounded
from dynx.same.scales import Whole
from dynx.spatial.inertia import RigidInertia
from dynx.spatial.scalar import Array, Floats
from dynx.spatial.se3 import homogeneous
from dynx.spatial.so3 import skew


def without_standing_mimics(model: Model) -> Model:
    """Return the model with its base at the identity, and with mimic joints of multiplier 0, which do not
    move, fixed at their offsets."""
    joints = tuple(
        lock_joint(joint, joint.mimic.offset)
        if joint.moves and joint.mimic is not None and joint.mimic.multiplier == 0.0
        else joint
        for joint in model.joints
    )
    return replace(model, joints=joints, base_pose=IDENTITY)


def kind_of(joint: Joint) -> str:
    """Return the type of a joint; one with limits and one without are of one kind."""
    return "revolute" if joint.type == "continuous" else joint.type


def exact_skeleton(model: Model) -> Skeleton:
    """Build the skeleton of a model in 50 digits."""
    with fifty_digits():
        return Skeleton(model)


def float_inertia(inertia: RigidInertia) -> RigidInertia:
    """Round an inertia to float64."""
    return RigidInertia(
        rounded(inertia.mass), rounded(inertia.first_moment), rounded(inertia.rotational_inertia)
    )


def subtract(one: RigidInertia, other: RigidInertia) -> RigidInertia:
    """Return the difference of two inertias in the same frame."""
    return RigidInertia(
        np.asarray(one.mass - other.mass),
        one.first_moment - other.first_moment,
        one.rotational_inertia - other.rotational_inertia,
    )


def transformed(inertia: RigidInertia, T: Array) -> RigidInertia:
    """Return an inertia in the frame in which its own frame has the pose T (4, 4)."""
    return inertia.transform(T[:3, :3], T[:3, 3])


JointKind = Literal["revolute", "prismatic", "ball"]
"""Motion of a joint; a continuous joint is revolute."""


ALIKE = 1e-12
"""Difference of two numbers that are the same but for rounding, relative to the largest of their kind."""


def are_alike(one: Pose | Inertial | None, other: Pose | Inertial | None) -> bool:
    """Check whether two descriptions state the same pose, or the same inertia of a link, to rounding: in
    other units, angles or axes of the tensor too."""
    if one == other or one is None or other is None:
        return one == other
    if isinstance(one, Pose) or isinstance(other, Pose):
        assert isinstance(one, Pose)
        assert isinstance(other, Pose)
        T, S = one.matrix, other.matrix
        size = max(1.0, float(np.max(np.abs(T[:3, 3]))))
        return bool(np.max(np.abs(T - S)) <= ALIKE * size)
    pairs = zip(_numbers_of(one), _numbers_of(other), strict=True)
    return all(bool(np.max(np.abs(x - y)) <= ALIKE * np.max(np.abs(x))) for x, y in pairs)


def _numbers_of(inertial: Inertial) -> tuple[Floats, Floats, Floats]:
    """Return mass, centre of mass and tensor about it, in the axes of the link."""
    return np.array([inertial.mass]), inertial.origin.matrix[:3, 3], inertial.link_tensor


def is_of_reader(model: Model, joint: Joint) -> bool:
    """Check whether a reader makes the child link of a joint, without mass: for a joint beside the origin of
    its body, or before another joint of the body."""
    inertial = model.inertial(joint.child)
    made = joint.moves and joint.line is not None and model.link(joint.child).line == joint.line
    held = sum(each.parent == joint.child for each in model.joints)
    return made and held == 1 and not (inertial.mass or inertial.tensor.any())


class Skeleton:
    """Bodies of a model, one for each joint that moves, in the order of its mechanism; ROOT is the root body.

    The three bodies of a ball joint in the mechanism are one here; `numbers` are the mechanism's. Build it
    inside `fifty_digits`. Poses T (4, 4) of joints are those in the body of the parent, at position 0.
    """

    def __init__(self, model: Model) -> None:
        self.model = model
        self.mechanism: Mechanism = build_mechanism(model, decimals)
        self.joints: tuple[Joint, ...] = tuple(joint for joint in model.joints if joint.moves)
        self.numbers: tuple[int, ...] = tuple(
            number for number, body in enumerate(self.mechanism.bodies) if body.ball in (None, 2)
        )
        self.number_of: dict[int, int] = {ROOT: ROOT} | {number: k for k, number in enumerate(self.numbers)}
        self.bodies: tuple[Body, ...] = tuple(self._body(number) for number in self.numbers)
        self.kinds: tuple[JointKind, ...] = tuple(
            "prismatic" if not body.revolute else "revolute" if body.ball is None else "ball"
            for body in self.bodies
        )
        self.frames: tuple[BodyFrame, ...] = tuple(
            replace(frame, body=self.number_of[frame.body]) for frame in self.mechanism.frames
        )
        self.exact = [homogeneous(body.R, body.p) for body in self.bodies]
        self.placements: list[Floats] = [rounded(T) for T in self.exact]
        self.axes: list[Floats] = [rounded(body.axis) for body in self.bodies]
        self.children: dict[int, list[int]] = {body: [] for body in range(ROOT, len(self.bodies))}
        for number, body in enumerate(self.bodies):
            self.children[body.parent].append(number)
        self.body_of = {link.name: frame.body for link, frame in zip(model.links, self.frames, strict=False)}
        self.links: dict[int, list[int]] = {body: [] for body in self.children}
        for number, link in enumerate(model.links):
            self.links[self.body_of[link.name]].append(number)
        self.number = {joint.name: k for k, joint in enumerate(self.joints)}

    def _body(self, number: int) -> Body:
        """Return a body of the mechanism; the last one of a ball joint, with the place of the first."""
        bodies = self.mechanism.bodies
        body = bodies[number]
        first = body if body.ball is None else bodies[number - body.ball]
        return replace(first, parent=self.number_of[first.parent], inertia=body.inertia)

    def inertia(self, body: int) -> RigidInertia:
        """Return the merged inertia of a body in 50 digits, in its frame."""
        return self.mechanism.root if body == ROOT else self.bodies[body].inertia

    @cached_property
    def inertias(self) -> dict[int, RigidInertia]:
        """Merged inertias in float64."""
        return {body: float_inertia(self.inertia(body)) for body in self.children}

    @cached_property
    def carried_links(self) -> list[str]:
        """Name of the first link below each body's joint that is more than a link without mass which holds
        the next joint: readers make such links, and files state them."""
        model = self.model
        below: dict[str, list[Joint]] = {}
        for joint in model.joints:
            below.setdefault(joint.parent, []).append(joint)
        found = []
        for joint in self.joints:
            link = joint.child
            while len(below.get(link, ())) == 1:
                inertial = model.inertial(link)
                if inertial.mass or inertial.tensor.any():
                    break
                link = below[link][0].child
            found.append(link)
        return found

    @cached_property
    def heavy_links(self) -> dict[int, dict[str, RigidInertia]]:
        """Inertias in float64 of the links of each body that have one, by name, in the frame of the body."""
        found: dict[int, dict[str, RigidInertia]] = {body: {} for body in self.links}
        for body, numbers in self.links.items():
            for k in numbers:
                inertial = self.model.links[k].inertial
                if inertial is not None and (inertial.mass or inertial.tensor.any()):
                    frame = self.frames[k]
                    own = float_inertia(self.mechanism.links[k].inertia)
                    moved = own.transform(rounded(frame.R), rounded(frame.p))
                    found[body][self.model.links[k].name] = moved
        return found

    @cached_property
    def grouped(self) -> dict[int, RigidInertia]:
        """Inertias of the bodies in float64, each with all of the bodies below it that may as well be the
        parent's.

        Of a body on a revolute joint that is its mass, its first moment along the axis, and the mean of its
        moments about the axes across; of one on a prismatic joint its tensor about the centre of mass
        (Gautier and Khalil 1990); of one on a ball joint its mass at the centre of the joint. An exchange of
        inertia that no state shows leaves that of the root alone.
        """
        total = dict(self.inertias)
        for number in reversed(range(len(self.bodies))):
            inertia, axis, T = total[number], self.axes[number], self.placements[number]
            along = np.outer(axis, axis)
            if self.kinds[number] == "ball":
                moved = RigidInertia(inertia.mass, np.zeros(3), np.zeros((3, 3)))
            elif self.kinds[number] == "revolute":
                tensor = inertia.rotational_inertia
                across = (np.trace(tensor) - axis @ tensor @ axis) / 2.0 * (np.eye(3) - along)
                moved = RigidInertia(inertia.mass, along @ inertia.first_moment, across)
            else:
                mass, H = float(inertia.mass), skew(inertia.first_moment)
                central = inertia.rotational_inertia + (H @ H / mass if mass else 0.0)
                moved = RigidInertia(np.zeros(()), np.zeros(3), central)
            parent = self.bodies[number].parent
            total[parent] = total[parent] + moved.transform(T[:3, :3], T[:3, 3])
        return total

    def link_pose(self, link: int) -> Array:
        """Return the pose (4, 4) of a link, by its number, in the frame of its body, in 50 digits."""
        frame = self.frames[link]
        return homogeneous(frame.R, frame.p)

    def link_inertia(self, link: int) -> RigidInertia:
        """Return the inertia of a link in 50 digits, in the frame of its body."""
        frame = self.frames[link]
        return self.mechanism.links[link].inertia.transform(frame.R, frame.p)

    def parent_pose(self, body: int) -> Array:
        """Return the pose (4, 4) of the link to which the joint of a body is attached, in the parent body."""
        names = [link.name for link in self.model.links]
        return self.link_pose(names.index(self.joints[body].parent))

    @cached_property
    def reach(self) -> float:
        """Length [m] of the longest path along the links from the root to a joint, a link or a centre of mass
        with prismatic joints at the end of their range; 1 where every length is 0."""
        path = {ROOT: 0.0}
        for number, body in enumerate(self.bodies):
            length = float(np.linalg.norm(self.placements[number][:3, 3]))
            path[number] = path[body.parent] + length + self.travel(number)
        ends = [path[frame.body] + float(np.linalg.norm(rounded(frame.p))) for frame in self.frames]
        ends += [path[number] + radius(inertia) for number, inertia in self.inertias.items()]
        return max(ends) or 1.0

    @cached_property
    def whole(self) -> Whole:
        """Mass and reach of the robot."""
        return Whole(sum(abs(float(each.mass)) for each in self.inertias.values()), self.reach)

    def travel(self, body: int) -> float:
        """Return the largest distance [m] that a prismatic joint moves from 0; 0 without limits, and for a
        revolute or ball joint."""
        limits = self.joints[body].limits
        if self.kinds[body] != "prismatic":
            return 0.0
        ends = [abs(end) for end in (limits.lower, limits.upper)]
        return max((end for end in ends if np.isfinite(end)), default=0.0)

    def unshared(self, body: int, inertia: RigidInertia) -> RigidInertia:
        """Return what of an inertia of a body (float64) cannot be its parent's as well."""
        if self.kinds[body] == "ball":
            return split_inertia(inertia, revolute=True, ball=True)[0]
        Q = self._axis_frames[body]
        turned = inertia.transform(Q.T, np.zeros(3))
        remaining, _ = split_inertia(turned, self.kinds[body] == "revolute")
        back: RigidInertia = remaining.transform(Q, np.zeros(3))
        return back

    @cached_property
    def _axis_frames(self) -> list[Floats]:
        return [rotation_to_axis(np.eye(3), axis) for axis in self.axes]

    @cached_property
    def depth(self) -> int:
        """Largest number of joints between the root and a body."""
        depths = {ROOT: 0}
        for number, body in enumerate(self.bodies):
            depths[number] = depths[body.parent] + 1
        return max(depths.values())

    @cached_property
    def sizes(self) -> dict[int, int]:
        """Number of bodies of the subtree of each body."""
        sizes = dict.fromkeys(self.children, 1)
        for number in reversed(range(len(self.bodies))):
            sizes[self.bodies[number].parent] += sizes[number]
        return sizes

    @cached_property
    def _shapes(self) -> dict[int, tuple[object, ...]]:
        found: dict[int, tuple[object, ...]] = {}
        for number in reversed(range(len(self.bodies))):
            below = sorted((found[child] for child in self.children[number]), key=repr)
            found[number] = (self.kinds[number], *below)
        return found

    def shape_of(self, body: int) -> tuple[object, ...]:
        """Return the kinds of the joint of a body and of all below it, the same for each order of them."""
        return self._shapes[body]

    def invariants(self, body: int) -> Floats:
        """Return numbers (n,) of the inertia of a body that no exchange with its parent and no turn of its
        frame about its joint changes."""
        inertia, axis = self.grouped[body], self.axes[body]
        h, tensor = inertia.first_moment, inertia.rotational_inertia
        if self.kinds[body] == "prismatic":
            return np.array([float(inertia.mass)])
        if self.kinds[body] == "ball":
            return np.array([float(np.linalg.norm(h)), *np.linalg.eigvalsh(tensor).tolist()])
        # Along the axis the origin may be anywhere; about it, the moments across may be turned.
        across = np.eye(3) - np.outer(axis, axis)
        low, high = np.sort(np.abs(np.linalg.eigvalsh(across @ tensor @ across)))[1:].tolist()
        return np.array([float(np.linalg.norm(across @ h)), float(axis @ tensor @ axis), high - low])


def radius(inertia: RigidInertia) -> float:
    """Return the distance [m] at which the whole mass of a body has the largest moment of its tensor."""
    mass = abs(float(inertia.mass))
    if mass == 0.0:
        return 0.0
    return float(np.sqrt(np.max(np.abs(inertia.rotational_inertia)) / mass))
