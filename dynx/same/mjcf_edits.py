"""Edits of a text of MJCF: bodies and joints, inertias, and tendons, constraints and keyframes.

Only what differs is replaced: a number in a list of numbers, an attribute, or an element that is new.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from xml.etree import ElementTree
from xml.etree.ElementTree import tostring

import numpy as np

from dynx.model import Model
from dynx.model.elements import Inertial, Joint
from dynx.model.mjcf.document import MjcfText, turn
from dynx.model.mjcf.equalities import EqualityWriter
from dynx.model.mjcf.expansion import read_document
from dynx.model.mjcf.sensor_objects import WORLD
from dynx.model.mjcf.tendons import (
    AUTOMATIC_LENGTH,
    UNBOUNDED,
    limited_range,
    spring_length_text,
    write_tendons,
)
from dynx.model.mjcf.writer import inertial_attributes
from dynx.model.stated_parts import LINEAR, NamedConfiguration, StatedEquality, StatedTendon
from dynx.model.xml.reading import Element
from dynx.model.xml.several_files import file_of_line
from dynx.model.xml.source import Edit, SourceElement, XmlSource
from dynx.model.xml.text import quoteattr
from dynx.same.stated_parts import StatedChange
from dynx.same.text_edits import MOMENTS, NotMendedError, are_near, number, number_edits, numbers
from dynx.spatial.scalar import Floats
from dynx.spatial.se3 import homogeneous, inverse
from dynx.spatial.so3 import quat_from_rotation

_OTHER_ORIENTATIONS = ("axisangle", "euler", "xyaxes", "zaxis")


@dataclass(frozen=True)
class _JointsOfBody:
    """The joints of a body in the pose of the file: the pose (4, 4) of the body in its parent, and the point
    and the axis of each joint, both (3,), in the body."""

    T_parent_body: Floats
    points: tuple[Floats, ...]
    axes: tuple[Floats, ...]


class MjcfEdits:
    """Edits of the bodies of a text, of which `model` is the robot."""

    def __init__(self, source: XmlSource, model: Model) -> None:
        self._source, self._model = source, model
        self._bodies: dict[str, SourceElement] = {}
        nameless: dict[int, list[SourceElement]] = {}
        for element in source.root.walk():
            if element.tag == "body":
                if "name" in element.attributes:
                    self._bodies.setdefault(element.attributes["name"], element)
                else:
                    nameless.setdefault(element.line, []).append(element)
        for link in model.links:
            found = nameless.get(link.line or 0, [])
            if len(found) == 1 and link.name not in self._bodies and file_of_line(link.line) is None:
                self._bodies[link.name] = found[0]
        compilers = source.root.all("compiler")
        self._from_geoms = any(each.attributes.get("inertiafromgeom") == "true" for each in compilers)

    @cached_property
    def _document(self) -> MjcfText:
        document = read_document(self._source.text_with_lines_before, self._source.source)
        assert document is not None
        return document

    # -- bodies and joints --------------------------------------------------------------------------------

    def places(self, before: Model, after: Model) -> Iterator[Edit]:
        """Yield the edits of the places of bodies and of the points and axes of their joints."""
        for old, new in zip(before.joints, after.joints, strict=True):
            if (old.type, old.mimic) != (new.type, new.mimic):
                raise NotMendedError(f"the type or coupling of joint {old.name}: MJCF is not mended for it")
        changed = {
            old.name
            for old, new in zip(before.joints, after.joints, strict=True)
            if (old.origin, old.axis) != (new.origin, new.axis)
        }
        if not changed:
            return
        above = {joint.child: joint for joint in before.joints}
        for name, body in self._bodies.items():
            joints = [*_joint_elements(body)]
            chain = _joints_above(name, above, len(joints))
            if chain is None or changed.isdisjoint(each.name for each in chain):
                continue
            changed -= {each.name for each in chain}
            wanted = [after.joint(each.name) for each in chain]
            yield from self._chain(name, body, joints, self._in_file(chain), self._in_file(wanted))
        for joint in before.joints:
            if joint.name in changed:
                # A fixed joint has no name in MJCF; its body has.
                what = f"joint {joint.name}" if joint.moves else f"body {joint.child}"
                raise NotMendedError(f"the place of {what} does not follow from one <body> alone")

    def _in_file(self, joints: Sequence[Joint]) -> _JointsOfBody:
        """Return the joints of a body as the file states them: at the positions in its pose."""
        initial = self._model.stated_initial
        references = {} if initial is None else dict(initial.positions)
        poses = []
        for joint in joints:
            T, axis = joint.origin.matrix, np.array(joint.axis)
            position = references.get(joint.name, (0.0,))[0]
            if joint.type in ("revolute", "continuous") and position:
                T = T @ homogeneous(turn(axis, position), np.zeros(3))
            elif joint.type == "prismatic" and position:
                T = T @ homogeneous(np.eye(3), position * axis)
            poses.append(T)
        points, axes, T_child_body = [], [], np.eye(4)
        for joint, T in zip(reversed(joints), reversed(poses), strict=True):
            if joint.moves:
                back = inverse(T_child_body)
                points.append(back[:3, 3])
                axes.append(back[:3, :3] @ joint.axis)
            T_child_body = T @ T_child_body
        return _JointsOfBody(T_child_body, tuple(points[::-1]), tuple(axes[::-1]))

    def _chain(
        self,
        name: str,
        body: SourceElement,
        joints: Sequence[SourceElement],
        old: _JointsOfBody,
        new: _JointsOfBody,
    ) -> Iterator[Edit]:
        """Yield the edits of a body and its joints; what stands in a <frame> is written in the frame."""
        if not _are_near(old.T_parent_body, new.T_parent_body):
            outer = self._frames_around(body)
            if outer is None:
                raise NotMendedError(f"the place of body {name} does not follow from one <body> alone")
            placed = inverse(outer) @ new.T_parent_body
            own = self._document.pose(_plain(body), "a body")
            if not _are_near(placed[:3, 3], own[:3, 3]):
                yield from number_edits(self._source, body, "pos", placed[:3, 3].tolist())
            if not _are_near(placed[:3, :3], own[:3, :3]):
                x, y, z, w = quat_from_rotation(placed[:3, :3]).tolist()
                yield self._source.attribute_edit(body, "quat", numbers((w, x, y, z)))
                for each in _OTHER_ORIENTATIONS:
                    if each in body.attributes:
                        yield self._source.attribute_removal(body, each)
        for element, point, other_point, axis, other_axis in zip(
            joints, old.points, new.points, old.axes, new.axes, strict=True
        ):
            outer = self._frames_around(element)
            assert outer is not None
            back = inverse(outer)
            if not _are_near(point, other_point):
                placed = back[:3, :3] @ other_point + back[:3, 3]
                yield from number_edits(self._source, element, "pos", placed.tolist())
            if not _are_near(axis, other_axis):
                yield self._source.attribute_edit(element, "axis", numbers(back[:3, :3] @ other_axis))

    def _frames_around(self, element: SourceElement) -> Floats | None:
        """Return the pose (4, 4) of the frames around an element in the body around them; None for one that
        stands elsewhere."""
        T, around = np.eye(4), element.parent
        while around is not None and around.tag == "frame":
            T, around = self._document.pose(_plain(around), "a <frame>") @ T, around.parent
        return T if around is not None and around.tag in ("body", "worldbody") else None

    # -- inertias -----------------------------------------------------------------------------------------

    def inertial(self, link: str, old: Inertial | None, new: Inertial | None) -> Iterator[Edit]:
        """Yield the edits of the inertia of a link."""
        if self._from_geoms:
            raise NotMendedError(f"the inertia of body {link} follows from its geoms")
        if new is None:
            raise NotMendedError(f"body {link} cannot be without an inertia in MJCF")
        body = self._bodies.get(link)
        if body is None:
            raise NotMendedError(f"body {link} has no name in the file, or stands in an included one")
        present = body.first("inertial")
        written = inertial_attributes(new)
        if present is None:
            text = "".join(f' {name}="{value}"' for name, value in written.items())
            yield self._source.insertion(body, f"<inertial{text}/>", first=True)
            return
        yield from number_edits(self._source, present, "mass", [new.mass])
        yield from number_edits(self._source, present, "pos", new.origin.xyz)
        turned = old is None or not _are_near(old.origin.matrix[:3, :3], new.origin.matrix[:3, :3])
        if old is None or turned or not _have_same_moments(old, new):
            for name in ("quat", "diaginertia", "fullinertia"):
                if name in written:
                    yield from number_edits(
                        self._source, present, name, list(map(float, written[name].split()))
                    )
            for name in ("quat", "diaginertia", "fullinertia", *_OTHER_ORIENTATIONS):
                if name in present.attributes and name not in written:
                    yield self._source.attribute_removal(present, name)


def _plain(element: SourceElement) -> Element:
    return Element(element.tag, dict(element.attributes), element.line)


def _are_near(one: Floats, other: Floats) -> bool:
    return all(map(are_near, np.ravel(one).tolist(), np.ravel(other).tolist()))


def _have_same_moments(one: Inertial, other: Inertial) -> bool:
    return all(getattr(one, name) == getattr(other, name) for name in MOMENTS)


def _joint_elements(body: SourceElement) -> Iterator[SourceElement]:
    """Yield the joints of a body and of the frames in it, in document order."""
    for child in body.children:
        if child.tag == "joint":
            yield child
        elif child.tag == "frame":
            yield from _joint_elements(child)


def _joints_above(link: str, above: Mapping[str, Joint], count: int) -> list[Joint] | None:
    """Return the joints of a body with `count` joints, outermost first, and the fixed one that the reader
    adds if the last of them lies off the origin of the body; None for a body of another robot, and for a
    root."""
    found: list[Joint] = []
    while link in above and len(found) < max(1, count) + (bool(found) and count > 0 and not found[0].moves):
        found.append(above[link])
        link = found[-1].parent
    moving = sum(each.moves for each in found)
    return found[::-1] if found and moving == count else None


# -- tendons, constraints and keyframes -------------------------------------------------------------------


def stated_edits(
    source: XmlSource, before: Model, after: Model, changes: Sequence[StatedChange]
) -> Iterator[Edit]:
    """Yield the edits of tendons, constraints and keyframes of the robot `before`, which is to be `after`.

    Raises NotMendedError for a part that does not stand in the file itself.
    """
    edits = _StatedEdits(source, before, after)
    new: dict[str, list[str]] = {}
    for each in changes:
        if each.old is None:
            new.setdefault(each.section, []).append(tostring(edits.written(each), encoding="unicode"))
            continue
        element = _stated_element(source, each)
        if each.new is None:
            yield source.removal(element)
        else:
            yield from edits.changed(element, each)
    for section, texts in new.items():
        there = source.root.all(section)
        if there:
            yield source.insertion(there[0], "\n".join(texts))
        else:
            lines = [f"<{section}>", *(f"  {text}" for text in texts), f"</{section}>"]
            yield source.insertion(source.root, "\n".join(lines))


def _stated_element(source: XmlSource, change: StatedChange) -> SourceElement:
    old = change.old
    assert old is not None
    for section in source.root.all(change.section):
        for element in section.children:
            if element.line == old.line and element.attributes.get("name", old.name) == old.name:
                return element
    raise NotMendedError(f"{change.words} does not stand in the file itself")


_DEFAULTS: Mapping[str, str] = {
    "active": "true",
    "anchor": "0 0 0",
    "polycoef": " ".join(map(str, LINEAR)),
    "torquescale": "1",
}
"""Values of attributes of constraints that the writer of MJCF leaves out."""


class _StatedEdits:
    """Edits of parts of a robot."""

    def __init__(self, source: XmlSource, before: Model, after: Model) -> None:
        self._source, self._before, self._after = source, before, after

    @cached_property
    def _document(self) -> MjcfText:
        document = read_document(self._source.text_with_lines_before, self._source.source)
        assert document is not None
        return document

    def written(self, change: StatedChange) -> ElementTree.Element:
        """Return a part as an element, with what a default class may state otherwise."""
        section, new = ElementTree.Element(str(change.section)), change.new
        if isinstance(new, StatedTendon):
            write_tendons(section, [new])
        elif isinstance(new, StatedEquality):
            section.append(self._written_equality(new, self._after, change.words))
        else:
            assert isinstance(new, NamedConfiguration)
            ElementTree.SubElement(section, "key", name=new.name, qpos=numbers(self._positions(new)))
        return section[0]

    def changed(self, element: SourceElement, change: StatedChange) -> Iterator[Edit]:
        """Yield the edits of a part that is there."""
        old, new = change.old, change.new
        if isinstance(old, StatedTendon) and isinstance(new, StatedTendon):
            yield from self._tendon(element, old, new)
        elif isinstance(old, StatedEquality) and isinstance(new, StatedEquality):
            yield from self._equality(element, old, new, change.words)
        else:
            assert isinstance(old, NamedConfiguration)
            assert isinstance(new, NamedConfiguration)
            yield from self._keyframe(element, old, new)

    def _set(self, element: SourceElement, name: str, value: str) -> Edit:
        return self._source.attribute_edit(element, name, value)

    # -- tendons ------------------------------------------------------------------------------------------

    def _tendon(self, element: SourceElement, old: StatedTendon, new: StatedTendon) -> Iterator[Edit]:
        source, document = self._source, self._document
        given = document.resolved(_plain(element), None, "tendon").attributes
        for name, field in (
            ("stiffness", "stiffness"),
            ("damping", "damping"),
            ("frictionloss", "friction"),
            ("armature", "armature"),
        ):
            if getattr(old, field) != getattr(new, field):
                yield from number_edits(source, element, name, [getattr(new, field)])
        length = old.spring_length
        if old.stiffness and float(given.get("springlength", "-1").split()[0]) == AUTOMATIC_LENGTH:
            # It follows from the coefficients, where the references of all springs are known.
            references = {each.name: each.dynamics.spring_reference for each in self._before.joints}
            was, length = (
                (sum(factor * references[joint] for joint, factor in each.terms),) * 2 for each in (old, new)
            )
            length = length if was == old.spring_length else (math.nan, math.nan)
        if new.stiffness and not _are_near(np.array(length), np.array(new.spring_length)):
            yield self._set(element, "springlength", spring_length_text(new))
        for flag, name, ends, others in (
            ("limited", "range", new.range, old.range),
            ("actuatorfrclimited", "actuatorfrcrange", new.force_range, old.force_range),
        ):
            if ends != others:
                yield from self._range(element, given, flag, name, ends)
        coefficients = dict(new.terms)
        for child in element.all("joint"):
            joint = child.attributes["joint"]
            if joint not in coefficients:
                yield source.removal(child)
                continue
            yield from number_edits(source, child, "coef", [coefficients.pop(joint)])
        texts = [
            f'<joint joint={quoteattr(joint)} coef="{number(factor)}"/>'
            for joint, factor in coefficients.items()
        ]
        if texts:
            yield source.insertion(element, "\n".join(texts))

    def _range(
        self,
        element: SourceElement,
        given: Mapping[str, str],
        flag: str,
        name: str,
        ends: tuple[float, float],
    ) -> Iterator[Edit]:
        if ends == UNBOUNDED:
            yield self._set(element, flag, "false")
            return
        low, high = limited_range(ends)
        yield from number_edits(self._source, element, name, (low, high))
        automatic = given.get(flag, "auto") == "auto" and self._document.compiler.autolimits
        if not automatic and given.get(flag) != "true":
            yield self._set(element, flag, "true")

    # -- constraints --------------------------------------------------------------------------------------

    def _equality(
        self, element: SourceElement, old: StatedEquality, new: StatedEquality, words: str
    ) -> Iterator[Edit]:
        source = self._source
        written = self._written_equality(new, self._after, words)
        if (old.type, old.object_type) != (new.type, new.object_type):
            kept = {k: v for k, v in element.attributes.items() if k not in _OF_EQUALITIES}
            written.attrib.update({k: v for k, v in kept.items() if k not in written.attrib})
            yield source.replacement(element, tostring(written, encoding="unicode"))
            return
        before, after = self._written_equality(old, self._before, words).attrib, written.attrib
        for name in dict.fromkeys([*before, *after]):
            value = after.get(name, _DEFAULTS.get(name))
            if name == "name" or before.get(name, _DEFAULTS.get(name)) == value:
                continue
            if value is None:
                if name in element.attributes:
                    yield source.attribute_removal(element, name)
            elif name in _NAMES_OF_EQUALITIES or name == "active":
                yield self._set(element, name, value)
            else:
                yield from number_edits(source, element, name, list(map(float, value.split())))

    def _written_equality(self, equality: StatedEquality, model: Model, words: str) -> ElementTree.Element:
        section = ElementTree.Element("equality")
        poses, reference = _pose_of_file(model)
        if not EqualityWriter({}, poses, reference).write(section, equality):
            raise NotMendedError(f"{words}: its points do not coincide in the pose of the file")
        return section[0]

    # -- keyframes ----------------------------------------------------------------------------------------

    def _keyframe(
        self, element: SourceElement, old: NamedConfiguration, new: NamedConfiguration
    ) -> Iterator[Edit]:
        was, q = self._positions(old), self._positions(new)
        if len(was) != len(q):
            yield self._set(element, "qpos", numbers(q))
            return
        kept = {index for index, (one, two) in enumerate(zip(was, q, strict=True)) if one == two}
        for start in self._quaternions(new):
            entries = set(range(start, start + 4))
            if not entries <= kept:
                kept -= entries
        last = max(set(range(len(q))) - kept, default=-1)
        yield from number_edits(self._source, element, "qpos", q[: last + 1], kept)

    def _stated_order(self) -> tuple[tuple[str, tuple[float, ...]], ...]:
        """Return all joints in the order of ``qpos``, each with its position in the pose of the file."""
        initial = self._after.stated_initial
        assert initial is not None
        return initial.positions

    def _positions(self, configuration: NamedConfiguration) -> list[float]:
        """Return ``qpos``, in which a quaternion begins with w."""
        model, given = self._after, dict(configuration.positions)
        found: list[float] = []
        if model.floating:
            assert configuration.base is not None
            *xyz, x, y, z, w = configuration.base
            found += [*xyz, w, x, y, z]
        for name, start in self._stated_order():
            position = given.get(name, start)
            mimic = model.joint(name).mimic
            if mimic is not None and mimic.joint in given:
                position = (mimic.multiplier * given[mimic.joint][0] + mimic.offset,)
            found += [position[3], *position[:3]] if len(position) == 4 else position
        return found

    def _quaternions(self, configuration: NamedConfiguration) -> Iterator[int]:
        """Yield the index in ``qpos`` of each quaternion."""
        at = 0
        if self._after.floating:
            yield 3
            at = 7
        for _, start in self._stated_order():
            if len(start) == 4:
                yield at
            at += len(start)


_NAMES_OF_EQUALITIES = frozenset(
    ("body1", "body2", "site1", "site2", "joint1", "joint2", "tendon1", "tendon2")
)
_OF_EQUALITIES = _NAMES_OF_EQUALITIES | {
    "anchor",
    "relpose",
    "polycoef",
    "torquescale",
    "active",
    "solref",
    "solimp",
}
"""Attributes that a constraint has instead of those in the file."""


def _pose_of_file(model: Model) -> tuple[dict[str, Floats], Callable[[str, str], float]]:
    """Return the poses (4, 4) of links in the pose of the file, and what a joint or tendon has in it."""
    from dynx.reference.backend import ReferenceBackend  # rarely needed

    q = model.initial_configuration
    poses = ReferenceBackend(model).forward_kinematics(q)
    found = {frame.name: T for frame, T in zip(model.frames, poses, strict=True)} | {WORLD: np.eye(4)}
    tendons = {each.name: each.terms for each in model.tendons or ()}

    def reference(kind: str, name: str) -> float:
        terms = ((name, 1.0),) if kind == "joint" else tendons[name]
        return float(sum(factor * q[model.position_index(joint)] for joint, factor in terms))

    return found, reference
