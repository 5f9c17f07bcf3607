"""Differences of two scenarios, each of which can be taken over alone: settings, gains, robots, scenes."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from dynx.errors import ArgumentError
from dynx.model import Model
from dynx.sim.comparison import robot_factors, scene_factors
from dynx.sim.comparison.words import documents_apart, plant_in_words
from dynx.sim.plants.scene_plant import ScenePlant
from dynx.sim.scenario.documents import (
    CLASS,
    CONTROLLER,
    FINGERPRINT,
    MODEL,
    Document,
    Unknown,
    decode,
    encode,
)
from dynx.sim.scenario.scenario import Scenario, field_names
from dynx.steppers.clock import Clock

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
        self._robot_edits: dict[str, robot_factors.Edit] = {}
        self._scene_edits: dict[str, scene_factors.Edit] = {}
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
        return plant if plant.scene_robot.model == model else scene_factors.with_model(plant, model)

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
        divided = scene_factors.divisible(self.ours.plant, self.theirs.plant)
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
        if not robot_factors.same_tree(ours, theirs):
            self._fields["model"] = ("model",)
            yield Factor("model", repr(ours), repr(theirs))
            return
        found = list(robot_factors.robot_factors(ours, theirs))
        if len(found) > MAX_PARTS:
            found = list(robot_factors.grouped(found))
        for name, both, edit in found:
            self._robot_edits[name] = edit
            yield Factor(name, *both)

    def _of_scene(self) -> Iterator[Factor]:
        ours, theirs = self.ours.plant, self.theirs.plant
        if isinstance(ours, ScenePlant) and isinstance(theirs, ScenePlant):
            for name, both, edit in scene_factors.scene_factors(ours, theirs):
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
