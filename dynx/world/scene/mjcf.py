"""A scene as an MJCF document, which MuJoCo and its tools load without dynx.

Each link and each body of the scene is a body of the document, so that the document can be read and edited
by the names of the scene. Robots are nested as their joints are; links on fixed joints stay bodies.
MuJoCo refuses negative masses and moments, principal moments of which one exceeds the sum of the others, and
bodies that move without a mass and three moments of their own or of a body fixed to them.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import combinations, product
from xml.etree.ElementTree import Element, SubElement, indent, tostring

import numpy as np

from dynx.errors import EngineLimitError, UnsupportedFeatureError, shown
from dynx.model.elements import IDENTITY, Inertial, Joint, Pose
from dynx.model.geometry import HeightField, Plane
from dynx.model.geometry.mjcf import ShapeWriter, placement, quat_text, text
from dynx.spatial.inertia import RigidInertia
from dynx.spatial.scalar import FLOAT64_EPS, Array, Floats, jacobi_eigen, longdouble
from dynx.spatial.se3 import homogeneous
from dynx.spatial.so3 import rotation_from_quat, rotation_from_rpy, skew
from dynx.steppers.contact_springs import damping_ratio
from dynx.steppers.material import geometric_means, material_numbers
from dynx.steppers.mean_coefficients import contact_directions, contact_priorities
from dynx.world.scene.bodies import PointToPoint, Weld
from dynx.world.scene.filters import CollisionFilter, merged_links
from dynx.world.scene.robots import WORLD, LinkFrames, SceneRobot, split_name
from dynx.world.scene.scene import Scene

LEAST_INERTIA = 1e-15
"""Mass [kg] and principal moment [kg m^2] that MuJoCo requires of bodies that move (mjMINVAL)."""

ROUNDING = 1e-9
"""Excess of the largest principal moment over the sum of the others, relative to it, that counts as
rounding."""


@dataclass(frozen=True, eq=False)
class PrincipalInertia:
    """A mass, its centre (3,) and principal moments (3,), whose axes are the columns of `axes` (3, 3)."""

    mass: float
    center: Floats
    moments: Floats
    axes: Array

    @classmethod
    def of(cls, mass: float, center: Array, tensor: Array, R: Array) -> PrincipalInertia:
        """Return the inertia with this tensor (3, 3) about the centre of mass, in axes R (3, 3)."""
        principal, axes = jacobi_eigen(longdouble(tensor))
        moments = np.asarray(principal, dtype=np.float64)
        scale = float(np.max(np.abs(moments)))
        moments[np.abs(moments) <= 4.0 * FLOAT64_EPS * scale] = 0.0
        largest = int(np.argmax(moments))
        others = float(np.delete(moments, largest).sum())
        if others < moments[largest] <= others + ROUNDING * scale:
            moments[largest] = others
        return cls(float(mass), np.asarray(center, dtype=np.float64), moments, R @ axes)

    @property
    def fault(self) -> str | None:
        """Reason for which MuJoCo refuses the inertia, also of a body that is fixed."""
        if self.mass < 0.0 or self.moments.min() < 0.0:
            return f"has the mass {self.mass:.4g} kg and the least moment {self.moments.min():.4g} kg m^2"
        if 2.0 * self.moments.max() > self.moments.sum() * (1.0 + FLOAT64_EPS):
            numbers = ", ".join(f"{moment:.4g}" for moment in self.moments)
            return f"has the principal moments {numbers} kg m^2, of which one exceeds the others' sum"
        return None

    @property
    def suffices_to_move(self) -> bool:
        """True if MuJoCo lets a body with this inertia move."""
        return bool(self.mass >= LEAST_INERTIA and self.moments.min() >= LEAST_INERTIA)

    def add_to(self, body: Element) -> None:
        """Add the inertia to a body."""
        given = {"pos": text(self.center), "quat": quat_text(self.axes)}
        SubElement(body, "inertial", given, mass=repr(self.mass), diaginertia=text(self.moments))


def add_inertial(body: Element, inertial: Inertial, name: str, source: str) -> None:
    """Add the inertia of a body that moves; raise UnsupportedFeatureError for one that MuJoCo refuses."""
    _add_moving(body, _of_link(inertial), name, source, inertial.line)


def add_inertias(robot: SceneRobot, bodies: dict[str, Element]) -> None:
    """Add the inertias of the links of a robot to its bodies.

    Where MuJoCo refuses those of links that fixed joints connect, the first of these links gets their merged
    inertia, which moves alike. In a fixed base, which does not move, refused ones are left out. Raises
    UnsupportedFeatureError where MuJoCo refuses the merged inertia too.
    """
    model = robot.model
    heads = merged_links(model)
    moving = {joint.joint: joint.inertia for joint in model.mechanism.bodies}
    merged = {joint.child: moving[joint.name] for joint in model.joints if joint.moves}
    if model.floating:
        merged[model.root] = model.mechanism.root
    groups: dict[str, dict[str, PrincipalInertia]] = {head: {} for head in heads.values()}
    for link in model.links:
        if link.inertial is not None and link.inertial != Inertial():
            groups[heads[link.name]][link.name] = _of_link(link.inertial)
    for head, group in groups.items():
        sound = {name: inertia for name, inertia in group.items() if inertia.fault is None}
        suffices = len(sound) == len(group) and any(each.suffices_to_move for each in group.values())
        if head in merged and not suffices:
            name, line = f"{robot.name}/{head}", model.link(head).line
            _add_moving(bodies[head], _of_rigid(merged[head]), name, model.source, line)
            continue
        for name, inertia in sound.items():
            inertia.add_to(bodies[name])


def _of_link(inertial: Inertial) -> PrincipalInertia:
    R = rotation_from_rpy(longdouble(inertial.origin.rpy))
    return PrincipalInertia.of(inertial.mass, np.array(inertial.origin.xyz), inertial.tensor, R)


def _of_rigid(inertia: RigidInertia) -> PrincipalInertia:
    mass = longdouble(inertia.mass)
    center = longdouble(inertia.first_moment) / mass if mass else longdouble(np.zeros(3))
    arm = skew(center)
    tensor = longdouble(inertia.rotational_inertia) + mass * (arm @ arm)
    return PrincipalInertia.of(float(mass), center, tensor, np.eye(3))


def _add_moving(body: Element, inertia: PrincipalInertia, name: str, source: str, line: int | None) -> None:
    fault = inertia.fault
    if fault is None and not inertia.suffices_to_move:
        moments = ", ".join(f"{moment:.4g}" for moment in inertia.moments)
        fault = (
            f"moves with a mass of {inertia.mass:.4g} kg and the principal moments {moments} kg m^2, links "
            "fixed to it included"
        )
    if fault is not None:
        raise UnsupportedFeatureError(
            f"{shown(name)} {fault}; MuJoCo refuses that: wanted a positive mass and three positive moments, "
            "none above the sum of the others",
            source=source,
            line=line,
        )
    inertia.add_to(body)


STEP = 0.002
"""Step [s] of a document that states none, by MuJoCo's default."""

