"""A scene as an MJCF document: the model that MuJoCo's world compiles, and that dynx exports.

A robot is a body named as it is, in which each link is a body ``robot/link``. Links that move are nested as
their joints are, and have the merged inertia of the links that fixed joints connect to them; those links are
bodies without inertia in them, and have their shapes in bodies ``robot/link/shapes``. What does not move has
no inertia either.

The body of a robot with a fixed base is at the origin of the world. A free body is at the centre of mass,
where MuJoCo's Euler conserves momentum: that of a floating base, and, for a body of the scene whose origin is
elsewhere, the body ``name/center``, to which the body ``name`` is fixed.

MuJoCo refuses negative masses and moments, principal moments of which one exceeds the sum of the others, and
bodies that move without a mass and three moments. Such bodies have substitutes in the document, which a world
replaces in the compiled model, and which are not exported.

**Filters**: MuJoCo tests a pair of geoms if the type of one and the affinity of the other share a bit, unless
their bodies are an excluded pair. A set of colliders that never touch each other, such as the links of a
robot, shares a bit of its own that is missing in its affinity; the other pairs that may not touch are
excluded one by one.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from itertools import groupby, product
from typing import Any, NamedTuple
from xml.etree.ElementTree import Element, SubElement

import numpy as np
from numpy.typing import NDArray

from dynx.engines.mujoco.materials import (
    MIMIC_IMPEDANCE,
    ContactMaterials,
    constraint_reference,
    limit_reference,
    option_attributes,
)
from dynx.errors import EngineLimitError, UnsupportedFeatureError, shown
from dynx.model import Model
from dynx.model.elements import Joint, JointDynamics
from dynx.model.geometry import HeightField, Mesh, Plane, Shape
from dynx.model.mechanism import ROOT, Mechanism
from dynx.model.mjcf.attributes import (
    MAX_DEPTH,
    attributes,
    document_text,
    joint_attributes,
    new_document,
    placement,
    primitive_attributes,
    quat_wxyz,
    text,
)
from dynx.spatial.inertia import RigidInertia
from dynx.spatial.scalar import FLOAT64_EPS, Array, Floats, jacobi_eigen, longdouble
from dynx.spatial.se3 import homogeneous
from dynx.spatial.so3 import cross, rotation_from_quat, skew
from dynx.steppers.layout import WORLD, BodyLayout, Layout, Owner, RobotLayout, SensorLayout
from dynx.steppers.materials import EffectiveCoefficient

# -- coordinates -----------------------------------------------------------------------------------------


def robot_coordinates(model: Model, q: Floats, v: Floats) -> tuple[Floats, Floats]:
    """Return MuJoCo's q and v of a robot with the state q, v in the coordinates of the model."""
    coupling = model.mechanism.coupling
    q, v = (q.copy(), v.copy()) if coupling is None else (coupling.expand_q(q), coupling.matrix() @ v)
    if model.floating:
        center = np.asarray(model.mechanism.root_center, dtype=float)
        R = rotation_from_quat(q[3:7])
        q[:3] += R @ center
        q[3:7] = q[[6, 3, 4, 5]]
        v[:3] = R @ (v[:3] + cross(v[3:6], center))
    for ball in model.ball_places:
        q[ball : ball + 4] = q[[ball + 3, ball, ball + 1, ball + 2]]
    return q, v


def from_wxyz(mechanism: Mechanism) -> NDArray[np.intp]:
    """Return the place (nq,) in MuJoCo's q of each entry of q, except for a floating base: quaternions of
    ball joints are (w, x, y, z) there."""
    order = np.arange(mechanism.nq)
    for ball in mechanism.ball_places:
        order[ball : ball + 4] = ball + 1, ball + 2, ball + 3, ball
    return order


