"""Twins, the left and the right one of two links, whose numbers differ."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations, product

import numpy as np

from dynx.model.elements import Inertial, Joint
from dynx.rules import Case, Detection, Rule
from dynx.rules.inertia import line_of
from dynx.spatial.scalar import Floats

_RIGHT = (
    {"left": "right"}
    | {
        word: word.replace("l", "r", 1)
        for word in ("l", "fl", "hl", "bl", "ml", "lf", "lh", "lr", "lb", "lm")
    }
    | {"rl": "rr"}
)
"""Words of the left, such as those of corners (front left), and those of the right."""

_LEFT = {right: left for left, right in _RIGHT.items()}

_WORD = re.compile(r"[A-Z]+(?=[A-Z][a-z])|[A-Z]?[a-z]+|[A-Z]+|[^A-Za-z]+")

_MASSES_ALIKE = 0.1
"""Relative difference of the masses of twins from which they are reported."""

_MOMENTS_ALIKE = 0.1
"""Difference of their principal moments, in order of size, relative to the largest."""

_PRODUCTS_ALIKE = 0.05
"""Difference of their products of inertia after reflection, relative to the largest moment."""

_CENTERS_ALIKE, _LEAST_OFFSET = 0.1, 0.005
"""Difference of the distances of their centres of mass from their joints: relative, and in metres."""

_PLACES_ALIKE, _LEAST_SHIFT = 0.01, 0.001
"""Difference of the distances of their joints from their parents, up to which they are equal: relative, and
from which they are reported: in metres, too."""

_MASSES_EQUAL = 0.01
"""Relative difference of masses up to which links with unequal distances are twins."""

_LIMITS_ALIKE, _LEAST_LIMIT = 0.01, 0.01
"""Difference of their limits: relative, and of positions in rad or m."""

_DIRECTIONS_ALIKE, _LEAST_SPREAD = 0.01, 0.3
"""Sine of the angle up to which two axes are parallel, and from which two lines show how a link is turned."""


class TwinsDiffer(Rule):
    """DX521 twins-differ: A left and a right link differ in mass, inertia, centre of mass, distance of the
    joint, or limits.

    *Twins* are two links with joints of the same type. Their names differ only in words such as ``left`` and
    ``right``, ``L`` and ``R``, ``FL`` and ``FR``. The rule compares four kinds of numbers of twins.

    **Mass, principal moments, and the distance of the centre of mass from the joint.** These numbers do not
    depend on the side or on the choice of link frames. The rule compares them if both joints have the same
    distance from their parents (to 1 %). It reports masses or moments that differ by more than 10 %. It
    reports distances that differ by more than 10 % and by more than 5 mm.

    **Distances of the joints from their parents.** The rule compares them under three conditions: the joints
    rotate, the parents are one link or twins by name, and masses (to 1 %), moments and centres of mass are
    alike. It reports distances that differ by more than 1 % and by more than 1 mm. It reports nothing if the
    twins lie about one plane that contains the centre of mass of the parent, but not the origin of the
    parent's frame.

    **Limits.** The rule reports limits of effort and velocity that differ by more than 1 %. It reports ranges
    whose widths differ by more than 1 % and by more than 0.01 rad or m. It leaves out mimic joints.

    **Numbers with a sign**, such as products of inertia. The rule reflects one twin at the plane between the
    twins, and compares the numbers in the axes of the root, with every joint at zero. This requires that the
    joints of the twins, and the joints of their children, are reflections of each other (to 1 mm and 1 %).
    These joints and the centre of mass must also show how each link is rotated about its joint. Otherwise the
    rule does not compare these numbers.

    - Products of inertia: the rule reports a difference of more than 5 % of the largest moment. The same part
      may be on both sides, or it may be rotated by half a turn. So the rule accepts the signs of any
      reflection or half turn along these axes that agrees with the centres of mass. If the products of
      inertia are reflections and the centres of mass are not, it reports the centres of mass.
    - The range of a joint: the rule reports limits that differ by more than 1 % and by more than 0.01 rad or
      m. The axes of the joints determine the expected range. For example, hips that pitch about y on both
      sides must have equal ranges. For hips that roll about x, the lower limit of one must be minus the upper
      limit of the other.

    The rule reports 15 of the 69 files of example-robot-data. A file may have several of these causes:

    - In six files the moments of forearms or arms differ or are exchanged.
    - In two files the moments of one leg are zero.
    - In four files limits of effort or velocity differ, such as 150 N m on the left and 1000 N m on the
      right.
    - In four files the products of inertia of an upper arm were copied without a change of sign.
    - In two files the roll joint of both ankles has the range of a pitch joint.

    The rule reports nine of more than 1,000 files of pybullet_data.

    Usual causes:

    - Only one side was measured or exported again.
    - A number has an extra digit, or moments are in another unit.
    - A sign of a product of inertia was lost when the file was reflected.
    - Limits were copied, but lower and upper were not exchanged.

    All engines use the numbers unchanged. The robot leans to one side, and a gait that was tuned on one leg
    fails on the other leg. If the two parts really differ, such as a tool in one hand, nothing is wrong.

    The file does not say which of the two links is right, so no edit removes the cause.
    """

    kind = "practice"
    advice = "Compare the two links, and mirror the one that is correct."

    def occurrences(self, case: Case) -> Iterable[Detection]:
        """Yield the left link of each pair of twins that differ in inertia or place, and the left joint of
        each pair that differ in limits."""
        joints = {joint.child: joint for joint in case.model.joints}
        inertials = {link.name: case.model.inertial(link.name) for link in case.model.links}
        twins = list(_twins(case))
        poses = _zero_poses(case)
        plane = _plane_of(poses, twins)
        for pair in twins:
            one, other = (joints[name] for name in pair)
            bodies = [inertials[name] for name in pair]
            sides = _sides(poses, joints, inertials, twins, pair)
            message = _difference_of_places(one, other)
            if plane is not None and one.parent == other.parent and plane.reflects(*(s.place for s in sides)):
                parent, center = poses[one.parent], inertials[one.parent].origin.xyz
                message = "" if _is_beside(plane, parent, np.array(center)) else message
            line, line_of_twin = one.line, other.line
            if _placed_alike(one, other):
                have_mass = min(each.mass for each in bodies) > 0.0
                message = _difference_of_twins(*bodies) if have_mass else ""
                if have_mass and not message and plane is not None:
                    message = _difference_of_products(plane, *sides)
                line, line_of_twin = (line_of(case, name, "inertia") for name in pair)
            if message:
                yield Detection(pair[0], None, line, f"{message} on its twin {pair[1]} (line {line_of_twin})")
            direction = 0 if plane is None else _direction(one, plane, *sides)
            follows = one.mimic is not None or other.mimic is not None
            if not follows and (message := _difference_of_limits(one, other, direction)):
                line, line_of_twin = (_line_of_limit(case, joint) for joint in (one, other))
                twin = f"{other.name} (line {line_of_twin})"
                yield Detection(None, one.name, line, f"{message} on its twin {twin}")


def _twins(case: Case) -> Iterator[tuple[str, str]]:
    """Yield the pairs of left and right links that are placed or made alike, in document order."""
    joints = {joint.child: joint for joint in case.model.joints}
    by_name = {link.name.lower(): link.name for link in case.model.links}
    seen: set[str] = set()
    for link in case.model.links:
        candidates = (by_name[name] for name in _reflected_names(link.name) if name in by_name)
        twin = next(candidates, link.name)
        if twin in seen or twin == link.name or not {link.name, twin} <= joints.keys():
            continue
        one, other = joints[link.name], joints[twin]
        inertials = case.model.inertial(link.name), case.model.inertial(twin)
        if one.type != other.type:
            continue
        if _placed_alike(one, other) or (_attached_alike(one, other) and _equal_bodies(*inertials)):
            seen |= {link.name, twin}
            yield link.name, twin


def _reflected_names(name: str) -> Iterator[str]:
    """Yield the names, in lower case, that the right twin of a left link may have.

    All words of a side are exchanged (``front_leftR``), or a single one (``leg_l_hip_r``, a roll joint).
    """
    words = [word.lower() for word in _WORD.findall(name)]
    left = [number for number, word in enumerate(words) if word in _RIGHT]
    if left:
        yield "".join(_RIGHT.get(word) or _LEFT.get(word, word) for word in words)
    for number in left:
        yield "".join((*words[:number], _RIGHT[words[number]], *words[number + 1 :]))


def _placed_alike(one: Joint, other: Joint) -> bool:
    """Check whether two joints are equally far from their parents."""
    return math.isclose(*_distances(one, other), rel_tol=_PLACES_ALIKE, abs_tol=1e-6)


def _attached_alike(one: Joint, other: Joint) -> bool:
    """Check whether two joints rotate links of one parent, or of parents that are twins by name."""
    parents = one.parent.lower(), other.parent.lower()
    rotate = one.type in ("revolute", "continuous")
    return rotate and (parents[0] == parents[1] or parents[1] in _names_of_twins(one.parent))


def _names_of_twins(name: str) -> set[str]:
    """Return the names, in lower case, that the twin of a left or of a right link may have."""
    words = [word.lower() for word in _WORD.findall(name)]
    return {"".join(_RIGHT.get(word) or _LEFT.get(word, word) for word in words), *_reflected_names(name)}


def _equal_bodies(left: Inertial, right: Inertial) -> bool:
    """Check whether two links with mass are copies of one part by their inertia."""
    alike = math.isclose(left.mass, right.mass, rel_tol=_MASSES_EQUAL)
    return min(left.mass, right.mass) > 0.0 and alike and not _difference_of_twins(left, right)


def _distances(one: Joint, other: Joint) -> tuple[float, float]:
    return math.hypot(*one.origin.xyz), math.hypot(*other.origin.xyz)


def _difference_of_places(one: Joint, other: Joint) -> str:
    """Describe the difference of the distances of two joints; empty where it is small."""
    left, right = _distances(one, other)
    if abs(left - right) <= _LEAST_SHIFT:
        return ""
    return f"the joint is {left:.4g} m from its parent, and {right:.4g} m"


def _difference_of_twins(left: Inertial, right: Inertial) -> str:
    """Describe the difference of two inertials; empty where they are alike."""
    if abs(left.mass - right.mass) > _MASSES_ALIKE * max(left.mass, right.mass):
        return f"the mass is {left.mass:.3g} kg, and {right.mass:.3g} kg"
    offsets = math.hypot(*left.origin.xyz), math.hypot(*right.origin.xyz)
    gap = abs(offsets[0] - offsets[1])
    if gap > max(_CENTERS_ALIKE * max(offsets), _LEAST_OFFSET):
        return f"the centre of mass is {offsets[0]:.3g} m from the joint, and {offsets[1]:.3g} m"
    one, other = (np.linalg.eigvalsh(each.tensor) for each in (left, right))
    if np.max(np.abs(one - other)) > _MOMENTS_ALIKE * max(np.max(one), np.max(other)):
        written = [", ".join(f"{moment:.3g}" for moment in moments) for moments in (one, other)]
        return f"the principal moments are {written[0]} kg m^2, and {written[1]} kg m^2"
    return ""


# The plane of the robot, in the position where all joints are at zero. Numbers with a sign are compared only
# where that position shows that the one twin lies as the reflection of the other.


@dataclass(frozen=True)
class _MirrorPlane:
    """The plane that reflects the left side of a robot into the right one, in the axes of the root.

    `axes` (3, 3) has the unit normal in its first row and two directions in the plane in the others;
    `offset` [m] is the coordinate of the plane along the normal.
    """

    axes: Floats
    offset: float
    support: int = 1
    """Number of twins whose places it reflects."""

    def vector(self, vector: Floats) -> Floats:
        """Return the reflection of a vector (3,)."""
        normal = self.axes[0]
        return np.asarray(vector - 2.0 * float(normal @ vector) * normal)

    def point(self, point: Floats) -> Floats:
        """Return the reflection of a point (3,) [m]."""
        return np.asarray(self.vector(point) + 2.0 * self.offset * self.axes[0])

    def reflects(self, one: Floats, other: Floats) -> bool:
        """Check whether two points (3,) [m] are reflections of each other."""
        limit = _LEAST_SHIFT + _PLACES_ALIKE * float(np.linalg.norm(one - other))
        return float(np.linalg.norm(self.point(one) - other)) <= limit


@dataclass(frozen=True)
class _TwinSide:
    """A twin with every joint at zero, in the axes of the root.

    `place` (3,) [m] is that of its joint, `axis` (3,) the direction of the joint or None where it is fixed,
    `tensor` (3, 3) [kg m^2] that about the centre of mass. Relative to the joint are `center` (3,) [m], that
    of mass, and `children` (n, 3) [m], the joints of those children that are twins, too; `lines` (n, 3) are
    the directions of these joints, zero where they are fixed.
    """

    place: Floats
    axis: Floats | None
    center: Floats
    tensor: Floats
    children: Floats
    lines: Floats


def _zero_poses(case: Case) -> dict[str, Floats]:
    """Return the poses (4, 4) of all links in the root, with every joint at zero."""
    poses: dict[str, Floats] = {case.model.root: np.eye(4)}
    for joint in case.model.joints:
        poses[joint.child] = poses[joint.parent] @ joint.origin.matrix
    return poses


def _plane_of(poses: Mapping[str, Floats], twins: Sequence[tuple[str, str]]) -> _MirrorPlane | None:
    """Find the plane that reflects the places of the most twins; None where all twins coincide."""
    places = [(poses[left][:3, 3], poses[right][:3, 3]) for left, right in twins]
    planes = [plane for one, other in places if (plane := _plane_between(one, other)) is not None]
    support = [sum(plane.reflects(*pair) for pair in places) for plane in planes]
    best = int(np.argmax(support)) if planes else None
    return None if best is None else replace(planes[best], support=support[best])


def _is_beside(plane: _MirrorPlane, pose: Floats, center: Floats) -> bool:
    """Check whether the origin of a link's frame lies beside a plane that several twins show, and the centre
    of mass (3,) [m] of the link near it: distances from such an origin are not equal on both sides."""
    places = pose[:3, 3], pose[:3, :3] @ center + pose[:3, 3]
    origin, middle = (abs(float(plane.axes[0] @ place) - plane.offset) for place in places)
    return plane.support > 1 and origin > _LEAST_SHIFT and middle < 0.5 * origin


def _plane_between(one: Floats, other: Floats) -> _MirrorPlane | None:
    """Return the plane that reflects one point into another; None where they coincide."""
    distance = float(np.linalg.norm(one - other))
    if distance <= _LEAST_SHIFT:
        return None
    normal = (one - other) / distance
    nearest = int(np.argmax(np.abs(normal)))
    if np.linalg.norm(np.delete(normal, nearest)) <= _DIRECTIONS_ALIKE:
        normal = np.eye(3)[nearest]
    across = np.cross(normal, np.eye(3)[(nearest + 1) % 3])
    across = across / np.linalg.norm(across)
    axes = np.array([normal, across, np.cross(normal, across)])
    return _MirrorPlane(axes, float(normal @ (one + other)) / 2.0)


def _sides(
    poses: Mapping[str, Floats],
    joints: Mapping[str, Joint],
    inertials: Mapping[str, Inertial],
    twins: Sequence[tuple[str, str]],
    pair: tuple[str, str],
) -> tuple[_TwinSide, _TwinSide]:
    """Return both sides of a pair of twins; their children are in one order."""
    below = [each for each in twins if tuple(joints[name].parent for name in each) == pair]
    sides = []
    for k, name in enumerate(pair):
        R, place = poses[name][:3, :3], poses[name][:3, 3]
        inertial = inertials[name]
        to_root = R @ inertial.origin.matrix[:3, :3]
        sides.append(
            _TwinSide(
                place,
                _axis(poses, joints[name]) if joints[name].moves else None,
                R @ np.array(inertial.origin.xyz),
                to_root @ inertial.tensor @ to_root.T,
                np.array([poses[each[k]][:3, 3] - place for each in below]).reshape(-1, 3),
                np.array([_axis(poses, joints[each[k]]) for each in below]).reshape(-1, 3),
            )
        )
    return sides[0], sides[1]


def _axis(poses: Mapping[str, Floats], joint: Joint) -> Floats:
    """Return the direction (3,) of a joint in the axes of the root, zero for a fixed one."""
    return np.asarray(poses[joint.child][:3, :3] @ np.array(joint.axis) * joint.moves)


def _joined_reflected(plane: _MirrorPlane, one: _TwinSide, other: _TwinSide) -> bool:
    """Check whether the joint of one twin and those of its children are reflections of the other's."""
    if not plane.reflects(one.place, other.place):
        return False
    axes = [] if one.axis is None or other.axis is None else [(one.axis, other.axis)]
    for here, there in (*axes, *zip(one.lines, other.lines, strict=True)):
        if np.linalg.norm(np.cross(plane.vector(here), there)) > _DIRECTIONS_ALIKE:
            return False
    children = zip(one.children, other.children, strict=True)
    return all(plane.reflects(one.place + here, other.place + there) for here, there in children)


