"""`compare`: how far apart two motions of a kind are, and which differences of two scenarios cause it.

A factor is a difference of two scenarios that can be taken over alone: of settings, gains, robots or scenes.
Causes are proved by reruns with it."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass, fields, replace
from inspect import signature
from typing import Any, TypeVar, overload

import numpy as np

from dynx.control.base import Controller, chain_of
from dynx.errors import ArgumentError, DynxError, shown
from dynx.model import Model
from dynx.model.elements import Inertial
from dynx.model.geometry.links import Collision
from dynx.model.numbers import is_real
from dynx.sim.plants.scene_plant import ScenePlant
from dynx.sim.record.rollout import Rollout
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
from dynx.sim.scenario.options import check_arguments
from dynx.sim.scenario.scenario import Difference, Scenario, document_differences, field_names
from dynx.sim.simulation import simulate
from dynx.steppers.clock import Clock
from dynx.world.comparison import WorldComparison, compare_engines
from dynx.world.scene.scene import Scene
from dynx.world.separation import Separation, separation

Whole = TypeVar("Whole", Model, ScenePlant)

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


Edit = tuple[tuple[str | int, ...], Any]
"""Path to a part of a robot or a plant, by fields and indices, and the value that it gets."""

PartFactor = tuple[str, tuple[str, str], Sequence[Edit]]
"""Name, values in words, and edits of a difference."""


def edited(whole: Whole, edits: Iterable[Edit]) -> Whole:
    """Return a copy of a robot or a plant with the parts at some paths replaced."""
    for path, value in edits:
        whole = _with_value(whole, path, value)
    return whole


def _with_value(whole: Any, path: Sequence[str | int], value: Any) -> Any:
    if not path:
        return value
    name, *rest = path
    if isinstance(name, int):
        return (*whole[:name], _with_value(whole[name], rest, value), *whole[name + 1 :])
    return replace(whole, **{name: _with_value(getattr(whole, name), rest, value)})


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


def robot_factors(ours: Model, theirs: Model) -> Iterator[PartFactor]:
    """Yield the name, the values in words, and the edits of each difference of two robots of one tree."""
    for k, (one, other) in enumerate(zip(ours.links, theirs.links, strict=True)):
        if (one.inertial or Inertial()) != (other.inertial or Inertial()):
            edit = ("links", k, "inertial"), other.inertial
            yield f"link {one.name}, inertial", words_apart(one.inertial, other.inertial), [edit]
    for k, (joint, twin) in enumerate(zip(ours.joints, theirs.joints, strict=True)):
        for part in JOINT_PARTS:
            mine, its = getattr(joint, part), getattr(twin, part)
            if mine != its:
                edit = ("joints", k, part), its
                yield f"joint {joint.name}, {part}", words_apart(mine, its), [edit]
    for part in MODEL_PARTS:
        mine, its = getattr(ours, part), getattr(theirs, part)
        if mine != its:
            yield part, words_apart(mine, its), [((part,), its)]


def grouped(found: Iterable[PartFactor]) -> Iterator[PartFactor]:
    """Yield one difference for each part of all links and of all joints, such as ``links, inertial``."""
    groups: dict[str, list[PartFactor]] = {}
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
        yield name, (mine, its), [edit for each in members for edit in each[2]]


def _item_of(name: str) -> str:
    """Return the link or joint in the name of a difference."""
    return name.rpartition(", ")[0].partition(" ")[2]


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


def scene_factors(ours: ScenePlant, theirs: ScenePlant) -> Iterator[PartFactor]:
    """Yield the name, the values in words, and the edits of each difference of two plants that are divisible.

    The model of the simulated robot is that of the scenario, and not among them; its shapes are, because
    models that differ in them alone are equal.
    """
    if ours.engine != theirs.engine:
        both = (_engine(ours), _engine(theirs))
        # An engine does not take the settings of another.
        settings = [(("settings",), each) for each in ((), theirs.settings)]
        yield "plant.engine", both, [settings[0], (("engine",), theirs.engine), settings[1]]
    elif ours.settings != theirs.settings:
        both = (str(dict(ours.settings)), str(dict(theirs.settings)))
        yield "plant.settings", both, [(("settings",), theirs.settings)]
    for kind in PARTS:
        for k, (one, other) in enumerate(
            zip(getattr(ours.scene, kind), getattr(theirs.scene, kind), strict=True)
        ):
            own = kind == "robots" and one.name == ours.robot
            for each in fields(one):
                mine, its = getattr(one, each.name), getattr(other, each.name)
                if each.name == "model" and _same_links(mine, its) and _shapes(mine) != _shapes(its):
                    edit = ("scene", kind, k, "model", "geometry"), its.geometry
                    yield f"robot {one.name}, shapes", _shapes_in_words(mine, its), [edit]
                if mine == its or (own and each.name == "model"):
                    continue
                name = f"{'body' if kind == 'bodies' else 'robot'} {one.name}, {each.name}"
                yield name, words_apart(mine, its), [(("scene", kind, k, each.name), its)]
    for each in fields(ours.scene):
        mine, its = getattr(ours.scene, each.name), getattr(theirs.scene, each.name)
        if each.name not in ("name", *PARTS) and mine != its:
            yield f"scene, {each.name}", words_apart(mine, its), [(("scene", each.name), its)]


def with_model(plant: ScenePlant, model: Model) -> ScenePlant:
    """Return the plant with another model of its simulated robot, which keeps its shapes if it has the same
    links."""
    known = plant.scene_robot.model
    if _same_links(model, known):
        model = replace(model, geometry=known.geometry)
    k = [each.name for each in plant.scene.robots].index(str(plant.robot))
    return edited(plant, [(("scene", "robots", k, "model"), model)])


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


def _engine(plant: ScenePlant) -> str:
    return plant.engine + "".join(f", {name}={value}" for name, value in dict(plant.settings).items())


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
    """What differs, as ``damping``, ``controller.kp``, ``link hand, inertial`` or ``joint elbow, axis``."""
    ours: str
    theirs: str


class Mixture:
    """Scenarios that have some differences from one scenario, and the rest from another."""

    def __init__(self, ours: Scenario, theirs: Scenario) -> None:
        self.ours, self.theirs = ours.with_defaults(), theirs.with_defaults()
        self._own_models = _controllers_have_own_models(ours, theirs)
        self._robot_edits: dict[str, Sequence[Edit]] = {}
        self._scene_edits: dict[str, Sequence[Edit]] = {}
        self._parts: dict[str, tuple[str, tuple[str, ...]]] = {}
        """Field and path of parts of a field, by factor."""
        self._fields: dict[str, tuple[str, ...]] = {}
        """Fields that are taken over as a whole, by factor."""
        self.factors = tuple(self._find())

    def scenario(self, taken: Collection[str], duration: float) -> Scenario:
        """Return our scenario with the factors of these names from theirs, for `duration` [s].

        Raises ArgumentError where a part cannot be rebuilt, such as a controller that is not registered.
        """
        model = edited(self.ours.model, [edit for name in taken for edit in self._robot_edits.get(name, ())])
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
        plant = edited(plant, [edit for name in taken for edit in self._scene_edits.get(name, ())])
        if "model" in whole and isinstance(self.theirs.plant, ScenePlant):
            # A scenario from a file has the shapes of its robot in the scene alone.
            model = self.theirs.plant.scene_robot.model
        return plant if plant.scene_robot.model == model else with_model(plant, model)

    def _part(self, field: str, model: Model, source: Scenario, paths: Collection[tuple[str, ...]]) -> Any:
        value = getattr(source, field)
        if isinstance(value, Unknown):
            raise ArgumentError(f"the {field} cannot be rebuilt from the file")
        own = field == "controller" and self._own_models
        if not paths and (field != "controller" or own or model == source.model):
            return value
        document = self._document(field, source)
        theirs = self._document(field, self.theirs)
        for path in paths:
            document = _with_part(document, theirs, path)
        if document == theirs and (own or model == self.theirs.model):
            # The object itself does not have to be rebuilt, which may be impossible.
            return getattr(self.theirs, field)
        found = decode(document, self.ours.model if own else model)
        if isinstance(found, Unknown):
            raise ArgumentError(
                f"the {field} cannot be rebuilt with another robot or other gains: it is no frozen "
                "dataclass that is registered (control.register_controller)"
            )
        return found

    def _document(self, field: str, scenario: Scenario) -> Document:
        """Return the document of a field, in which a controller that keeps its model has it relative to our
        robot."""
        own = field == "controller" and self._own_models
        return encode(getattr(scenario, field), (self.ours if own else scenario).model)

    def _differences(self) -> list[Difference]:
        """Return the fields that differ; a model that both controllers have is no difference."""
        found = self.ours.differences(self.theirs)
        if not self._own_models:
            return found
        pair = (self._document("controller", each) for each in (self.ours, self.theirs))
        rest = [each for each in found if each.field.partition(".")[0] != "controller"]
        return [*document_differences("controller", *pair), *rest]

    def _find(self) -> Iterator[Factor]:
        yield from self._of_robot()
        divided = divisible(self.ours.plant, self.theirs.plant)
        if divided:
            yield from self._of_scene()
        tied = _tied_times(self.ours, self.theirs)
        for found in self._differences():
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
        both = (self._document(field, each) for each in (self.ours, self.theirs))
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
        for name, both, edits in found:
            self._robot_edits[name] = edits
            yield Factor(name, *both)

    def _of_scene(self) -> Iterator[Factor]:
        ours, theirs = self.ours.plant, self.theirs.plant
        if isinstance(ours, ScenePlant) and isinstance(theirs, ScenePlant):
            for name, both, edits in scene_factors(ours, theirs):
                self._scene_edits[name] = edits
                yield Factor(name, *both)


def _controllers_have_own_models(ours: Scenario, theirs: Scenario) -> bool:
    """Return True if the robots differ, and a controller is not made for that of its scenario: then both
    controllers keep their models where the robot changes, else they follow it."""
    both = [(each.controller, each.model) for each in (ours, theirs)]
    if ours.model == theirs.model or any(isinstance(controller, Unknown) for controller, _ in both):
        return False
    return any(
        each.model != model
        for controller, model in both
        if isinstance(controller, Controller)
        for each in chain_of(controller)
    )


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


TOLERANCE = 1e-9
"""Default distance [rad or m] up to which two rollouts are alike: that of engines which add in another order
stays below it in most motions without contacts."""

MAX_FACTORS = 40
"""Largest number of differences that are examined one by one, with two reruns each."""

Progress = Callable[[int, int], object]


@dataclass(frozen=True)
class Cause:
    """A difference of the scenarios, and what it does to the motion."""

    factor: Factor
    alone: float | None
    """Largest distance [rad or m] between our rollout and one that differs from it by this factor alone;
    infinite where that one diverges, None where it cannot be simulated."""
    without: float | None
    """Largest distance between their rollout and one that has all of their factors but this."""
    obstacle: str | None = None
    """Why one of the two could not be simulated, or ended early."""

    def acts(self, tolerance: float) -> bool:
        """Return True if the factor moves either rollout by more than `tolerance`."""
        return any(each is not None and each > tolerance for each in (self.alone, self.without))


@dataclass(frozen=True, eq=False)
class RolloutComparison:
    """Two rollouts, their distance over time, and the causes of it."""

    ours: Rollout
    theirs: Rollout
    separation: Separation
    tolerance: float
    """Distance up to which rollouts are alike [rad or m]."""
    causes: tuple[Cause, ...]
    """All differences of the scenarios, the one with the largest effect first."""
    remaining: float | None
    """Largest distance between `theirs` and a rerun of the scenario of `ours` with all differences taken
    over; None if it cannot be simulated."""
    repeated: float | None
    """Largest distance between `ours` and a rerun of its own scenario; None if it cannot be simulated."""
    notes: tuple[str, ...]

    @property
    def alike(self) -> bool:
        """True if nothing is farther apart than the tolerance."""
        return self.separation.largest <= self.tolerance

    @property
    def proved(self) -> bool:
        """True if the rollouts differ, and taking over the causes removes the distance."""
        reruns = (self.remaining, self.repeated)
        return not self.alike and all(each is not None and each <= self.tolerance for each in reruns)

    def __repr__(self) -> str:
        if self.alike:
            return f"<RolloutComparison: alike to {self.separation.largest:.2g}>"
        acting = sum(cause.acts(self.tolerance) for cause in self.causes)
        proof = "proved" if self.proved else "not proved"
        count = f"{acting} of {len(self.causes)} differences"
        return f"<RolloutComparison: {self.separation.largest:.3g} apart, causes: {count}, {proof}>"

    def _repr_html_(self) -> str:
        rows = (
            (
                each.factor.name,
                each.factor.ours,
                each.factor.theirs,
                *("" if effect is None else f"{effect:.2g}" for effect in (each.alone, each.without)),
            )
            for each in self.causes
        )
        from dynx.files.pages import html_grid  # most are shown on no page

        return html_grid(repr(self)[1:-1], ("difference", "ours", "theirs", "alone", "without it"), rows)


@overload
def compare(
    ours: Rollout,
    theirs: Rollout,
    *,
    tolerance: float = TOLERANCE,
    rerun: bool = True,
    progress: Progress | None = None,
) -> RolloutComparison: ...
@overload
def compare(
    ours: Scene, theirs: Sequence[str], duration: float, dt: float = 1e-3, **options: Any
) -> WorldComparison: ...
def compare(ours: Any, theirs: Any, *given: Any, **options: Any) -> Any:
    """Find out how far apart two motions are, and why.

    ``compare(rollout, rollout, tolerance=, rerun=, progress=)`` returns a `RolloutComparison` of two rollouts
    of a robot, or of logs that `Rollout.load` reads. A *difference* of their scenarios is an argument of
    `simulate`, a gain, a link or a joint. For each difference dynx simulates twice: first it copies only this
    difference from `theirs` into `ours`, then it copies all other differences. If dynx copies all
    differences, the new rollout must equal `theirs`. This proves that nothing else is a cause. `tolerance` is
    the distance [rad or m] up to which rollouts are alike. Without `rerun` dynx only lists the differences.
    `progress` is called with the number of finished simulations and their total number.

    ``compare(scene, engines, duration, dt=1e-3, substeps=, settings=, samples=, finish=, progress=)`` returns
    a `dynx.world.WorldComparison` of the motions of one scene on several engines. Each engine runs the scene
    for `duration` [s] in steps of `dt` / `substeps` [s]. `settings` maps engines to settings of `World`. dynx
    compares the states at `samples` times. `finish` is called with each world at its end, and `progress` with
    the name of the engine and the time reached. If an engine fails in a step, its run ends there.

    Raises ArgumentError for rollouts of robots with other coordinates or without a common time, for anything
    but two rollouts or a scene with its engines, and for an invalid tolerance; UnknownNameError for an option
    of another name; TypeError for other arguments that do not fit; the errors of `World` for a scene that
    cannot be opened.
    """
    comparing = compare_engines if isinstance(ours, Scene) else _compare_rollouts
    check_arguments("compare", signature(comparing), (ours, theirs, *given), options)
    return comparing(ours, theirs, *given, **options)


def rollout_separation(ours: Rollout, theirs: Rollout) -> Separation:
    """Measure how far apart two rollouts are over time, in the coordinates of their robot and the positions
    of the bodies that both have.

    Raises ArgumentError for rollouts of robots with other coordinates, or without a common time.
    """
    one, other = ours.model, theirs.model
    if (one.base, one.joint_names) != (other.base, other.joint_names):
        raise ArgumentError(
            "the rollouts have other coordinates: "
            f"{one.base} base and joints {', '.join(one.joint_names) or 'none'}; "
            f"{other.base} base and joints {', '.join(other.joint_names) or 'none'}"
        )
    return separation(ours.record("the first rollout"), theirs.record("the second rollout"))


def _compare_rollouts(
    ours: Rollout,
    theirs: Rollout,
    *,
    tolerance: float = TOLERANCE,
    rerun: bool = True,
    progress: Progress | None = None,
) -> RolloutComparison:
    for name, each in (("ours", ours), ("theirs", theirs)):
        if not isinstance(each, Rollout):
            raise ArgumentError(
                f"{name} is of type {type(each).__name__}; wanted a dynx.Rollout, which "
                "simulate returns and Rollout.load reads, or first a Scene and second its engines"
            )
    if not is_real(tolerance) or not 0.0 <= tolerance < math.inf:
        raise ArgumentError(f"tolerance is {shown(tolerance)}; wanted a number of rad or m, 0 or more")
    apart = rollout_separation(ours, theirs)
    notes = [*_departures("the first", ours), *_departures("the second", theirs)]
    if ours.scenario is None or theirs.scenario is None:
        which = " and ".join(
            name for name, each in (("first", ours), ("second", theirs)) if each.scenario is None
        )
        notes.append(f"the {which} rollout has no scenario, so that differences cannot be listed or proved")
        return RolloutComparison(ours, theirs, apart, tolerance, (), None, None, tuple(notes))
    mixture = Mixture(ours.scenario, theirs.scenario)
    names = [factor.name for factor in mixture.factors]
    causes = [Cause(factor, None, None) for factor in mixture.factors]
    remaining = repeated = None
    if rerun and apart.largest > tolerance:
        trials = _Trials(mixture, float(apart.times[-1]), progress)
        repeated, first = trials.distance((), ours)
        remaining, last = trials.distance(names, theirs)
        reruns = (("the first", first), ("the second", last))
        notes += [f"a rerun of {which}: {why}" for which, why in reruns if why]
        if len(names) > MAX_FACTORS:
            notes.append(f"{len(names)} differences are too many to be examined one by one ({MAX_FACTORS})")
        else:
            causes = [trials.cause(factor, names) for factor in mixture.factors]
            causes.sort(key=lambda each: -max(each.alone or 0.0, each.without or 0.0))
    return RolloutComparison(ours, theirs, apart, tolerance, tuple(causes), remaining, repeated, tuple(notes))


class _Trials:
    """Reruns of mixed scenarios; each is simulated once."""

    def __init__(self, mixture: Mixture, duration: float, progress: Progress | None) -> None:
        self._mixture, self._duration, self._progress = mixture, duration, progress
        self._total = _number_of_reruns(len(mixture.factors))
        self._known: dict[frozenset[str], tuple[Rollout | None, str | None]] = {}

    def cause(self, factor: Factor, names: Collection[str]) -> Cause:
        """Return the factor with its effects on both rollouts."""
        base, _ = self._rollout(())
        every, _ = self._rollout(names)
        alone, first = (None, None) if base is None else self.distance((factor.name,), base)
        rest = [name for name in names if name != factor.name]
        without, last = (None, None) if every is None else self.distance(rest, every)
        return Cause(factor, alone, without, first or last)

    def distance(self, taken: Collection[str], record: Rollout) -> tuple[float | None, str | None]:
        """Return the largest distance of a rerun from a record, and why it is not known or not finite."""
        found, why = self._rollout(taken)
        if found is None:
            return None, why
        return (float("inf") if why is not None else rollout_separation(found, record).largest), why

    def _rollout(self, taken: Collection[str]) -> tuple[Rollout | None, str | None]:
        key = frozenset(taken)
        if key not in self._known:
            self._known[key] = self._simulated(taken)
        return self._known[key]

    def _simulated(self, taken: Collection[str]) -> tuple[Rollout | None, str | None]:
        try:
            return simulate(self._mixture.scenario(taken, self._duration)), None
        except DynxError as error:
            partial = getattr(error, "rollout", None)
            return (partial if isinstance(partial, Rollout) and len(partial) else None), str(error)
        finally:
            if self._progress is not None:
                self._progress(len(self._known) + 1, self._total)


def _number_of_reruns(n: int) -> int:
    """Return how many scenarios there are with none, one, all but one and all of n differences."""
    if n > MAX_FACTORS:
        return 2
    return 2 + 2 * n if n > 2 else 2**n


def _departures(name: str, rollout: Rollout) -> list[str]:
    """Return notes on what makes a record differ from its scenario."""
    notes = [f"{name} rollout departs from its scenario: {each}" for each in rollout.departures]
    scenario = rollout.scenario
    if scenario is not None and isinstance(scenario.controller, Unknown):
        notes.append(f"the controller of {name} rollout cannot be rebuilt from its file")
    return notes
