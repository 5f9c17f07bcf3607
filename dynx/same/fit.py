"""How far each matched body of two robots is from its counterpart, in 50 digits."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dynx.model.elements import Joint
from dynx.model.mechanism import ROOT
from dynx.same.decimals import decimals, rounded
from dynx.same.matching import BodyPair, MatchingPlan
from dynx.same.skeleton import Skeleton, subtract, transformed
from dynx.spatial.inertia import RigidInertia
from dynx.spatial.scalar import Array, Floats
from dynx.spatial.se3 import inverse
from dynx.spatial.so3 import cross


@dataclass(frozen=True)
class BodyFit:
    """A matched body: the pose D (4, 4) of its frame in that of its counterpart, and what differs.

    `sign` is that of the joint's positions: 1, or -1 where the axes are opposite. `axis` is the sine of the
    angle between the axes [rad], `line` the distance of the axes [m]. `turn` [rad] and `shift` [m] are those
    of the joint's place in the parent, `scale` and `offset` those of a mimic joint. `inertia` is the
    difference of the inertias, ours minus theirs, in the frame of our body.

    Of a ball joint `line` is the distance of the centres. Its attitudes R(q) (3, 3) are those of its
    counterpart, ``R(q_ours) = before R(q_theirs) D'`` with the rotation of D; `before` is None for other
    joints.
    """

    ours: int
    theirs: int
    D: Array
    sign: int = 1
    axis: float = 0.0
    line: float = 0.0
    turn: float = 0.0
    shift: float = 0.0
    scale: float = 0.0
    offset: float = 0.0
    inertia: RigidInertia | None = None
    before: Array | None = None

    @property
    def turns(self) -> tuple[Floats, Floats]:
        """Rotations (3, 3) before and after that of the counterpart of a ball joint."""
        assert self.before is not None
        return rounded(self.before), rounded(self.D[:3, :3]).T

    @property
    def zero_turn(self) -> float:
        """Angle [rad] between the zero poses of two ball joints; 0 for other joints."""
        if self.before is None:
            return 0.0
        before, after = self.turns
        return angle_of(before @ after)

    @property
    def frame_turn(self) -> float:
        """Angle [rad] by which the frame of the body is turned from that of its counterpart."""
        return angle_of(self.D)

    @property
    def frame_shift(self) -> float:
        """Distance [m] of the origins of both frames."""
        return float(np.linalg.norm(rounded(self.D[:3, 3])))


@dataclass(frozen=True)
class Fit:
    """All matched bodies, the root first, and the bodies without counterpart."""

    ours: Skeleton
    theirs: Skeleton
    bodies: tuple[BodyFit, ...]
    missing: tuple[int, ...]
    extra: tuple[int, ...]

    def of_joint(self, name: str) -> BodyFit | None:
        """Return the matched body of a joint of `theirs`."""
        number = self.theirs.number.get(name)
        return next((each for each in self.bodies if each.theirs == number), None)


def fit(ours: Skeleton, theirs: Skeleton, plan: MatchingPlan) -> Fit:
    """Evaluate a plan in 50 digits; call it inside `fifty_digits`."""
    frames: dict[int, Array] = {}
    signs: dict[str, int] = {}
    counterparts: dict[str, str] = {}
    found: list[BodyFit] = []
    for pair in plan.pairs:
        if pair.ours == ROOT:
            assert pair.chosen is not None
            body = BodyFit(ROOT, ROOT, decimals(pair.chosen), inertia=None)
        else:
            body = _joint_fit(ours, theirs, pair, frames)
            joint, other = ours.joints[pair.ours], theirs.joints[pair.theirs]
            signs[other.name], counterparts[other.name] = body.sign, joint.name
        frames[pair.ours] = body.D
        found.append(_with_inertia(ours, theirs, body))
    bodies = [
        each if each.ours == ROOT else _with_mimic(ours, theirs, each, signs, counterparts) for each in found
    ]
    return Fit(ours, theirs, tuple(bodies), plan.missing, plan.extra)


def _joint_fit(ours: Skeleton, theirs: Skeleton, pair: BodyPair, frames: dict[int, Array]) -> BodyFit:
    a, b = pair.ours, pair.theirs
    D_parent = frames[ours.bodies[a].parent]
    followed = theirs.exact[b] if _is_identity(D_parent) else D_parent @ theirs.exact[b]
    turn = shift = 0.0
    if pair.chosen is None:
        equal = bool((followed == ours.exact[a]).all())
        D = decimals(np.eye(4)) if equal else inverse(ours.exact[a]) @ followed
    else:
        D = decimals(pair.chosen)
        # What the place of the joint would have to be moved by, in the frame of the joint.
        off = inverse(followed) @ ours.exact[a] @ D
        turn, shift = angle_of(off), float(np.linalg.norm(rounded(off[:3, 3])))
    if ours.kinds[a] == "ball":
        # The zero pose of a ball joint may be any: only its centre has a place.
        before = (inverse(ours.exact[a]) @ followed)[:3, :3]
        line = float(np.linalg.norm(rounded(D[:3, 3])))
        return BodyFit(a, b, D, line=line, shift=shift, before=before)
    axis, mine = D[:3, :3] @ theirs.bodies[b].axis, ours.bodies[a].axis
    sign = 1 if float(np.sum(axis * mine)) >= 0.0 else -1
    line = 0.0
    if ours.kinds[a] == "revolute":
        line = float(np.linalg.norm(rounded(cross(D[:3, 3], mine))))
    sine = float(np.linalg.norm(rounded(cross(axis, mine))))
    if float(np.sum(axis * mine)) * sign < 0.5:
        sine = 1.0
    return BodyFit(a, b, D, sign, axis=sine, line=line, turn=turn, shift=shift)


def _with_inertia(ours: Skeleton, theirs: Skeleton, body: BodyFit) -> BodyFit:
    other = theirs.inertia(body.theirs)
    if not _is_identity(body.D):
        other = transformed(other, body.D)
    return _replace(body, inertia=subtract(ours.inertia(body.ours), other))


def _with_mimic(
    ours: Skeleton, theirs: Skeleton, body: BodyFit, signs: dict[str, int], counterparts: dict[str, str]
) -> BodyFit:
    mine, other = ours.joints[body.ours].mimic, theirs.joints[body.theirs].mimic
    if mine is None and other is None:
        return body
    if mine is None or other is None or counterparts.get(other.joint) != mine.joint:
        return _replace(body, scale=float("inf"), offset=float("inf"))
    scale = mine.multiplier * signs[other.joint] - body.sign * other.multiplier
    offset = mine.offset - body.sign * other.offset
    return _replace(body, scale=abs(scale), offset=abs(offset))


def _replace(body: BodyFit, **changes: object) -> BodyFit:
    return BodyFit(**{**body.__dict__, **changes})


def _is_identity(T: Array) -> bool:
    return bool((np.eye(4, dtype=int) == T).all())


def angle_of(T: Array) -> float:
    """Return the angle [rad] of the rotation of a pose, exact also where it is tiny."""
    R = T[:3, :3]
    twice = np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]])
    sine = float(np.linalg.norm(rounded(twice))) / 2.0
    cosine = (float(R[0, 0] + R[1, 1] + R[2, 2]) - 1.0) / 2.0
    return float(np.arctan2(sine, cosine))


def drive(joint: Joint) -> str:
    """Write what a mimic joint follows."""
    if joint.mimic is None:
        return "follows no joint"
    return f"{joint.mimic.multiplier!r} * {joint.mimic.joint} + {joint.mimic.offset!r}"
