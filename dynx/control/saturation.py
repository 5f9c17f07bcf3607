"""Motors have limits: torque cut to the model's effort limits, or to others."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from dynx.backends import Backend
from dynx.control.base import Controller, ControllerState, Measurement
from dynx.errors import GainError, LimitError, shown
from dynx.model import Model
from dynx.model.configuration import real_array
from dynx.spatial.scalar import Floats, clamp
from dynx.trajectory.base import Setpoint


class Saturated(Controller[ControllerState]):
    """Another law, its torques cut to what the motors can give.

    `dynx.simulate(..., effort_limits=True)` cuts them in the plant instead, and records where.
    """

    def __init__(self, inner: Controller[ControllerState], *, limit: ArrayLike | None = None) -> None:
        """`limit` [N m or N]: one number or one for each joint, by default the effort limits of the model.

        Raises LimitError for a limit of 0, with which nothing could be done.
        """
        self.inner = inner
        self.model = inner.model
        self.lead, self.control_dt = inner.lead, inner.control_dt
        self.needs_setpoint = inner.needs_setpoint
        self.limit = checked_limit(inner.model, limit)

    def initial_state(self) -> Any:
        """As the inner law starts."""
        return self.inner.initial_state()

    def torque(
        self, measurement: Measurement, setpoint: Setpoint, state: ControllerState
    ) -> tuple[Floats, ControllerState]:
        """The inner law's torque (nv,), within the limits."""
        tau, state = self.inner.torque(measurement, setpoint, state)
        return clamp(tau, self.limit), state

    def on(self, engine: str | Backend) -> Saturated[ControllerState]:
        """The same with the inner law on another backend."""
        return Saturated(self.inner.on(engine), limit=self.limit)

    @property
    def name(self) -> str:
        """That of the law, and that it is cut."""
        return f"{self.inner.name}, saturated"


def checked_limit(model: Model, limit: ArrayLike | None) -> Floats:
    """Effort limits (nv,): the model's, or one number or one for each joint; LimitError where one is 0.

    Infinite where there is none. Many descriptions say ``effort="0"`` for "not known": as a limit it
    would forbid any torque.
    """
    base = 6 if model.floating else 0
    efforts: Floats = model.effort_limit
    if limit is not None:
        given, n = real_array("limit", limit), model.nv - base
        if given.shape not in ((), (n,)) or not (given >= 0.0).all():
            raise GainError(f"limit is {shown(limit)}; wanted one number, or {n}, 0 or more")
        efforts = np.concatenate([np.full(base, np.inf), np.broadcast_to(given, (n,))])
    without = [name for name, effort in zip(model.joint_names, efforts[base:], strict=True) if effort == 0.0]
    if without:
        listed = ", ".join(shown(name) for name in without[:6])
        more = f" and {len(without) - 6} more" if len(without) > 6 else ""
        raise LimitError(
            f"the effort limit of {listed}{more} of {model.name} is 0, so that no torque is allowed; "
            "give limits of your own, or leave them out"
        )
    return efforts