def body_coordinates(T: Floats, twist: Floats, center: Floats) -> tuple[Floats, Floats]:
    """Return MuJoCo's q and v of a body with its pose (4, 4), its twist (6,) in world axes and its centre of
    mass (3,) in its own frame."""
    R = T[:3, :3]
    lever = R @ center
    q = np.concatenate([T[:3, 3] + lever, quat_wxyz(R)])
    return q, np.concatenate([twist[:3] + cross(twist[3:], lever), twist[3:] @ R])


# -- inertias -----------------------------------------------------------------------------------------------

LEAST_INERTIA = 1e-15
"""Mass [kg] and principal moment [kg m^2] that MuJoCo requires of bodies that move (mjMINVAL)."""

ROUNDING = 1e-9
"""Excess of the largest principal moment over the sum of the others, relative to it, that counts as
rounding."""

SUBSTITUTE = {"mass": 1.0, "pos": (0.25, 0.5, 0.75), "quat": (0.5, 0.5, 0.5, 0.5), "diaginertia": (1.0,) * 3}
"""Inertia that MuJoCo accepts, in another pose than the frame of the body, so that nothing is simplified."""


@dataclass(frozen=True, eq=False)
class PrincipalInertia:
    """A mass, its centre (3,) and principal moments (3,), whose axes are the columns of `axes` (3, 3)."""

    mass: float
    center: Floats
    moments: Floats
    axes: Array

    @classmethod
    def of(cls, mass: float, center: Array, tensor: Array, scale: float = 0.0) -> PrincipalInertia:
        """Return the inertia with this tensor (3, 3) about the centre of mass.

        `scale` is the magnitude of the moments from which the tensor was computed.
        """
        principal, axes = jacobi_eigen(longdouble(tensor))
        moments = np.asarray(principal, dtype=np.float64)
        largest = int(np.argmax(moments))
        size = float(moments[largest])
        moments[np.abs(moments) <= 4.0 * FLOAT64_EPS * max(scale, float(np.max(np.abs(moments))))] = 0.0
        others = float(np.delete(moments, largest).sum())
        if others < moments[largest] <= others + ROUNDING * size:
            moments[largest] = others
        return cls(float(mass), np.asarray(center, dtype=np.float64), moments, axes)

    @classmethod
    def of_rigid(cls, inertia: RigidInertia, robot: str) -> PrincipalInertia:
        """Return the inertia of a body of a robot.

        Raises EngineLimitError for a first moment without a mass, which MuJoCo cannot represent.
        """
        mass, center = longdouble(inertia.mass), longdouble(np.zeros(3))
        if mass != 0.0:
            center = longdouble(inertia.first_moment) / mass
        elif np.any(inertia.first_moment != 0.0):
            raise EngineLimitError(
                f"a body of {shown(robot)} has a first moment and no mass, because masses of its links "
                "cancel; 'mujoco' cannot represent that"
            )
        arm = skew(center)
        tensor = longdouble(inertia.rotational_inertia) + mass * (arm @ arm)
        # Merging leaves a point mass with rounding errors of either sign.
        scale = float(np.max(np.abs(inertia.rotational_inertia)))
        return cls.of(float(mass), center, tensor, scale)

    def at_center(self) -> PrincipalInertia:
        """Return the inertia in a frame at the centre of mass."""
        return replace(self, center=np.zeros(3))

    @property
    def fault(self) -> str | None:
        """Reason for which MuJoCo refuses the inertia of a body that moves."""
        if self.mass < 0.0 or self.moments.min() < 0.0:
            return f"has the mass {self.mass:.4g} kg and the least moment {self.moments.min():.4g} kg m^2"
        if 2.0 * self.moments.max() > self.moments.sum() * (1.0 + FLOAT64_EPS):
            numbers = ", ".join(f"{moment:.4g}" for moment in self.moments)
            return f"has the principal moments {numbers} kg m^2, of which one exceeds the others' sum"
        if self.mass < LEAST_INERTIA or self.moments.min() < LEAST_INERTIA:
            numbers = ", ".join(f"{moment:.4g}" for moment in self.moments)
            return (
                f"moves with a mass of {self.mass:.4g} kg and the principal moments {numbers} kg m^2, links "
                "fixed to it included"
            )
        return None

    def add_to(self, body: Element) -> None:
        """Add the inertia to a body."""
        moments = attributes({"mass": self.mass, "diaginertia": self.moments})
        SubElement(body, "inertial", placement(self.axes, self.center) | moments)


