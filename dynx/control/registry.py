"""Controllers by name, and as documents that JSON can hold.

The classes of dynx have their own names; a program registers others, and installed packages offer theirs by
entry points in the group ``dynx.controllers`` (`dynx.registry`).
"""

from __future__ import annotations

from collections.abc import Mapping
from importlib import import_module
from inspect import isabstract
from pathlib import Path
from pkgutil import iter_modules
from typing import Any

import numpy as np

from dynx.argument_types import checks_types
from dynx.backends import Backend, backend_class
from dynx.control.base import Controller
from dynx.control.content import attributes_of, fields_of
from dynx.errors import ArgumentError, UnknownNameError, shown
from dynx.model import Model
from dynx.registry import ClassRegistry

GROUP = "dynx.controllers"
"""The entry-point group: ``name = "package.module:ControllerClass"``."""


def _own_controllers() -> dict[str, str]:
    """Return the entries of the controllers in the modules beside this one."""
    beside = iter_modules([str(Path(__file__).parent)])
    modules = (name for _, name, is_package in beside if name != "registry" and not is_package)
    members = (each for name in modules for each in vars(import_module(f"dynx.control.{name}")).values())
    # `isinstance(each, type)` would not do, because it is true in Python 3.10 for aliases such as
    # Callable[..., float].
    kinds = [each for each in members if type(each) is type(Controller) and issubclass(each, Controller)]
    return {kind.__name__: f"{kind.__module__}:{kind.__name__}" for kind in kinds if not isabstract(kind)}


FORMER_NAMES = {
    "PDMotor": "BulletPDMotor",
    "PositionMotor": "BulletPositionMotor",
    "TorqueMotor": "BulletTorqueMotor",
    "VelocityMotor": "BulletVelocityMotor",
}
"""Names in documents of dynx's first versions."""

BUILT_IN = _own_controllers()
"""Controllers of dynx itself."""

_classes: ClassRegistry[Controller[Any]] = ClassRegistry(
    "controller", GROUP, BUILT_IN, lambda: Controller, error=ArgumentError, unknown=UnknownNameError
)
controller_names = _classes.names
controller_class = _classes.find
register = _classes.register
unregister = _classes.unregister


@checks_types
def to_document(controller: Controller[Any]) -> dict[str, Any]:
    """Return the name of a controller's class and its constructor arguments, in types that JSON has.

    The model is not included. Numbers that are not finite are strings, such as "inf". Raises ArgumentError
    for a class that is not a registered dataclass, and for an argument that cannot be written.
    """
    kind, known = type(controller), fields_of(controller)
    names = controller_names() if kind.__name__ not in BUILT_IN else (kind.__name__, *controller_names())
    name = next((name for name in names if controller_class(name) is kind), None)
    if name is None or not attributes_of(controller).keys() <= known.keys():
        raise ArgumentError(
            f"{kind.__name__} cannot be written: wanted a frozen dataclass that is registered as a controller"
        )
    arguments = {
        each.metadata.get("argument") or field: _written(kind, field, getattr(controller, field))
        for field, each in known.items()
        if each.init and field != "model"
    }
    return {"controller": name, **arguments}


@checks_types
def from_document(model: Model, document: Mapping[str, Any]) -> Controller[Any]:
    """Return the controller of `model` that `controller_to_document` wrote. Raises ArgumentError for other
    documents."""
    if "controller" not in document:
        raise ArgumentError(f"document is {shown(document)}, which lacks the name of its controller")
    arguments = {name: _read(model, value) for name, value in document.items() if name != "controller"}
    name = document["controller"]
    kind = controller_class(FORMER_NAMES.get(name, name) if isinstance(name, str) else name)
    known = getattr(kind, "__dataclass_fields__", {})
    if "model" in known and known["model"].init:
        arguments["model"] = model
    try:
        return kind(**arguments)
    except TypeError as error:
        raise ArgumentError(f"the document of a {kind.__name__} is invalid: {error}") from None


def _written(kind: type, name: str, value: Any) -> Any:
    if isinstance(value, Controller):
        return to_document(value)
    if isinstance(value, Backend) and backend_class(value.name) is type(value):
        return value.name
    if isinstance(value, np.ndarray | np.generic):
        value = value.tolist()
    if isinstance(value, list | tuple):
        return [_written(kind, name, entry) for entry in value]
    if isinstance(value, float) and not np.isfinite(value):
        return str(value)
    if value is None or isinstance(value, bool | int | float | str):
        return value
    raise ArgumentError(f"{name} of {kind.__name__} cannot be written: {shown(value)}")


def _read(model: Model, value: Any) -> Any:
    if isinstance(value, Mapping):
        return from_document(model, value)
    if isinstance(value, list):
        return np.array(value, dtype=np.float64)
    return float(value) if isinstance(value, str) and value in ("inf", "-inf", "nan") else value
