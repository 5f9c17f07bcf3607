"""Differences of two scenarios, each of which can be taken over alone: settings, gains, robots, scenes."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from dynx.errors import ArgumentError
from dynx.model import Model
from dynx.model.elements import Inertial
from dynx.model.geometry.links import Collision
from dynx.sim.plants.scene_plant import ScenePlant
from dynx.sim.scenario.documents import (
    ARRAY,
    CLASS,
    CONTROLLER,
    FINGERPRINT,
    MODEL,
    Document,
    Unknown,
    decode,
    encode,
    in_words,
)
from dynx.sim.scenario.scenario import Scenario, field_names
from dynx.steppers.clock import Clock

DIGITS = (6, 17)
"""Significant digits of numbers; the second are all that a float has, for numbers that the first do not tell
apart."""


def words_apart(ours: Any, theirs: Any) -> tuple[str, str]:
    """Describe two parts of a robot or a scene by the fields in which they differ."""
    if ours is None or theirs is None or not hasattr(ours, "__dataclass_fields__"):
        return _told_apart(words, ours, theirs)
    names = [each.name for each in fields(ours) if each.compare]
    apart = [name for name in names if getattr(ours, name) != getattr(theirs, name)]
    pairs = [_told_apart(words, getattr(ours, name), getattr(theirs, name)) for name in apart]
    mine, its = (", ".join(map(" ".join, zip(apart, each, strict=True))) for each in zip(*pairs, strict=True))
    return mine, its


def words(value: Any, digits: int = DIGITS[0]) -> str:
    """Describe a part of a robot or a scene."""
    if value is None:
        return "none"
    if isinstance(value, float):
        return f"{value:.{digits}g}"
    if isinstance(value, tuple) and all(isinstance(x, int | float) for x in value):
        return " ".join(f"{x:.{digits}g}" for x in value)
    if hasattr(value, "__dataclass_fields__"):
        parts = ((each.name, getattr(value, each.name)) for each in fields(value) if each.compare)
        return ", ".join(f"{name} {words(part, digits)}" for name, part in parts)
    return str(value)


def documents_apart(ours: Document, theirs: Document) -> tuple[str, str]:
    """Describe two values of a part of a scenario's document."""
    return _told_apart(document_in_words, ours, theirs)


def document_in_words(document: Document, digits: int = DIGITS[0]) -> str:
    """Describe a part of a scenario's document; equal numbers of a list stand once."""
    numbers = document[ARRAY] if isinstance(document, dict) and document.keys() == {ARRAY} else document
    if isinstance(numbers, list) and len(numbers) > 1 and all(isinstance(x, float) for x in numbers):
        shown = numbers[:1] if len(set(numbers)) == 1 else numbers
        return " ".join(f"{x:.{digits}g}" for x in shown)
    return in_words(document)


def plant_in_words(plant: str | ScenePlant, integrator: str | None) -> str:
    """Describe a plant by its engine and integrator, or by what its scene has."""
    if isinstance(plant, str):
        return f"{plant}, {integrator}"
    robots, bodies = ([each.name for each in kind] for kind in (plant.scene.robots, plant.scene.bodies))
    return f"{plant} with {', '.join([*robots, *bodies])}"


def _told_apart(describe: Callable[[Any, int], str], ours: Any, theirs: Any) -> tuple[str, str]:
    """Describe two values with as few digits as tell them apart."""
    pairs = [(describe(ours, digits), describe(theirs, digits)) for digits in DIGITS]
    return next((pair for pair in pairs if pair[0] != pair[1]), pairs[-1])


RobotEdit = Callable[[Model], Model]
"""Function that takes a difference over into a robot."""

RobotFactor = tuple[str, tuple[str, str], RobotEdit]
"""Name, values in words, and edit of a difference."""

JOINT_PARTS = ("type", "origin", "axis", "limits", "dynamics", "mimic", "locked_at")
MODEL_PARTS = ("gravity", "base_pose", "extra_frames")