class RefusedInertia(NamedTuple):
    """An inertia that MuJoCo's compiler refuses, of the body with this name in the document."""

    body: str
    inertia: PrincipalInertia
    error: UnsupportedFeatureError


# -- shapes and filters -------------------------------------------------------------------------------------

FIELD_GROUP = 2
"""MuJoCo's geom group of height fields, which `mj_ray` can leave out; others are in group 0. Viewers show
both."""

MIN_HEIGHT_RANGE = 1e-6
"""Range of heights [m] that a level height field is given, because MuJoCo requires one above zero."""


class ShapeWriter:
    """Adds shapes to bodies; equal meshes and height fields become one asset."""

    def __init__(self, asset: Element) -> None:
        self._asset = asset
        self._names: dict[Shape, str] = {}

    def add(self, body: Element, name: str, shape: Shape, T: Floats, options: Mapping[str, str]) -> None:
        """Add a shape at a pose (4, 4) of the body, with attributes of its own."""
        position = T[:3, 3]
        given = {"name": name, **self._form(shape)}
        if isinstance(shape, HeightField):
            position = position + T[:3, 2] * np.min(shape.heights)
            given["group"] = str(FIELD_GROUP)
        SubElement(body, "geom", {**given, **placement(T[:3, :3], position), **options})

    def _form(self, shape: Shape) -> dict[str, str]:
        if isinstance(shape, HeightField):
            return {"type": "hfield", "hfield": self._field(shape)}
        if isinstance(shape, Mesh):
            return {"type": "mesh", "mesh": self._hull(shape)}
        return primitive_attributes(shape)

    def _field(self, shape: HeightField) -> str:
        if shape not in self._names:
            heights = np.array(shape.heights)
            span = max(float(np.ptp(heights)), MIN_HEIGHT_RANGE)
            # MuJoCo reads the rows of a document from the highest y to the lowest.
            rows = heights[::-1] - heights.min()
            SubElement(
                self._asset,
                "hfield",
                name=self._new_name("heights", shape),
                nrow=str(heights.shape[0]),
                ncol=str(heights.shape[1]),
                size=text([0.5 * shape.size[0], 0.5 * shape.size[1], span, shape.DEPTH]),
                elevation=text(rows.ravel()),
            )
        return self._names[shape]

    def _hull(self, shape: Mesh) -> str:
        if shape not in self._names:
            vertices, _ = shape.hull
            name = self._new_name("mesh", shape)
            # The moments of a shell need no volume, so that a tiny mesh is accepted too.
            SubElement(self._asset, "mesh", name=name, vertex=text(vertices.ravel()), inertia="shell")
        return self._names[shape]

    def _new_name(self, kind: str, shape: Shape) -> str:
        return self._names.setdefault(shape, f"{kind}{len(self._names)}")


BITS = 31
"""Bits of a mask; a signed integer of 32 has no more."""

ALL = 2**BITS - 1

Mask = tuple[int, int]
"""MuJoCo's contype and conaffinity."""


def collision_masks(layout: Layout) -> list[Mask]:
    """Return the masks of every collider. Bit 0 is that of colliders which may touch others of their set."""
    masks = [(1, ALL)] * len(layout.colliders)
    bit = 1
    for robot, numbers in _by_robot(layout):
        apart = robot is not None and not layout.collides[np.ix_(numbers, numbers)].any()
        if apart and len(numbers) > 1 and bit < BITS:
            for number in numbers:
                masks[number] = (1 << bit, ALL ^ (1 << bit))
            bit += 1
    return masks


