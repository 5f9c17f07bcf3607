"""Scenarios from the keyword arguments of `dynx.simulate` and `dynx.simulate_batch`."""

from __future__ import annotations

import os
from collections.abc import Mapping
from typing import Any

from dynx.backends.registry import backend_class
from dynx.control.base import Controller
from dynx.errors import ArgumentError
from dynx.model import Model
from dynx.model.loading import load
from dynx.model.package_paths import StrPath
from dynx.sim.scenario.scenario import Scenario


def scenario_of(
    model: Model | Scenario | StrPath, controller_backend: str | None, given: dict[str, Any]
) -> Scenario:
    """Return the scenario of keyword arguments, or the scenario given instead of a model.

    The model may be whatever `dynx.load` takes. Raises ArgumentError if an argument is given that is a field
    of the given scenario.
    """
    if isinstance(model, Scenario):
        refuse_beside_scenario({**given, "controller_backend": controller_backend})
        return model
    controller = given["controller"]
    if controller_backend is not None and isinstance(controller, Controller):
        if isinstance(controller_backend, str):
            backend_class(controller_backend)
        given = {**given, "controller": controller.on(controller_backend)}
    if not isinstance(model, Model | str | os.PathLike):
        kind = type(model).__name__
        raise ArgumentError(f"model is of type {kind}; wanted a Model, a Scenario, or a robot's name or file")
    return Scenario(load(model), **given)


def refuse_beside_scenario(given: Mapping[str, Any]) -> None:
    """Raise ArgumentError for an argument that is also a field of the given scenario."""
    for name, value in given.items():
        known = Scenario.__dataclass_fields__.get(name)
        default = None if known is None else known.default
        plain = type(value) is type(default) and isinstance(value, str | float | int | tuple)
        if value is not default and not (plain and value == default):
            raise ArgumentError(
                f"{name} is given in addition to a scenario, which has a field "
                "of that name: change it by dataclasses.replace"
            )
