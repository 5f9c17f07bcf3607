"""Differences of two scenarios, each of which can be taken over alone: settings, gains, robots, scenes."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from dynx.errors import ArgumentError
from dynx.model import Model
from dynx.sim.comparison import robot_factors, scene_factors
from dynx.sim.comparison.words import document_in_words
from dynx.sim.plants.scene_plant import ScenePlant
from dynx.sim.scenario.documents import CLASS, CONTROLLER, Document, Unknown, decode, encode
from dynx.sim.scenario.scenario import Scenario, field_names

IRRELEVANT = ("duration", "check_reference")
"""Fields that change no motion at times that both rollouts have."""

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
        for found in self.ours.differences(self.theirs):
            field, *path = found.field.split(".")
            if field in ("model", *IRRELEVANT) or "model" in path or (field == "plant" and divided):
                continue
            if field == "integrator" and self.ours.plant != self.theirs.plant:
                continue  # belongs to the plant
            if field in DIVIDED and path and not any(part.startswith(("class ", "code ")) for part in path):
                self._parts[found.field] = (field, tuple(path))
                yield Factor(found.field, document_in_words(found.ours), document_in_words(found.theirs))
            elif field not in self._fields:
                self._fields[field] = (field, "integrator") if field == "plant" else (field,)
                yield Factor(field, _in_words(self.ours, field), _in_words(self.theirs, field))

    def _of_robot(self) -> Iterator[Factor]:
        ours, theirs = self.ours.model, self.theirs.model
        if ours == theirs:
            return
        if not robot_factors.same_tree(ours, theirs):
            self._fields["model"] = ("model",)
            yield Factor("model", repr(ours), repr(theirs))
            return
        for name, both, edit in robot_factors.robot_factors(ours, theirs):
            self._robot_edits[name] = edit
            yield Factor(name, *both)

    def _of_scene(self) -> Iterator[Factor]:
        ours, theirs = self.ours.plant, self.theirs.plant
        if isinstance(ours, ScenePlant) and isinstance(theirs, ScenePlant):
            for name, both, edit in scene_factors.scene_factors(ours, theirs):
                self._scene_edits[name] = edit
                yield Factor(name, *both)


def _in_words(scenario: Scenario, field: str) -> str:
    value = getattr(scenario, field)
    if field == "plant" and isinstance(value, str):
        return f"{value}, {scenario.integrator}"
    if isinstance(value, Unknown | np.ndarray):
        return document_in_words(encode(value, scenario.model))
    if isinstance(value, list | tuple):
        return ", ".join(map(repr, value)) or "none"
    return "none" if value is None else repr(value)


def _with_part(ours: Document, theirs: Document, path: tuple[str, ...]) -> Document:
    """Return the document of an object with one part of another of the same class."""
    name, *rest = path
    key = "fields" if CLASS in ours else CONTROLLER
    inner = dict(ours[key])
    inner[name] = _with_part(inner[name], theirs[key][name], tuple(rest)) if rest else theirs[key][name]
    return {**ours, key: inner}