def same_tree(one: Model, other: Model) -> bool:
    """Return True if the robots have the same base, and the same links and joints, connected alike."""
    trees = [
        (
            each.base,
            [link.name for link in each.links],
            [(joint.name, joint.parent, joint.child) for joint in each.joints],
        )
        for each in (one, other)
    ]
    return trees[0] == trees[1]


def robot_factors(ours: Model, theirs: Model) -> Iterator[RobotFactor]:
    """Yield the name, the values in words, and the edit of each difference of two robots of one tree."""
    for k, (one, other) in enumerate(zip(ours.links, theirs.links, strict=True)):
        if (one.inertial or Inertial()) != (other.inertial or Inertial()):
            edit = _item_edit("links", k, "inertial", other.inertial)
            yield f"link {one.name}, inertial", words_apart(one.inertial, other.inertial), edit
    for k, (joint, twin) in enumerate(zip(ours.joints, theirs.joints, strict=True)):
        for part in JOINT_PARTS:
            mine, its = getattr(joint, part), getattr(twin, part)
            if mine != its:
                edit = _item_edit("joints", k, part, its)
                yield f"joint {joint.name}, {part}", words_apart(mine, its), edit
    for part in MODEL_PARTS:
        mine, its = getattr(ours, part), getattr(theirs, part)
        if mine != its:
            yield part, words_apart(mine, its), _field_edit(part, its)


def grouped(found: Iterable[RobotFactor]) -> Iterator[RobotFactor]:
    """Yield one difference for each part of all links and of all joints, such as ``links, inertial``."""
    groups: dict[str, list[RobotFactor]] = {}
    for each in found:
        item, _, part = each[0].rpartition(", ")
        groups.setdefault(f"{item.partition(' ')[0]}s, {part}" if item else part, []).append(each)
    for name, members in groups.items():
        if len(members) == 1:
            yield members[0]
            continue
        mine, its = (
            f"{len(members)}: " + "; ".join(f"{_item_of(each[0])} {each[1][side]}" for each in members)
            for side in (0, 1)
        )
        yield name, (mine, its), _all_edits([each[2] for each in members])


def _item_of(name: str) -> str:
    """Return the link or joint in the name of a difference."""
    return name.rpartition(", ")[0].partition(" ")[2]


def _all_edits(edits: Sequence[RobotEdit]) -> RobotEdit:
    def edit(model: Model) -> Model:
        for each in edits:
            model = each(model)
        return model

    return edit


def _item_edit(kind: str, k: int, field: str, value: object) -> RobotEdit:
    def edit(model: Model) -> Model:
        items = list(getattr(model, kind))
        items[k] = replace(items[k], **{field: value})
        return _replaced(model, kind, tuple(items))

    return edit


def _field_edit(field: str, value: object) -> RobotEdit:
    return lambda model: _replaced(model, field, value)


def _replaced(model: Model, field: str, value: Any) -> Model:
    changes: dict[str, Any] = {field: value}
    return replace(model, **changes)


SceneEdit = Callable[[ScenePlant], ScenePlant]
"""Function that takes a difference over into a plant."""

PARTS = ("bodies", "robots")


def divisible(ours: Any, theirs: Any) -> bool:
    """Return True for two plants of scenes whose bodies and robots have the same names."""
    if not (isinstance(ours, ScenePlant) and isinstance(theirs, ScenePlant)):
        return False
    names = [
        [each.robot, *([part.name for part in getattr(each.scene, kind)] for kind in PARTS)]
        for each in (ours, theirs)
    ]
    return names[0] == names[1]


