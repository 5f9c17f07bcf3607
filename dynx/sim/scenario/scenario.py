"""A simulation as data: robot, controller, reference, plant, clock, sensors, disturbances and limits."""

from __future__ import annotations

import json
import os
from collections.abc import Collection, Mapping
from dataclasses import dataclass, fields, make_dataclass, replace
from typing import TYPE_CHECKING, Any, Literal, NamedTuple, overload

import numpy as np
from numpy.typing import ArrayLike

from dynx.argument_types import checks_types
from dynx.backends.joint_dynamics import JointDynamicsTerms
from dynx.control.base import Controller, refuse_other_than_controller
from dynx.errors import ArgumentError, shown
from dynx.files.documents import check_document, parse_json
from dynx.model import Model
from dynx.model.limited_positions import joint_ranges
from dynx.model.loading import load
from dynx.model.model import refuse_other_than_model
from dynx.model.package_search import StrPath
from dynx.option_names import checks_field_names
from dynx.rbd.parameters import Payload
from dynx.sim.controller_checks import copy_for_record
from dynx.sim.plants.registry import default_integrator
from dynx.sim.scenario.documents import (
    ARRAY,
    CLASS,
    CONTROLLER,
    DAMAGED,
    FINGERPRINT,
    MODEL,
    Document,
    Unknown,
    arguments_of,
    decode,
    encode,
    in_words,
)
from dynx.sim.scenario.documents import NUMBERS as CONTROLLER_NUMBERS
from dynx.sim.scenario.options import FORMER_NAMES, OPTIONS, SimulationOptions, as_array
from dynx.steppers.clock import TIME_ROUNDING, Clock
from dynx.steppers.forces import ExternalForce
from dynx.trajectory.base import Trajectory

SCHEMA = "dynx.scenario/2"
"""Name and version of the layout of a scenario's document."""

FIRST_SCHEMA = "dynx.scenario/1"
"""Version in which options had their former names, and a document without joint dynamics had none."""

ScenarioDocument = make_dataclass(
    "ScenarioDocument",
    [
        ("schema", Literal["dynx.scenario/2"]),
        ("model", dict[str, Any]),
        ("controller", dict[str, Any] | None, None),
        ("reference", list[Any] | dict[str, Any] | None, None),
        *((each.name, each.json_type, None) for each in OPTIONS.values()),
    ],
    namespace={"__doc__": "One simulation; the keys are the arguments of `dynx.simulate`."},
)
"""Keys of a scenario's document and the types of their values, from which its JSON Schema is generated.

Objects inside have one of the forms that `dynx.sim.scenario.documents` describes.
"""


class Difference(NamedTuple):
    """A field in which two scenarios differ, and the two values."""

    field: str
    """Its name; for a field inside another field with a dot, as in ``noise.seed``."""
    ours: Any
    theirs: Any


def innermost(difference: Difference) -> Difference:
    """Return the first entry in which two lists of equal length differ, such as ``pushes[0].wrench``, where
    the lists have objects or begin alike; any other difference as it is."""
    name, *pair = difference
    ours, theirs = (
        each[ARRAY] if isinstance(each, dict) and each.keys() == {ARRAY} else each for each in pair
    )
    if not isinstance(ours, list) or not isinstance(theirs, list) or len(ours) != len(theirs):
        return difference
    if not any(isinstance(each, dict) for each in ours) and in_words(ours) != in_words(theirs):
        return difference
    k = next(k for k, entries in enumerate(zip(ours, theirs, strict=True)) if not _same(*entries))
    return innermost(document_differences(f"{name}[{k}]", ours[k], theirs[k])[0])