FREQUENCY = 200.0
"""Natural frequency [rad/s] of contacts that rebound."""


class ContactWriter:
    """Attributes of the geoms of every part of a scene, and the elements of pairs."""

    def __init__(self, scene: Scene) -> None:
        self._names = [name for name in scene.parts if _has_shapes(scene, name)]
        filters = CollisionFilter(scene.robots, scene.bodies, ())
        fixed = [filters.is_fixed(name) for name in self._names]
        n = len(self._names)
        self._touch = np.zeros((n, n), dtype=bool)
        self._excluded: list[tuple[str, str]] = []
        for i, j in combinations(range(n), 2):
            pair = self._names[i], self._names[j]
            if scene.may_collide(*pair):
                self._touch[i, j] = self._touch[j, i] = True
            elif not (fixed[i] and fixed[j]):
                # MuJoCo itself tests none that are both fixed.
                self._excluded.append(pair)
        materials, self._material = material_numbers(map(scene.material, self._names))
        means = geometric_means(materials)
        self._rows, inverse = np.unique(means.reshape(-1, 4), axis=0, return_inverse=True)
        self._combination = inverse.reshape(means.shape[:2])
        self._found = contact_priorities(self._material, self._combination, self._touch)

    def geom(self, name: str) -> dict[str, str]:
        """Return the attributes of the geoms of a part."""
        number = self._names.index(name)
        attributes = self._attributes(int(self._found.combination[number]), 1)
        priority = int(self._found.priority[number])
        return attributes | ({"priority": str(priority)} if priority else {})

    def add_pairs(self, contact: Element, geoms: Mapping[str, int]) -> None:
        """Add the pairs that have coefficients of their own, and those that may not touch.

        `geoms` is the number of geoms of each part.
        """
        for i, j in self._found.pairs:
            a, b = self._names[i], self._names[j]
            combination = int(self._combination[self._material[i], self._material[j]])
            for first, second in product(range(geoms[a]), range(geoms[b])):
                ends = {"geom1": f"{a}/{first}", "geom2": f"{b}/{second}"}
                SubElement(contact, "pair", ends | self._attributes(combination, 2))
        for a, b in self._excluded:
            SubElement(contact, "exclude", body1=a, body2=b)

    def _attributes(self, combination: int, axes: int) -> dict[str, str]:
        """Return the coefficients, those of sliding and rolling once for each of the `axes`."""
        sliding, torsional, rolling, restitution = self._rows[combination].tolist()
        friction = [*[sliding] * axes, torsional, *[rolling] * axes]
        attributes = {
            "friction": " ".join(map(repr, friction)),
            "condim": str(contact_directions(sliding, torsional, rolling)),
        }
        if restitution:
            ratio = damping_ratio(restitution, FREQUENCY * STEP)
            attributes["solref"] = f"{-(FREQUENCY**2)!r} {-2.0 * ratio * FREQUENCY!r}"
        return attributes