def pairs_to_exclude(layout: Layout, masks: list[Mask]) -> list[tuple[int, int]]:
    """Return the pairs of colliders that must not touch and that neither masks nor MuJoCo's own rules filter:
    it tests no bodies that are rigidly connected, or both fixed."""
    pairs = []
    fixed = [layout.is_fixed(collider.owner) for collider in layout.colliders]
    for a, b in np.argwhere(np.triu(~layout.collides, 1)).tolist():
        tested = masks[a][0] & masks[b][1] or masks[b][0] & masks[a][1]
        connected = layout.colliders[a].owner == layout.colliders[b].owner
        if tested and not connected and not (fixed[a] and fixed[b]):
            pairs.append((a, b))
    return pairs


def _by_robot(layout: Layout) -> list[tuple[int | None, list[int]]]:
    numbers = range(len(layout.colliders))
    groups = groupby(numbers, key=lambda number: layout.colliders[number].owner.robot)
    return [(robot, list(group)) for robot, group in groups]


# -- the document -------------------------------------------------------------------------------------------


class Carrier(NamedTuple):
    """The body of an owner in the document, and the origin (3,) of its frame in that of the owner."""

    body: Element
    origin: Floats

    def placement(self, R: Array, p: Array) -> dict[str, str]:
        """Return the attributes of a pose (R, p) in the owner's frame."""
        return placement(R, p - self.origin)