@checks_field_names(**FORMER_NAMES)
@dataclass(frozen=True, eq=False, repr=False)
class Scenario(SimulationOptions):
    """Complete description of one simulation, which `dynx.simulate` and `dynx.simulate_batch` run and a
    record contains.

    The fields are the arguments of `dynx.simulate`, which documents them. Two scenarios are equal if all
    fields are equal, element by element, with the defaults filled in. Joint dynamics and limits that a
    description does not have count as switched off. ``dataclasses.replace`` changes one field; `to_json` and
    `from_json` keep every bit. The constructor checks types; a simulation checks the values when it starts.
    """

    model: Model
    """The robot as the controller knows it."""
    controller: Controller[Any] | Unknown | None = None
    """None for a robot without motors; `Unknown` only in a scenario that was read from a file."""
    reference: Trajectory | ArrayLike | Unknown | None = None

    def __post_init__(self) -> None:
        refuse_other_than_model(self.model)
        if not isinstance(self.controller, Unknown | None):
            refuse_other_than_controller("controller", self.controller)
        if isinstance(self.reference, str) or (
            callable(self.reference) and not isinstance(self.reference, Trajectory)
        ):
            formula = (
                "" if isinstance(self.reference, str) else "; trajectory.from_function(f, duration) makes one"
            )
            raise ArgumentError(
                f"reference is {shown(self.reference)}; wanted a trajectory of dynx.trajectory{formula}, one "
                "configuration to hold, or None"
            )
        object.__setattr__(self, "reference", as_array("reference", self.reference))
        for name, each in OPTIONS.items():
            object.__setattr__(self, name, each.kind.checked(name, getattr(self, name), self.model))

    if not TYPE_CHECKING:  # type checkers report an unknown attribute themselves

        def __getattr__(self, name: str) -> Any:
            if name in FORMER_NAMES:
                raise AttributeError(f"Scenario.{name} is now {FORMER_NAMES[name]}")
            raise AttributeError(f"{type(self).__name__!r} object has no attribute {name!r}")

    @property
    def payloads(self) -> tuple[Payload, ...]:
        """All payloads of the plant."""
        return tuple(self.payload) if isinstance(self.payload, tuple) else ()

    @property
    def all_pushes(self) -> tuple[ExternalForce, ...]:
        """All pushes on the plant."""
        return tuple(self.pushes) if isinstance(self.pushes, tuple) else ()

    def with_defaults(self) -> Scenario:
        """Return an equal scenario without None for integrator, control step and, if known, duration, which
        is that of the simulation: rounded up to a multiple of `dt`."""
        duration = self.duration
        if duration is None and isinstance(self.reference, Trajectory | Unknown):
            duration = self.reference.duration
        return replace(
            self,
            integrator=self.integrator or default_integrator(self.plant),
            control_dt=self.dt if self.control_dt is None else self.control_dt,
            duration=_simulated(duration, self.dt),
        )

    def for_record(self) -> Scenario:
        """Return an equal scenario that does not change if the user later changes their own controller or
        trajectory."""
        parts: dict[str, Any] = {
            name: copy_for_record(part)
            for name, part in (("controller", self.controller), ("reference", self.reference))
            if isinstance(part, Controller | Trajectory)
        }
        unchanged = all(copied is getattr(self, name) for name, copied in parts.items())
        return self if unchanged else replace(self, **parts)

    @checks_types
    def differences(self, other: Scenario) -> list[Difference]:
        """Return the fields in which `other` differs; empty for an equal scenario."""
        found: list[Difference] = []
        ours, theirs = self.with_defaults(), other.with_defaults()
        for name in field_names():
            mine, its = getattr(ours, name), getattr(theirs, name)
            if name == "model":
                if mine != its:
                    found.append(Difference(name, mine, its))
                continue
            if (
                name in (*JOINT_TERMS, LIMITS)
                and (_acts(name, mine, self.model), _acts(name, its, other.model)) == NEITHER
            ):
                continue
            pair = encode(mine, self.model), encode(its, other.model)
            found += document_differences(name, *pair)
        return found

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Scenario):
            return NotImplemented
        return not self.differences(other)

    def __hash__(self) -> int:
        return hash((self.model, self.plant))

    def __repr__(self) -> str:
        """Show the fields that differ from their defaults."""
        shown_fields = [f"Scenario({self.model.name}"]
        defaults = {each.name: each.default for each in fields(self)}
        for name in field_names()[1:]:
            value = getattr(self, name)
            if not _same(encode(value, self.model), encode(defaults[name], self.model)):
                shown_fields.append(f"{name}={value}")
        return ",\n    ".join(shown_fields) + ")"

    def to_dict(self) -> dict[str, Document]:
        """Convert to a document of numbers and text, from which `from_dict` makes an equal scenario.

        A trajectory of your own can be rebuilt if its class is a frozen dataclass, and a controller of your
        own if its class is registered too. Any other is written as a fingerprint, which can only be compared.
        """
        document: dict[str, Document] = {"schema": SCHEMA, "model": encode(self.model)}
        for name in field_names():
            if name != "model":
                document[name] = encode(getattr(self, name), self.model)
        return document

    @classmethod
    @checks_types
    def from_dict(cls, document: Mapping[str, Document]) -> Scenario:
        """Return the scenario of a document, of an earlier dynx too. Raises ArgumentError for a document of
        another layout."""
        # Imported here, because most simulations read no document.
        from dynx.sim.scenario.earlier import of_present_schema, with_joint_limits

        if isinstance(document, Mapping) and document.get("schema") == FIRST_SCHEMA:
            document = {**of_present_schema(document), "schema": SCHEMA}
        if isinstance(document, Mapping):
            document = with_joint_limits(document)
        if not isinstance(document, Mapping) or document.get("schema") != SCHEMA:
            has = f"has the schema {shown(document['schema'])}" if "schema" in document else "lacks a schema"
            raise ArgumentError(f"the document {has}; wanted that of a scenario, {SCHEMA!r}")
        given = {name: decode(each) if _is_number(each) else each for name, each in document.items()}
        check_document(given, ScenarioDocument)
        del given["schema"]
        model = decode(given.pop("model"))
        parts = {name: decode(value, model) for name, value in given.items()}
        try:
            scenario = cls(model, **parts)
            # Objects with parts of wrong types may be made, and fail when they are compared, shown or used.
            scenario.to_dict()
            repr(scenario)
            if isinstance(scenario.reference, Trajectory):
                for count in (2, 3):
                    scenario.reference(np.linspace(0.0, float(scenario.reference.duration), count))
        except ArgumentError:
            raise
        except DAMAGED as error:
            raise ArgumentError(f"the scenario's document has a part of a wrong type: {error}") from error
        return scenario

    def to_json(self) -> str:
        """Return `to_dict` as text."""
        return json.dumps(self.to_dict(), indent=1)

    @classmethod
    def from_json(cls, text: str) -> Scenario:
        """Return the scenario of a text that `to_json` wrote. Raises ArgumentError for any other text."""
        try:
            document = parse_json(text)
        except (TypeError, ValueError) as error:
            raise ArgumentError(
                f"the text is not JSON: {error}; got {shown(text)}, wanted what to_json returned"
            ) from error
        return cls.from_dict(document)