def _has_shapes(scene: Scene, name: str) -> bool:
    owner, _, link = name.partition("/")
    return not link or bool(scene.robot(owner).model.geometry.collisions(link))


MAX_DEPTH = 490
"""Largest number of links in a row; MuJoCo's reader refuses elements that are nested 500 deep."""

UNLIMITED = 1e10
"""Joint limit [rad or m] that stands for an absent one beside one that is stated."""

RANGE_GAP = 1e-12
"""Range given to a joint whose limits are equal, which MuJoCo refuses, relative to the limit and at least in
rad or m."""


def scene_to_mjcf(scene: Scene) -> str:
    """Return a scene as an MJCF document, complete in itself, that MuJoCo loads without dynx.

    Bodies are named ``robot/link`` or as the body of the scene, joints ``robot/joint``, free joints as the
    robot or body that they move, geoms by their part and number; the state at the start is the keyframe
    ``start``. Meshes are written as their convex hulls. Coefficients of contact are those of pairs, by
    priorities of geoms and, where these will not do, by explicit pairs; restitution is that of MuJoCo's
    default step of 2 ms. Left out are velocity and effort limits, motors, added frames and visual shapes, of
    which links keep the first colour. Where MuJoCo refuses the inertias of links that fixed joints connect,
    the first of these links gets the merged inertia.

    Raises UnsupportedFeatureError for an inertia that MuJoCo refuses, such as a link that moves without mass,
    DescriptionError for a fault in a collision shape or its mesh, EngineLimitError for a robot with more than
    `MAX_DEPTH` links in a row.
    """
    return _Document(scene).write()


