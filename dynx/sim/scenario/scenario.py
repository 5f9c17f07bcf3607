"""A simulation as data: robot, controller, reference, plant, clock, sensors, disturbances and limits."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import KW_ONLY, dataclass, fields, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from dynx.control.base import Controller, refuse_other_than_controller
from dynx.control.friction import Coefficients, coefficients_by_joint
from dynx.errors import ArgumentError, nearest, shown
from dynx.model import Model
from dynx.model.model import refuse_other_than_model
from dynx.model.numbers import refuse_mask
from dynx.registry import DEFAULT_ENGINE
from dynx.sim.loop.noise import Noise
from dynx.sim.plants.disturbances import Push
from dynx.sim.plants.model_error import MassScale, Payload
from dynx.sim.plants.registry import default_integrator
from dynx.sim.plants.scene_plant import ScenePlant
from dynx.sim.scenario.documents import (
    ARRAY,
    CLASS,
    CODE,
    CONTROLLER,
    FINGERPRINT,
    MODEL,
    Document,
    Unknown,
    arguments_of,
    decode,
    encode,
)
from dynx.sim.scenario.documents import NUMBERS as CONTROLLER_NUMBERS
from dynx.steppers.clock import TIME_ROUNDING, Clock
from dynx.trajectory.base import Trajectory

SCHEMA = "dynx.scenario/1"
"""Name and version of the layout of a scenario's document."""

NUMBERS = ("reference", "q0", "v0", "damping", "friction", "armature", "effort_limits")
"""Fields that may be given as lists of numbers, and are kept as arrays."""


BY_JOINT = {"damping": 0.0, "friction": 0.0, "armature": 0.0, "effort_limits": math.inf}
"""Fields that may be given as numbers by joint, and the value of the joints that are not named."""


class Difference(NamedTuple):
    """A field in which two scenarios differ, and the two values."""

    field: str
    """Its name; for a field inside another field with a dot, as in ``noise.seed``."""
    ours: Any
    theirs: Any


@dataclass(frozen=True, eq=False, repr=False)
class Scenario:
    """Complete description of one simulation, which `dynx.simulate` and `dynx.simulate_batch` run and a
    record contains.

    The fields are the arguments of `dynx.simulate`, which documents them. Two scenarios are equal if all
    fields are, element by element, with the defaults filled in. ``dataclasses.replace`` changes one field;
    `to_json` and `from_json` keep every bit. A field is checked when a simulation is made of it.
    """

    model: Model
    """The robot as the controller knows it."""
    controller: Controller[Any] | Unknown | None = None
    """None for a robot without motors; `Unknown` only in a scenario that was read from a file."""
    reference: Trajectory | ArrayLike | Unknown | None = None
    _: KW_ONLY
    plant: str | ScenePlant = DEFAULT_ENGINE
    integrator: str | None = None
    substeps: int = 1
    method: str = "DOP853"
    rtol: float = 1e-10
    atol: float = 1e-12
    dt: float = 1e-3
    """Step of the record [s]."""
    duration: float | None = None
    """Time to simulate [s], rounded up to a multiple of `dt`; by default the duration of the reference. A
    `Simulation` does not need it."""
    control_dt: float | None = None
    """Step of the controller [s]; by default `dt`."""
    delay: float = 0.0
    """Age of a measurement [s]."""
    q0: ArrayLike | None = None
    v0: ArrayLike | None = None
    noise: Noise | None = None
    damping: Coefficients = False
    friction: Coefficients = False
    friction_slip: float = 0.0
    armature: Coefficients = False
    effort_limits: Coefficients = False
    position_limits: bool = False
    payload: Payload | Sequence[Payload] | None = None
    mass_scale: MassScale = 1.0
    pushes: Push | Sequence[Push] = ()
    check_reference: bool = True

    def __post_init__(self) -> None:
        refuse_other_than_model(self.model)
        if not isinstance(self.controller, Unknown | None):
            refuse_other_than_controller("controller", self.controller)
        if isinstance(self.reference, str) or (
            callable(self.reference) and not isinstance(self.reference, Trajectory)
        ):
            raise ArgumentError(
                f"reference is {shown(self.reference)}; wanted a trajectory of dynx.trajectory, one "
                "configuration to hold, or None"
            )
        for name in ("position_limits", "check_reference"):
            if not isinstance(getattr(self, name), bool | np.bool_):
                raise ArgumentError(f"{name} is {shown(getattr(self, name))}; wanted True or False")
        if not isinstance(self.integrator, str | None):
            raise ArgumentError(f"integrator is {shown(self.integrator)}; wanted the name of one, or None")
        if self.effort_limits is None:
            raise ArgumentError("effort_limits is None; wanted True (those of the model), False or numbers")
        if isinstance(self.plant, ScenePlant):
            self.plant.require_model(self.model)
            if self.position_limits:
                raise ArgumentError(
                    "position_limits are the stops of dynx; a plant in a scene has those of its engine, by "
                    "ScenePlant(joint_limits=True)"
                )
        elif not isinstance(self.plant, str):
            raise ArgumentError(
                f"plant is of type {type(self.plant).__name__}; wanted the name of a plant or a ScenePlant"
            )
        if not isinstance(self.noise, Noise | Unknown | None):
            raise ArgumentError(f"noise is {shown(self.noise)}; wanted a dynx.Noise, as in Noise(v=1e-3)")
        for name in NUMBERS:
            value = getattr(self, name)
            if name in BY_JOINT:
                value = coefficients_by_joint(self.model, name, value, BY_JOINT[name])
            refuse_mask(name, value)
            object.__setattr__(self, name, _as_array(value))
        payload = () if self.payload is None else self.payload
        kinds: dict[str, tuple[Any, type]] = {"payload": (payload, Payload), "pushes": (self.pushes, Push)}
        for name, (given, kind) in kinds.items():
            parts = tuple(given) if isinstance(given, Iterable) else (given,)
            if not all(isinstance(each, kind | Unknown) for each in parts):
                raise ArgumentError(f"{name} is {shown(given)}; wanted a {kind.__name__}, or a list of them")
            object.__setattr__(self, name, parts)
        if isinstance(self.mass_scale, Mapping):
            by_name = sorted(self.mass_scale.items(), key=lambda entry: str(entry[0]))
            object.__setattr__(self, "mass_scale", dict(by_name))

    @property
    def payloads(self) -> tuple[Payload, ...]:
        """All payloads of the plant."""
        return tuple(self.payload) if isinstance(self.payload, tuple) else ()

    @property
    def all_pushes(self) -> tuple[Push, ...]:
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
            pair = encode(mine, self.model), encode(its, other.model)
            found += _differences(name, *pair)
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
        for each in fields(self):
            value = getattr(self, each.name)
            default = () if each.name == "payload" else each.default
            if each.name != "model" and not _same(encode(value, self.model), encode(default, self.model)):
                shown_fields.append(f"{each.name}={value}")
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
    def from_dict(cls, document: Mapping[str, Document]) -> Scenario:
        """Return the scenario of a document. Raises ArgumentError for a document of another layout."""
        if not isinstance(document, Mapping) or document.get("schema") != SCHEMA:
            raise ArgumentError(f"a scenario's document has schema {SCHEMA!r}; this one does not")
        given = {name: value for name, value in document.items() if name != "schema"}
        names = field_names()
        for name in given:
            if name not in names:
                raise ArgumentError(f"a scenario has no field {shown(name)}{nearest(name, names)}")
        if "model" not in given:
            raise ArgumentError("the scenario's document has no model")
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
        except Exception as error:
            raise ArgumentError(f"the scenario's document has a part of a wrong type: {error}") from error
        return scenario

    def to_json(self) -> str:
        """Return `to_dict` as text."""
        return json.dumps(self.to_dict(), indent=1)

    @classmethod
    def from_json(cls, text: str) -> Scenario:
        """Return the scenario of a text that `to_json` wrote. Raises ArgumentError for any other text."""
        try:
            document = json.loads(text)
        except (TypeError, ValueError, RecursionError) as error:
            raise ArgumentError(f"the text is not JSON: {error}") from error
        return cls.from_dict(document)


