"""Mended text: the description with some elements replaced, and all else as it is written.

What is written follows from two models, the one that was read and the one that it is to be. URDF can be
mended wherever they differ; in MJCF and SDF inertias, places of bodies and axes of joints.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from xml.etree import ElementTree
from xml.etree.ElementTree import tostring

import numpy as np

from dynx.model import Model
from dynx.model.elements import Inertial, Joint, NamedConfiguration, Pose
from dynx.model.equalities import StatedEquality
from dynx.model.mjcf.equalities import EqualityWriter
from dynx.model.mjcf.expansion import read_document
from dynx.model.mjcf.sensor_objects import WORLD
from dynx.model.mjcf.tendons import write_tendons
from dynx.model.mjcf.writer import inertial_attributes
from dynx.model.tendons import StatedTendon
from dynx.model.xml.reading import Element
from dynx.model.xml.source import Edit, SourceElement, XmlSource
from dynx.model.xml.text import quoteattr
from dynx.same.stated_parts import StatedChange
from dynx.spatial.scalar import Floats
from dynx.spatial.so3 import quat_from_rotation

MOMENTS = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")

_ORIENTATIONS = ("quat", "axisangle", "euler", "xyaxes", "zaxis")


class NotMendedError(Exception):
    """A change cannot be written into the text; the message says which."""


def mended_text(source: XmlSource, before: Model, after: Model) -> XmlSource:
    """Return the text in which the joints and links of `before` are those of `after`.

    Raises NotMendedError for a change that cannot be written.
    """
    if source.root.tag not in ("robot", "mujoco", "sdf"):
        raise NotMendedError(
            f"a file whose root is <{source.root.tag}> is not mended; wanted URDF, MJCF or SDF"
        )
    edits: _Urdf | _Mjcf | _Sdf
    found: list[Edit] = []
    if source.root.tag == "sdf":
        edits = _Sdf(source)
        found += edits.places(before, after)
    else:
        edits = _Urdf(source) if source.root.tag == "robot" else _Mjcf(source, before)
    for old, new in zip(before.joints, after.joints, strict=True):
        if old != new:
            found += edits.joint(old, new)
    for link, other in zip(before.links, after.links, strict=True):
        if link != other:
            found += edits.inertial(link.name, link.inertial, other.inertial)
    return source.apply(*found)


def with_stated_parts(source: XmlSource, model: Model, changes: Sequence[StatedChange]) -> XmlSource:
    """Return a text of MJCF in which tendons, constraints and keyframes are changed; `model` is its robot.

    Raises NotMendedError for a part that does not stand in the file itself.
    """
    if source.root.tag != "mujoco":
        raise NotMendedError(f"tendons, constraints and keyframes of <{source.root.tag}> are not mended")
    found: list[Edit] = []
    new: dict[str, list[str]] = {}
    for each in changes:
        written = None if each.new is None else _written(each, model)
        old = None if each.old is None else _stated_element(source, each)
        if old is None:
            assert written is not None
            new.setdefault(each.section, []).append(tostring(written, encoding="unicode"))
        elif written is None:
            found.append(source.removal(old))
        else:
            kept = {k: v for k, v in old.attributes.items() if k not in _STATED[each.section]}
            written.attrib.update({k: v for k, v in kept.items() if k not in written.attrib})
            found.append(source.replacement(old, tostring(written, encoding="unicode")))
    for section, texts in new.items():
        there = source.root.all(section)
        if there:
            found.append(source.insertion(there[0], "\n".join(texts)))
        else:
            lines = [f"<{section}>", *(f"  {text}" for text in texts), f"</{section}>"]
            found.append(source.insertion(source.root, "\n".join(lines)))
    return source.apply(*found)


def _stated_element(source: XmlSource, change: StatedChange) -> SourceElement:
    old = change.old
    assert old is not None
    for section in source.root.all(change.section):
        for element in section.children:
            if element.line == old.line and element.attributes.get("name", old.name) == old.name:
                return element
    raise NotMendedError(f"{change.words} does not stand in the file itself")


_STATED = {
    "tendon": frozenset(
        (
            *("range", "limited", "actuatorfrcrange", "actuatorfrclimited"),
            *("stiffness", "springlength", "damping", "frictionloss", "armature"),
        )
    ),
    "equality": frozenset(
        (
            *("body1", "body2", "site1", "site2", "joint1", "joint2", "tendon1", "tendon2"),
            *("anchor", "relpose", "polycoef", "torquescale", "active", "solref", "solimp"),
        )
    ),
    "keyframe": frozenset(("qpos",)),
}
"""Attributes that a part has instead of those in the file."""


def _written(change: StatedChange, model: Model) -> ElementTree.Element:
    """Return the element of a part, with what a default class may state otherwise."""
    name: str = change.section
    section, new = ElementTree.Element(name), change.new
    if isinstance(new, StatedTendon):
        write_tendons(section, [new])
        given = section[0].attrib
        for name in ("stiffness", "damping", "frictionloss", "armature"):
            given.setdefault(name, "0")
        for flag, ends in (("limited", "range"), ("actuatorfrclimited", "actuatorfrcrange")):
            given[flag] = "true" if ends in given else "false"
    elif isinstance(new, StatedEquality):
        poses, reference = _pose_of_file(model)
        if not EqualityWriter({}, poses, reference).write(section, new):
            raise NotMendedError(f"{change.words}: its points do not coincide in the pose of the file")
        section[0].attrib.setdefault("active", "true")
    else:
        assert isinstance(new, NamedConfiguration)
        named = replace(model, stated_configurations=(new,))
        q = named.configurations[new.name].copy()
        for first in model.quaternions:
            q[first : first + 4] = np.roll(q[first : first + 4], 1)  # w is the first in MJCF
        ElementTree.SubElement(section, "key", name=new.name, qpos=numbers(q))
    return section[0]


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


def number(value: float) -> str:
    """Write a number so that it reads back exactly."""
    return repr(float(value) + 0.0)


def numbers(values: object) -> str:
    """Write several numbers."""
    return " ".join(number(value) for value in np.ravel(np.asarray(values)).tolist())


class _Urdf:
    def __init__(self, source: XmlSource) -> None:
        self._source = source

    def _element(self, tag: str, name: str) -> SourceElement:
        for element in self._source.root.all(tag):
            if element.attributes.get("name") == name:
                return element
        raise NotMendedError(f"<{tag}> {name} does not stand in the file itself")

    def joint(self, old: Joint, new: Joint) -> Iterator[Edit]:
        element = self._element("joint", old.name)
        if old.type != new.type:
            yield self._source.attribute_edit(element, "type", new.type)
        if old.origin != new.origin:
            yield from self._origin(element, old.origin, new.origin)
        if new.moves and old.axis != new.axis:
            yield from self._set(element, "axis", {"xyz": numbers(new.axis)})
        if new.type in ("revolute", "prismatic") and element.first("limit") is None:
            limits = new.limits
            values = {
                name: number(getattr(limits, name)) for name in ("lower", "upper", "effort", "velocity")
            }
            yield from self._set(element, "limit", {k: v for k, v in values.items() if "inf" not in v})
        if old.mimic != new.mimic and new.moves:
            present = element.first("mimic")
            if new.mimic is None:
                if present is not None:
                    yield self._source.removal(present)
                return
            mimic = new.mimic
            values = {
                "joint": mimic.joint,
                "multiplier": number(mimic.multiplier),
                "offset": number(mimic.offset),
            }
            yield from self._set(element, "mimic", values)

    def _origin(self, parent: SourceElement, old: Pose, new: Pose) -> Iterator[Edit]:
        values = {}
        if old.xyz != new.xyz:
            values["xyz"] = numbers(new.xyz)
        if old.rpy != new.rpy:
            values["rpy"] = numbers(new.rpy)
            present = parent.first("origin")
            if present is not None and "quat_xyzw" in present.attributes:
                yield self._source.attribute_removal(present, "quat_xyzw")
        yield from self._set(parent, "origin", values)

    def _set(self, parent: SourceElement, tag: str, values: dict[str, str]) -> Iterator[Edit]:
        """Yield the edits that set attributes of a child element, which is made where there is none."""
        present = parent.first(tag)
        if present is None:
            written = "".join(f" {name}={quoteattr(value)}" for name, value in values.items())
            yield self._source.insertion(parent, f"<{tag}{written}/>", first=True)
            return
        old = [name for name in values if name in present.attributes]
        for name in old:
            yield self._source.attribute_edit(present, name, values[name])
        new = {name: value for name, value in values.items() if name not in old}
        if new:
            # All at once: edits at one place would be in no order.
            first, *others = new.items()
            edit = self._source.attribute_edit(present, *first)
            rest = "".join(f" {name}={quoteattr(value)}" for name, value in others)
            yield Edit(edit.start, edit.end, edit.text + rest)

    def inertial(self, link: str, old: Inertial | None, new: Inertial | None) -> Iterator[Edit]:
        element = self._element("link", link)
        present = element.first("inertial")
        if new is None:
            if present is not None:
                yield self._source.removal(present)
            return
        if present is None or old is None:
            lines = [
                "<inertial>",
                f'  <origin xyz="{numbers(new.origin.xyz)}" rpy="{numbers(new.origin.rpy)}"/>',
                f'  <mass value="{number(new.mass)}"/>',
                "  <inertia " + " ".join(f'{k}="{number(getattr(new, k))}"' for k in MOMENTS) + "/>",
                "</inertial>",
            ]
            yield self._source.insertion(element, "\n".join(lines), first=True)
            return
        if old.origin != new.origin:
            yield from self._origin(present, old.origin, new.origin)
        if old.mass != new.mass:
            yield from self._set(present, "mass", {"value": number(new.mass)})
        moments = {k: number(getattr(new, k)) for k in MOMENTS if getattr(old, k) != getattr(new, k)}
        if moments:
            yield from self._set(present, "inertia", moments)


class _Mjcf:
    def __init__(self, source: XmlSource, model: Model) -> None:
        self._source, self._model = source, model
        self._bodies: dict[str, SourceElement] = {}
        self._joints: dict[str, SourceElement] = {}
        for element in source.root.walk():
            name = element.attributes.get("name")
            table = {"body": self._bodies, "joint": self._joints}.get(element.tag)
            if table is not None and name is not None:
                table.setdefault(name, element)
        compilers = source.root.all("compiler")
        self._from_geoms = any(each.attributes.get("inertiafromgeom") == "true" for each in compilers)

    def _body(self, name: str) -> SourceElement:
        element = self._bodies.get(name)
        if element is None:
            raise NotMendedError(f"body {name} has no name in the file, or stands in an included one")
        return element

    def joint(self, old: Joint, new: Joint) -> Iterator[Edit]:
        if (old.type, old.mimic) != (new.type, new.mimic):
            raise NotMendedError(f"the type or coupling of joint {old.name}: MJCF is not mended for it")
        if old.axis != new.axis:
            element = self._joints.get(old.name)
            if element is None or element.parent is None or element.parent.tag != "body":
                raise NotMendedError(f"joint {old.name} does not stand in its body in the file itself")
            yield self._source.attribute_edit(element, "axis", numbers(new.axis))
        if old.origin != new.origin:
            yield from self._place(old, new)

    def _place(self, old: Joint, new: Joint) -> Iterator[Edit]:
        """Move the body of a joint: the first of its joints keeps its place in it."""
        at: SourceElement | None
        if old.moves:
            joint = self._joints.get(old.name)
            at = None if joint is None else joint.parent
            first = at is not None and at.tag == "body" and at.all("joint")[0] is joint
        else:
            at = self._bodies.get(old.child)
            first = at is not None and not at.all("joint")
        if at is None or not first or at.parent is None or at.parent.tag not in ("body", "worldbody"):
            # A fixed joint has no name in MJCF; its body has.
            what = f"joint {old.name}" if old.moves else f"body {old.child}"
            raise NotMendedError(f"the place of {what} does not follow from one <body> alone")
        body = self._placement(at)
        moved = new.origin.matrix @ np.linalg.inv(old.origin.matrix) @ body
        x, y, z, w = quat_from_rotation(moved[:3, :3]).tolist()
        values = {"pos": numbers(moved[:3, 3]), "quat": numbers((w, x, y, z))}
        present = [name for name in values if name in at.attributes]
        for name in present:
            yield self._source.attribute_edit(at, name, values[name])
        for name in _ORIENTATIONS[1:]:
            if name in at.attributes:
                yield self._source.attribute_removal(at, name)
        new_ones = [name for name in values if name not in present]
        if new_ones:
            end = at.start_tag.start + 1 + len(at.tag)
            written = "".join(f' {name}="{values[name]}"' for name in new_ones)
            yield Edit(end, end, written)

    def _placement(self, element: SourceElement) -> Floats:
        """Return the pose (4, 4) of a body in its parent, as the reader of MJCF has it."""
        document = read_document(self._source.text_with_lines_before, self._source.source)
        assert document is not None
        return document.pose(Element(element.tag, dict(element.attributes), element.line), "a body")

    def inertial(self, link: str, old: Inertial | None, new: Inertial | None) -> Iterator[Edit]:
        if self._from_geoms:
            raise NotMendedError(f"the inertia of body {link} follows from its geoms")
        if new is None:
            raise NotMendedError(f"body {link} cannot be without an inertia in MJCF")
        written = " ".join(f'{name}="{value}"' for name, value in inertial_attributes(new).items())
        text = f"<inertial {written}/>"
        body = self._body(link)
        present = body.first("inertial")
        if present is not None:
            yield self._source.replacement(present, text)
        else:
            yield self._source.insertion(body, text, first=True)


class _Sdf:
    """Edits of SDF: poses of links are in their model, so that a joint is moved with all links below it."""

    def __init__(self, source: XmlSource) -> None:
        self._source = source
        self._elements: dict[tuple[str, str], list[SourceElement]] = {}
        for element in source.root.walk():
            if element.tag in ("link", "joint"):
                key = element.tag, element.attributes.get("name", "")
                self._elements.setdefault(key, []).append(element)

    def _element(self, tag: str, name: str) -> SourceElement:
        found = self._elements.get((tag, name), [])
        if len(found) != 1:
            where = "stands more than once in" if found else "does not stand in"
            raise NotMendedError(f"<{tag}> {name} {where} the file itself")
        return found[0]

    def joint(self, old: Joint, new: Joint) -> Iterator[Edit]:
        # Its place and axis are written with all places.
        if (old.type, old.mimic) != (new.type, new.mimic):
            raise NotMendedError(f"the type or coupling of joint {old.name}: SDF is not mended for it")
        return iter(())

    def places(self, before: Model, after: Model) -> Iterator[Edit]:
        """Yield the edits of axes of joints, and of poses of links whose places in the root link differ at
        position 0."""
        old, new = _places(before), _places(after)
        for link in before.links:
            # A link that a joint with two axes adds stands in no file.
            if ("link", link.name) in self._elements and (old[link.name] != new[link.name]).any():
                yield self._place(link.name, np.linalg.inv(old[link.name]) @ new[link.name])
        for joint, other in zip(before.joints, after.joints, strict=True):
            if joint.moves and other.moves:
                moved = np.linalg.inv(old[joint.child]) @ new[joint.child]
                turned = bool((old[joint.child] != new[joint.child])[:3, :3].any())
                yield from self._axis(joint, other, moved, turned=turned)

    def _axis(self, old: Joint, new: Joint, moved: Floats, *, turned: bool) -> Iterator[Edit]:
        """Write the axis of a joint that differs, or that is written in the frame of the model if the link is
        `turned`; `moved` (4, 4) is the pose of the link's new frame in its old one."""
        if old.axis == new.axis and (not turned or ("joint", old.name) not in self._elements):
            return
        joint = self._element("joint", old.name)
        axis = joint.first("axis")
        stated = None if axis is None else axis.first("xyz")
        if axis is None or stated is None:
            raise NotMendedError(f"the axis of joint {old.name} is not written in the file")
        given = axis.first("use_parent_model_frame")
        in_model = given is not None and self._source.text_in(given) in ("1", "true")
        in_model = in_model or stated.attributes.get("expressed_in") == "__model__"
        if in_model:
            R = (self._pose(self._element("link", old.child), old.child) @ moved)[:3, :3]
            written = "".join(f' {name}="{value}"' for name, value in stated.attributes.items())
            yield self._source.replacement(stated, f"<xyz{written}>{numbers(R @ np.array(new.axis))}</xyz>")
        elif old.axis != new.axis:
            if stated.attributes or joint.first("pose") is not None:
                raise NotMendedError(f"the axis of joint {old.name} is not written in the frame of its child")
            yield self._source.replacement(stated, f"<xyz>{numbers(new.axis)}</xyz>")

    def _pose(self, element: SourceElement, link: str) -> Floats:
        """Return the pose (4, 4) of a link in its model, as the file states it."""
        pose = element.first("pose")
        text = "" if pose is None else self._source.text_in(pose)
        given = [float(word) for word in text.split()] or [0.0] * 6
        if (pose is not None and pose.attributes) or len(given) != 6:
            raise NotMendedError(f"the pose of link {link} is written in another frame or unit")
        return Pose((given[0], given[1], given[2]), (given[3], given[4], given[5])).matrix

    def _place(self, link: str, moved: Floats) -> Edit:
        """Move a link: `moved` (4, 4) is the pose of its new frame in its old one."""
        element = self._element("link", link)
        pose, T = element.first("pose"), self._pose(element, link) @ moved
        found = Pose.from_matrix(T)
        written = f"<pose>{numbers([*found.xyz, *found.rpy])}</pose>"
        if pose is None:
            return self._source.insertion(element, written, first=True)
        return self._source.replacement(pose, written)

    def inertial(self, link: str, old: Inertial | None, new: Inertial | None) -> Iterator[Edit]:
        element = self._element("link", link)
        if new is None:
            raise NotMendedError(f"link {link} without an inertia has 1 kg in SDF")
        present = element.first("inertial")
        if present is not None and present.attributes.get("auto") == "true":
            raise NotMendedError(f"the inertia of link {link} follows from its shapes")
        rows = "".join(f"<{name}>{number(getattr(new, name))}</{name}>" for name in MOMENTS)
        lines = [
            "<inertial>",
            f"  <pose>{numbers([*new.origin.xyz, *new.origin.rpy])}</pose>",
            f"  <mass>{number(new.mass)}</mass>",
            f"  <inertia>{rows}</inertia>",
            "</inertial>",
        ]
        if present is None:
            yield self._source.insertion(element, "\n".join(lines), first=True)
        else:
            yield self._source.replacement(present, "\n".join(lines))


def _places(model: Model) -> dict[str, Floats]:
    """Return the pose (4, 4) of each link in the root link at position 0."""
    found = {model.root: np.eye(4)}
    for joint in model.joints:
        found[joint.child] = found[joint.parent] @ joint.origin.matrix
    return found
