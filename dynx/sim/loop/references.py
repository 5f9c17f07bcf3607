"""References of a controller, checked, and their setpoints at all control steps."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from dynx.control.base import Controller
from dynx.errors import ArgumentError, LimitError, LimitViolation
from dynx.model import Model
from dynx.model.configuration import checked_q
from dynx.spatial.scalar import Floats
from dynx.steppers.clock import Clock
from dynx.trajectory.base import Setpoint, Trajectory
from dynx.trajectory.limit_check import check

UNCHECKED = "check_reference=False simulates it nevertheless"
"""Advice in the errors of limits."""

SetpointOf = Callable[[Floats], Setpoint]
"""From times (n,) to setpoints (n, nq), (n, nv), (n, nv)."""


def checked_reference(model: Model, reference: Any, *, within_limits: bool) -> SetpointOf | None:
    """Return `reference` as a function of time; None stays None.

    Raises ArgumentError for the reference of another robot, and LimitError (if `within_limits`) where it
    violates position or velocity limits of the model.
    """
    if reference is None:
        return None
    if not isinstance(reference, Trajectory):
        return _held(model, reference, within_limits)
    if (reference.nq, reference.nv) != (model.nq, model.nv):
        raise ArgumentError(
            f"the reference has nq {reference.nq} and nv {reference.nv}; "
            f"{model.name} has nq {model.nq} and nv {model.nv}"
        )
    if within_limits:
        try:
            check(model, reference, effort=False)
        except LimitError as error:
            raise LimitError(f"{error}\n  ({UNCHECKED})", error.violations) from None
    return reference


def setpoints_of(
    setpoint_of: SetpointOf | None, clock: Clock, controller: Controller[Any] | None
) -> Setpoint:
    """Return the setpoint of every control step, `lead` control steps ahead: (n_controls, ...).

    Raises ArgumentError if there is no reference and the controller needs one.
    """
    n = clock.n_controls
    if controller is None:
        nothing = np.zeros((n, 0))
        return Setpoint(nothing, nothing, nothing)
    if setpoint_of is not None:
        return setpoint_of(clock.control_times(controller.lead))
    if controller.needs_setpoint:
        raise ArgumentError(f"{controller.name} needs a reference: a trajectory, or a configuration to hold")
    model = controller.model
    rest = np.broadcast_to(np.zeros(model.nv), (n, model.nv))
    return Setpoint(np.broadcast_to(model.neutral(), (n, model.nq)), rest, rest)


def _held(model: Model, q: Any, within_limits: bool) -> SetpointOf:
    """Return the reference that stays at the configuration `q`."""
    held = checked_q(model, q, "reference")
    if held.ndim != 1:
        raise ArgumentError(f"reference has shape {held.shape}; wanted a trajectory or ({model.nq},)")
    if within_limits:
        joints = slice(7 if model.floating else 0, None)
        rows = zip(
            model.coordinate_joints, held[joints], model.lower[joints], model.upper[joints], strict=True
        )
        found = [
            LimitViolation(joint.name, "position", 0.0, float(x), float(low if x < low else high), joint.unit)
            for joint, x, low, high in rows
            if not low <= x <= high
        ]
        if found:
            raise LimitError(f"the reference of {model.name} breaks limits: {found[0]} ({UNCHECKED})", found)

    def at(times: Floats) -> Setpoint:
        rest = np.zeros((len(times), model.nv))
        return Setpoint(np.array(np.broadcast_to(held, (len(times), model.nq))), rest, rest)

    return at
