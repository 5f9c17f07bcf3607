"""Bodies of a scene: rigid shapes that move freely or are fixed in the world, and a body as URDF."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any, TypedDict

import numpy as np
from numpy.typing import ArrayLike

from dynx.argument_types import checks_types
from dynx.errors import ArgumentError, ShapeError, shown
from dynx.model import Inertial, Link, Model, Pose
from dynx.model.elements import IDENTITY, ZERO, Vector, checked_pose
from dynx.model.geometry import (
    Appearance,
    Box,
    Capsule,
    Collision,
    Cylinder,
    Ellipsoid,
    Geometry,
    HeightField,
    LinkGeometry,
    Mesh,
    Plane,
    Shape,
    Sphere,
    Visual,
    solid_properties,
)
from dynx.model.geometry.links import Colour
from dynx.model.numbers import checked_array, checked_bool, finite_numbers, finite_vector, positive_number
from dynx.model.urdf.reader import inertia_fault
from dynx.spatial.scalar import Floats
from dynx.steppers.material import DEFAULT_MATERIAL, Material, checked_material
from dynx.world.scene.robots import checked_name

if TYPE_CHECKING:
    from typing_extensions import Unpack


Tensor = tuple[Vector, Vector, Vector]


class BodyOptions(TypedDict, total=False):
    """Fields of `SceneBody` other than its name and its shapes."""

    pose: Pose | ArrayLike
    mass: float | None
    inertia: ArrayLike | None
    center_of_mass: ArrayLike | None
    twist: ArrayLike
    material: Material
    visuals: Sequence[Visual]


@dataclass(frozen=True)
class SceneBody:
    """A rigid body of one shape, or of several placed ones (`Collision`), at `pose` in the world.

    Without `mass` it is fixed in the world. `center_of_mass` (3,) [m] is in the body frame, and `inertia` (3,
    3) [kg m^2] about it in the axes of the body. If one is None, dynx computes it from the shapes at uniform
    density (overlaps count twice; a mesh counts as its convex hull). `twist` (6,) is the velocity at the
    start: linear [m/s] of the origin of the body frame, angular [rad/s], in world axes. The body is drawn by
    its `visuals`, which never collide, where it has some, and otherwise by its shapes.
    """

    name: str
    shapes: tuple[Collision, ...]
    pose: Pose = IDENTITY
    mass: float | None = None
    inertia: Tensor | None = None
    center_of_mass: Vector | None = None
    twist: tuple[float, ...] = (0.0,) * 6
    material: Material = DEFAULT_MATERIAL
    visuals: tuple[Visual, ...] = ()

    if TYPE_CHECKING:
        # Type checkers see what is accepted; the fields hold what is made of it.
        def __init__(
            self,
            name: str,
            shapes: Shape | Collision | Sequence[Shape | Collision],
            pose: Pose | ArrayLike = IDENTITY,
            mass: float | None = None,
            inertia: ArrayLike | None = None,
            center_of_mass: ArrayLike | None = None,
            twist: ArrayLike = ...,
            material: Material = DEFAULT_MATERIAL,
            visuals: Sequence[Visual] = (),
        ) -> None: ...

    def __post_init__(self) -> None:
        checked_name("body", self.name)
        what = f"body {shown(self.name)}"
        put = object.__setattr__
        put(self, "shapes", _placed_shapes(what, self.shapes))
        put(self, "pose", checked_pose(f"pose of {what}", self.pose))
        put(self, "twist", finite_numbers(f"twist of {what}", self.twist, 6))
        checked_material(f"material of {what}", self.material)
        put(self, "visuals", _checked_visuals(what, self.visuals))
        if self.mass is None:
            self._refuse_motion(what)
            return
        put(self, "mass", positive_number(f"mass of {what}", self.mass))
        for placed in self.shapes:
            if isinstance(placed.shape, Plane | HeightField):
                kind = type(placed.shape).__name__
                raise ArgumentError(f"{what} has a mass and a {kind}, which belongs to fixed bodies only")
        if self.center_of_mass is not None:
            put(self, "center_of_mass", finite_vector(f"center_of_mass of {what}", self.center_of_mass))
        if self.inertia is not None:
            put(self, "inertia", _checked_inertia(what, self.inertia))

    def _refuse_motion(self, what: str) -> None:
        for name in ("inertia", "center_of_mass"):
            if getattr(self, name) is not None:
                raise ArgumentError(f"{what} has {name} and no mass; a body without mass is fixed")
        if any(self.twist):
            raise ArgumentError(f"{what} has a twist and no mass; a body without mass is fixed")

    def drawn_shapes(self) -> Iterator[tuple[Shape, Colour, Floats]]:
        """Yield the shapes by which the body is drawn, each with its colour and its pose in the body (4, 4).

        `coloured_shapes` states the colours. A shape without a colour of its own has the colour of the
        material of the body. If the body has the default colour, grey, a mesh has the colours of its file.
        """
        # Imported here, because most scenes are never drawn.
        from dynx.model.geometry.drawn_shapes import coloured_shapes

        grey, rgba = Material().rgba, self.material.rgba
        for each in self.visuals or self.shapes:
            yield from coloured_shapes(each, None if rgba == grey else rgba, grey)

    @property
    def fixed(self) -> bool:
        """True if the body is fixed in the world."""
        return self.mass is None

    @cached_property
    def inertial(self) -> Inertial:
        """Mass, centre of mass and moments about it, in the axes of the body; zero for a fixed body.

        Raises DescriptionError for a mesh without a usable hull.
        """
        if self.mass is None:
            return Inertial()
        center, inertia = self.center_of_mass, self.inertia
        if center is None or inertia is None:
            parts = [solid_properties(each.shape).transform(each.origin.matrix) for each in self.shapes]
            solid = sum(parts[1:], start=parts[0])
            density = self.mass / solid.volume
            center = tuple(solid.center.tolist()) if center is None else center
            tensor = density * solid.inertia if inertia is None else np.array(inertia)
        else:
            tensor = np.array(inertia)
        (xx, xy, xz), (_, yy, yz), (_, _, zz) = tensor.tolist()
        return Inertial(self.mass, Pose(center), xx, xy, xz, yy, yz, zz)


@checks_types
def ground(
    name: str = "ground", *, pose: Pose | ArrayLike = IDENTITY, material: Material = DEFAULT_MATERIAL
) -> SceneBody:
    """Return a fixed plane, the half-space below z = 0 of `pose`."""
    return SceneBody(name, Plane(), checked_pose("pose", pose), material=material)


@checks_types
def box(name: str, size: ArrayLike, **options: Unpack[BodyOptions]) -> SceneBody:
    """Return a body with the shape of a box of that size (3,) [m]; `options` are those of `SceneBody`."""
    return SceneBody(name, Box(finite_vector("size of a box", size)), **options)


@checks_types
def sphere(name: str, radius: float, **options: Unpack[BodyOptions]) -> SceneBody:
    """Return a body with the shape of a ball; `options` are those of `SceneBody`."""
    return SceneBody(name, Sphere(radius), **options)


@checks_types
def cylinder(name: str, radius: float, length: float, **options: Unpack[BodyOptions]) -> SceneBody:
    """Return a body with the shape of a cylinder about z [m]; `options` are those of `SceneBody`."""
    return SceneBody(name, Cylinder(radius, length), **options)


@checks_types
def capsule(name: str, radius: float, length: float, **options: Unpack[BodyOptions]) -> SceneBody:
    """Return a body with the shape of a capsule about z [m], whose ends are half balls beyond the length;
    `options` are those of `SceneBody`."""
    return SceneBody(name, Capsule(radius, length), **options)


@checks_types
def ellipsoid(name: str, radii: ArrayLike, **options: Unpack[BodyOptions]) -> SceneBody:
    """Return a body with the shape of an ellipsoid of these half axes (3,) [m]; `options` are those of
    `SceneBody`."""
    return SceneBody(name, Ellipsoid(finite_vector("radii of an ellipsoid", radii)), **options)


@checks_types
def mesh(
    name: str, file: str, scale: ArrayLike = (1.0, 1.0, 1.0), **options: Unpack[BodyOptions]
) -> SceneBody:
    """Return a body with the shape of the convex hull of a mesh in a file; `options` are those of
    `SceneBody`."""
    return SceneBody(name, Mesh(file, finite_vector("scale", scale)), **options)


def _placed_shapes(what: str, shapes: object) -> tuple[Collision, ...]:
    if isinstance(shapes, str | bytes):
        raise ArgumentError(f"shapes of {what} is {shown(shapes)}; wanted a shape, such as Box((1, 1, 1))")
    listed: list[Any] = list(shapes) if isinstance(shapes, Sequence) else [shapes]
    if not listed:
        raise ArgumentError(f"{what} has no shape; wanted at least one")
    return tuple(each if isinstance(each, Collision) else Collision(each) for each in listed)


def _checked_visuals(what: str, visuals: object) -> tuple[Visual, ...]:
    if not isinstance(visuals, Sequence) or not all(isinstance(each, Visual) for each in visuals):
        raise ArgumentError(f"visuals of {what} is {shown(visuals)}; wanted a sequence of Visual")
    return tuple(visuals)


def _checked_inertia(what: str, inertia: ArrayLike) -> Tensor:
    array: Floats = checked_array(f"inertia of {what}", inertia, 3)
    if array.shape != (3, 3):
        raise ShapeError(f"inertia of {what} has shape {array.shape}; wanted (3, 3)")
    largest = float(np.max(np.abs(array)))
    if np.max(np.abs(array - array.T)) > 1e-9 * largest:
        raise ArgumentError(f"inertia of {what} is not symmetric")
    (xx, xy, xz), (_, yy, yz), (_, _, zz) = array.tolist()
    fault = inertia_fault(Inertial(1.0, Pose(), xx, xy, xz, yy, yz, zz))
    if fault is not None or largest == 0.0:
        raise ArgumentError(f"inertia of {what} {fault or 'is zero'}")
    return ((xx, xy, xz), (xy, yy, yz), (xz, yz, zz))


@checks_types
def body_to_urdf(body: SceneBody) -> str:
    """Return a body of a scene as URDF text of one link; the frame of the link is the frame of the body.

    `dynx.load(text, base="floating")` of it has the same inertia and shapes, in the colour of the body. URDF
    has neither the pose, the twist nor the coefficients of contact. Raises DescriptionError for a height
    field, which URDF cannot express.
    """
    colour = Appearance(f"{body.name}_colour", body.material.rgba)
    visuals = tuple(
        each
        if isinstance(each, Visual) and each.material is not None and each.material.rgba is not None
        else Visual(each.shape, each.origin, colour)
        for each in body.visuals or body.shapes
    )
    geometry = Geometry({body.name: LinkGeometry(visuals, body.shapes)})
    link = Link(body.name, None if body.fixed else body.inertial)
    return Model.build(body.name, [link], [], geometry=geometry).to_urdf(geometry=True)


@dataclass(frozen=True)
class Weld:
    """A rigid connection of `a` and `b`: each a body, ``robot/link`` or ``world``.

    `T_a_b` is the pose of frame b in frame a. None keeps their relative pose at the start, or that in which
    `World.set_active` switches the weld on. A weld that is not `active` does nothing until then. With
    `collides=False` its two ends do not touch each other while it acts. `name` is for `World.set_active`.
    """

    a: str
    b: str
    T_a_b: Pose | None = None
    name: str = field(default="", kw_only=True)
    active: bool = field(default=True, kw_only=True)
    collides: bool = field(default=True, kw_only=True)

    def __post_init__(self) -> None:
        _check_ends(self)
        _check_switches(self)
        if self.T_a_b is not None:
            object.__setattr__(self, "T_a_b", checked_pose("T_a_b of a weld", self.T_a_b))


@checks_types
@dataclass(frozen=True)
class PointToPoint:
    """A ball joint: `point_a` (3,) [m] of `a` stays at `point_b` of `b`, each in the frame of its end.

    Each end is a body, ``robot/link`` or ``world``. `name`, `active` and `collides` are those of a `Weld`.
    """

    a: str
    b: str
    point_a: Vector = ZERO
    point_b: Vector = ZERO
    name: str = field(default="", kw_only=True)
    active: bool = field(default=True, kw_only=True)
    collides: bool = field(default=True, kw_only=True)

    def __post_init__(self) -> None:
        _check_ends(self)
        _check_switches(self)
        for name in ("point_a", "point_b"):
            object.__setattr__(self, name, finite_vector(f"{name} of a constraint", getattr(self, name)))


Constraint = Weld | PointToPoint


def _check_switches(constraint: Constraint) -> None:
    kind = type(constraint).__name__
    if constraint.name != "":
        checked_name(kind, constraint.name)
    for name in ("active", "collides"):
        object.__setattr__(constraint, name, checked_bool(f"{name} of a {kind}", getattr(constraint, name)))


def _check_ends(constraint: Constraint) -> None:
    kind = type(constraint).__name__
    for end in (constraint.a, constraint.b):
        if not isinstance(end, str):
            raise ArgumentError(
                f"an end of a {kind} is {shown(end)}; wanted the name of a body or robot/link"
            )
    if constraint.a == constraint.b:
        raise ArgumentError(f"a {kind} connects {shown(constraint.a)} to itself")