def _is_oriented(side: _TwinSide, *centers: Floats) -> bool:
    """Check whether the axes and places of joints, and centres (3,) [m], show how a link is turned."""
    points = [point for point in (*side.children, *centers) if np.linalg.norm(point) > _LEAST_OFFSET]
    lines = [line for line in side.lines if line.any()] + ([] if side.axis is None else [side.axis])
    lines += [point / np.linalg.norm(point) for point in points]
    return any(np.linalg.norm(np.cross(*pair)) > _LEAST_SPREAD for pair in combinations(lines, 2))


def _centers_limit(one: _TwinSide, other: _TwinSide) -> float:
    """Return the distance [m] up to which centres of mass are equal after reflection."""
    largest = max(float(np.linalg.norm(each.center)) for each in (one, other))
    return max(_CENTERS_ALIKE * largest, _LEAST_OFFSET)


def _difference_of_products(plane: _MirrorPlane, one: _TwinSide, other: _TwinSide) -> str:
    """Describe the difference of the products of inertia after reflection; empty where they are alike, and
    where it is unknown how the twins lie.

    A part may also be the same on both sides, or be turned by half a turn. So its products may have the signs
    of every half turn and reflection along the axes of the plane that agrees with the centres of mass.
    """
    if not (_is_oriented(one, one.center) and _joined_reflected(plane, one, other)):
        return ""
    centers = [plane.axes @ each.center for each in (one, other)]
    tensors = [plane.axes @ each.tensor @ plane.axes.T for each in (one, other)]
    limit = _centers_limit(one, other)
    errors = [
        float(np.max(np.abs(np.outer(signs, signs) * tensors[0] - tensors[1])[np.triu_indices(3, 1)]))
        for signs in map(np.array, product((-1.0, 1.0), repeat=3))
        if np.linalg.norm(signs * centers[0] - centers[1]) <= limit
    ]
    largest = max(float(np.max(np.linalg.eigvalsh(each))) for each in tensors)
    if not errors or min(errors) <= _PRODUCTS_ALIKE * largest:
        return ""
    M = np.eye(3) - 2.0 * np.outer(plane.axes[0], plane.axes[0])
    upper, reflected = np.triu_indices(3, 1), M @ one.tensor @ M
    if np.max(np.abs((reflected - other.tensor)[upper])) <= _PRODUCTS_ALIKE * largest:
        # The products are reflections, and the centres of mass none that agrees with them.
        written = [_numbers(M @ one.center), _numbers(other.center)]
        return (
            f"the centre of mass is {written[0]} m from the joint in the axes of the root, reflected, "
            f"and {written[1]} m"
        )
    written = [_numbers(tensor[upper]) for tensor in (reflected, other.tensor)]
    return (
        f"the products of inertia xy, xz, yz in the axes of the root are, reflected, {written[0]} kg m^2, "
        f"and {written[1]} kg m^2"
    )


