"""Parts of a scenario as JSON documents, and back: exact to the last bit.

Numbers, text, lists and arrays are written as they are; an array that is not float64 also has its dtype. A
registered controller is written as its name and the arguments of its constructor, a dataclass or named tuple
as its class and its fields. An object of any other class is written as a fingerprint alone: it can be
compared but not rebuilt. The code of a class that is not part of dynx is not compared, which its document
states: whoever changes the class changes what the scenario does.
"""

from __future__ import annotations

import importlib
import json
import math
import sys
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, fields
from hashlib import sha256
from types import CellType, CodeType, FunctionType
from typing import Any

import numpy as np

from dynx.backends import Backend
from dynx.control.base import Controller, chain_of
from dynx.control.content import attributes_of, entered, is_foreign
from dynx.control.registry import from_document, to_document
from dynx.errors import ArgumentError, DynxError, UnknownNameError, shown
from dynx.model import Model
from dynx.model.documents import robot_document, robot_from_document
from dynx.sim.controller_checks import controller_numbers
from dynx.trajectory.base import Trajectory
from dynx.world import Scene

MAX_WORDS_LENGTH = 80
"""Largest number of characters of a value in a message."""

JSON_KINDS = "biufU"
"""Kinds of NumPy's types whose elements JSON can hold."""

Document = Any
"""Value that `json.dumps` accepts."""

FINGERPRINT, CLASS, MODEL, ARRAY, CONTROLLER = "fingerprint", "class", "model", "array", "controller"
SCENE, SENSOR = "scene", "sensor"

_ROOMS_ABOVE = frozenset(
    ("__main__", "agreement", "bench", "cli", "contacts", "doctor", "rules", "testing", "training", "viewer")
)
"""Rooms of dynx that no part of a scenario is from, and which a file does not import."""

REGISTRATION = (
    "a controller of your own is rebuilt if its class is a frozen dataclass with a name, which an entry "
    "point in the group dynx.controllers or dynx.control.register_controller gives it"
)
"""Condition on the class of a controller, for messages."""

NUMBERS = "numbers"
"""Entry for the public numbers of a controller that is written as a fingerprint."""

CODE, DURATION = "code", "duration"
"""Entries for a class that is not of dynx: that its code is not checked, and the duration of a trajectory."""

NOT_CHECKED = "not checked"
"""Value of `CODE`; files of dynx's first versions have a checksum of bytecode, which is ignored."""

SAME_MODEL = {MODEL: "of the scenario"}
"""Value that represents the scenario's model inside its controller or reference."""


_FORMS: dict[str, dict[str, type]] = {
    FINGERPRINT: {FINGERPRINT: str, "sha256": str},
    CLASS: {CLASS: str, "fields": dict},
}
"""Types of the entries of an object's document, by the entry that marks it."""


@dataclass(frozen=True)
class Unknown:
    """A controller or a reference from a scenario file that cannot be rebuilt in this program."""

    name: str
    """Name of its class."""
    text: str
    """Its document as JSON."""

    def __post_init__(self) -> None:
        # Numbers of a wrong type raise their errors here, where the document is read.
        _ = self.numbers, self.duration

    @property
    def numbers(self) -> dict[str, Any]:
        """Public numbers of a controller, such as gains."""
        return dict(json.loads(self.text).get(NUMBERS, {}))

    @property
    def duration(self) -> float | None:
        """Duration of a trajectory [s]; None for anything else."""
        seconds = json.loads(self.text).get(DURATION)
        return None if seconds is None else float(seconds)

    @property
    def why(self) -> str:
        """Reason why it cannot be rebuilt, and what the class lacks."""
        document = json.loads(self.text)
        if CONTROLLER in document:
            return f"no controller {shown(self.name)} is registered here: {REGISTRATION}"
        if FINGERPRINT in document and NUMBERS in document:
            return f"the file has only its fingerprint, because its class is not registered: {REGISTRATION}"
        if FINGERPRINT in document:
            return (
                "the file has only its fingerprint, because its class is not a frozen dataclass, or its "
                "objects have more than the fields: a class of your own that is to be rebuilt is one"
            )
        return "its class does not exist here: import its module first"