class MjcfDocument:
    """A scene as an MJCF document, with the step [s] and the settings of the engine."""

    def __init__(self, layout: Layout, dt: float, settings: Mapping[str, Any]) -> None:
        """Raises EngineLimitError for a robot with more than `MAX_DEPTH` links in a row and one whose masses
        cancel, UnsupportedFeatureError for a ground that moves."""
        self.layout = layout
        self._settings, self._dt = settings, dt
        self.materials = ContactMaterials(layout, settings, dt)
        self.refused: list[RefusedInertia] = []
        """Inertias for which the document has substitutes."""
        self.free: dict[str, str] = {}
        """The free body of each robot and body of the scene that moves freely."""
        self._colliders = {each.name: number for number, each in enumerate(layout.colliders)}
        self._bodies_of_colliders: dict[int, str] = {}
        self._root = root = new_document(layout.name)
        option = SubElement(root, "option", attributes(option_attributes(settings, layout.gravity, dt)))
        # MuJoCo's reset after a divergence would replace the state by another one, and its filter of parents
        # and children is replaced by that of the scene.
        SubElement(option, "flag", autoreset="disable", filterparent="disable")
        # Explicit pairs are tested whatever the masks.
        explicit = self.materials.complete
        self._masks = [(0, 0)] * len(layout.colliders) if explicit else collision_masks(layout)
        masks = {"contype": 0, "conaffinity": 0} if explicit else {}
        self._geom_defaults = {**self.materials.common, **masks}
        self._add_defaults()
        self._shapes = ShapeWriter(SubElement(root, "asset"))
        world = SubElement(root, "worldbody")
        self._carriers = {Owner(None, WORLD): Carrier(world, np.zeros(3))}
        self._contact, self._equality, self._actuator, self._sensor = (
            SubElement(root, name) for name in ("contact", "equality", "actuator", "sensor")
        )
        q: list[Floats] = []
        v: list[Floats] = []
        for k, robot in enumerate(layout.robots):
            self._add_robot(k, robot)
            _append_state(q, v, robot_coordinates(robot.model, robot.q, robot.v))
        for k, body in enumerate(layout.bodies):
            self._add_scene_body(k, body)
            if not body.fixed:
                _append_state(q, v, body_coordinates(body.T, body.twist, body.center))
        self._add_contacts()
        self._add_constraints()
        self.left_out: list[str] = []
        """Names of sensors that the document cannot carry."""
        for sensor in layout.sensors:
            self._add_sensor(sensor)
        if q:
            state = {"name": "start", "qpos": np.concatenate(q), "qvel": np.concatenate(v)}
            SubElement(SubElement(root, "keyframe"), "key", attributes(state))
        for empty in [part for part in root if len(part) == 0 and not part.attrib]:
            root.remove(empty)

    def effective_materials(self) -> Mapping[str, EffectiveCoefficient]:
        """Return coefficients of contact in effect, as `Stepper.effective_materials` does."""
        return self.materials.effective()

    def text(self, remarks: Iterable[str] = ()) -> str:
        """Return the document, with remarks as comments at its beginning."""
        return document_text(self._root, remarks)

    def _add_defaults(self) -> None:
        settings, dt = self._settings, self._dt
        loss = settings["joint_friction_impedance"]
        default = SubElement(self._root, "default")
        joint = {
            "solreflimit": limit_reference(settings, dt),
            "solimplimit": settings["impedance"],
            "solreffriction": constraint_reference(settings, dt),
            "solimpfriction": (loss, loss),
        }
        equality = {
            "solref": constraint_reference(settings, dt),
            "solimp": settings["constraint_impedance"],
        }
        SubElement(default, "joint", attributes(joint))
        SubElement(default, "geom", attributes(self._geom_defaults))
        SubElement(default, "pair", attributes(self.materials.common_of_pairs))
        SubElement(default, "equality", attributes(equality))

    # -- robots and bodies --------------------------------------------------------------------

    def _add_robot(self, number: int, robot: RobotLayout) -> None:
        model = robot.model
        mechanism = model.extended_mechanism
        frames = {frame.name: frame for frame in mechanism.frames}
        center = np.asarray(model.mechanism.root_center, dtype=float)
        root = SubElement(self._carriers[Owner(None, WORLD)].body, "body", name=robot.name)
        carriers = {ROOT: Carrier(root, center)}
        if model.floating:
            q, _ = robot_coordinates(model, robot.q, robot.v)
            self._set_free(root, robot.name, q)
            inertia = PrincipalInertia.of_rigid(mechanism.root, model.name)
            self._add_inertia(root, f"{robot.name}/{model.root}", inertia.at_center(), model, model.root)
        depths = {ROOT: 0}
        moving = {joint.child: joint for joint in model.joints if joint.moves}
        for link in (model.root, *(joint.child for joint in model.joints)):
            name, frame = f"{robot.name}/{link}", frames[link]
            index = frame.body
            if link in moving:
                each = mechanism.bodies[index]
                # The first of the three bodies of a ball joint has its pose.
                first = each if each.ball is None else mechanism.bodies[index - 2]
                parent = carriers[first.parent]
                body = SubElement(parent.body, "body", {"name": name, **parent.placement(first.R, first.p)})
                carriers[index], depths[index] = Carrier(body, np.zeros(3)), depths[first.parent] + 1
                if depths[index] > MAX_DEPTH:
                    raise EngineLimitError(
                        f"robot {shown(robot.name)} has more than {MAX_DEPTH} moving links in a row; MuJoCo "
                        "reads no deeper document"
                    )
                inertia = PrincipalInertia.of_rigid(each.inertia, model.name)
                self._add_inertia(body, name, inertia, model, link)
                _add_joint(body, robot, index, moving[link])
                offset = np.eye(4)
            else:
                carrier = carriers[index]
                pose = carrier.placement(frame.R, frame.p)
                SubElement(carrier.body, "body", {"name": name, **pose})
                offset = homogeneous(frame.R, frame.p - carrier.origin)
            self._add_link_shapes(
                robot, link, carriers[index].body, offset, moves=model.floating or index != ROOT
            )
        self._carriers |= {Owner(number, index): carrier for index, carrier in carriers.items()}
        self._couple(robot)

    def _add_link_shapes(
        self, robot: RobotLayout, link: str, carrier: Element, T: Floats, *, moves: bool
    ) -> None:
        """Add the shapes of a link at the pose T (4, 4) in its carrier's body."""
        name = f"{robot.name}/{link}"
        if name not in self._colliders:
            return
        geometry = robot.model.geometry
        placed = geometry.collisions(link)
        grounds = [each for each in placed if isinstance(each.shape, Plane | HeightField)]
        if grounds and moves:
            raise UnsupportedFeatureError(
                f"{shown(name)} moves with a {type(grounds[0].shape).__name__}, which MuJoCo refuses",
                source=robot.model.source,
                line=grounds[0].line,
            )
        drawn = (each.material.rgba for each in geometry.visuals(link) if each.material is not None)
        colour = next((each for each in drawn if each is not None), None)
        self._add_shapes(carrier, name, ((each.shape, T @ each.origin.matrix) for each in placed), colour)

    def _couple(self, robot: RobotLayout) -> None:
        """Add a motor for each joint with a coordinate of its own, and the coupling of the mimic joints."""
        moving = [joint for joint in robot.model.joints if joint.moves]
        own = [joint for joint in moving if joint.mimic is None]
        for joint in own:
            name = f"{robot.name}/{joint.name}"
            if joint.type != "ball":
                SubElement(self._actuator, "motor", name=name, joint=name)
        coupling = robot.model.mechanism.coupling
        if coupling is None:
            return
        for joint, driver, scale, offset in zip(
            moving, coupling.index, coupling.scale, coupling.offset, strict=True
        ):
            if joint.mimic is not None:
                ends = {
                    "joint1": f"{robot.name}/{joint.name}",
                    "joint2": f"{robot.name}/{own[driver].name}",
                }
                numbers = {"polycoef": (offset, scale, 0.0, 0.0, 0.0), "solimp": MIMIC_IMPEDANCE}
                SubElement(self._equality, "joint", ends | attributes(numbers))

    def _add_scene_body(self, number: int, body: BodyLayout) -> None:
        world = self._carriers[Owner(None, WORLD)].body
        if body.fixed:
            pose = placement(body.T[:3, :3], body.T[:3, 3])
            element = SubElement(world, "body", {"name": body.name, **pose})
            carrier = Carrier(element, np.zeros(3))
        else:
            offset = bool(body.center.any())
            name = self.free[body.name] = f"{body.name}/center" if offset else body.name
            element = SubElement(world, "body", name=name)
            q, _ = body_coordinates(body.T, body.twist, body.center)
            self._set_free(element, body.name, q)
            inertia = PrincipalInertia.of(body.mass, np.zeros(3), body.inertia)
            self._add_inertia(element, body.name, inertia)
            carrier = Carrier(element, body.center)
            if offset:
                SubElement(element, "body", name=body.name, pos=text(-body.center))
        self._carriers[Owner(None, number)] = carrier
        if body.name in self._colliders:
            shapes = self.layout.colliders[self._colliders[body.name]].shapes
            T = homogeneous(np.eye(3), -carrier.origin)
            self._add_shapes(carrier.body, body.name, ((each.shape, T @ each.T) for each in shapes), None)

    @staticmethod
    def _set_free(body: Element, joint: str, q: Floats) -> None:
        """Let a body move freely, with its coordinates first in MuJoCo's q at the start."""
        body.attrib.update(attributes({"pos": q[:3], "quat": q[3:7]}))
        # Aligning would turn the frame to the principal axes.
        SubElement(body, "freejoint", name=joint, align="false")

    def _add_inertia(
        self,
        body: Element,
        name: str,
        inertia: PrincipalInertia,
        model: Model | None = None,
        link: str | None = None,
    ) -> None:
        """Add the inertia of a body that moves, or a substitute."""
        fault = inertia.fault
        if fault is None:
            inertia.add_to(body)
            return
        error = UnsupportedFeatureError(
            f"{shown(name)} {fault}; MuJoCo refuses that: wanted a positive mass and three positive moments, "
            "none above the sum of the others",
            source=self.layout.name if model is None else model.source,
            line=None if model is None or link is None else model.link(link).line,
        )
        self.refused.append(RefusedInertia(body.attrib["name"], inertia, error))
        SubElement(body, "inertial", attributes(SUBSTITUTE))

    # -- contacts and constraints -------------------------------------------------------------

    def _add_shapes(
        self,
        carrier: Element,
        name: str,
        placed: Iterable[tuple[Shape, Floats]],
        colour: Iterable[float] | None,
    ) -> None:
        """Add the shapes of a link or body, named by it and their number, at poses in its carrier's body.

        Shapes of a link that is fixed to another are in a body of their own, so that its pairs can be
        excluded. It is at the origin of the carrier's body, because MuJoCo scales the softness of a contact
        by the inverse weight that the origin has while all joints are at 0: that of a foot below a straight
        leg is 50 times as large.
        """
        number = self._colliders[name]
        body = carrier
        if carrier.attrib.get("name") not in (name, f"{name}/center"):
            body = SubElement(carrier, "body", name=f"{name}/shapes")
        self._bodies_of_colliders[number] = body.get("name", "world")
        rgba = self.layout.colliders[number].material.rgba if colour is None else colour
        contype, conaffinity = self._masks[number]
        options = {**self.materials.geom(number), "contype": contype, "conaffinity": conaffinity}
        given = {**attributes(options, self._geom_defaults), "rgba": text(rgba)}
        for k, (shape, T) in enumerate(placed):
            self._shapes.add(body, f"{name}/{k}", shape, T, given)

    def _add_contacts(self) -> None:
        """Add the pairs that have coefficients of their own, and those that may not touch."""
        colliders = self.layout.colliders
        excluded = () if self.materials.complete else pairs_to_exclude(self.layout, self._masks)
        for a, b in excluded:
            ends = {f"body{k}": self._bodies_of_colliders[end] for k, end in ((1, a), (2, b))}
            SubElement(self._contact, "exclude", ends)
        for a, b, options in self.materials.pairs:
            given = attributes(options, self.materials.common_of_pairs)
            for i, j in product(range(len(colliders[a].shapes)), range(len(colliders[b].shapes))):
                ends = {"geom1": f"{colliders[a].name}/{i}", "geom2": f"{colliders[b].name}/{j}"}
                SubElement(self._contact, "pair", ends | given)

    def _add_constraints(self) -> None:
        """Add welds and point-to-point constraints, between sites at their anchors."""
        tags = {"weld": "weld", "point": "connect"}
        for number, constraint in enumerate(self.layout.constraints):
            sites = [f"constraint{number}/{end}" for end in "ab"]
            for name, anchor in zip(sites, (constraint.a, constraint.b), strict=True):
                carrier = self._carriers[anchor.owner]
                # A site of group 3 is not drawn unless it is asked for.
                pose = carrier.placement(anchor.T[:3, :3], anchor.T[:3, 3])
                SubElement(carrier.body, "site", {"name": name, "group": "3", **pose})
            switches = {} if constraint.active else {"active": "false"}
            if constraint.name:
                switches["name"] = constraint.name
            ends = {"site1": sites[0], "site2": sites[1]}
            SubElement(self._equality, tags[constraint.kind], ends | switches)

    def _add_sensor(self, sensor: SensorLayout) -> None:
        """Add the elements of a sensor, named by it and by what they measure.

        MuJoCo measures force and torque between a body and its parent, so that it knows those of joints that
        move alone: the inertia of links that fixed joints connect is merged.
        """
        names = {name: f"{sensor.name}/{name}" for name in SENSOR_ELEMENTS[sensor.kind]}
        transmits = sensor.kind in ("force_torque", "joint_torque")
        if transmits and (sensor.joint is None or not sensor.joint.moves):
            self.left_out.append(sensor.name)
            return
        if sensor.kind == "encoder":
            assert sensor.joint is not None
            joint = f"{sensor.part.partition('/')[0]}/{sensor.joint.name}"
            for name, element in SENSOR_ELEMENTS[sensor.kind].items():
                SubElement(self._sensor, element, name=names[name], joint=joint)
            return
        number = self._colliders.get(sensor.part)
        body = sensor.part if number is None else self._bodies_of_colliders[number]
        if sensor.kind == "contact":
            given = {"name": names["force"], "body2": body, "reduce": "netforce", "data": "force"}
            SubElement(self._sensor, "contact", given)
            return
        # A ray passes through the shapes of the body on which its site is.
        self._add_site(sensor, body if sensor.kind == "ray" else sensor.part)
        for name, element in SENSOR_ELEMENTS[sensor.kind].items():
            along = sensor.joint is not None and sensor.joint.type == "prismatic"
            kind = "force" if along and sensor.kind == "joint_torque" else element
            SubElement(self._sensor, kind, name=names[name], site=site_name(sensor))

    def _add_site(self, sensor: SensorLayout, body: str) -> None:
        """Add the site of a sensor to a body that is rigidly connected with its part."""
        elements = {each.get("name"): each for each in self._root.iter("body")}
        T = sensor.T
        if body == f"{sensor.part}/shapes":
            part = elements[sensor.part]
            given = (np.array(part.get(name, default).split(), dtype=float) for name, default in _AT_ORIGIN)
            position, (w, x, y, z) = given
            T = homogeneous(rotation_from_quat(np.array([x, y, z, w])), position) @ T
        elif body == f"{sensor.part}/center":
            T = (
                homogeneous(np.eye(3), np.array(elements[sensor.part].get("pos", "").split(), dtype=float))
                @ T
            )
        pose = placement(T[:3, :3], T[:3, 3])
        if sensor.kind == "joint_torque" and sensor.joint is not None:
            pose = attributes({"zaxis": sensor.joint.axis})
        SubElement(elements[body], "site", {"name": site_name(sensor), "group": "3", **pose})


