"""`Scene`: robots, bodies, constraints and collision filters of a world."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from types import UnionType
from typing import TYPE_CHECKING

from numpy.typing import ArrayLike

from dynx.argument_types import checks_types, is_listed
from dynx.errors import ArgumentError, UnknownNameError, nearest, shown
from dynx.model import Model
from dynx.model.elements import Note, Vector
from dynx.model.numbers import checked_gravity, is_real
from dynx.model.tree import STANDARD_GRAVITY
from dynx.registry import explains_names
from dynx.steppers.material import Material
from dynx.world.scene.bodies import Constraint, PointToPoint, SceneBody, Weld
from dynx.world.scene.filters import CollisionFilter
from dynx.world.scene.robots import WORLD, SceneRobot, checked_name, checked_pairs, split_name

if TYPE_CHECKING:
    from dynx.distance.avoidance import Avoidance
    from dynx.world.sensors.places import SensedParts
    from dynx.world.sensors.sensor import Sensor

MARGIN = 0.01
"""Distance [m] that is kept where no other margin is given."""


@explains_names
@dataclass(frozen=True)
class Scene:
    """Everything that is in a world at the start, for every engine alike.

    The name of a part is the name of a body or a robot, or ``robot/link``. `ignored` are pairs of names of
    parts that do not collide. The name of a robot stands for all its links, and a name in `groups` for all
    its members. If both names of a pair are the same, its parts do not collide with one another. `gravity`
    (3,) [m/s^2] replaces the gravity of the models. `World.read_sensors` reads the `sensors`. `notes` state
    how dynx read a file that contains more than a scene can hold, such as a file in MJCF.
    """

    name: str = "scene"
    robots: tuple[SceneRobot, ...] = ()
    bodies: tuple[SceneBody, ...] = ()
    constraints: tuple[Constraint, ...] = ()
    ignored: tuple[tuple[str, str], ...] = ()
    groups: tuple[tuple[str, tuple[str, ...]], ...] = ()
    gravity: Vector = STANDARD_GRAVITY
    sensors: tuple[Sensor, ...] = ()
    notes: tuple[Note, ...] = field(default=(), compare=False)

    if TYPE_CHECKING:
        # Type checkers see what is accepted; the fields hold what is made of it.
        def __init__(
            self,
            name: str = "scene",
            robots: Iterable[SceneRobot] = (),
            bodies: Iterable[SceneBody] = (),
            constraints: Iterable[Constraint] = (),
            ignored: Iterable[Sequence[str]] = (),
            groups: Mapping[str, Iterable[str]] | Iterable[tuple[str, Iterable[str]]] = (),
            gravity: ArrayLike = STANDARD_GRAVITY,
            sensors: Iterable[Sensor] = (),
            notes: Iterable[Note] = (),
        ) -> None: ...

    def __post_init__(self) -> None:
        put = object.__setattr__
        checked_name("scene", self.name)
        put(self, "robots", _instances("robots", self.robots, SceneRobot))
        put(self, "bodies", _instances("bodies", self.bodies, SceneBody))
        put(self, "constraints", _instances("constraints", self.constraints, Weld | PointToPoint))
        put(self, "gravity", checked_gravity(self.gravity))
        put(self, "notes", _instances("notes", self.notes, Note))
        _refuse_repeated([*(r.name for r in self.robots), *(b.name for b in self.bodies)])
        groups = [
            (name, _names(f"group {shown(name)}", members))
            for name, members in checked_pairs("groups", self.groups, Iterable, "a name and names")
        ]
        put(self, "groups", tuple(groups))
        self._check_groups()
        put(self, "ignored", checked_pairs("ignored", self.ignored, str, "two names"))
        for name in (name for pair in self.ignored for name in pair):
            if name not in self._groups:
                self.require(name)
        for constraint in self.constraints:
            self._check_constraint(constraint)
        named = [each.name for each in self.constraints if each.name]
        for name in named:
            if named.count(name) > 1:
                raise ArgumentError(f"two constraints are called {shown(name)}; wanted different names")
        if not isinstance(self.sensors, tuple) or self.sensors:
            # Imported here, because most scenes have none.
            from dynx.world.sensors.sensor import checked_sensors

            put(self, "sensors", checked_sensors(self.sensors, self.sensed_parts))

    @cached_property
    def _robots(self) -> dict[str, SceneRobot]:
        return {robot.name: robot for robot in self.robots}

    @cached_property
    def _bodies(self) -> dict[str, SceneBody]:
        return {body.name: body for body in self.bodies}

    @cached_property
    def _groups(self) -> dict[str, tuple[str, ...]]:
        return dict(self.groups)

    @checks_types
    def robot(self, name: str) -> SceneRobot:
        """Return the robot of that name; UnknownNameError if there is none."""
        if name not in self._robots:
            raise UnknownNameError(f"no robot {shown(name)} in {self.name}{nearest(name, self._robots)}")
        return self._robots[name]

    @checks_types
    def body(self, name: str) -> SceneBody:
        """Return the body of that name; UnknownNameError if there is none."""
        if name not in self._bodies:
            raise UnknownNameError(f"no body {shown(name)} in {self.name}{nearest(name, self._bodies)}")
        return self._bodies[name]

    @checks_types
    def material(self, name: str) -> Material:
        """Return the material of a body or of ``robot/link``; UnknownNameError for another name."""
        self.require(name)
        owner, link = split_name(name)
        if owner in self._bodies:
            return self._bodies[owner].material
        if link is None:
            raise UnknownNameError(f"{shown(name)} is a robot, whose links have materials; wanted robot/link")
        return self._robots[owner].material_of(link)

    @checks_types
    def may_collide(self, a: str, b: str) -> bool:
        """Check whether two parts, each a body or ``robot/link``, collide where they touch.

        Parts that are fixed in the world, links of one robot without `self_collision`, links that a joint
        connects and the pairs in `ignored` do not.
        """
        for name in (a, b):
            self.material(name)
        return self.collision_filter.may_collide(a, b)

    @cached_property
    def parts(self) -> tuple[str, ...]:
        """Every body, and every link as ``robot/link``, robots first."""
        links = (f"{robot.name}/{link.name}" for robot in self.robots for link in robot.model.links)
        return (*links, *self._bodies)

    @cached_property
    def sensed_parts(self) -> SensedParts:
        """Robots and bodies on which sensors may be."""
        from dynx.world.sensors.places import SensedParts

        models = {robot.name: robot.model for robot in self.robots}
        return SensedParts(models, tuple(self._bodies), self.robots[0].name if len(models) == 1 else None)

    @cached_property
    def collision_filter(self) -> CollisionFilter:
        """Which parts may collide, by names that are not checked again."""
        return CollisionFilter(self.robots, self.bodies, [tuple(map(self._members, p)) for p in self.ignored])

    @checks_types
    def avoidance(
        self, robot: str | None = None, *, margin: float = MARGIN, self_margin: float | None = None
    ) -> Avoidance:
        """Return what a robot keeps away from, for the option `avoid` of inverse kinematics.

        Its links keep `margin` [m] from bodies and other robots, which stay where they start, and
        `self_margin` (by default `margin`) from one another, by certified distances. Bodies with mass that
        are welded to the robot move with it. Pairs in `ignored` are left out. `robot` is needed if the scene
        has several robots.

        Raises UnknownNameError for the robot or an option, ArgumentError for a margin, a scene without robots
        and a robot none of whose moving links has a collision shape, and the errors of collision shapes.
        """
        if robot is None:
            if not self.robots:
                raise ArgumentError(
                    f"scene {shown(self.name)} has no robot; add a SceneRobot, or use "
                    "avoidance_for(model, margin=...), which takes the model as its robot"
                )
            if len(self.robots) != 1:
                names = ", ".join(shown(each.name) for each in self.robots)
                raise ArgumentError(
                    f"scene {shown(self.name)} has {len(self.robots)} robots; wanted the name of one: {names}"
                )
            robot = self.robots[0].name
        return self._avoidance(self.robot(robot), margin, self_margin)

    @checks_types
    def avoidance_for(
        self, model: Model, *, margin: float = MARGIN, self_margin: float | None = None
    ) -> Avoidance:
        """Return what the robot that is `model` keeps away from, with the margins of `avoidance`. In a scene
        without robots, `model` is the only robot. Raises ArgumentError unless exactly one robot of the scene
        is like `model`, or the scene has none; and the errors of `avoidance`.
        """
        margins = margin, self_margin
        numbers = all(each is None or is_real(each) for each in margins)
        kept = self._kept_avoidance.get(margins) if numbers else None
        if kept is None or kept.model is not model:
            # Distances are imported where something is to be avoided, which a scene that moves does not need.
            from dynx.world.scene.avoidance import robot_like

            kept = self._avoidance(robot_like(self.robots, model), *margins)
            self._kept_avoidance[margins] = kept
        return kept

    @cached_property
    def _kept_avoidance(self) -> dict[tuple[float, float | None], Avoidance]:
        return {}

    def _avoidance(self, robot: SceneRobot, margin: float, self_margin: float | None) -> Avoidance:
        from dynx.world.scene.avoidance import robot_avoidance

        ignored = [tuple(map(self._members, pair)) for pair in self.ignored]
        own = margin if self_margin is None else self_margin
        return robot_avoidance(robot, self.robots, self.bodies, self.constraints, ignored, margin, own)

    def _members(self, name: str) -> frozenset[str]:
        """Return the parts behind a name."""
        if name in self._groups:
            return frozenset[str]().union(*map(self._members, self._groups[name]))
        if name in self._robots:
            return frozenset(f"{name}/{link.name}" for link in self._robots[name].model.links)
        return frozenset([name])

    @checks_types
    def require(self, name: str) -> None:
        """Raise UnknownNameError unless `name` is a body, a robot or ``robot/link``."""
        if not isinstance(name, str):
            raise ArgumentError(f"a name is {shown(name)}; wanted a body, a robot or robot/link")
        owner, link = split_name(name)
        if owner in self._robots and link is not None:
            self._robots[owner].model.link(link)
        elif owner not in self._robots and (owner not in self._bodies or link is not None):
            known = [*self._robots, *self._bodies]
            links = [
                f"{robot.name}/{each.name}"
                for robot in self.robots
                for each in robot.model.links
                if each.name == name
            ]
            raise UnknownNameError(
                f"no part {shown(name)} in {self.name}{nearest(name, links) or nearest(owner, known)}"
            )

    def _check_groups(self) -> None:
        _refuse_repeated([*self._robots, *self._bodies, *(name for name, _ in self.groups)])
        for name, members in self.groups:
            checked_name("group", name)
            for member in members:
                self.require(member)

    def _check_constraint(self, constraint: Constraint) -> None:
        ends = (constraint.a, constraint.b)
        for end in ends:
            if end == WORLD:
                continue
            self.require(end)
            if end in self._robots:
                raise UnknownNameError(
                    f"a {type(constraint).__name__} ends on the robot {shown(end)}; wanted robot/link"
                )
        if all(end == WORLD or self.collision_filter.is_fixed(end) for end in ends):
            raise ArgumentError(
                f"a {type(constraint).__name__} connects {ends[0]!r} and {ends[1]!r}, both fixed"
            )


def _instances(name: str, parts: object, kinds: type | UnionType) -> tuple[object, ...]:
    if not is_listed(parts):
        single = not isinstance(parts, str) and isinstance(parts, kinds)
        hint = f", such as [{type(parts).__name__}(...)]" if single else ""
        raise ArgumentError(f"{name} of a scene is {shown(parts)}; wanted a sequence{hint}")
    found = tuple(parts)
    for each in found:
        if not isinstance(each, kinds):
            raise ArgumentError(f"{name} of a scene holds {shown(each)}; wanted {_spelled(kinds)}")
    return found


def _spelled(kinds: object) -> str:
    return kinds.__name__ if isinstance(kinds, type) else str(kinds).replace("dynx.world.scene.bodies.", "")


def _names(what: str, names: object) -> tuple[str, ...]:
    if not is_listed(names):
        raise ArgumentError(f"{what} is {shown(names)}; wanted a sequence of names")
    return tuple(names)


def _refuse_repeated(names: list[str]) -> None:
    seen: set[str] = set()
    for name in names:
        if name in seen:
            raise ArgumentError(f"two parts of the scene are called {shown(name)}; wanted different names")
        seen.add(name)