def scene_factors(ours: ScenePlant, theirs: ScenePlant) -> Iterator[tuple[str, tuple[str, str], SceneEdit]]:
    """Yield the name, the values in words, and the edit of each difference of two plants that are divisible.

    The model of the simulated robot is that of the scenario, and not among them; its shapes are, because
    models that differ in them alone are equal.
    """
    if ours.engine != theirs.engine:
        both = (_engine(ours), _engine(theirs))
        yield (
            "plant.engine",
            both,
            lambda plant: replace(plant, engine=theirs.engine, settings=theirs.settings),
        )
    elif ours.settings != theirs.settings:
        both = (str(dict(ours.settings)), str(dict(theirs.settings)))
        yield "plant.settings", both, lambda plant: replace(plant, settings=theirs.settings)
    if ours.joint_limits != theirs.joint_limits:
        both = (str(ours.joint_limits), str(theirs.joint_limits))
        yield "plant.joint_limits", both, lambda plant: replace(plant, joint_limits=theirs.joint_limits)
    for kind in PARTS:
        for k, (one, other) in enumerate(
            zip(getattr(ours.scene, kind), getattr(theirs.scene, kind), strict=True)
        ):
            own = kind == "robots" and one.name == ours.robot
            for each in fields(one):
                mine, its = getattr(one, each.name), getattr(other, each.name)
                if each.name == "model" and _same_links(mine, its) and _shapes(mine) != _shapes(its):
                    yield f"robot {one.name}, shapes", _shapes_in_words(mine, its), _shapes_edit(k, its)
                if mine == its or (own and each.name == "model"):
                    continue
                name = f"{'body' if kind == 'bodies' else 'robot'} {one.name}, {each.name}"
                yield name, words_apart(mine, its), _part_edit(kind, k, each.name, its)
    for each in fields(ours.scene):
        mine, its = getattr(ours.scene, each.name), getattr(theirs.scene, each.name)
        if each.name not in ("name", *PARTS) and mine != its:
            yield f"scene, {each.name}", words_apart(mine, its), _scene_edit(each.name, its)


def with_model(plant: ScenePlant, model: Model) -> ScenePlant:
    """Return the plant with another model of its simulated robot, which keeps its shapes if it has the same
    links."""
    known = plant.scene_robot.model
    if _same_links(model, known):
        model = replace(model, geometry=known.geometry)
    robots = tuple(
        replace(each, model=model) if each.name == plant.robot else each for each in plant.scene.robots
    )
    return replace(plant, scene=replace(plant.scene, robots=robots))


def _same_links(one: Model, other: Model) -> bool:
    return [link.name for link in one.links] == [link.name for link in other.links]


def _shapes(model: Model) -> dict[str, tuple[Collision, ...]]:
    """Return the shapes that collide, by link; those that are only seen move nothing."""
    return {name: link.collisions for name, link in model.geometry.links.items() if link.collisions}


def _shapes_in_words(ours: Model, theirs: Model) -> tuple[str, str]:
    """Describe the shapes of the links in which two robots differ."""
    mine, its = _shapes(ours), _shapes(theirs)
    apart = [name for name in {**mine, **its} if mine.get(name) != its.get(name)]

    def described(shapes: dict[str, tuple[Collision, ...]]) -> str:
        links = ((name, " and ".join(words(each) for each in shapes.get(name, ()))) for name in apart)
        return ", ".join(f"{name} {each or 'none'}" for name, each in links)

    return described(mine), described(its)


def _shapes_edit(k: int, theirs: Model) -> SceneEdit:
    def edit(plant: ScenePlant) -> ScenePlant:
        robots = list(plant.scene.robots)
        model = replace(robots[k].model, geometry=theirs.geometry)
        robots[k] = replace(robots[k], model=model)
        return replace(plant, scene=replace(plant.scene, robots=tuple(robots)))

    return edit


def _engine(plant: ScenePlant) -> str:
    return plant.engine + "".join(f", {name}={value}" for name, value in dict(plant.settings).items())


def _part_edit(kind: str, k: int, field: str, value: Any) -> SceneEdit:
    def edit(plant: ScenePlant) -> ScenePlant:
        parts = list(getattr(plant.scene, kind))
        parts[k] = replace(parts[k], **{field: value})
        changes: dict[str, Any] = {kind: tuple(parts)}
        return replace(plant, scene=replace(plant.scene, **changes))

    return edit


def _scene_edit(field: str, value: Any) -> SceneEdit:
    return lambda plant: replace(plant, scene=replace(plant.scene, **{field: value}))


IRRELEVANT = ("duration", "check_reference")
"""Fields that change no motion at times that both rollouts have."""

TIMES = ("dt", "control_dt", "delay")
"""Fields of the clock; the others are multiples of the first."""