def site_name(sensor: SensorLayout) -> str:
    """Return the name of the site of a sensor, which no site of a constraint has."""
    return f"{sensor.name}/site"


SENSOR_ELEMENTS: dict[str, dict[str, str]] = {
    "force_torque": {"force": "force", "torque": "torque"},
    "imu": {"acceleration": "accelerometer", "angular_velocity": "gyro"},
    "joint_torque": {"torque": "torque"},
    "encoder": {"position": "jointpos", "velocity": "jointvel"},
    "contact": {"force": "contact"},
    "ray": {"distance": "rangefinder"},
}
"""Elements of MuJoCo by what sensors of each kind measure."""

_AT_ORIGIN = (("pos", "0 0 0"), ("quat", "1 0 0 0"))
"""Attributes of a pose, and their defaults."""


def _append_state(q: list[Floats], v: list[Floats], state: tuple[Floats, Floats]) -> None:
    q.append(state[0])
    v.append(state[1])


def _add_joint(body: Element, robot: RobotLayout, index: int, joint: Joint) -> None:
    limits = float(robot.lower[index]), float(robot.upper[index])
    if joint.type == "ball":
        largest = robot.largest_angles[robot.model.ball_joints.index(joint)]
        limits = (0.0, largest) if np.isfinite(largest) else limits
    given = joint_attributes(
        joint,
        limits,
        JointDynamics(
            robot.damping[index],
            robot.friction[index],
            robot.armature[index],
            robot.stiffness[index],
            robot.spring_reference[index],
        ),
    )
    SubElement(body, "joint", {"name": f"{robot.name}/{joint.name}"} | given)
