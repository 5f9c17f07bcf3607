"""Rigid transforms that may map the frame of a body onto that of its counterpart: candidates from what both
bodies have, such as joint axes, centres of mass and links of the same names.

Where a frame of one description is turned or moved, all that is fixed to the body is in other coordinates.
Two lines, or a line and a point off it, determine the transform up to the signs of the lines.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations, islice, permutations, product

import numpy as np

from dynx.model.mechanism import ROOT
from dynx.same.arrangement import arrangements
from dynx.same.decimals import rounded
from dynx.same.shapes import SHAPE_KINDS, frames_of_shapes
from dynx.same.skeleton import Skeleton
from dynx.same.stated_poses import StatedPoses
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

MAX_PAIRINGS = 24
"""Largest number of ways to pair the bodies of two robots that are tried."""

MAX_STATED = 4
"""Largest number of configurations from which a frame of a floating base or of a ball joint is derived."""

MAX_LIKE_JOINTS = 4
"""Largest number of like joints of one body of which all orders are tried."""

DIGITS_APART = 6
"""Decimals in which relative differences of inertias are compared: those below are rounding."""

Line = tuple[Floats, Floats]
"""A point (3,) and a unit direction (3,)."""


MAX_DEPTH = 4
"""Largest number of joints between a symmetric body and another one below it that determines its frame."""


def candidates(ours: Skeleton, theirs: Skeleton, a: int, b: int, depth: int = 0) -> Iterator[Floats]:
    """Yield poses (4, 4) that the frame of body b of `theirs` may have in the frame of body a of `ours`; of a
    body on a ball joint their rotations alone count."""
    yield from _own_candidates(ours, theirs, a, b)
    free = is_free(ours, a)
    if free and depth == 0:
        for pairs in islice(_pairings(ours, theirs, a, b), 1):
            yield from arrangements(ours, theirs, pairs)
    massless = not float(ours.inertias[a].mass) > 0.0
    if depth >= MAX_DEPTH or (depth == 0 and not (free or massless)):
        # Only the frame of a floating root, or of a body on a ball joint, follows from no other; that of a
        # body without mass follows from what it carries.
        return
    for i, j in _children(ours, theirs, a, b):
        if ours.kinds[i] == "ball":
            continue
        back = inverse(theirs.placements[j])
        for D in candidates(ours, theirs, i, j, depth + 1):
            yield ours.placements[i] @ D @ back


def candidates_of_other_pairings(ours: Skeleton, theirs: Skeleton, a: int, b: int) -> Iterator[Floats]:
    """Yield further candidates, for bodies whose joints may be paired otherwise than `candidates` has it."""
    if is_free(ours, a):
        for pairs in islice(_pairings(ours, theirs, a, b), 1, None):
            yield from arrangements(ours, theirs, pairs)


def _children(ours: Skeleton, theirs: Skeleton, a: int, b: int) -> list[tuple[int, int]]:
    """Return the child bodies of both that may be counterparts: those with the same name, or else all that
    are of one kind."""
    left, right = ours.children[a], theirs.children[b]
    pairs = _namesakes(ours, theirs, a, b)
    if not pairs:
        pairs = [(i, j) for i in left for j in right if ours.kinds[i] == theirs.kinds[j]]
        pairs = [(i, j) for i, j in pairs if ours.sizes[i] == theirs.sizes[j]]
    return pairs[:MAX_LINES]


def _namesakes(ours: Skeleton, theirs: Skeleton, a: int, b: int) -> list[tuple[int, int]]:
    names = {theirs.joints[j].name: j for j in theirs.children[b]}
    pairs = ((i, names.get(ours.joints[i].name)) for i in ours.children[a])
    return [(i, j) for i, j in pairs if j is not None and ours.kinds[i] == theirs.kinds[j]]


def _pairings(ours: Skeleton, theirs: Skeleton, a: int, b: int) -> Iterator[list[tuple[int, int]]]:
    """Yield lists of the bodies of two subtrees that may be counterparts, parents first, each once: up to
    `MAX_PAIRINGS`. Bodies below a ball joint, whose pose is not known, are left out.

    Joints with the same names are counterparts. The others are so if their kinds and what is below them are
    alike; among several that are, each order is tried, those first whose inertias are nearest.
    """
    yield from islice(_extended(ours, theirs, [(a, b)], 0), MAX_PAIRINGS)


def _extended(
    ours: Skeleton, theirs: Skeleton, pairs: list[tuple[int, int]], done: int
) -> Iterator[list[tuple[int, int]]]:
    """Yield the pairings that begin with `pairs`, of which the first `done` have their children in it."""
    if done == len(pairs):
        yield pairs
        return
    a, b = pairs[done]
    if done and ours.kinds[a] == "ball":
        yield from _extended(ours, theirs, pairs, done + 1)
        return
    for children in _orders(ours, theirs, a, b):
        yield from _extended(ours, theirs, [*pairs, *children], done + 1)


def _orders(ours: Skeleton, theirs: Skeleton, a: int, b: int) -> Iterator[list[tuple[int, int]]]:
    """Yield the ways to pair the children of two bodies."""
    named = _namesakes(ours, theirs, a, b)
    left = [i for i in ours.children[a] if i not in {i for i, _ in named}]
    right = [j for j in theirs.children[b] if j not in {j for _, j in named}]
    groups: dict[object, tuple[list[int], list[int]]] = {}
    for which, (skeleton, bodies) in enumerate(((ours, left), (theirs, right))):
        for body in bodies:
            groups.setdefault(skeleton.shape_of(body), ([], []))[which].append(body)
    yield from (
        [*named, *(pair for some in chosen for pair in some)]
        for chosen in product(*(_matched(ours, theirs, *group) for group in groups.values()))
    )


def _matched(
    ours: Skeleton, theirs: Skeleton, left: list[int], right: list[int]
) -> list[list[tuple[int, int]]]:
    """Return the ways to pair bodies of one shape, those first whose inertias are nearest."""
    count = min(len(left), len(right))
    if len(left) > MAX_LIKE_JOINTS or len(right) > MAX_LIKE_JOINTS:
        return [list(zip(left, right, strict=False))]
    apart = {(i, j): _apart(ours.invariants(i), theirs.invariants(j)) for i in left for j in right}
    several = [
        list(zip(some, order, strict=True))
        for some in combinations(left, count)
        for order in permutations(right, count)
    ]
    return sorted(several, key=lambda pairs: round(sum(apart[pair] for pair in pairs), DIGITS_APART))


def _apart(one: Floats, other: Floats) -> float:
    """Return how far invariants are apart, relative to the larger ones."""
    return float(np.sum(np.abs(one - other) / np.maximum(np.maximum(np.abs(one), np.abs(other)), 1e-300)))


def _own_candidates(ours: Skeleton, theirs: Skeleton, a: int, b: int) -> Iterator[Floats]:
    yield np.eye(4)
    named = {ours.model.links[k].name: k for k in ours.links[a]}
    for k in theirs.links[b]:
        mine = named.get(theirs.model.links[k].name)
        if mine is not None:
            yield rounded(ours.link_pose(mine)) @ inverse(rounded(theirs.link_pose(k)))
    if is_free(ours, a):
        yield from _candidates_of_links(ours, theirs, a, b)
    pairs = [(ours.inertias[a], theirs.inertias[b])]
    if is_free(ours, a):
        # The centre of mass moves where a part of the inertia is stated in another body.
        pairs.append((ours.grouped[a], theirs.grouped[b]))
    for first, second in pairs:
        frames = zip(_frames(ours, a, first), _frames(theirs, b, second), strict=False)
        for mine_frames, their_frames in frames:
            for mine_frame in mine_frames[:1]:
                for their_frame in their_frames:
                    yield mine_frame @ inverse(their_frame)


def _candidates_of_links(ours: Skeleton, theirs: Skeleton, a: int, b: int) -> Iterator[Floats]:
    """Yield the frames of which a link of one name, with mass or a shape, is where it is in the other robot:
    where a link of the body is misplaced, that of another one is right. Then those in which a floating base
    is where it is in a configuration of one name."""
    mine, others = ours.heavy_links[a], theirs.heavy_links[b]
    if len(mine) > 1:
        for name in (each for each in mine if each in others):
            inertias = mine[name], others[name]
            if all(float(each.mass) > 0.0 for each in inertias):
                (frame, *_), _ = principal_frames(inertias[0])
                yield from (frame @ inverse(each) for each in principal_frames(inertias[1])[0])
    for kind in SHAPE_KINDS:
        yield from frames_of_shapes(kind, ours, theirs, a, b)
    if a == ROOT and ours.model.floating and theirs.model.floating:
        yield from islice(StatedPoses(ours, theirs).frames_of_base(), MAX_STATED)


def _frames(skeleton: Skeleton, body: int, inertia: RigidInertia) -> Iterator[list[Floats]]:
    """Yield lists of frames of a body that follow from what it has: those of a list differ by the signs of
    axes. Lists of two bodies correspond where the bodies have the same joints."""
    own = _own_line(skeleton, body)
    lines = [] if own is None else [own]
    lines += [
        _line(skeleton, child)
        for child in skeleton.children[body][:MAX_LINES]
        if skeleton.kinds[child] == "revolute"
    ]
    mass = float(inertia.mass)
    center = inertia.first_moment / mass if mass > 0.0 else None
    if body != ROOT and skeleton.kinds[body] == "ball":
        # The mass may be the parent's: what stays are the tensor and the first moment about the centre.
        inertia = RigidInertia(np.ones(()), np.zeros(3), inertia.rotational_inertia)
        length = float(np.linalg.norm(center)) if center is not None else 0.0
        lines += [] if center is None or length == 0.0 else [(np.zeros(3), center / length)]
        center = np.zeros(3)
    if center is None:
        yield []
    else:
        principal, symmetric = principal_frames(inertia)
        yield principal
        lines += [(center, axis) for axis in symmetric]
    lines += list(_lines_of_slides(skeleton, body, center))
    if body != ROOT and skeleton.kinds[body] == "prismatic":
        # Its direction, through a point that the body has.
        points = [line[0] for line in lines[:1]] if center is None else [center]
        lines += [(point, skeleton.axes[body]) for point in points]
    lines += list(_lines_of_centers(skeleton, body, center))
    for line in lines:
        yield [] if center is None else _frames_of_point(line, center)
    for one, other in combinations(lines, 2):
        yield _frames_of_lines(one, other, center)
    for line in lines:
        yield _frames_of_point(line, line[0]) if center is None else []


def _own_line(skeleton: Skeleton, body: int) -> Line | None:
    if body == ROOT or skeleton.kinds[body] != "revolute":
        return None
    return np.zeros(3), skeleton.axes[body]


def _line(skeleton: Skeleton, child: int) -> Line:
    T = skeleton.placements[child]
    return T[:3, 3], T[:3, :3] @ skeleton.axes[child]


def _lines_of_slides(skeleton: Skeleton, body: int, center: Floats | None) -> Iterator[Line]:
    """Yield the directions of prismatic joints at a body, through its centre of mass, and the lines from that
    to the centres of mass of what slides. A slide has a direction, and no point of its own."""
    slides = (each for each in skeleton.children[body] if skeleton.kinds[each] == "prismatic")
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


def _lines_of_centers(skeleton: Skeleton, body: int, center: Floats | None) -> Iterator[Line]:
    """Yield the lines between the centre of mass and the centres of the ball joints at a body."""
    points = [skeleton.placements[child][:3, 3] for child in skeleton.children[body][: 2 * MAX_LINES]]
    points = [
        point
        for child, point in zip(skeleton.children[body], points, strict=False)
        if skeleton.kinds[child] == "ball"
    ][:MAX_LINES]
    if center is not None:
        points.insert(0, center)
    for one, other in combinations(points, 2):
        length = float(np.linalg.norm(other - one))
        if length > PARALLEL * skeleton.reach:
            yield one, (other - one) / length


def is_free(skeleton: Skeleton, body: int) -> bool:
    """Check whether the orientation of a body's frame follows from no other: that of a root, or of a body on
    a ball joint."""
    return body == ROOT or skeleton.kinds[body] == "ball"


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