MAX_PARTS = 20
"""Largest number of parts of robots that are differences of their own; of more, those of one kind are one."""

DIVIDED = ("controller", "noise")
"""Fields whose parts are differences of their own. A trajectory is taken as a whole, because its parts belong
together."""


@dataclass(frozen=True)
class Factor:
    """A difference of two scenarios, and the values of both in words."""

    name: str
    """Such as ``damping``, ``controller.kp``, ``link hand, inertial`` or ``joint elbow, axis``."""
    ours: str
    theirs: str


class Mixture:
    """Scenarios that have some differences from one scenario, and the rest from another."""

    def __init__(self, ours: Scenario, theirs: Scenario) -> None:
        self.ours, self.theirs = ours.with_defaults(), theirs.with_defaults()
        self._robot_edits: dict[str, RobotEdit] = {}
        self._scene_edits: dict[str, SceneEdit] = {}
        self._parts: dict[str, tuple[str, tuple[str, ...]]] = {}
        """Field and path of parts of a field, by factor."""
        self._fields: dict[str, tuple[str, ...]] = {}
        """Fields that are taken over as a whole, by factor."""
        self.factors = tuple(self._find())

    def scenario(self, taken: Collection[str], duration: float) -> Scenario:
        """Return our scenario with the factors of these names from theirs, for `duration` [s].

        Raises ArgumentError where a part cannot be rebuilt, such as a controller that is not registered.
        """
        model = self.ours.model
        for name in taken:
            if name in self._robot_edits:
                model = self._robot_edits[name](model)
        whole = {field for name in taken for field in self._fields.get(name, ())}
        if "model" in whole:
            model = self.theirs.model
        parts: dict[str, Any] = {}
        for field in field_names():
            if field == "plant":
                parts[field] = self._plant(taken, model, whole)
            elif field != "model":
                paths = [path for name, (of, path) in self._parts.items() if of == field and name in taken]
                parts[field] = self._part(field, model, self.theirs if field in whole else self.ours, paths)
        return Scenario(model, **{**parts, "duration": duration, "check_reference": False})

    def _plant(self, taken: Collection[str], model: Model, whole: Collection[str]) -> str | ScenePlant:
        plant = (self.theirs if "plant" in whole else self.ours).plant
        if isinstance(plant, str):
            return plant
        for name in taken:
            if name in self._scene_edits:
                plant = self._scene_edits[name](plant)
        if "model" in whole and isinstance(self.theirs.plant, ScenePlant):
            # A scenario from a file has the shapes of its robot in the scene alone.
            model = self.theirs.plant.scene_robot.model
        return plant if plant.scene_robot.model == model else with_model(plant, model)

    def _part(self, field: str, model: Model, source: Scenario, paths: Collection[tuple[str, ...]]) -> Any:
        value = getattr(source, field)
        if isinstance(value, Unknown):
            raise ArgumentError(f"the {field} cannot be rebuilt from the file")
        if not paths and (field != "controller" or model == source.model):
            return value
        document = encode(value, source.model)
        theirs = encode(getattr(self.theirs, field), self.theirs.model)
        for path in paths:
            document = _with_part(document, theirs, path)
        if model == self.theirs.model and document == theirs:
            # The object itself does not have to be rebuilt, which may be impossible.
            return getattr(self.theirs, field)
        found = decode(document, model)
        if isinstance(found, Unknown):
            raise ArgumentError(
                f"the {field} cannot be rebuilt with another robot or other gains: it is no frozen "
                "dataclass that is registered (control.register_controller)"
            )
        return found

    def _find(self) -> Iterator[Factor]:
        yield from self._of_robot()
        divided = divisible(self.ours.plant, self.theirs.plant)
        if divided:
            yield from self._of_scene()
        tied = _tied_times(self.ours, self.theirs)
        for found in self.ours.differences(self.theirs):
            field, *path = found.field.split(".")
            if field in ("model", *IRRELEVANT, *tied[1:]) or (field == "plant" and divided):
                continue
            if field == "integrator" and self.ours.plant != self.theirs.plant:
                continue  # belongs to the plant
            if path and self._can_be_divided(field, path):
                self._parts[found.field] = (field, tuple(path))
                yield Factor(found.field, *documents_apart(found.ours, found.theirs))
            elif field not in self._fields:
                whole = {"plant": ("plant", "integrator"), "dt": tied or ("dt",)}
                self._fields[field] = whole.get(field, (field,))
                yield Factor(field, *self._in_words(field, tied))

    def _can_be_divided(self, field: str, path: Collection[str]) -> bool:
        """Return True if a part of a field can be taken over without the rest."""
        if field not in DIVIDED or any(part.startswith(("class ", "code ")) for part in path):
            return False
        both = (encode(getattr(each, field), each.model) for each in (self.ours, self.theirs))
        return not any(FINGERPRINT in each for each in both)

    def _in_words(self, field: str, tied: Collection[str]) -> tuple[str, str]:
        """Describe both values of a field that is taken over as a whole."""
        pair = (self.ours, self.theirs)
        values = [getattr(each, field) for each in pair]
        if field == "plant":
            mine, its = (plant_in_words(each.plant, each.integrator) for each in pair)
        elif field in tied:
            mine, its = (", ".join(f"{name} {getattr(each, name)}" for name in tied) for each in pair)
        elif any(isinstance(value, Unknown | np.ndarray) for value in values):
            mine = its = ""
        else:
            mine, its = map(_value_in_words, values)
        if mine != its:
            return mine, its
        ours, theirs = (encode(value, each.model) for value, each in zip(values, pair, strict=True))
        return documents_apart(ours, theirs)

    def _of_robot(self) -> Iterator[Factor]:
        ours, theirs = self.ours.model, self.theirs.model
        if ours == theirs:
            return
        if not same_tree(ours, theirs):
            self._fields["model"] = ("model",)
            yield Factor("model", repr(ours), repr(theirs))
            return
        found = list(robot_factors(ours, theirs))
        if len(found) > MAX_PARTS:
            found = list(grouped(found))
        for name, both, edit in found:
            self._robot_edits[name] = edit
            yield Factor(name, *both)

    def _of_scene(self) -> Iterator[Factor]:
        ours, theirs = self.ours.plant, self.theirs.plant
        if isinstance(ours, ScenePlant) and isinstance(theirs, ScenePlant):
            for name, both, edit in scene_factors(ours, theirs):
                self._scene_edits[name] = edit
                yield Factor(name, *both)