def encode(value: Any, model: Model | None = None) -> Document:
    """Convert `value` to a document; `model` is the model of its scenario."""
    if value is None or isinstance(value, bool | str):
        return value
    if isinstance(value, np.generic):
        return encode(value.item(), model)
    if isinstance(value, int):
        return value
    if isinstance(value, float):
        return value if math.isfinite(value) else {"float": repr(value)}
    if isinstance(value, np.ndarray) and value.dtype.kind in JSON_KINDS:
        return _array(value)
    if isinstance(value, Model):
        if model is not None and value == model:
            return SAME_MODEL
        return {MODEL: robot_document(value)}
    if isinstance(value, Backend) and (model is None or value.model == model):
        return value.name
    if isinstance(value, Unknown):
        return json.loads(value.text)
    if isinstance(value, Scene):
        from dynx.world.scene.documents import scene_document

        return {SCENE: scene_document(value)}
    if _is_sensor(value):
        from dynx.world.scene.documents import document_of_sensor

        return {SENSOR: document_of_sensor(value)}
    if isinstance(value, Controller):
        document = _controller(value, model)
        if document is not None:
            return document | _code_of(value)
    elif isinstance(value, tuple) and hasattr(value, "_fields"):
        return _object(value, dict(zip(value._fields, value, strict=True)), model)
    elif isinstance(value, list | tuple):
        return [encode(each, model) for each in value]
    elif isinstance(value, Mapping):
        return {"mapping": [[encode(key, model), encode(each, model)] for key, each in value.items()]}
    elif _is_declared(value):
        given = {each.name: getattr(value, each.name) for each in fields(value) if each.init}
        return _object(value, given, model)
    document = {FINGERPRINT: _name_of(type(value)), "sha256": _fingerprint(value, model)}
    numbers = {NUMBERS: controller_numbers(value)} if isinstance(value, Controller) else {}
    return document | numbers | _code_of(value)


DAMAGED = (
    *(DynxError, TypeError, ValueError, LookupError, AttributeError, ArithmeticError),
    *(ImportError, RecursionError),
)
"""Errors of reading a damaged document: of its forms, of constructors, and of parts of wrong types.

Others are defects of dynx, or come from a class of the user's own, and pass."""


def decode(document: Document, model: Model | None = None) -> Any:
    """Return the value of a document that `encode` made; `Unknown` for an object that cannot be rebuilt here.

    Classes are looked up in modules that are already imported and in the rooms of dynx whose objects a
    scenario has; a file imports nothing else.
    Raises ArgumentError for a document of another form.
    """
    try:
        _require_forms(document)
        return _decoded(document, model)
    except DAMAGED as error:
        text = shown(document)
        raise ArgumentError(f"a part of the scenario cannot be read: {error}; it is {text}") from error


def in_words(document: Document) -> str:
    """Describe a document in a few words, for a message."""
    if isinstance(document, dict):
        if FINGERPRINT in document:
            return f"{document[FINGERPRINT].rpartition(':')[2]} (fingerprint {document['sha256'][:8]})"
        if CLASS in document:
            inside = ", ".join(f"{name} {in_words(each)}" for name, each in document["fields"].items())
            return f"{document[CLASS].rpartition(':')[2]}({inside})"
        if CONTROLLER in document:
            inner = document[CONTROLLER]
            name = inner if isinstance(inner, str) else inner[CONTROLLER]
            given = ", ".join(f"{key} {in_words(each)}" for key, each in arguments_of(document).items())
            return f"{name}({given})"
        if document == SAME_MODEL or MODEL in document:
            return "of the scenario's model" if document == SAME_MODEL else "of another model"
        if SENSOR in document:
            return f"the sensor {shown(document[SENSOR].get('name', ''))}"
        if SCENE in document:
            return f"the scene {shown(document[SCENE].get('name', 'scene'))}"
        for kind in (ARRAY, "float", "mapping"):
            document = document.get(kind, document) if isinstance(document, dict) else document
    if isinstance(document, str):
        return shown(document)
    text = str(document)
    if len(text) <= MAX_WORDS_LENGTH:
        return text
    return f"{text[:MAX_WORDS_LENGTH]}..." + (
        f" ({len(document)} entries)" if isinstance(document, list) else ""
    )


