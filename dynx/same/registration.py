"""Rigid transforms that may map the frame of a body onto that of its counterpart: candidates from what both
bodies have, such as joint axes, centres of mass and links of the same names.

Where a frame of one description is turned or moved, all that is fixed to the body is in other coordinates.
Two lines, or a line and a point off it, determine the transform up to the signs of the lines.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations, islice, product

import numpy as np

from dynx.model.mechanism import ROOT
from dynx.same.arrangement import arrangements
from dynx.same.decimals import rounded
from dynx.same.skeleton import Skeleton
from dynx.spatial.inertia import RigidInertia
from dynx.spatial.scalar import Floats
from dynx.spatial.se3 import homogeneous, inverse
from dynx.spatial.so3 import cross, skew

PARALLEL = 1e-6
"""Sine of an angle [rad] below which two lines are too close to parallel to determine a frame."""

SYMMETRIC = 1e-6
"""Relative difference of two principal moments below which a body counts as symmetric."""

MAX_LINES = 4
"""Largest number of joint axes of a body from which pairs are made."""

Line = tuple[Floats, Floats]
"""A point (3,) and a unit direction (3,)."""


MAX_DEPTH = 4
"""Largest number of joints between a symmetric body and another one below it that determines its frame."""


def candidates(ours: Skeleton, theirs: Skeleton, a: int, b: int, depth: int = 0) -> Iterator[Floats]:
    """Yield poses (4, 4) that the frame of body b of `theirs` may have in the frame of body a of `ours`."""
    yield from _own_candidates(ours, theirs, a, b)
    if a == b == ROOT:
        yield from arrangements(ours, theirs, _counterparts(ours, theirs))
    if depth >= MAX_DEPTH or (a != ROOT and depth == 0):
        # Only the frame of a floating root follows from no other.
        return
    for i, j in _children(ours, theirs, a, b):
        back = inverse(theirs.placements[j])
        for D in candidates(ours, theirs, i, j, depth + 1):
            yield ours.placements[i] @ D @ back


def _children(ours: Skeleton, theirs: Skeleton, a: int, b: int) -> list[tuple[int, int]]:
    """Return the child bodies of both that may be counterparts: those with the same name, or else all that
    are of one kind."""
    left, right = ours.children[a], theirs.children[b]
    names = {theirs.joints[j].name: j for j in right}
    pairs = [(i, names[ours.joints[i].name]) for i in left if ours.joints[i].name in names]
    if not pairs:
        pairs = [(i, j) for i in left for j in right if ours.bodies[i].revolute == theirs.bodies[j].revolute]
        pairs = [(i, j) for i, j in pairs if ours.sizes[i] == theirs.sizes[j]]
    return pairs[:MAX_LINES]


def _counterparts(ours: Skeleton, theirs: Skeleton) -> list[tuple[int, int]]:
    """Return the bodies of both robots that may be counterparts, each once, parents first."""
    found = {ROOT: ROOT}
    waiting = [(ROOT, ROOT)]
    while waiting:
        a, b = waiting.pop(0)
        for i, j in _children(ours, theirs, a, b):
            if i not in found and j not in found.values():
                found[i] = j
                waiting.append((i, j))
    return list(found.items())


def _own_candidates(ours: Skeleton, theirs: Skeleton, a: int, b: int) -> Iterator[Floats]:
    yield np.eye(4)
    named = {ours.model.links[k].name: k for k in ours.links[a]}
    for k in theirs.links[b]:
        mine = named.get(theirs.model.links[k].name)
        if mine is not None:
            yield rounded(ours.link_pose(mine)) @ inverse(rounded(theirs.link_pose(k)))
    pairs = [(ours.inertias[a], theirs.inertias[b])]
    if a == b == ROOT:
        # The centre of mass moves where a part of the inertia is stated in another body.
        pairs.append((ours.grouped[ROOT], theirs.grouped[ROOT]))
    for first, second in pairs:
        frames = zip(_frames(ours, a, first), _frames(theirs, b, second), strict=False)
        for mine_frames, their_frames in frames:
            for mine_frame in mine_frames[:1]:
                for their_frame in their_frames:
                    yield mine_frame @ inverse(their_frame)


def _frames(skeleton: Skeleton, body: int, inertia: RigidInertia) -> Iterator[list[Floats]]:
    """Yield lists of frames of a body that follow from what it has: those of a list differ by the signs of
    axes. Lists of two bodies correspond where the bodies have the same joints."""
    own = _own_line(skeleton, body)
    lines = [] if own is None else [own]
    lines += [
        _line(skeleton, child)
        for child in skeleton.children[body][:MAX_LINES]
        if skeleton.bodies[child].revolute
    ]
    mass = float(inertia.mass)
    center = inertia.first_moment / mass if mass > 0.0 else None
    if center is None:
        yield []
    else:
        principal, symmetric = principal_frames(inertia)
        yield principal
        lines += [(center, axis) for axis in symmetric]
    lines += list(_lines_of_slides(skeleton, body, center))
    for line in lines:
        yield [] if center is None else _frames_of_point(line, center)
    for one, other in combinations(lines, 2):
        yield _frames_of_lines(one, other, center)
    for line in lines:
        yield _frames_of_point(line, line[0]) if center is None else []


def _own_line(skeleton: Skeleton, body: int) -> Line | None:
    if body == ROOT or not skeleton.bodies[body].revolute:
        return None
    return np.zeros(3), skeleton.axes[body]


def _line(skeleton: Skeleton, child: int) -> Line:
    T = skeleton.placements[child]
    return T[:3, 3], T[:3, :3] @ skeleton.axes[child]


def _lines_of_slides(skeleton: Skeleton, body: int, center: Floats | None) -> Iterator[Line]:
    """Yield the directions of prismatic joints at a body, through its centre of mass, and the lines from that
    to the centres of mass of what slides. A slide has a direction, and no point of its own."""
    slides = (each for each in skeleton.children[body] if not skeleton.bodies[each].revolute)
    for child in islice(slides, MAX_LINES):
        start, direction = _line(skeleton, child)
        yield (start if center is None else center), direction
        inertia = skeleton.inertias[child]
        if center is None or not float(inertia.mass) > 0.0:
            continue
        T = skeleton.placements[child]
        away = T[:3, 3] + T[:3, :3] @ (inertia.first_moment / float(inertia.mass)) - center
        length = float(np.linalg.norm(away))
        if length > PARALLEL * float(np.linalg.norm(center)):
            yield center, away / length


def principal_frames(inertia: RigidInertia) -> tuple[list[Floats], list[Floats]]:
    """Return the frames of the principal axes at the centre of mass, and the axis of a symmetric body."""
    mass, h = float(inertia.mass), inertia.first_moment
    H = skew(h)
    moments, axes = np.linalg.eigh(inertia.rotational_inertia + H @ H / mass)
    axes = axes * np.sign(np.linalg.det(axes))
    turns = (np.diag(signs) for signs in ((1, 1, 1), (1, -1, -1), (-1, 1, -1), (-1, -1, 1)))
    low, high = (np.diff(moments) <= SYMMETRIC * np.max(np.abs(moments))).tolist()
    symmetric = [axes[:, 2]] if low and not high else [axes[:, 0]] if high and not low else []
    return [homogeneous(axes @ turn, h / mass) for turn in turns], symmetric


def _frames_of_point(line: Line, point: Floats) -> list[Floats]:
    start, direction = line
    foot = start + direction * float(direction @ (point - start))
    across = point - foot
    length = float(np.linalg.norm(across))
    if length <= PARALLEL * (float(np.linalg.norm(point)) + float(np.linalg.norm(start))):
        # On the line: any turn about it will do.
        across = np.eye(3)[int(np.argmin(np.abs(direction)))]
        across = across - direction * float(direction @ across)
        length, foot = float(np.linalg.norm(across)), point
    return [_frame(sign * direction, across / length, foot) for sign in (1.0, -1.0)]


def _frames_of_lines(one: Line, other: Line, center: Floats | None) -> list[Floats]:
    normal = cross(one[1], other[1])
    sine = float(np.linalg.norm(normal))
    offset = other[0] - one[0]
    if sine <= PARALLEL:
        # Parallel: the centre of mass says where along them.
        across = offset - one[1] * float(one[1] @ offset)
        length = float(np.linalg.norm(across))
        if length <= PARALLEL * float(np.linalg.norm(offset)) or length == 0.0:
            return []
        at = one[0] if center is None else center
        foot = one[0] + one[1] * float(one[1] @ (at - one[0]))
        return [_frame(sign * one[1], across / length, foot) for sign in (1.0, -1.0)]
    # Foot on the first line of the common normal of both.
    foot = one[0] + one[1] * float(cross(offset, other[1]) @ normal) / sine**2
    return [
        _frame(first * one[1], first * second * normal / sine, foot)
        for first, second in product((1.0, -1.0), repeat=2)
    ]


def _frame(z: Floats, x: Floats, origin: Floats) -> Floats:
    return homogeneous(np.stack([x, cross(z, x), z], axis=1), origin)
