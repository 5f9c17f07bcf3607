"""Checks of a controller before and while it is simulated, and its numbers for the record."""

from __future__ import annotations

from hashlib import sha256
from typing import Any

import numpy as np

from dynx.backends import Backend
from dynx.control.base import Controller, chain_of
from dynx.control.content import attributes_of
from dynx.errors import ArgumentError, shown
from dynx.model import Model
from dynx.sim.clock import WHOLE, Clock

MAX_LISTED_NUMBERS = 64
"""Size of the largest array that a record lists; it keeps a checksum of a larger one."""


def check_controller(model: Model, controller: Controller[Any], clock: Clock) -> None:
    """Refuse a controller of another robot, or made for another control step, by an ArgumentError."""
    known = getattr(controller, "model", None)
    if not isinstance(known, Model):
        raise ArgumentError(
            f"{controller.name} has no model; a controller sets self.model to the robot it is for"
        )
    if (known.joint_names, known.base) != (model.joint_names, model.base):
        raise ArgumentError(
            f"the controller is one of {shown(known)}, whose joints are not those of {shown(model)}"
        )
    made_for = controller.control_dt
    if made_for is not None and abs(made_for - clock.control_dt) > WHOLE * clock.control_dt:
        raise ArgumentError(
            f"{controller.name} was made for control_dt = {made_for:.12g} s; it is {clock.control_dt:.12g} s"
        )


def controller_numbers(controller: Controller[Any]) -> dict[str, Any]:
    """Public numbers of a controller and of its inner one, such as gains, in types that JSON has."""
    found: dict[str, Any] = {}
    for name, value in sorted(attributes_of(controller).items()):
        if name.startswith("_"):
            continue
        if isinstance(value, Controller):
            found[name] = {"law": value.name, **controller_numbers(value)}
        elif isinstance(value, np.ndarray) and value.dtype.kind in "biuf":
            digest = sha256(np.ascontiguousarray(value).tobytes())
            found[name] = (
                value.tolist() if value.size <= MAX_LISTED_NUMBERS else f"sha256 {digest.hexdigest()}"
            )
        elif isinstance(value, Backend):
            found[name] = value.name
        elif value is None or isinstance(value, bool | int | float | str):
            found[name] = value
    return found


def is_row(state: Any) -> bool:
    """Whether a controller's state is an array (n,) of float64, which kernels need."""
    return isinstance(state, np.ndarray) and state.dtype == np.float64 and state.ndim == 1


class Unchanged:
    """Detects a controller that changes itself, and so hides its state."""

    def __init__(self, controller: Controller[Any]) -> None:
        self._before = [(each, _copied(attributes_of(each))) for each in chain_of(controller)]

    @property
    def changed(self) -> str | None:
        """The controller and its attribute that changed, if there is one."""
        for each, before in self._before:
            for name, now in attributes_of(each).items():
                if name not in before or not _same(before[name], now):
                    return f"{each.name} changes itself (attribute {name}) when its torque is evaluated"
        return None


def _copied(attributes: dict[str, Any]) -> dict[str, Any]:
    return {
        name: value.copy() if isinstance(value, np.ndarray | list | dict | set) else value
        for name, value in attributes.items()
    }


def _same(before: Any, now: Any) -> bool:
    if isinstance(now, np.ndarray) and isinstance(before, np.ndarray):
        return before.dtype == now.dtype and before.tobytes() == now.tobytes()
    if isinstance(now, list | dict | set):
        return type(before) is type(now) and repr(before) == repr(now)
    return before is now or (isinstance(now, int | float | str) and bool(before == now))