class RecordedScenario:
    """Attribute for the scenario of a record, which nobody can change: it is copied when it is set, and again
    when it is read, by `Scenario.for_record`. As a field of a dataclass its default is None."""

    @overload
    def __get__(self, instance: None, owner: type) -> None: ...
    @overload
    def __get__(self, instance: object, owner: type) -> Scenario: ...
    def __get__(self, instance: object | None, owner: type) -> Scenario | None:
        """Return a copy, in which a controller of the user's own may be changed without effect."""
        if instance is None:
            return None
        scenario: Scenario | None = vars(instance).get("scenario")
        return None if scenario is None else scenario.for_record()

    @checks_types
    def __set__(self, instance: object, scenario: Scenario | None) -> None:
        vars(instance)["scenario"] = None if scenario is None else scenario.for_record()


@dataclass(frozen=True, eq=False, repr=False)
class ScenarioArguments(SimulationOptions):
    """Arguments of a function that simulates a robot or a `Scenario`."""

    model: Model | Scenario | StrPath
    controller: Controller[Any] | None = None
    reference: Trajectory | ArrayLike | None = None

    def scenario(self, rows: Collection[str] = ()) -> Scenario:
        """Return the scenario of these arguments, or the one that is given instead of a model.

        The arguments `rows` do not go into it. Raises ArgumentError if another argument is given beside a
        scenario, of which it is a field.
        """
        given = {name: getattr(self, name) for name in field_names()[1:] if name not in rows}
        if isinstance(self.model, Scenario):
            defaults = {each.name: each.default for each in fields(self)}
            for name, value in given.items():
                if not _is_default(value, defaults[name]):
                    raise ArgumentError(
                        f"{name} is given in addition to a scenario, which has a field of that name: change "
                        "it by dataclasses.replace"
                    )
            return self.model
        if not isinstance(self.model, Model | str | os.PathLike):
            kind = type(self.model).__name__
            raise ArgumentError(
                f"model is of type {kind}; wanted a Model, a Scenario, or a robot's name or file"
            )
        return Scenario(load(self.model), **given)