def arguments_of(document: Document) -> dict[str, Document]:
    """Return the arguments in the document of a registered controller, or of one inside another."""
    inside = isinstance(document[CONTROLLER], str)
    given = document if inside else document[CONTROLLER]
    return {name: each for name, each in given.items() if name != CONTROLLER}


def _decoded(document: Document, model: Model | None) -> Any:
    if isinstance(document, list):
        return tuple(_decoded(each, model) for each in document)
    if not isinstance(document, dict):
        return document
    if "float" in document:
        return float(document["float"])
    if ARRAY in document:
        array = np.array(_with_infinities(document[ARRAY]), dtype=document.get("dtype", "float64"))
        array = array.reshape(document["shape"]) if "shape" in document else array
        array.setflags(write=False)
        return array
    if "mapping" in document:
        return {_decoded(key, model): _decoded(each, model) for key, each in document["mapping"]}
    if CODE in document:
        document = document | {CODE: NOT_CHECKED}
    if CONTROLLER in document:
        name = str(document[CONTROLLER]["controller"])
        try:
            return from_document(_decoded(document[MODEL], model), document[CONTROLLER])
        except UnknownNameError:
            return Unknown(name, json.dumps(document))
    if document == SAME_MODEL and model is not None:
        return model
    if SCENE in document:
        from dynx.world.scene.documents import scene_from_document

        return scene_from_document(document[SCENE])
    if SENSOR in document:
        from dynx.world.scene.documents import sensor_of_document

        return sensor_of_document(document[SENSOR])
    if MODEL in document:
        return robot_from_document(document[MODEL])
    if FINGERPRINT in document:
        return Unknown(document[FINGERPRINT].rpartition(":")[2], json.dumps(document))
    kind = _class_of(document[CLASS])
    if kind is Model:
        raise TypeError("a model is written as URDF text")
    if kind is None:
        return Unknown(document[CLASS].rpartition(":")[2], json.dumps(document))
    from dynx.sim.scenario.moved import present_fields

    given = present_fields(document[CLASS], document["fields"])
    return kind(**{name: _decoded(each, model) for name, each in given.items()})


def _require_forms(document: Document) -> None:
    """Raise TypeError if entries of an object in a document have other types than `encode` gives them."""
    if isinstance(document, list | dict):
        for each in document.values() if isinstance(document, dict) else document:
            _require_forms(each)
    if not isinstance(document, dict):
        return
    if not isinstance(document.get(NUMBERS, {}), dict) and FINGERPRINT in document:
        raise TypeError(f"{NUMBERS} is {shown(document[NUMBERS])}; wanted a dict")
    for kind, forms in _FORMS.items():
        for name, form in forms.items() if kind in document else ():
            if not isinstance(document.get(name), form):
                raise TypeError(f"{name} is {shown(document.get(name))}; wanted a {form.__name__}")


def _object(value: Any, given: Mapping[str, Any], model: Model | None) -> Document:
    written = {name: encode(each, model) for name, each in given.items()}
    return {CLASS: _name_of(type(value)), "fields": written} | _code_of(value)


def _code_of(value: Any) -> dict[str, Document]:
    """Return the note on the code of a foreign class, and a trajectory's duration; empty for dynx's own."""
    if not is_foreign(type(value)):
        return {}
    duration = {DURATION: float(value.duration)} if isinstance(value, Trajectory) else {}
    return {CODE: NOT_CHECKED, **duration}


def _array(array: np.ndarray[Any, Any]) -> Document:
    document: dict[str, Any] = {ARRAY: _without_infinities(array.tolist())}
    if array.dtype != np.float64:
        document["dtype"] = array.dtype.str
    if not array.size:
        document["shape"] = list(array.shape)
    return document


def _without_infinities(entry: Any) -> Any:
    """Replace the numbers that JSON does not have by text."""
    if isinstance(entry, list):
        return [_without_infinities(each) for each in entry]
    return repr(entry) if isinstance(entry, float) and not math.isfinite(entry) else entry