class _Document:
    def __init__(self, scene: Scene) -> None:
        self._scene = scene
        self._root = Element("mujoco", model=scene.name)
        SubElement(
            self._root,
            "compiler",
            angle="radian",
            autolimits="true",
            inertiafromgeom="false",
            fusestatic="false",
        )
        option = SubElement(self._root, "option", gravity=text(scene.gravity))
        # MuJoCo's own filter of parents and children is replaced by that of the scene.
        SubElement(option, "flag", filterparent="disable")
        self._shapes = ShapeWriter(SubElement(self._root, "asset"))
        self._contacts = ContactWriter(scene)
        self._bodies = {WORLD: SubElement(self._root, "worldbody")}
        self._contact = SubElement(self._root, "contact")
        self._equality = SubElement(self._root, "equality")

    def write(self) -> str:
        q: list[str] = []
        v: list[str] = []
        for robot in self._scene.robots:
            self._add_robot(robot)
            _extend_start(robot, q, v)
        for body in self._scene.bodies:
            element = SubElement(
                self._bodies[WORLD], "body", {"name": body.name, **placement(body.pose.matrix)}
            )
            self._bodies[body.name] = element
            if not body.fixed:
                SubElement(element, "freejoint", name=body.name, align="false")
                add_inertial(element, body.inertial, body.name, self._scene.name)
                R = body.pose.matrix[:3, :3]
                q += [text(body.pose.xyz), quat_text(R)]
                v += [text(body.twist[:3]), text(np.array(body.twist[3:]) @ R)]
            given = self._contacts.geom(body.name)
            self._shapes.add(element, body.name, body.shapes, given, body.material.rgba)
        geoms = {name: len(body.findall("geom")) for name, body in self._bodies.items()}
        self._contacts.add_pairs(self._contact, geoms)
        for number, constraint in enumerate(self._scene.constraints):
            self._constrain(number, constraint)
        if q:
            keyframe = SubElement(self._root, "keyframe")
            SubElement(keyframe, "key", name="start", qpos=" ".join(q), qvel=" ".join(v))
        for empty in [part for part in self._root if len(part) == 0 and not part.attrib]:
            self._root.remove(empty)
        indent(self._root)
        return tostring(self._root, encoding="unicode") + "\n"

    def _add_robot(self, robot: SceneRobot) -> None:
        model = robot.model
        root = _start_pose(robot)
        bodies = {model.root: self._add_body(WORLD, f"{robot.name}/{model.root}", root)}
        if model.floating:
            SubElement(bodies[model.root], "freejoint", name=robot.name, align="false")
        depths = {model.root: 1}
        for joint in model.joints:
            depths[joint.child] = depths[joint.parent] + 1
            if depths[joint.child] > MAX_DEPTH:
                raise EngineLimitError(
                    f"robot {shown(robot.name)} has more than {MAX_DEPTH} links in a row; MuJoCo reads no "
                    "deeper document"
                )
            parent, child = f"{robot.name}/{joint.parent}", f"{robot.name}/{joint.child}"
            bodies[joint.child] = self._add_body(parent, child, joint.origin.matrix)
            if joint.moves:
                _add_joint(bodies[joint.child], f"{robot.name}/{joint.name}", joint)
            if joint.moves and joint.mimic is not None:
                SubElement(
                    self._equality,
                    "joint",
                    joint1=f"{robot.name}/{joint.name}",
                    joint2=f"{robot.name}/{joint.mimic.joint}",
                    polycoef=text([joint.mimic.offset, joint.mimic.multiplier, 0.0, 0.0, 0.0]),
                )
        heads = merged_links(model)
        add_inertias(robot, bodies)
        for link in model.links:
            shapes = model.geometry.links.get(link.name)
            if shapes is None:
                continue
            material = robot.material_of(link.name)
            colours = (each.material.rgba for each in shapes.visuals if each.material is not None)
            rgba = next((colour for colour in colours if colour is not None), material.rgba)
            placed = model.geometry.collisions(link.name)
            grounds = [each for each in placed if isinstance(each.shape, Plane | HeightField)]
            if grounds and (model.floating or heads[link.name] != model.root):
                kind = type(grounds[0].shape).__name__
                raise UnsupportedFeatureError(
                    f"{shown(f'{robot.name}/{link.name}')} moves with a {kind}, which MuJoCo refuses",
                    source=model.source,
                    line=grounds[0].line,
                )
            if placed:
                name = f"{robot.name}/{link.name}"
                self._shapes.add(bodies[link.name], name, placed, self._contacts.geom(name), rgba)

    def _add_body(self, parent: str, name: str, T: Floats) -> Element:
        self._bodies[name] = SubElement(self._bodies[parent], "body", {"name": name, **placement(T)})
        return self._bodies[name]

    def _constrain(self, number: int, constraint: Weld | PointToPoint) -> None:
        """Add a constraint between sites at its two ends."""
        if isinstance(constraint, PointToPoint):
            tag, at_b = "connect", Pose(constraint.point_b).matrix
            at_a = Pose(constraint.point_a).matrix
        else:
            tag, at_b = "weld", IDENTITY.matrix
            at_a = (
                np.linalg.inv(self._start(constraint.a)) @ self._start(constraint.b)
                if constraint.T_a_b is None
                else constraint.T_a_b.matrix
            )
        sites = [f"constraint{number}/{end}" for end in "ab"]
        for name, part, T in zip(sites, (constraint.a, constraint.b), (at_a, at_b), strict=True):
            # A site of group 3 is not drawn unless it is asked for.
            SubElement(self._bodies[part], "site", {"name": name, "group": "3", **placement(T)})
        SubElement(self._equality, tag, site1=sites[0], site2=sites[1])

    def _start(self, part: str) -> Floats:
        """Return the pose of a part in the world at the start."""
        owner, link = split_name(part)
        if link is not None:
            robot = self._scene.robot(owner)
            return LinkFrames(robot.model).pose(np.array(robot.q), link)
        return IDENTITY.matrix if owner == WORLD else self._scene.body(owner).pose.matrix