def field_names() -> tuple[str, ...]:
    """Return the names of all fields of a scenario."""
    return tuple(each.name for each in fields(Scenario))


def _simulated(duration: float | None, dt: float) -> float | None:
    """Return `duration` rounded up to a multiple of `dt`; unchanged if it is one, or if a time is invalid."""
    if duration is None:
        return None
    try:
        simulated = Clock.of(dt, duration, None, 0.0).duration
    except (ArgumentError, OverflowError):
        return duration
    return duration if abs(simulated - duration) <= TIME_ROUNDING * simulated else simulated


def _as_array(value: Any) -> Any:
    """Convert lists of numbers to a read-only array; return anything else unchanged."""
    if not isinstance(value, list | tuple | np.ndarray):
        return value
    try:
        array = np.array(value)
    except ValueError:
        return value
    if array.dtype.kind in "iuf":
        array = array.astype(np.float64)
    array.setflags(write=False)
    return array


def _differences(name: str, ours: Document, theirs: Document) -> list[Difference]:
    """Yield the innermost entries in which two documents differ."""
    if _same(ours, theirs):
        return []
    one, other = _parts_of(ours), _parts_of(theirs)
    if one is None or other is None or one.keys() != other.keys():
        return [Difference(name, ours, theirs)]
    inner = [found for key in one for found in _differences(f"{name}.{key}", one[key], other[key])]
    return inner or [Difference(name, ours, theirs)]


def _parts_of(document: Document) -> dict[str, Document] | None:
    """Return the parts of an object's document by name, with the same names for all objects of a class;
    None for a document that is not of an object."""
    if not isinstance(document, dict):
        return None
    code = {"code of the class": document[CODE]} if CODE in document else {}
    if CLASS in document:
        return {f"class {document[CLASS]}": True, **document["fields"], **code}
    if isinstance(document.get(CONTROLLER), str):
        # A controller inside another one has its model, and no entry for it.
        return {f"class {document[CONTROLLER]}": True, **arguments_of(document)}
    if CONTROLLER in document:
        kind = document[CONTROLLER][CONTROLLER]
        return {f"class {kind}": True, MODEL: document.get(MODEL), **arguments_of(document), **code}
    if FINGERPRINT in document:
        return {f"class {document[FINGERPRINT]}": True, **document.get(CONTROLLER_NUMBERS, {}), **code}
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
