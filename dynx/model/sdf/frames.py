"""Frames of SDF: the pose that each part states, in any other frame, and the link that a frame moves with.

SDFormat, "Pose frame semantics" and "Model composition" (http://sdformat.org/tutorials): a pose is stated
in ``relative_to``, else in the frame of the element around; a joint stands in its child.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from dynx.errors import nearest, shown
from dynx.model.sdf.document import MODEL_FRAME, WORLD, NamedPart, Scope, SdfReading
from dynx.model.xml.reading import Element
from dynx.spatial.scalar import Floats
from dynx.spatial.se3 import homogeneous, inverse
from dynx.spatial.so3 import rotation_from_quat, rotation_from_rpy

_IDENTITY = np.eye(4)

MAX_NEAR = 8
"""Largest number of frames from one to that in which two frames are compared by the numbers of the file."""

Frame = NamedPart | Scope


class Frames:
    """Poses of the parts of a document, each computed once."""

    def __init__(self, reading: SdfReading) -> None:
        self._reading = reading
        self._poses: dict[int, Floats] = {}
        self._stated: dict[int, Floats] = {}
        self._links: dict[int, NamedPart | None] = {}
        self._open: set[int] = set()

    # -- poses ----------------------------------------------------------------------------------

    def stated(self, element: Element | None, what: str) -> Floats:
        """Return the pose (4, 4) that the numbers of a ``<pose>`` state, in whatever frame."""
        reading = self._reading
        if element is None:
            return _IDENTITY
        at = reading.like(element, {**element.attributes, "pose": element.text.strip()})
        format_ = reading.choice(at, "rotation_format", what, ("euler_rpy", "quat_xyzw"), "euler_rpy")
        degrees = reading.flag(at, "degrees", what, default=False)
        if not at.attributes["pose"]:
            return _IDENTITY
        if format_ == "quat_xyzw":
            if degrees:
                raise reading.error(element, f"<pose> of {what} has a quaternion and degrees")
            numbers = reading.numbers(at, "pose", what, 7)
            quaternion = np.array(numbers[3:])
            length = float(np.linalg.norm(quaternion))
            if length < 1e-6:
                raise reading.error(element, f"the quaternion of <pose> of {what} is zero")
            if abs(length - 1.0) > 1e-12:
                reading.note(
                    element,
                    f"the quaternion in <pose> of {what} has length {length:.12g}; it was scaled to 1",
                )
            return homogeneous(rotation_from_quat(quaternion / length), np.array(numbers[:3]))
        numbers = reading.numbers(at, "pose", what, 6)
        angles = np.radians(numbers[3:]) if degrees else np.array(numbers[3:])
        return homogeneous(rotation_from_rpy(angles), np.array(numbers[:3]))

    def placed(self, owner: NamedPart, element: Element | None, what: str) -> Floats:
        """Return the pose (4, 4) in a link of what stands in it."""
        name = _relative_to(element)
        pose = self.stated(element, what)
        if name is None or element is None:
            return pose
        return self.between(owner, self.named(owner.scope, name, element, what)) @ pose

    def between(self, a: Frame | None, b: Frame | None) -> Floats:
        """Return the pose (4, 4) of frame b in frame a; None is the world around all."""
        if a is b:
            return _IDENTITY
        scope_a, scope_b = (each.scope if isinstance(each, NamedPart) else each for each in (a, b))
        if scope_a is scope_b and a is not None and b is not None:
            self.in_scope(a), self.in_scope(b)  # raise the errors of all that they are stated in
            near = self._by_near_frame(a, b)
            return inverse(self.in_scope(a)) @ self.in_scope(b) if near is None else near
        return inverse(self._in_world(a)) @ self._in_world(b)

    def _by_near_frame(self, a: Frame, b: Frame) -> Floats | None:
        """Return the pose (4, 4) of frame b in frame a of one scope by way of a near frame that both are
        stated in, so that one that is stated in a has the numbers of the file; None without such a frame."""
        near_a, near_b = ([*self._stated_chain(each)] for each in (a, b))
        places = {id(frame): pose for frame, pose in near_a}
        for frame, second in near_b:
            first = places.get(id(frame))
            if first is not None:
                return second if frame is a else inverse(first) @ second
        return None

    def _stated_chain(self, frame: Frame) -> Iterator[tuple[Frame, Floats]]:
        """Yield a frame, the one that its pose is stated in, and so on in their scope, each with the pose
        (4, 4) of the first in it; at most `MAX_NEAR`."""
        pose, each = _IDENTITY, frame
        yield each, pose
        for _ in range(MAX_NEAR):
            if isinstance(each, Scope):
                return
            stated = self._stated_in(each)
            inside = isinstance(stated, NamedPart) and stated.scope is each.scope
            if not (inside or stated is None or stated is each.scope):
                return
            pose = self._stated_pose(each) @ pose if pose is not _IDENTITY else self._stated_pose(each)
            each = stated if isinstance(stated, NamedPart) else each.scope
            yield each, pose

    def _stated_pose(self, part: NamedPart) -> Floats:
        """Return the pose (4, 4) that a part states, read once."""
        if id(part) not in self._stated:
            self._stated[id(part)] = self.stated(self._reading.only(part.element, "pose"), part.what)
        return self._stated[id(part)]

    def in_scope(self, frame: Frame) -> Floats:
        """Return the pose (4, 4) of a part in the frame of its scope; of a scope that is the identity."""
        return _IDENTITY if isinstance(frame, Scope) else self._pose(frame)

    def of_scope(self, scope: Scope) -> Floats:
        """Return the pose (4, 4) of a scope in the one around."""
        return self._pose(scope)

    def _pose(self, node: Frame) -> Floats:
        """Return the pose of a part in its scope, or of a scope in the one around, after those it needs."""
        waiting = [node]
        while waiting:
            each = waiting[-1]
            if id(each) in self._poses:
                waiting.pop()
                continue
            self._open.add(id(each))
            needed = [other for other in self._needs(each) if id(other) not in self._poses]
            for other in needed:
                if id(other) in self._open:
                    raise self._reading.error(
                        each.element, f"the pose of {each.what} is relative to itself, by way of others"
                    )
            if not needed:
                self._poses[id(each)] = (
                    self._placement(each) if isinstance(each, Scope) else self._resolved(each)
                )
                self._open.discard(id(each))
                waiting.pop()
            waiting += needed[:1]
        return self._poses[id(node)]

    def _needs(self, node: Frame) -> list[Frame]:
        """Return the parts and scopes whose poses that of a part, or the placement of a scope, is made of."""
        found: list[Frame] = []
        around = node.parent if isinstance(node, Scope) else node.scope
        stated = self._stated_in(node)
        if around is not None and stated is not None:
            found += self._way(around, stated)
        if isinstance(node, Scope) and node.placement_frame:
            what, name = node.what, node.placement_frame
            found += self._way(node, self.named(node, name, node.element, what))
        return found

    @staticmethod
    def _way(scope: Scope, frame: Frame) -> list[Frame]:
        """Return a frame, if it is a part, and the scopes between it and one that holds it."""
        found: list[Frame] = [frame] if isinstance(frame, NamedPart) else []
        inner: Scope | None = frame.scope if isinstance(frame, NamedPart) else frame
        while inner is not None and inner is not scope:
            found.append(inner)
            inner = inner.parent
        return found

    def _stated_in(self, node: Frame) -> Frame | None:
        """Return the frame in which the pose of a part or scope is stated; None for the scope around."""
        if isinstance(node, Scope):
            name = _relative_to(node.pose)
            if node.parent is None or name is None or node.pose is None:
                return None
            return self.named(node.parent, name, node.pose, node.what)
        element = self._reading.only(node.element, "pose")
        name = _relative_to(element)
        if name is None and node.kind == "frame":
            name = node.element.attributes.get("attached_to") or None
        if name is None and node.kind == "joint":
            name = self._end(node, "child")
        return None if name is None else self.named(node.scope, name, element or node.element, node.what)

    def axis(self, joint: NamedPart, axis: Element, what: str) -> Floats:
        """Return the axis (3,) of length 1 of a joint in the frame of its joint."""
        reading = self._reading
        xyz = reading.only(axis, "xyz")
        numbers = (0.0, 0.0, 1.0)
        if xyz is not None:
            at = reading.like(xyz, {**xyz.attributes, "xyz": xyz.text.strip()})
            numbers = reading.vector(at, "xyz", what)
        vector = np.array(numbers)
        length = float(np.linalg.norm(vector))
        if length < 1e-14:
            raise reading.error(xyz or axis, f"the axis of {what} is zero; wanted a direction")
        if abs(length - 1.0) > 1e-15:
            vector = vector / length
        old = joint.scope.version < (1, 5)
        in_model = reading.truth(axis, "use_parent_model_frame", what, default=old)
        name = (xyz.attributes.get("expressed_in") if xyz is not None else None) or (
            MODEL_FRAME if in_model else None
        )
        if name is None or xyz is None:
            return vector
        other = self.named(joint.scope, name, xyz, what)
        turned = self.between(joint, other)[:3, :3] @ vector
        return np.asarray(turned)

    def _resolved(self, part: NamedPart) -> Floats:
        pose, other = self._stated_pose(part), self._stated_in(part)
        return pose if other is None else self._seen_from(part.scope, other) @ pose

    def _placement(self, scope: Scope) -> Floats:
        if scope.is_world:
            return _IDENTITY
        pose, other = self.stated(scope.pose, scope.what), self._stated_in(scope)
        name = _relative_to(scope.pose)
        if scope.parent is not None and other is not None:
            pose = self._seen_from(scope.parent, other) @ pose
        elif scope.pose is not None and name not in (None, WORLD):
            raise self._reading.error(
                scope.pose, f"the pose of {scope.what} is relative to {shown(name)}, and nothing is around it"
            )
        if scope.placement_frame:
            frame = self.named(scope, scope.placement_frame, scope.element, scope.what)
            pose = pose @ inverse(self._seen_from(scope, frame))
        return pose

    def _seen_from(self, scope: Scope, frame: Frame) -> Floats:
        """Return the pose (4, 4) of a frame in a scope that holds it."""
        pose, inner = self.in_scope(frame), frame.scope if isinstance(frame, NamedPart) else frame
        while inner is not scope:
            pose = self.of_scope(inner) @ pose
            if inner.parent is None:
                return inverse(self._in_world(scope)) @ pose
            inner = inner.parent
        return pose

    def _in_world(self, frame: Frame | None) -> Floats:
        if frame is None:
            return _IDENTITY
        pose: Floats = self.in_scope(frame)
        scope: Scope | None = frame.scope if isinstance(frame, NamedPart) else frame
        while scope is not None:
            pose = self.of_scope(scope) @ pose
            scope = scope.parent
        return pose

    # -- names ----------------------------------------------------------------------------------

    def named(self, scope: Scope, name: str, element: Element, what: str) -> Frame:
        """Return the frame of that name in a scope; raise an error if there is none."""
        if name == MODEL_FRAME and not scope.is_world:
            return scope
        if name == WORLD and scope.is_world:
            return scope
        found = scope.find(name)
        if found is None:
            raise self._reading.error(
                element,
                f"{what} names {shown(name)}, which {scope.what} has not{nearest(name, scope.names())}",
            )
        return found

    def link_of(self, frame: Frame) -> NamedPart | None:
        """Return the link that a frame moves with; None for the world."""
        reading, seen = self._reading, set[int]()
        found: NamedPart | None = None
        while id(frame) not in self._links:
            if id(frame) in seen:
                raise reading.error(frame.element, f"{frame.what} is attached to itself, by way of others")
            seen.add(id(frame))
            if isinstance(frame, Scope):
                if frame.is_world:
                    break
                frame = self._canonical(frame)
            elif frame.kind == "link":
                found = frame
                break
            elif frame.kind == "joint":
                frame = self.named(frame.scope, self._end(frame, "child"), frame.element, frame.what)
            else:
                name = frame.element.attributes.get("attached_to") or (
                    WORLD if frame.scope.is_world else MODEL_FRAME
                )
                frame = self.named(frame.scope, name, frame.element, frame.what)
        else:
            found = self._links[id(frame)]
        self._links |= dict.fromkeys(seen, found)
        return found

    def ends(self, joint: NamedPart) -> tuple[NamedPart | None, NamedPart | None]:
        """Return the links that a joint joins, the parent first; None for the world."""
        parent, child = (self._end(joint, role) for role in ("parent", "child"))
        if child == WORLD:
            raise self._reading.error(joint.element, f"the child of {joint.what} is the world; wanted a link")
        return (
            None
            if parent == WORLD
            else self.link_of(self.named(joint.scope, parent, joint.element, joint.what)),
            self.link_of(self.named(joint.scope, child, joint.element, joint.what)),
        )

    def _end(self, joint: NamedPart, role: str) -> str:
        found = self._reading.word(joint.element, role, joint.what)
        if found is None:
            raise self._reading.error(joint.element, f"{joint.what} has no <{role}>")
        return found

    def _canonical(self, scope: Scope) -> Frame:
        """Return the frame that the frame of a model is attached to."""
        name = scope.element.attributes.get("canonical_link")
        if name:
            return self.named(scope, name, scope.element, f"the canonical link of {scope.what}")
        first = next(
            (each for each in scope.content if isinstance(each, NamedPart) and each.kind == "link"), None
        )
        if first is None:
            first = next((each for each in scope.walk() if each.kind == "link"), None)
        if first is None:
            raise self._reading.error(scope.element, f"{scope.what} has no link")
        return first


def _relative_to(element: Element | None) -> str | None:
    """Return the name of the frame in which a ``<pose>`` is stated, ``frame`` before version 1.7."""
    if element is None:
        return None
    return element.attributes.get("relative_to") or element.attributes.get("frame") or None