def _numbers(values: Floats) -> str:
    return ", ".join(f"{value:.3g}" for value in values + 0.0)


def _difference_of_limits(one: Joint, other: Joint, direction: int) -> str:
    """Describe the differences of the limits of two joints; empty where they are alike.

    Positions of the one are those of the other times `direction`; 0 where that is unknown.
    """
    found = []
    left, right = one.limits, other.limits
    widths = left.upper - left.lower, right.upper - right.lower
    ends = sorted((direction * left.lower, direction * left.upper)) if direction else None
    if not math.isclose(*widths, rel_tol=_LIMITS_ALIKE, abs_tol=_LEAST_LIMIT):
        found.append(f"the range is {widths[0]:.4g} {one.unit}, and {widths[1]:.4g} {one.unit}")
    elif ends is not None and not _close_ends(ends, (right.lower, right.upper)):
        reflected = f" (reflected {ends[0]:.4g} to {ends[1]:.4g})" if direction < 0 else ""
        found.append(
            f"the range is {left.lower:.4g} to {left.upper:.4g} {one.unit}{reflected}, and "
            f"{right.lower:.4g} to {right.upper:.4g} {one.unit}"
        )
    effort, speed = ("N", "m/s") if one.unit == "m" else ("N m", "rad/s")
    for name, unit, values in (
        ("effort", effort, (left.effort, right.effort)),
        ("velocity", speed, (left.velocity, right.velocity)),
    ):
        if not math.isclose(*values, rel_tol=_LIMITS_ALIKE):
            found.append(f"the {name} limit is {values[0]:.4g} {unit}, and {values[1]:.4g} {unit}")
    return "; ".join(found)


def _close_ends(one: Sequence[float], other: Sequence[float]) -> bool:
    pairs = zip(one, other, strict=True)
    return all(math.isclose(*pair, rel_tol=_LIMITS_ALIKE, abs_tol=_LEAST_LIMIT) for pair in pairs)


def _direction(joint: Joint, plane: _MirrorPlane, one: _TwinSide, other: _TwinSide) -> int:
    """Return the sign of the positions of the right joint in a reflected posture; 0 where it is unknown,
    because nothing shows how the twins are turned about their joints at zero."""
    if one.axis is None or other.axis is None or not _joined_reflected(plane, one, other):
        return 0
    gap = float(np.linalg.norm(plane.vector(one.center) - other.center))
    reflected = gap <= _centers_limit(one, other)
    if not _is_oriented(one, *([one.center] if reflected else [])):
        return 0
    # The reflection of a rotation about an axis is one about the reflected axis in the other sense.
    along = float(plane.vector(one.axis) @ other.axis)
    return int(math.copysign(1.0, along if joint.type == "prismatic" else -along))


def _line_of_limit(case: Case, joint: Joint) -> int | None:
    element = case.joints.get(joint.name)
    limit = None if element is None else element.first("limit")
    return joint.line if limit is None else limit.line
