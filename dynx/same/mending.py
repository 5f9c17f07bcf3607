"""Mended text: the description with some elements replaced, and all else as it is written.

What is written follows from two models, the one that was read and the one that it is to be. URDF can be
mended wherever they differ; in MJCF and SDF inertias, places of bodies and axes of joints, in SDF also types.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from dynx.model import Model
from dynx.model.elements import Inertial, Joint, Pose
from dynx.model.xml.source import Edit, SourceElement, XmlSource
from dynx.model.xml.text import quoteattr
from dynx.same.mjcf_edits import MjcfEdits, stated_edits
from dynx.same.stated_parts import StatedChange
from dynx.same.text_edits import MOMENTS, NotMendedError, number, numbers
from dynx.spatial.scalar import Floats


def mended_text(source: XmlSource, before: Model, after: Model) -> XmlSource:
    """Return the text in which the joints and links of `before` are those of `after`.

    Raises NotMendedError for a change that cannot be written.
    """
    if source.root.tag not in ("robot", "mujoco", "sdf"):
        raise NotMendedError(
            f"a file whose root is <{source.root.tag}> is not mended; wanted URDF, MJCF or SDF"
        )
    edits: _Urdf | MjcfEdits | _Sdf
    if source.root.tag == "robot":
        edits = _Urdf(source)
    else:
        edits = MjcfEdits(source, before) if source.root.tag == "mujoco" else _Sdf(source)
    found = [*edits.places(before, after)]
    for link, other in zip(before.links, after.links, strict=True):
        if link != other:
            found += edits.inertial(link.name, link.inertial, other.inertial)
    return source.apply(*found)


def with_stated_parts(
    source: XmlSource, before: Model, after: Model, changes: Sequence[StatedChange]
) -> XmlSource:
    """Return a text of MJCF in which tendons, constraints and keyframes of the robot `before` are changed,
    which is to be `after`.

    Raises NotMendedError for a part that does not stand in the file itself.
    """
    if source.root.tag != "mujoco":
        raise NotMendedError(f"tendons, constraints and keyframes of <{source.root.tag}> are not mended")
    return source.apply(*stated_edits(source, before, after, changes))


class _Urdf:
    def __init__(self, source: XmlSource) -> None:
        self._source = source

    def _element(self, tag: str, name: str) -> SourceElement:
        for element in self._source.root.all(tag):
            if element.attributes.get("name") == name:
                return element
        raise NotMendedError(f"<{tag}> {name} does not stand in the file itself")

    def places(self, before: Model, after: Model) -> Iterator[Edit]:
        """Yield the edits of all joints."""
        for old, new in zip(before.joints, after.joints, strict=True):
            if old != new:
                yield from self._joint(old, new)

    def _joint(self, old: Joint, new: Joint) -> Iterator[Edit]:
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

    def places(self, before: Model, after: Model) -> Iterator[Edit]:
        """Yield the edits of axes of joints, and of poses of links whose places in the root link differ at
        position 0."""
        for joint, new_joint in zip(before.joints, after.joints, strict=True):
            if joint.mimic != new_joint.mimic:
                raise NotMendedError(f"the coupling of joint {joint.name}: SDF is not mended for it")
            if joint.type != new_joint.type:
                yield from self._type(joint, new_joint)
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

    def _type(self, old: Joint, new: Joint) -> Iterator[Edit]:
        """Write the type of a joint, and axis and limits of one that was fixed."""
        joint = self._element("joint", old.name)
        if "ball" in (old.type, new.type) or joint.first("axis2") is not None:
            raise NotMendedError(f"the type of joint {old.name}: SDF is not mended for more than one axis")
        yield self._source.attribute_edit(joint, "type", new.type)
        if not old.moves and joint.first("axis") is None:
            ends = {"lower": new.limits.lower, "upper": new.limits.upper}
            rows = "".join(f"<{k}>{number(end)}</{k}>" for k, end in ends.items() if np.isfinite(end))
            axis = f"<axis><xyz>{numbers(new.axis)}</xyz><limit>{rows}</limit></axis>"
            yield self._source.insertion(joint, axis)

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