def _with_infinities(entry: Any) -> Any:
    if isinstance(entry, list):
        return [_with_infinities(each) for each in entry]
    return float(entry) if isinstance(entry, str) else entry


def _is_declared(value: Any) -> bool:
    """Check whether the class of `value` is itself a dataclass, and `value` has only its fields."""
    if "__dataclass_fields__" not in vars(type(value)):
        return False
    return set(getattr(value, "__dict__", ())) <= {each.name for each in fields(value)}


def _is_sensor(value: object) -> bool:
    # A sensor exists only where its module is imported, which most scenarios do not need.
    module = sys.modules.get("dynx.world.sensors.sensor")
    return module is not None and isinstance(value, module.Sensor)


def _controller(controller: Controller[Any], model: Model | None) -> Document | None:
    """Convert a registered controller to a document; return None for any other controller."""
    if any(each.model != controller.model for each in chain_of(controller)):
        return None
    try:
        return {CONTROLLER: to_document(controller), MODEL: encode(controller.model, model)}
    except ArgumentError:
        return None


def _name_of(kind: type) -> str:
    return f"{kind.__module__}:{kind.__qualname__}"


def _class_of(name: str) -> Any:
    """Return the class of that name in dynx or a module that is already imported; None without one.

    Only the module that defines a class has it, not one that imports it.
    """
    # Imported here, because most simulations read no document.
    from dynx.sim.scenario.moved import present_name

    module, _, path = present_name(name).partition(":")
    package, *rooms = module.split(".")
    if package == "dynx" and not _ROOMS_ABOVE & {*rooms[:1]}:
        importlib.import_module(module)
    found: Any = sys.modules.get(module)
    for part in path.split("."):
        found = getattr(found, part, None)
    allowed = (
        isinstance(found, type)
        and found.__module__ == module
        and (
            "__dataclass_fields__" in vars(found) or (issubclass(found, tuple) and hasattr(found, "_fields"))
        )
    )
    return found if allowed else None


def _fingerprint(value: Any, model: Model | None) -> str:
    """Return the checksum of the parts of an object, and of the objects in it."""
    with entered(value) as place:
        if place is not None:
            return f"see {place}"
        parts = [json.dumps(encode(part, model), sort_keys=True) for part in _parts(value)]
    # The order of a set changes from process to process.
    parts = sorted(parts) if isinstance(value, set | frozenset) else parts
    return sha256(json.dumps(parts).encode()).hexdigest()


def _parts(value: Any) -> Iterable[Any]:
    """Return the name, code, defaults and closure of a function; for any other object, all that a copy of it
    gets."""
    if isinstance(value, set | frozenset):
        return value
    if isinstance(value, bytes):
        return [value.hex()]
    if isinstance(value, type):
        return [_name_of(value)]
    if isinstance(value, Backend):
        return [value.name, value.model]
    if isinstance(value, FunctionType):
        name = f"{value.__module__}:{value.__qualname__}"
        # A cell is empty until the enclosing function assigns its variable.
        enclosed = [cell.cell_contents for cell in value.__closure__ or () if cell != CellType()]
        # Functions of one place, such as lambdas, have equal names.
        constants = [each for each in value.__code__.co_consts if not isinstance(each, CodeType)]
        code = [value.__code__.co_code.hex(), value.__code__.co_names, constants]
        return [name, *code, value.__defaults__, value.__kwdefaults__, enclosed]
    try:
        attributes = attributes_of(value)
        reduced = value.__reduce_ex__(2)
    except TypeError:
        # An object that cannot be copied is represented by its class, and by its name if it has one, as
        # ufuncs do.
        return [getattr(value, "__name__", None)]
    if isinstance(reduced, str):
        return [reduced]
    arguments, state, entries, items = [*reduced, None, None, None][1:5]
    states = state if isinstance(state, tuple) else (state,)
    hidden = [part for part in states if not isinstance(part, Mapping)]
    return [arguments, hidden, list(entries or ()), list(items or ()), *sorted(attributes.items())]
