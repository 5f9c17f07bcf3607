"""What a simulation looks at in a controller before it asks it anything."""

from __future__ import annotations

from collections.abc import Iterator
from hashlib import sha256
from typing import Any

import numpy as np

from dynx.control.base import Controller
from dynx.errors import ArgumentError, shown
from dynx.model import Model
from dynx.sim.loop.clock import WHOLE, Clock

LISTED = 64
"""Numbers in one attribute of a law that a record lists; of more it keeps a checksum."""


def check_controller(model: Model, controller: Controller[Any], clock: Clock) -> None:
    """Refuse a controller of another robot, or made for another control step, by an ArgumentError."""
    known = getattr(controller, "model", None)
    if not isinstance(known, Model):
        raise ArgumentError(f"{controller.name} has no model; a law sets self.model to the robot it is for")
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
    """The public numbers of a law and of the law inside it, such as gains, in types that JSON has."""
    found: dict[str, Any] = {}
    for name, value in sorted(vars(controller).items()):
        if name.startswith("_"):
            continue
        if isinstance(value, Controller):
            found[name] = {"law": value.name, **controller_numbers(value)}
        elif isinstance(value, np.ndarray) and value.dtype.kind in "biuf":
            digest = sha256(np.ascontiguousarray(value).tobytes())
            found[name] = value.tolist() if value.size <= LISTED else f"sha256 {digest.hexdigest()}"
        elif value is None or isinstance(value, bool | int | float | str):
            found[name] = value
    return found


def is_row(state: Any) -> bool:
    """Whether what a law remembers is what kernels can: numbers (n,) in float64."""
    return isinstance(state, np.ndarray) and state.dtype == np.float64 and state.ndim == 1


class Unchanged:
    """Watches whether a law changes itself while it is asked, which hides what it remembers."""

    def __init__(self, controller: Controller[Any]) -> None:
        self._before = [(law, _copied(vars(law))) for law in _chain(controller)]

    @property
    def changed(self) -> str | None:
        """The law and the attribute that is not as it was, if there is one."""
        for law, before in self._before:
            for name, now in vars(law).items():
                if name not in before or not _same(before[name], now):
                    return f"{law.name} changes itself (attribute {name}) when it is asked"
        return None


def _chain(controller: Controller[Any]) -> Iterator[Controller[Any]]:
    yield controller
    inner = vars(controller).get("inner")
    if isinstance(inner, Controller):
        yield from _chain(inner)


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
