"""Saturation of a controller's torque at effort limits."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from dynx.argument_types import checks_types
from dynx.backends.joint_friction import coefficients_by_joint, refuse_text
from dynx.control.base import Controller, ControllerState, Measurement, Wrapper, parameter
from dynx.errors import GainError, LimitError, shown
from dynx.model import Model
from dynx.model.numbers import real_array
from dynx.spatial.scalar import Floats, clamp
from dynx.trajectory.base import Setpoint


@dataclass(frozen=True)
class Saturated(Wrapper[ControllerState], pure=True):
    """Another controller's torque, saturated at the limits of the motors.

    With `dynx.simulate(..., effort_limits=True)` the plant saturates the torque instead, and the record
    has the steps in which it did.
    """

    limit: Floats = parameter("N m or N")

    def __init__(self, inner: Controller[ControllerState], *, limit: ArrayLike | None = None) -> None:
        """`limit` [N m or N]: one number or one for each joint, by default the effort limits of the model.

        Raises LimitError for a limit of 0, which would allow no torque.
        """
        super().__init__(inner)
        self._set(limit=checked_limit(inner.model, limit))

    @checks_types
    def torque(
        self, measurement: Measurement, setpoint: Setpoint, state: ControllerState
    ) -> tuple[Floats, ControllerState]:
        """Return the torque (nv,) of the inner controller, within the limits."""
        tau, state = self.inner.torque(measurement, setpoint, state)
        return clamp(tau, self.limit), state

    @property
    def name(self) -> str:
        """Name of the inner controller, followed by a word for the saturation."""
        return f"{self.inner.name}, saturated"


def checked_limit(
    model: Model, limit: ArrayLike | Mapping[str, ArrayLike] | None, name: str = "limit"
) -> Floats:
    """Return the effort limits (nv,): the model's, or one number, one for each joint, or numbers by joint, of
    which those not named are unlimited; LimitError where one is 0.

    A missing limit is infinite. Many descriptions write ``effort="0"`` for an unknown limit; as a limit it
    would forbid any torque.
    """
    base = 6 if model.floating else 0
    efforts: Floats = model.effort_limit
    if limit is not None:
        n = model.nv - base
        refuse_text(name, limit, n, "None" if name in ("limit", "force") else "True")
        given = real_array(name, coefficients_by_joint(model, name, limit, others=np.inf))
        if base and given.shape == (model.nv,) and (given[:base] == np.inf).all():
            given = given[base:]
        if given.shape not in ((), (n,)) or not (given >= 0.0).all():
            raise GainError(f"{name} is {shown(limit)}; wanted one number, or {n}, 0 or more")
        efforts = np.concatenate([np.full(base, np.inf), np.broadcast_to(given, (n,))])
    names = model.coordinate_names
    without = [name for name, effort in zip(names, efforts[base:], strict=True) if effort == 0.0]
    if without:
        listed = ", ".join(shown(name) for name in without[:6])
        more = f" and {len(without) - 6} more" if len(without) > 6 else ""
        raise LimitError(
            f"the effort limit of {listed}{more} of {model.name} is 0, so that no torque is allowed; "
            "give limits of your own, or leave them out"
        )
    return efforts
