"""Inertias of links: about the centre of mass, merged over rigid groups, impossible or missing; edits."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import combinations, permutations
from types import MappingProxyType
from typing import ClassVar, Literal

import numpy as np

from dynx.engines.pybullet.file_checks import CACHE_SIZE, bullet_reading, tree_may_reject
from dynx.model.elements import IDENTITY, Inertial, Pose, Vector
from dynx.model.mechanism import pose_arrays
from dynx.model.xml.source import Edit, SourceElement, XmlSource
from dynx.rules.attributes import orientation_edits
from dynx.rules.case import Case, end_of
from dynx.rules.numbers_in_text import MOMENTS, decimal, is_number
from dynx.rules.rule import Detection, Remedy, Rule, links_of, measured_on
from dynx.spatial.scalar import FLOAT64_EPS, Array, jacobi_eigen, longdouble
from dynx.spatial.so3 import rotation_from_rpy, rpy_from_rotation

# The inertia of a link in extended precision: sums, principal axes, and conversion to an element.
#
# All tensors are about the centre of mass, so that no two large numbers are subtracted, and in NumPy's long
# double, so that the numbers of an element are right to the last digit of float64.


@dataclass(frozen=True, eq=False)
class CentralInertia:
    """Mass [kg], centre of mass (3,) and inertia about it (3, 3), in the axes of some frame."""

    mass: Array
    center: Array
    tensor: Array

    @classmethod
    def of(cls, inertial: Inertial) -> CentralInertia:
        """Return the inertia that an ``<inertial>`` states, in the frame of its link."""
        R = rotation_from_rpy(longdouble(inertial.origin.rpy))
        tensor = longdouble(inertial.tensor)
        return cls(longdouble(inertial.mass), longdouble(inertial.origin.xyz), R @ tensor @ R.T)

    def transform(self, R: Array, p: Array) -> CentralInertia:
        """Return the same body in frame A, where (R, p) is the pose of this frame in A."""
        return CentralInertia(self.mass, R @ self.center + p, R @ self.tensor @ R.T)

    def __add__(self, other: CentralInertia) -> CentralInertia:
        """Return the sum of two rigidly connected bodies in the same frame (parallel axis theorem)."""
        mass = self.mass + other.mass
        if mass == 0:
            return CentralInertia(mass, self.center, self.tensor + other.tensor)
        center = (self.mass * self.center + other.mass * other.center) / mass if other.mass else self.center
        arm = other.center - self.center
        steiner = self.mass * other.mass / mass * (arm @ arm * np.eye(3) - np.outer(arm, arm))
        return CentralInertia(mass, center, self.tensor + other.tensor + steiner)

    def about_origin(self) -> Array:
        """Return the inertia about the origin of the frame (3, 3)."""
        c = self.center
        return np.asarray(self.tensor + self.mass * (c @ c * np.eye(3) - np.outer(c, c)))

    def moments(self) -> Array:
        """Return the principal moments (3,), smallest first."""
        return np.sort(jacobi_eigen(self.tensor)[0])

    def principal(self, near: Vector = (0.0, 0.0, 0.0)) -> tuple[Array, Array]:
        """Return the principal moments (3,) and axes (3, 3), the columns of a rotation, in the axes of the
        frame.

        Order and directions of the axes are those nearest to the attitude `near` (rpy).
        """
        values, axes = jacobi_eigen(self.tensor)
        order, R = _nearest_axes(axes, rotation_from_rpy(longdouble(near)))
        return values[order], R

    def inertial(self, near: Vector = (0.0, 0.0, 0.0)) -> Inertial:
        """Return the ``<inertial>`` in principal form: no products of inertia, the axes in its rpy."""
        return self.about(*self.principal(near))

    def about(self, moments: Array, axes: Array) -> Inertial:
        """Return the ``<inertial>`` with other moments (3,), about the columns of a rotation (3, 3)."""
        x, y, z = (float(value) for value in moments)
        origin = Pose(_vector(self.center), _vector(rpy_from_rotation(axes)))
        return Inertial(float(self.mass), origin, ixx=x, iyy=y, izz=z)

    def aligned(self) -> Inertial:
        """Return the ``<inertial>`` in the axes of the link, with its products of inertia."""
        t = [[float(x) for x in row] for row in self.tensor]
        origin = Pose(_vector(self.center))
        return Inertial(float(self.mass), origin, t[0][0], t[0][1], t[0][2], t[1][1], t[1][2], t[2][2])


def _nearest_axes(axes: Array, wanted: Array) -> tuple[list[int], Array]:
    """Return the order and directions of the columns of `axes` that make the rotation nearest to `wanted`."""
    overlap = wanted.T @ axes
    best: tuple[float, list[int], Array] | None = None
    for chosen in permutations(range(3)):
        order = list(chosen)
        along = np.array([overlap[row, column] for row, column in enumerate(order)])
        signs = np.where(along < 0, -1, 1)
        if np.linalg.det(np.asarray(axes[:, order] * signs, dtype=float)) < 0:
            signs[int(np.argmin(np.abs(along)))] *= -1
        trace = float(np.sum(along * signs))
        # Of orders that are equally near, to rounding, the first is kept.
        if best is None or trace > best[0] + 1e-9:
            best = trace, order, axes[:, order] * signs
    assert best is not None
    return best[1], best[2]


def _vector(numbers: Array) -> Vector:
    x, y, z = (float(number) + 0.0 for number in numbers)
    return x, y, z


# Edits that write ``<inertial>`` elements into a document.


ZERO_TENSOR = "<inertia {}/>".format(" ".join(f'{name}="0"' for name in MOMENTS))


def zero_inertial() -> str:
    """Return the text of an ``<inertial>`` without mass and moments."""
    return f'<inertial>\n  <mass value="0"/>\n  {ZERO_TENSOR}\n</inertial>'


def inertial_edits(source: XmlSource, link: SourceElement, old: Inertial | None, new: Inertial) -> list[Edit]:
    """Replace the inertial `old` of a link by `new`; unchanged numbers keep their spelling."""
    element = link.first("inertial")
    if old is None or element is None:
        return [source.insertion(link, _inertial_text(new), first=True)]
    edits = []
    origin = element.first("origin")
    for name in ("xyz", "rpy"):
        wanted = getattr(new.origin, name)
        if wanted == getattr(old.origin, name):
            continue
        if origin is None:
            continue
        if name == "rpy":
            edits += orientation_edits(source, origin, wanted)
        else:
            edits.append(
                source.attribute_edit(origin, name, _vector_text(origin.attributes.get(name), wanted))
            )
    if origin is None and new.origin != old.origin:
        edits.append(source.insertion(element, _origin_text(new), first=True))
    mass, tensor = element.first("mass"), element.first("inertia")
    if mass is not None and new.mass != old.mass:
        edits.append(source.attribute_edit(mass, "value", decimal(new.mass)))
    if tensor is not None:
        changed = [name for name in MOMENTS if getattr(new, name) != getattr(old, name)]
        edits += [source.attribute_edit(tensor, name, decimal(getattr(new, name))) for name in changed]
    return edits


def with_inertials(case: Case, inertials: dict[str, Inertial]) -> Case:
    """Return the case with these inertials, by link name."""
    edits: list[Edit] = []
    for name, inertial in inertials.items():
        edits += inertial_edits(case.source, case.links[name], case.inertials[name], inertial)
    return case.with_source(case.source.apply(*edits))


def line_of(case: Case, link: str, tag: str) -> int:
    """Find the line of an element inside the ``<inertial>`` of a link, or of the nearest one around it."""
    element = case.links[link]
    for inner in ("inertial", tag):
        element = element.first(inner) or element
    return element.line


def _vector_text(written: str | None, wanted: Vector) -> str:
    """Write a vector; numbers that stay as they are keep their spelling."""
    words = (written or "").split()
    if len(words) != len(wanted):
        return " ".join(map(decimal, wanted))
    return " ".join(
        word if is_number(word) and float(word) == value else decimal(value)
        for word, value in zip(words, wanted, strict=True)
    )


def _origin_text(inertial: Inertial) -> str:
    xyz, rpy = (" ".join(map(decimal, vector)) for vector in (inertial.origin.xyz, inertial.origin.rpy))
    return f'<origin xyz="{xyz}" rpy="{rpy}"/>'


def _inertial_text(inertial: Inertial) -> str:
    moments = " ".join(f'{name}="{decimal(getattr(inertial, name))}"' for name in MOMENTS)
    mass = f'<mass value="{decimal(inertial.mass)}"/>'
    lines = [_origin_text(inertial), mass, f"<inertia {moments}/>"]
    return "\n".join(["<inertial>", *(f"  {line}" for line in lines), "</inertial>"])


# Physical consistency of inertia tensors, the checks of engines, and the nearest consistent tensor.
#
# The principal moments are sums of two of three non-negative second moments of mass, so none is negative
# and none exceeds the sum of the other two (Wensing, Kim and Slotine 2018, section II). Engines check this
# in float64, each in its own way; a body on the edge, such as a thin plate, passes in one and not in another.


MIN_MOMENT = 1e-14
"""Smallest principal moment [kg m^2] that MuJoCo accepts, unless the whole tensor is zero."""

ACCEPTED_MOMENT = 1.5 * MIN_MOMENT
"""Principal moment [kg m^2] that MuJoCo accepts whatever its rounding."""

MIN_MASS = 1e-15
"""Smallest mass [kg] of a moving body that MuJoCo accepts (mjMINVAL)."""

ROUNDING = 16.0 * FLOAT64_EPS
"""Bound on the rounding of a tensor relative to its largest moment; `dynx.load` uses the same bound."""

_ROTATION_ROUNDING = 4.0 * FLOAT64_EPS
"""Relative rounding of the moments of a rotated tensor. MuJoCo refused tensors whose triangle inequality
held with a margin of 0 to 2 eps."""

_MARGIN = 16.0 * FLOAT64_EPS
"""Relative distance from the bound at which corrected moments are placed."""

Fault = Literal["negative", "triangle"]
"""Fault of principal moments: one is negative, or one exceeds the sum of the others."""


@lru_cache(maxsize=CACHE_SIZE)
def principal_moments(inertial: Inertial) -> Array:
    """Return the principal moments (3,), smallest first, in long double; the array must not be changed."""
    return CentralInertia.of(inertial).moments()


@lru_cache(maxsize=CACHE_SIZE)
def fault_beyond_rounding(inertial: Inertial) -> Fault | None:
    """Find the fault of an inertial, if it exceeds rounding; None also for a tensor too small to matter, and
    for one without mass."""
    return None if inertial.mass == 0.0 else tensor_fault(inertial)


def tensor_fault(inertial: Inertial) -> Fault | None:
    """Find the fault of a tensor whatever the mass, as `fault_beyond_rounding` does for a body."""
    if float(np.max(np.abs(inertial.tensor))) < MIN_MOMENT:
        return None
    small, middle, large = principal_moments(inertial)
    rounding = ROUNDING * max(abs(small), abs(large))
    if small < -rounding:
        return "negative"
    return "triangle" if small + middle < large - rounding else None


@lru_cache(maxsize=CACHE_SIZE)
def is_borderline(inertial: Inertial, *, root: bool, on_fixed_joint: bool) -> bool:
    """Check whether an engine may refuse the inertial because of rounding alone.

    `root` says that no joint carries the link, `on_fixed_joint` that a fixed one does.
    """
    size = float(np.max(np.abs(inertial.tensor)))
    if (
        inertial.mass == 0.0
        or (size < MIN_MOMENT and size > 0.0)
        or fault_beyond_rounding(inertial) is not None
    ):
        return False
    small, middle, large = principal_moments(inertial)
    too_small_for_mujoco = small < MIN_MOMENT and bullet_reading(inertial).moments.any()  # DX111
    rotated = any(inertial.origin.rpy) or bool(inertial.ixy or inertial.ixz or inertial.iyz)
    if (
        rotated
        and small + middle - large < _ROTATION_ROUNDING * large
        and size > 0.0
        and not too_small_for_mujoco
    ):
        return True
    if bullet_reading(inertial).zeroed:
        return True
    return not root and tree_may_reject(inertial, on_fixed_joint=on_fixed_joint)


def moment_increase(inertial: Inertial, floor: float = 0.0) -> float:
    """Return the amount [kg m^2] to add to all three moments so that no check fails by rounding.

    It is a few units in the last place of the largest moment about the link's origin, too little to show in
    the equations of motion, or more where a moment would be below `floor` [kg m^2].
    """
    body = CentralInertia.of(inertial)
    size = max(float(np.max(np.abs(body.tensor))), float(np.max(np.diagonal(body.about_origin()))))
    small, middle, large = (float(value) for value in principal_moments(inertial))
    added = max(0.0, _MARGIN * size - min(small + middle - large, small))
    return max(added, floor - small)


def with_raised_moments(inertial: Inertial, floor: float = 0.0) -> Inertial:
    """Return the inertial with all moments raised by `moment_increase`."""
    added = moment_increase(inertial, floor)
    return replace(inertial, ixx=inertial.ixx + added, iyy=inertial.iyy + added, izz=inertial.izz + added)


def nearest_moments(moments: Array) -> Array:
    """Find the physical principal moments (3,) nearest to these by least squares, in the same order.

    The moments of a body are G s with second moments of mass s >= 0 and G = [[0,1,1],[1,0,1],[1,1,0]]. In the
    least-squares solution over s >= 0 some s are zero. All eight sets of zeros are tried; y = G s is the
    solution if no column of G has a positive product with x - y (Karush, Kuhn and Tucker). The tensor with
    these moments is the nearest in the Frobenius norm.
    """
    wanted = np.asarray(moments, dtype=float)
    G = np.ones((3, 3)) - np.eye(3)
    best, least = np.zeros(3), float(np.max(G.T @ wanted))
    for count in (1, 2, 3):
        for free in combinations(range(3), count):
            columns = G[:, list(free)]
            s = np.linalg.solve(columns.T @ columns, columns.T @ wanted)
            nearest = columns @ np.maximum(s, 0.0)
            fault = max(float(np.max(-s)), float(np.max(G.T @ (wanted - nearest))))
            if fault < least:
                best, least = nearest, fault
    return longdouble(best)


# Groups of links that fixed joints connect rigidly, and the pose of each link in its group.


@dataclass(frozen=True, eq=False)
class RigidGroup:
    """Rigidly connected links; `head` is nearest to the root, `static` says that the group cannot move.

    `links` are in depth-first order, the head first; `poses` has (R, p) of each in the head's frame, in
    long double; `parents` maps each link but the head to its parent.
    """

    head: str
    static: bool
    links: tuple[str, ...]
    poses: dict[str, tuple[Array, Array]]
    parents: dict[str, str]

    def pose(self, link: str, frame: str) -> tuple[Array, Array]:
        """Return (R, p) of one link of the group in the frame of another."""
        R_frame, p_frame = self.poses[frame]
        R_link, p_link = self.poses[link]
        return R_frame.T @ R_link, R_frame.T @ (p_link - p_frame)

    def children(self, link: str) -> tuple[str, ...]:
        """Return the child links of one link within the group, in document order."""
        return tuple(child for child in self.links if self.parents.get(child) == link)

    def below(self, link: str) -> tuple[str, ...]:
        """Return all descendants of one link within the group, in depth-first order."""
        found = {link}
        for each in self.links:
            if self.parents.get(each) in found:
                found.add(each)
        return tuple(each for each in self.links if each in found and each != link)


# Cached, because all rules use the groups of one case before the first remedy makes another case.
@lru_cache(maxsize=8)
def rigid_groups(case: Case) -> Mapping[str, RigidGroup]:
    """Return the group of every link that dynx reads, by the link's name.

    Joints that the document calls ``fixed`` connect rigidly. Joints that dynx holds still for other reasons,
    such as one that follows a fixed joint, move in other engines.
    """
    model = case.model
    heads = {model.root: model.root}
    poses = {model.root: _identity()}
    parents: dict[str, str] = {}
    for joint in model.joints:
        element = case.joints.get(joint.name)
        fixed = joint.type == "fixed" and (element is None or element.attributes.get("type") == "fixed")
        if not fixed:
            heads[joint.child] = joint.child
            poses[joint.child] = _identity()
            continue
        R_parent, p_parent = poses[joint.parent]
        R, p = pose_arrays(joint.origin, longdouble)
        heads[joint.child] = heads[joint.parent]
        poses[joint.child] = (R_parent @ R, p_parent + R_parent @ p)
        parents[joint.child] = joint.parent
    members: dict[str, list[str]] = {}
    for link in model.links:
        members.setdefault(heads[link.name], []).append(link.name)
    groups: dict[str, RigidGroup] = {}
    for head, names in members.items():
        group = RigidGroup(
            head,
            head == model.root and case.base == "fixed",
            tuple(names),
            {name: poses[name] for name in names},
            {name: parents[name] for name in names if name != head},
        )
        groups.update(dict.fromkeys(names, group))
    return MappingProxyType(groups)


def inertials_in_groups(case: Case) -> Iterator[tuple[str, Inertial, RigidGroup]]:
    """Yield each link with an ``<inertial>``: its name, the inertial as dynx reads it, and its group."""
    groups = rigid_groups(case)
    for name, inertial in case.inertials.items():
        if inertial is not None:
            yield name, inertial, groups[name]


def static_links(case: Case) -> frozenset[str]:
    """Name the links that cannot move: on the fixed base the root and links rigidly connected to it.

    They are taken from the document, so links that dynx reads as frames are included.
    """
    if case.base != "fixed":
        return frozenset()
    ends = [(end_of(joint, "parent"), end_of(joint, "child"), joint) for joint in case.joints.values()]
    children: dict[str, list[str]] = {}
    for parent, child, joint in ends:
        if joint.attributes.get("type") == "fixed":
            children.setdefault(parent, []).append(child)
    below = {child for _, child, _ in ends}
    waiting = [name for name in case.links if name not in below]
    found: set[str] = set()
    while waiting:
        name = waiting.pop()
        if name not in found:
            found.add(name)
            waiting += children.get(name, [])
    return frozenset(found)


def _identity() -> tuple[Array, Array]:
    return longdouble(np.eye(3)), longdouble(np.zeros(3))


# Inertia moved between rigidly connected links, which leaves the rigid body unchanged.


def as_inertial(case: Case, link: str, body: CentralInertia, old: Inertial | None = None) -> Inertial:
    """Return the ``<inertial>`` of a link with this body, in principal form unless the link is a fixed root.

    There PyBullet mistakes the attitude of the inertial frame for that of the base (DX106).
    """
    if case.base == "fixed" and link == case.model.root:
        return body.aligned()
    return body.inertial(near=(0.0, 0.0, 0.0) if old is None else old.origin.rpy)


def merged_inertials(case: Case, group: RigidGroup, links: Sequence[str], into: str) -> dict[str, Inertial]:
    """Merge the inertials of some links of a group: the sum in the link `into`, zero in the others."""
    body = _sum(case, group, links, into)
    bodies = {into: as_inertial(case, into, body, case.inertials[into])}
    for name in links:
        inertial = case.inertials[name]
        if name != into and inertial is not None:
            bodies[name] = _without_mass(inertial)
    return bodies


def _without_mass(inertial: Inertial) -> Inertial:
    """Return the inertial with mass and moments of zero; its origin is kept."""
    return Inertial(0.0, inertial.origin)


def _sum(case: Case, group: RigidGroup, links: Iterable[str], into: str) -> CentralInertia:
    """Return the inertia of some links of a group together, in the frame of the link `into`."""
    total: CentralInertia | None = None
    # The link itself first, so that its centre of mass is kept where no link has mass.
    for name in sorted(links, key=lambda name: name != into):
        inertial = case.inertials[name]
        if inertial is not None:
            part = CentralInertia.of(inertial).transform(*group.pose(name, into))
            total = part if total is None else total + part
    return CentralInertia.of(Inertial()) if total is None else total


# The common part of the rules on inertia tensors that no body can have: detection and remedies.


NUMBERS_OF_THE_FILE = ("pybullet.set_inertias", "pybullet.extrapolate_inertias", "drake.set_inertias")
"""The engine settings with which engines use the numbers of the file."""


class ImpossibleInertia(Rule):
    """A rule about tensors that no body can have, by more than rounding."""

    fault: ClassVar[Fault]
    engines: ClassVar[Mapping[str, str]] = measured_on("pybullet", "mujoco", "drake")
    advice = (
        "Take the tensor from the CAD model again; until then use the nearest tensor that a body can have."
    )
    choices: ClassVar[Mapping[str, str]] = {
        "fuse": (
            "merge the link with rigidly connected links if a body can have their inertia; otherwise as with "
            "nearest"
        ),
        "nearest": "write the nearest tensor that a body can have",
        "keep": "leave the numbers, and set them after loading in the engines that accept them",
    }

    def occurrences(self, case: Case) -> Iterable[Detection]:
        """Yield the links whose tensor has the fault, static ones too: MuJoCo refuses the file for them."""
        kept = self.chosen(case) == "keep" and case.calls.issuperset(NUMBERS_OF_THE_FILE)
        groups = rigid_groups(case)
        for link in case.model.links:
            inertial = link.inertial
            if inertial is None or fault_beyond_rounding(inertial) != self.fault:
                continue
            if kept and (groups[link.name].static or _has_largest_on_y(inertial)):
                continue
            message = self._message(inertial) + (
                ", held still by the world" if groups[link.name].static else ""
            )
            yield Detection(link.name, None, line_of(case, link.name, "inertia"), message)

    def remedy(self, case: Case, detections: Sequence[Detection]) -> Remedy | None:
        """Merge, replace or keep, as chosen; the default merges where that is enough."""
        names = links_of(detections)
        decision, chosen = self.decision(case), self.chosen(case)
        if chosen == "keep":
            moving = [name for name in names if not rigid_groups(case)[name].static]
            rotated = {name: _with_largest_on_y(found) for name in moving if (found := case.inertials[name])}
            mended = with_inertials(case, rotated).with_calls(*NUMBERS_OF_THE_FILE)
            return Remedy(mended, "gave engines the numbers of the file after loading", decision)
        merged: list[str] = []
        if chosen == "fuse":
            for name in names:
                bodies = _merge_link(case, rigid_groups(case)[name], name)
                if bodies is not None:
                    case = with_inertials(case, bodies)
                    merged.append(name)
        replaced: dict[str, Inertial] = {}
        for name in names:
            inertial = case.inertials[name]
            if inertial is not None and fault_beyond_rounding(inertial) == self.fault:
                replaced[name] = _nearest_inertial(case, inertial, name)
        case = with_inertials(case, replaced)
        parts = []
        if merged:
            parts.append(
                f"merged the inertia of {_listed(merged)} with that of links rigidly connected to it"
            )
        if replaced:
            parts.append(f"put the nearest that a body can have for the tensor of {_listed(replaced)}")
        return Remedy(case, " and ".join(parts), decision, changes_physics=bool(replaced))

    def _message(self, inertial: Inertial) -> str:
        small, middle, large = (float(value) for value in principal_moments(inertial))
        if self.fault == "negative":
            return f"the principal moment {small:.6g} is negative"
        return f"the principal moment {large:.6g} exceeds the sum of the others, {small:.6g} and {middle:.6g}"


def _merge_link(case: Case, group: RigidGroup, name: str) -> dict[str, Inertial] | None:
    """Merge the link with its parent, its descendants, or its whole group: the first that gives a physical
    inertia; None where none does."""
    attempts: list[tuple[tuple[str, ...], str]] = []
    if name in group.parents:
        parent = group.parents[name]
        attempts.append(((parent, name), parent))
    if below := group.below(name):
        attempts.append(((name, *below), name))
    if len(group.links) > 1:
        attempts.append((group.links, group.head))
    for links, into in attempts:
        # Another rule is about links without mass, and must still find them.
        if not case.model.inertial(into).mass > 0.0:
            continue
        bodies = merged_inertials(case, group, links, into)
        new = bodies[into]
        if new.mass > 0.0 and fault_beyond_rounding(new) is None:
            root = into == case.model.root
            if is_borderline(new, root=root, on_fixed_joint=into in group.parents):
                bodies[into] = with_raised_moments(new)
            return bodies
    return None


def _nearest_inertial(case: Case, inertial: Inertial, name: str) -> Inertial:
    body = CentralInertia.of(inertial)
    moments, axes = body.principal(inertial.origin.rpy)
    near = body.about(nearest_moments(moments), axes)
    if case.base == "fixed" and name == case.model.root:
        near = CentralInertia.of(near).aligned()
    return with_raised_moments(near, ACCEPTED_MOMENT)


def _with_largest_on_y(inertial: Inertial) -> Inertial:
    """Return the tensor in principal form with the largest moment about y: the only one that Bullet's inverse
    dynamics does not compare with the sum of the others."""
    body = CentralInertia.of(inertial)
    moments, axes = body.principal(inertial.origin.rpy)
    largest = int(np.argmax(moments))
    order = [(largest + shift) % 3 for shift in (-1, 0, 1)]
    return body.about(moments[order], axes[:, order])


def _has_largest_on_y(inertial: Inertial) -> bool:
    products = inertial.ixy or inertial.ixz or inertial.iyz
    return not products and inertial.iyy == max(inertial.ixx, inertial.iyy, inertial.izz)


def _listed(names: Iterable[str]) -> str:
    found = list(names)
    shown = ", ".join(found[:5])
    return shown if len(found) <= 5 else f"{shown} and {len(found) - 5} more"


# Links that a joint moves and that have neither mass nor moments of inertia.


LEAST_MASS = 2.0 * MIN_MASS
"""Mass [kg] that every engine accepts, too small to show in any result."""


def has_inertial_data(case: Case) -> bool:
    """Check that anything that can move has mass or moments; True where nothing can move."""
    moving = [case.inertials[name] for name, group in rigid_groups(case).items() if not group.static]
    return not moving or not all(map(_is_empty, moving))


def massless_links(case: Case) -> dict[str, bool]:
    """Return the first link of each moving rigid group without mass and moments.

    The value is True where no link beyond it has mass or moments either. A robot without any inertial data
    has no such links here, because DX118 reports it.
    """
    if not has_inertial_data(case):
        return {}
    model, groups = case.model, rigid_groups(case)
    empty: dict[str, bool] = {}
    for link in model.links:
        head = groups[link.name].head
        empty[head] = empty.get(head, True) and _is_empty(link.inertial)
    carrier = {
        joint.child: groups[joint.parent].head
        for joint in model.joints
        if groups[joint.child].head == joint.child
    }
    # In depth-first order each group comes after the group that carries it.
    bare = dict(empty)
    for head in reversed(carrier):
        bare[carrier[head]] = bare[carrier[head]] and bare[head]
    return {head: bare[head] for head in carrier if empty[head]}


def _is_empty(inertial: Inertial | None) -> bool:
    return inertial is None or (inertial.mass < MIN_MASS and not inertial.tensor.any())


def with_least_inertia(case: Case, names: Sequence[str]) -> tuple[Case, str]:
    """Give these links the least mass and moments that MuJoCo accepts; also return the change in words.

    A tensor that is not zero is kept.
    """
    new = {}
    for name in names:
        inertial = case.inertials[name]
        origin = IDENTITY if inertial is None else inertial.origin
        if inertial is not None and inertial.tensor.any():
            new[name] = replace(inertial, mass=LEAST_MASS)
        else:
            new[name] = Inertial(
                LEAST_MASS, origin, ixx=ACCEPTED_MOMENT, iyy=ACCEPTED_MOMENT, izz=ACCEPTED_MOMENT
            )
    many = "a link without mass" if len(new) == 1 else f"{len(new)} links without mass"
    changed = f"gave {many} {LEAST_MASS:g} kg and {ACCEPTED_MOMENT:g} kg m^2 about every axis"
    return with_inertials(case, new), changed


def least_inertial() -> str:
    """Return the text of an ``<inertial>`` with the least mass and moments that every engine accepts."""
    moments = " ".join(f'i{axis}{axis}="{decimal(ACCEPTED_MOMENT)}"' for axis in "xyz")
    products = " ".join(f'{name}="0"' for name in ("ixy", "ixz", "iyz"))
    return (
        f'<inertial>\n  <mass value="{decimal(LEAST_MASS)}"/>\n  <inertia {moments} {products}/>\n</inertial>'
    )


def heaviest_in_root_group(case: Case) -> str | None:
    """Return the heaviest link rigidly connected to the root, itself included; None where none has mass."""
    model = case.model
    group = rigid_groups(case)[model.root].links
    masses = {name: mass for name in group if (mass := model.inertial(name).mass) > 0.0}
    return max(masses, key=lambda name: masses[name]) if masses else None
