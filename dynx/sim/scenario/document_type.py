"""Keys and types of a scenario's document, from which its JSON Schema is generated.

Objects inside have one of the forms that `dynx.sim.scenario.documents` describes.
"""

from __future__ import annotations

from typing import Any, Literal, TypedDict

Numbers = bool | float | list[Any] | dict[str, Any] | None
"""One number, an array, or true for the values of the URDF."""


class ScenarioDocument(TypedDict):
    """One simulation; the keys are the arguments of `dynx.simulate`."""

    schema: Literal["dynx.scenario/1"]
    model: dict[str, Any]
    controller: dict[str, Any] | None
    reference: list[Any] | dict[str, Any] | None
    plant: str | dict[str, Any]
    integrator: str | None
    substeps: int
    method: str
    rtol: float
    atol: float
    dt: float
    duration: float | None
    control_dt: float | None
    delay: float
    q0: Numbers
    v0: Numbers
    noise: dict[str, Any] | None
    damping: Numbers
    friction: Numbers
    friction_slip: float
    armature: Numbers
    effort_limits: Numbers
    position_limits: bool
    payload: list[dict[str, Any]]
    mass_scale: float | dict[str, Any]
    pushes: list[dict[str, Any]]
    check_reference: bool