def _tied_times(ours: Scenario, theirs: Scenario) -> tuple[str, ...]:
    """Return the times of the clock that differ and cannot be taken over one by one, because neither `dt` is
    one for the other control step or delay; `dt` is the first. Empty where they can."""
    apart = tuple(name for name in TIMES if getattr(ours, name) != getattr(theirs, name))
    mixed = ((ours.dt, theirs), (theirs.dt, ours))
    return apart if len(apart) > 1 and not any(_is_clock(dt, rest) for dt, rest in mixed) else ()


def _is_clock(dt: float, rest: Scenario) -> bool:
    try:
        Clock.of(dt, dt, rest.control_dt, rest.delay)
    except ArgumentError:
        return False
    return True


def _value_in_words(value: Any) -> str:
    if isinstance(value, list | tuple):
        return ", ".join(map(repr, value)) or "none"
    return "none" if value is None else repr(value)


def _with_part(ours: Document, theirs: Document, path: tuple[str, ...]) -> Document:
    """Return the document of an object with one part of another of the same class."""
    name, *rest = path
    key = "fields" if CLASS in ours else CONTROLLER
    if name == MODEL or isinstance(ours[key], str):
        # The model of a controller stands beside its arguments; a controller inside another has them itself.
        return {**ours, name: _part_or_mixture(ours[name], theirs[name], tuple(rest))}
    inner = {**ours[key], name: _part_or_mixture(ours[key][name], theirs[key][name], tuple(rest))}
    return {**ours, key: inner}


def _part_or_mixture(ours: Document, theirs: Document, path: tuple[str, ...]) -> Document:
    return _with_part(ours, theirs, path) if path else theirs