JOINT_TERMS = {
    "joint_damping": "damping",
    "joint_friction": "friction",
    "joint_armature": "rotors",
    "joint_springs": "stiffness",
}
"""Attribute of `JointDynamicsTerms` with the coefficients of the description, by the name of the option."""

LIMITS = "joint_limits"
"""Option that acts on robots with position limits."""

NEITHER = (False, False)


def _acts(option: str, value: object, model: Model) -> bool:
    """Check whether an option of joints acts: True does not where the description has none."""
    if value is True and option == LIMITS:
        return bool(np.isfinite(joint_ranges(model)).any())
    if value is True:
        return bool(getattr(JointDynamicsTerms(model), JOINT_TERMS[option]).any())
    return value is not False


def _is_default(value: object, default: object) -> bool:
    plain = type(value) is type(default) and isinstance(value, str | float | int | tuple)
    return value is default or (plain and value == default)


def field_names() -> tuple[str, ...]:
    """Return the names of all fields of a scenario, those that can be given by position first."""
    return ("model", "controller", "reference", *OPTIONS)


def _is_number(document: Document) -> bool:
    """Check whether a document is that of a number that JSON does not have."""
    return isinstance(document, Mapping) and document.keys() == {"float"}


def _simulated(duration: float | None, dt: float) -> float | None:
    """Return `duration` rounded up to a multiple of `dt`; unchanged if it is one, or if a time is invalid."""
    if duration is None:
        return None
    try:
        simulated = Clock.of(dt, duration, None, 0.0).duration
    except (ArgumentError, OverflowError):
        return duration
    return duration if abs(simulated - duration) <= TIME_ROUNDING * simulated else simulated


def document_differences(name: str, ours: Document, theirs: Document) -> list[Difference]:
    """Yield the innermost entries in which two documents differ."""
    if _same(ours, theirs):
        return []
    one, other = _parts_of(ours), _parts_of(theirs)
    if one is None or other is None or one.keys() != other.keys():
        return [Difference(name, ours, theirs)]
    inner = [found for key in one for found in document_differences(f"{name}.{key}", one[key], other[key])]
    return inner or [Difference(name, ours, theirs)]


def _parts_of(document: Document) -> dict[str, Document] | None:
    """Return the parts of an object's document by name, with the same names for all objects of a class;
    None for a document that is not of an object."""
    if not isinstance(document, dict):
        return None
    if CLASS in document:
        return {f"class {document[CLASS]}": True, **document["fields"]}
    if isinstance(document.get(CONTROLLER), str):
        # A controller inside another one has its model, and no entry for it.
        return {f"class {document[CONTROLLER]}": True, **arguments_of(document)}
    if CONTROLLER in document:
        kind = document[CONTROLLER][CONTROLLER]
        return {f"class {kind}": True, MODEL: document.get(MODEL), **arguments_of(document)}
    if FINGERPRINT in document:
        return {f"class {document[FINGERPRINT]}": True, **document.get(CONTROLLER_NUMBERS, {})}
    return None


def _same(one: Document, other: Document) -> bool:
    """Compare documents: True and 1 are different, but lists and arrays of equal numbers are the same."""
    one, other = (
        each[ARRAY] if isinstance(each, dict) and each.keys() == {ARRAY} else each for each in (one, other)
    )
    if isinstance(one, list) and isinstance(other, list):
        return len(one) == len(other) and all(map(_same, one, other))
    if isinstance(one, dict) and isinstance(other, dict):
        return one.keys() == other.keys() and all(_same(one[key], other[key]) for key in one)
    return isinstance(one, bool) == isinstance(other, bool) and bool(one == other)
