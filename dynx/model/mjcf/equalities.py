"""Equality constraints of MJCF, in the terms of `dynx.model.stated_parts.StatedEquality`.

MuJoCo lets a ``connect`` or ``weld`` of bodies coincide where it does so in the pose of the file, `qpos0`,
unless ``relpose`` says where. The reader computes both poses, and the writer states them by the pose of the
document that it writes.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import dataclass, replace
from xml.etree.ElementTree import Element as Written
from xml.etree.ElementTree import SubElement

import numpy as np

from dynx.errors import nearest, shown
from dynx.model.elements import IDENTITY, Pose
from dynx.model.mjcf.attributes import quat_wxyz, text
from dynx.model.mjcf.document import MjcfText
from dynx.model.mjcf.extension import MIMIC
from dynx.model.mjcf.sensor_objects import WORLD
from dynx.model.mjcf.sensors import names_by_kind
from dynx.model.stated_parts import LINEAR, Polynomial, StatedEquality
from dynx.model.xml.reading import Element
from dynx.spatial.scalar import Floats
from dynx.spatial.se3 import homogeneous, inverse
from dynx.spatial.so3 import rotation_from_quat

_OF_ALL = ("name", "class", "active", "solref", "solimp")
_ENDS = {
    "connect": (("body1", "body2"), ("site1", "site2")),
    "weld": (("body1", "body2"), ("site1", "site2")),
    "joint": (("joint1", "joint2"),),
    "tendon": (("tendon1", "tendon2"),),
}
"""Pairs of attributes of each type that name what it couples; the second of a pair may be absent, but for
sites."""
_OF_BODIES = {"connect": ("anchor",), "weld": ("anchor", "relpose")}
"""Attributes that constraints of bodies have beside these, and those of sites have not."""
_OTHERS = {"weld": ("torquescale",), "joint": ("polycoef",), "tendon": ("polycoef",)}
_NOT_TAKEN = ("flex", "flexvert", "flexstrain", "distance")
"""Types that couple soft bodies, and one that is no longer part of MJCF."""

COINCIDENCE = 1e-9
"""Largest distance of two points that coincide, relative to the distance of the farthest link."""


@dataclass(frozen=True)
class EqualityObjects:
    """Parts of a robot that constraints may couple: links by names of bodies, frames by names of sites, and
    the positions of joints and lengths of tendons in the pose of the file. `poses` are those (4, 4) of the
    links in the world."""

    links: Mapping[str, str]
    sites: Mapping[str, str]
    joints: Mapping[str, float]
    tendons: Mapping[str, float]
    poses: Mapping[str, Floats]

    def of_kind(self, kind: str) -> Collection[str]:
        """Return the names of a kind that the file uses."""
        return {"body": self.links, "site": self.sites, "joint": self.joints, "tendon": self.tendons}[kind]


def is_mimic(element: Element) -> bool:
    """Check whether an element is the constraint of a mimic joint that dynx wrote."""
    return element.tag == "joint" and element.attributes.get("name", "").startswith(MIMIC)


def read_equalities(
    document: MjcfText, parts: EqualityObjects, ball_joints: Collection[str]
) -> tuple[tuple[StatedEquality, ...], list[tuple[Element, str]]]:
    """Return the equality constraints of a robot, and those that are not taken, each with the reason.

    Those that dynx wrote for mimic joints are neither. Raises DescriptionError for a malformed constraint,
    and for one of a part that the file does not have, as MuJoCo does.
    """
    taken, left = [], []
    elements = list(document.named_elements("equality", (*_ENDS, *_NOT_TAKEN), "constraint"))
    known = names_by_kind(document) if elements else {}
    for element in elements:
        tag = element.tag
        if is_mimic(element):
            continue
        if tag in _NOT_TAKEN:
            reason = "is no longer part of MJCF" if tag == "distance" else "couples a soft body"
            left.append((element, f"<{tag}> {reason}"))
            continue
        found = _read(document, element, parts, known, ball_joints)
        if isinstance(found, StatedEquality):
            taken.append(found)
        else:
            left.append((element, f"<{tag}> {found}"))
    return tuple(taken), left


def _read(
    document: MjcfText,
    element: Element,
    parts: EqualityObjects,
    known: Mapping[str, set[str]],
    ball_joints: Collection[str],
) -> StatedEquality | str:
    """Return a constraint, or why it is not taken."""
    reading, tag = document.reading, element.tag
    element = document.resolved(element, None, "equality")
    given, what = element.attributes, f"equality {shown(element.attributes.get('name', ''))}"
    pairs = [pair for pair in _ENDS[tag] if any(each in given for each in pair)] or [_ENDS[tag][0]]
    others = (*_OF_BODIES.get(tag, ()), *_OTHERS.get(tag, ()))
    reading.require_known_attributes(element, (*_OF_ALL, *others, *(x for pair in _ENDS[tag] for x in pair)))
    (first, second), kind = pairs[0], pairs[0][0].removesuffix("1")
    mixed = [each for each in _OF_BODIES.get(tag, ()) if each in given] if kind == "site" else []
    if len(pairs) > 1 or mixed:
        raise reading.error(element, f"{what} has {', '.join(mixed) or 'bodies'} beside sites; wanted one")
    names = [reading.attribute(element, first, what)]
    if kind == "site" or second in given:
        names.append(reading.attribute(element, second, what))
    for name in names:
        if name not in known[kind]:
            raise reading.error(
                element,
                f"{what} names the {kind} {shown(name)}, which the file has not{nearest(name, known[kind])}",
            )
        if name in ball_joints and kind == "joint":
            raise reading.error(
                element, f"{what} names the ball joint {shown(name)}; wanted a hinge or slide"
            )
    if kind == "body" and len(names) == 1:
        names.append(WORLD)
    if len(set(names)) < len(names):
        raise reading.error(element, f"{what} couples the {kind} {shown(names[0])} to itself")
    missing = next((each for each in names if each not in parts.of_kind(kind)), None)
    if missing is not None:
        return f"names the {kind} {shown(missing)}, which the robot has not"
    found = StatedEquality(
        given.get("name", ""),
        tag,
        "xbody" if kind == "body" else kind,
        names[0],
        names[1] if len(names) > 1 else "",
        active=reading.flag(element, "active", what, default=True),
        solref=_numbers(document, element, "solref", what, 2),
        solimp=_numbers(document, element, "solimp", what, 5),
        torque_scale=reading.number_or(element, "torquescale", what, 1.0),
        line=element.line,
    )
    if kind in ("joint", "tendon"):
        positions = parts.joints if kind == "joint" else parts.tendons
        numbers = _numbers(document, element, "polycoef", what, 5)
        a, b, c, d, e = (*numbers, *LINEAR[len(numbers) :])
        references = positions[names[0]], positions[names[1]] if len(names) > 1 else 0.0
        return replace(found, polynomial=(a, b, c, d, e), references=references)
    names_of = parts.sites if kind == "site" else parts.links
    found = replace(found, first=names_of[names[0]], second=names_of[names[1]])
    if kind == "site":
        return found
    poses = _poses_of_bodies(document, element, [parts.poses[each] for each in found.objects], what)
    return replace(found, first_pose=poses[0], second_pose=poses[1])


def _numbers(document: MjcfText, element: Element, attribute: str, what: str, most: int) -> tuple[float, ...]:
    if attribute not in element.attributes:
        return ()
    return document.reading.some_numbers(element, attribute, what, 1, most)


def _poses_of_bodies(
    document: MjcfText, element: Element, T_world: list[Floats], what: str
) -> tuple[Pose, Pose]:
    """Return the poses in both bodies that coincide, from the poses of the bodies in the pose of the file."""
    reading, given = document.reading, element.attributes
    if element.tag == "connect":
        anchor = np.array(reading.vector(element, "anchor", what))
        in_second = inverse(T_world[1]) @ T_world[0] @ homogeneous(np.eye(3), anchor)
        return _unrotated_pose(anchor), _unrotated_pose(in_second[:3, 3])
    anchor = np.array(reading.vector(element, "anchor", what) if "anchor" in given else (0.0, 0.0, 0.0))
    relative = np.array(reading.numbers(element, "relpose", what, 7)) if "relpose" in given else np.zeros(7)
    if relative[3:].any():
        w, x, y, z = relative[3:] / np.linalg.norm(relative[3:])
        in_first = homogeneous(rotation_from_quat(np.array([x, y, z, w])), relative[:3])
    else:
        in_first = inverse(T_world[0]) @ T_world[1] @ homogeneous(np.eye(3), anchor)
    return Pose.from_matrix(in_first), _unrotated_pose(anchor)


def _unrotated_pose(point: Floats) -> Pose:
    x, y, z = point.tolist()
    return Pose((x, y, z))


@dataclass(frozen=True)
class EqualityWriter:
    """Writes constraints for a document of which the pose is known: `poses` are those (4, 4) of its links in
    the world, `reference` returns the position of a joint, and the length of a tendon, in it. `bodies` are
    those of the links."""

    bodies: Mapping[str, str]
    poses: Mapping[str, Floats]
    reference: Callable[[str, str], float]

    def write(self, section: Written, equality: StatedEquality) -> bool:
        """Add a constraint to a section ``<equality>``; return False for one that the pose of the document
        contradicts."""
        kind = equality.object_type.removeprefix("x")
        if kind == "body":
            ends = [self.bodies.get(each, each) for each in equality.objects]
        else:
            ends = [*equality.objects]
        given = {"name": equality.name} if equality.name else {}
        given |= {f"{kind}{number}": end for number, end in enumerate(ends, start=1)}
        if kind == "body" and equality.type == "connect" and not self._coincide(equality):
            return False
        given |= dict(self._values(equality, kind))
        if not equality.active:
            given["active"] = "false"
        for name in ("solref", "solimp"):
            if getattr(equality, name):
                given[name] = text(getattr(equality, name))
        SubElement(section, equality.type, given)
        return True

    def _values(self, equality: StatedEquality, kind: str) -> Iterator[tuple[str, str]]:
        if kind in ("joint", "tendon"):
            numbers = self._polynomial(equality, kind)
            if numbers != LINEAR:
                yield "polycoef", text(numbers)
        elif kind == "body" and equality.type == "connect":
            yield "anchor", text(equality.first_pose.xyz)
        elif kind == "body":
            T = equality.first_pose.matrix
            yield "relpose", text([*T[:3, 3], *quat_wxyz(T[:3, :3])])
            if equality.second_pose != IDENTITY:
                yield "anchor", text(equality.second_pose.xyz)
        if equality.type == "weld" and equality.torque_scale != 1.0:
            yield "torquescale", text(equality.torque_scale)

    def _coincide(self, equality: StatedEquality) -> bool:
        """Check whether the points of a ``connect`` coincide in the pose of the document."""
        ends = zip(equality.objects, (equality.first_pose, equality.second_pose), strict=True)
        first, second = ((self.poses[name] @ pose.matrix)[:3, 3] for name, pose in ends)
        reach = max([1.0, *(float(np.linalg.norm(T[:3, 3])) for T in self.poses.values())])
        return float(np.linalg.norm(first - second)) <= COINCIDENCE * reach

    def _polynomial(self, equality: StatedEquality, kind: str) -> Polynomial:
        """Return the polynomial between positions relative to those of the document."""
        y, x = (self.reference(kind, each) if each else 0.0 for each in (equality.first, equality.second))
        shifts = y - equality.references[0], x - equality.references[1]
        if shifts == (0.0, 0.0):
            return equality.polynomial
        moved = np.polynomial.Polynomial(equality.polynomial)(np.polynomial.Polynomial([shifts[1], 1.0]))
        a, b, c, d, e = (*moved.coef.tolist(), *(0.0,) * 5)[:5]
        return (a - shifts[0], b, c, d, e)
