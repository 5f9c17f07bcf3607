"""Scenarios from the keyword arguments of `dynx.simulate` and `dynx.simulate_batch`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from dynx.control.base import Controller
from dynx.errors import ArgumentError, shown
from dynx.model import Model
from dynx.sim.scenario.scenario import Scenario


def scenario_of(model: Model | Scenario, controller_backend: str | None, given: dict[str, Any]) -> Scenario:
    """Return the scenario of keyword arguments, or the scenario given instead of a model.

    Raises ArgumentError if an argument is given that is a field of the given scenario.
    """
    if isinstance(model, Scenario):
        refuse_beside_scenario({**given, "controller_backend": controller_backend})
        return model
    controller = given["controller"]
    if controller_backend is not None and isinstance(controller, Controller):
        given = {**given, "controller": controller.on(controller_backend)}
    if not isinstance(model, Model):
        raise ArgumentError(f"model is {shown(model)}; wanted a Model or a Scenario")
    return Scenario(model, **given)


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
