"""Visual and collision shapes of the links of a robot, and what of them is drawn."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from functools import cached_property

from dynx.argument_types import checks_types
from dynx.errors import ArgumentError, DescriptionError, UnknownNameError, nearest, shown
from dynx.model.elements import IDENTITY, Pose, checked_pose
from dynx.model.geometry.mesh import Mesh
from dynx.model.geometry.shapes import Box, Capsule, Cylinder, Ellipsoid, HeightField, Plane, Sphere
from dynx.model.geometry.solids import Shape
from dynx.model.numbers import colour

_SHAPES = (Box, Sphere, Cylinder, Capsule, Ellipsoid, Mesh, Plane, HeightField)

Colour = tuple[float, float, float, float]


@dataclass(frozen=True)
class Appearance:
    """URDF's ``<material>``: its name, colour (red, green, blue, opacity from 0 to 1) and texture file."""

    name: str = ""
    rgba: Colour | None = None
    texture: str | None = None
    fault: str = field(default="", compare=False)
    """The reason why the texture of a description is not read."""

    def __post_init__(self) -> None:
        if self.rgba is not None:
            object.__setattr__(self, "rgba", colour(f"colour of material {shown(self.name)}", self.rgba))


@dataclass(frozen=True)
class Collision:
    """A shape that collides, at `origin` in its link or body."""

    shape: Shape
    origin: Pose = IDENTITY
    name: str = ""
    line: int | None = field(default=None, compare=False)

    def __post_init__(self) -> None:
        _check_placed(self)


@dataclass(frozen=True)
class Visual:
    """A shape that is seen, at `origin` in its link or body."""

    shape: Shape
    origin: Pose = IDENTITY
    material: Appearance | None = None
    name: str = ""
    line: int | None = field(default=None, compare=False)

    def __post_init__(self) -> None:
        _check_placed(self)


def _check_placed(placed: Visual | Collision) -> None:
    if not isinstance(placed.shape, _SHAPES):
        known = ", ".join(each.__name__ for each in _SHAPES)
        raise ArgumentError(f"a shape is {shown(placed.shape)}; wanted one of {known}")
    object.__setattr__(placed, "origin", checked_pose("origin of a shape", placed.origin))


@dataclass(frozen=True)
class LinkGeometry:
    """The shapes of one link, or the first fault of the description in each kind."""

    visuals: tuple[Visual, ...] = ()
    collisions: tuple[Collision, ...] = ()
    visual_fault: DescriptionError | None = field(default=None, compare=False)
    collision_fault: DescriptionError | None = field(default=None, compare=False)


ShapeNumber = tuple[str, int]
"""A collision shape: the name of its link, and its number among those of the link, from 0."""


@dataclass(frozen=True)
class ContactFilter:
    """Which collision shapes of a robot may touch, as MJCF states it. It is only data: a world uses the
    filter of its scene.

    Two shapes may touch if contype of one and conaffinity of the other share a bit. They do not touch if
    their links are `excluded` or rigidly connected, or if one joint connects the links and neither is fixed
    in the world. Shapes that are `paired` may touch in any case.
    """

    bits: Mapping[str, tuple[tuple[int, int], ...]]
    """contype and conaffinity of the collision shapes, by their link."""
    excluded: tuple[tuple[str, str], ...] = ()
    """Pairs of links whose shapes do not touch."""
    paired: tuple[tuple[ShapeNumber, ShapeNumber], ...] = ()
    enabled: bool = True
    """False if no contacts are computed at all (MJCF's flag ``contact``)."""
    filters_parents: bool = True
    """False if links on both sides of a joint may touch (MJCF's flag ``filterparent``)."""

    @property
    def restricts(self) -> bool:
        """True unless exactly the shapes may touch that MJCF lets touch by default."""
        stated = any(set(each) - {(1, 1)} for each in self.bits.values())
        return bool(stated or self.excluded or self.paired) or not (self.enabled and self.filters_parents)

    def bits_of(self, shape: ShapeNumber) -> tuple[int, int]:
        """Return contype and conaffinity of a shape, 1 and 1 where none are stated."""
        link, number = shape
        stated = self.bits.get(link, ())
        return stated[number] if number < len(stated) else (1, 1)


Links = Mapping[str, LinkGeometry]


@checks_types
class Geometry:
    """The shapes of every link of a robot, by the name of the link.

    dynx reads the shapes of a description at their first use. A fault in a shape raises an error at the first
    use of the visual or collision shapes of its link, not in `dynx.load`.
    """

    def __init__(self, links: Links | Callable[[], Links]) -> None:
        """`links` are the shapes by link, or a function that returns them and can be pickled."""
        self._links_or_reader = links

    @checks_types
    def visuals(self, link: str) -> tuple[Visual, ...]:
        """Return the visual shapes of a link, in the order of the description.

        Raises UnknownNameError for an unknown link, DescriptionError for a fault in one of these shapes.
        """
        found = self._of(link)
        if found.visual_fault is not None:
            raise found.visual_fault
        return found.visuals

    @checks_types
    def collisions(self, link: str) -> tuple[Collision, ...]:
        """Return the collision shapes of a link, in the order of the description.

        Raises UnknownNameError for an unknown link, DescriptionError for a fault in one of these shapes.
        """
        found = self._of(link)
        if found.collision_fault is not None:
            raise found.collision_fault
        return found.collisions

    def for_links(self, names: Iterable[str]) -> Geometry:
        """Return the geometry with an entry for each of these links; a link without shapes has an empty
        entry. The geometry of a description has these entries, and is returned unchanged. Raises
        UnknownNameError for an entry of another link.
        """
        if callable(self._links_or_reader):
            return self
        known = dict.fromkeys(names, LinkGeometry())
        for name in self.links:
            if name not in known:
                raise UnknownNameError(f"geometry of {shown(name)}, which is no link{nearest(name, known)}")
        return Geometry(known | self.links)

    @cached_property
    def links(self) -> dict[str, LinkGeometry]:
        """The shapes by the name of the link."""
        given = self._links_or_reader
        return dict(given() if callable(given) else given)

    def _of(self, link: str) -> LinkGeometry:
        try:
            return self.links[link]
        except (KeyError, TypeError):
            raise UnknownNameError(f"no link {shown(link)}{nearest(link, self.links)}") from None

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Geometry) and self.links == other.links

    def __hash__(self) -> int:
        return hash(frozenset(self.links.items()))

    def __repr__(self) -> str:
        shapes = [*self.links.values()]
        visuals, collisions = (
            sum(len(getattr(s, kind)) for s in shapes) for kind in ("visuals", "collisions")
        )
        return f"<Geometry of {len(shapes)} links: {visuals} visual and {collisions} collision shapes>"

    def __getstate__(self) -> dict[str, object]:
        return {"_links_or_reader": self._links_or_reader}
