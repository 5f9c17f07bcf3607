"""Main settings of a scenario, as numbers and text for reports and recordings."""

from __future__ import annotations

from typing import Any

from dynx.control.base import Controller
from dynx.sim.loop.controller_checks import controller_numbers
from dynx.sim.plants.model_error import plant_model
from dynx.sim.scenario.documents import Unknown
from dynx.sim.scenario.scenario import Scenario
from dynx.sim.setup import clock_of, disturbances_of, effort_limits_of, refuse_unknown


def settings_of(scenario: Scenario) -> dict[str, Any]:
    """Return plant, controller, times, limits, friction, noise and pushes of a scenario, fit for JSON."""
    refuse_unknown(*scenario.payloads, *scenario.all_pushes)
    controller, clock, limit = scenario.controller, clock_of(scenario), effort_limits_of(scenario)
    moved = plant_model(scenario.model, scenario.payloads, scenario.mass_scale)
    disturbances = disturbances_of(scenario, moved)
    friction = disturbances.friction
    return {
        "plant": str(scenario.plant),
        "integrator": scenario.with_defaults().integrator,
        "controller": "none" if controller is None else controller.name,
        "law": _numbers(controller),
        "dt": clock.dt,
        "control_dt": clock.control_dt,
        "delay": clock.delay_steps * clock.dt,
        "substeps": scenario.substeps,
        "effort_limits": None if limit is None else limit.tolist(),
        "position_limits": scenario.position_limits,
        "joints": {
            "damping": friction.damping.tolist(),
            "friction": friction.friction.tolist(),
            "slip": friction.slip,
        },
        "noise": None if scenario.noise is None else repr(scenario.noise),
        "pushes": [repr(push) for push in disturbances.pushes],
    }


def _numbers(controller: Controller[Any] | Unknown | None) -> dict[str, Any]:
    if isinstance(controller, Unknown):
        return controller.numbers
    return {} if controller is None else controller_numbers(controller)