def _start_pose(robot: SceneRobot) -> Floats:
    if not robot.model.floating:
        return robot.model.base_pose.matrix
    q = np.array(robot.q)
    return homogeneous(rotation_from_quat(q[3:7]), q[:3])


def _extend_start(robot: SceneRobot, q: list[str], v: list[str]) -> None:
    """Append the state of a robot at the start, in MuJoCo's coordinates."""
    model = robot.model
    start, speed = np.array(robot.q), np.array(robot.v)
    coupling = model.mechanism.coupling
    if coupling is not None:
        start, speed = coupling.expand_q(start), coupling.matrix() @ speed
    if model.floating:
        R = rotation_from_quat(start[3:7])
        start[3:7] = start[[6, 3, 4, 5]]
        # MuJoCo's linear velocity of a floating base is in world axes, the angular one in those of the base.
        speed[:3] = R @ speed[:3]
    if len(start):
        q.append(text(start))
    if len(speed):
        v.append(text(speed))


def _add_joint(body: Element, name: str, joint: Joint) -> None:
    attributes = {
        "name": name,
        "type": "slide" if joint.type == "prismatic" else "hinge",
        "axis": text(joint.axis),
    }
    lower, upper = sorted((joint.limits.lower, joint.limits.upper))
    if math.isfinite(lower) or math.isfinite(upper):
        lower = lower if math.isfinite(lower) else -UNLIMITED
        upper = max(upper if math.isfinite(upper) else UNLIMITED, lower + RANGE_GAP * max(1.0, abs(lower)))
        attributes |= {"limited": "true", "range": text((lower, upper))}
    dynamics = joint.dynamics
    given = {"damping": dynamics.damping, "frictionloss": dynamics.friction, "armature": dynamics.armature}
    attributes |= {key: repr(float(value)) for key, value in given.items() if value}
    SubElement(body, "joint", attributes)
