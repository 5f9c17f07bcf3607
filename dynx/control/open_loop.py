"""Torques from a table, to replay a record or to give several plants the same input."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from dynx.argument_types import checks_types
from dynx.control.base import Controller, Measurement, parameter
from dynx.errors import ShapeError
from dynx.model import Model
from dynx.model.numbers import checked_array, positive_seconds
from dynx.spatial.scalar import Floats
from dynx.trajectory.base import Setpoint


@checks_types
@dataclass(frozen=True)
class OpenLoop(Controller[None], pure=True):
    """Controller that applies row k of a table of torques from time k control_dt on, and zero after the
    table."""

    model: Model
    torques: Floats = parameter("N m or N")
    row_dt: float = parameter("s", argument="control_dt")

    needs_setpoint = False

    def __init__(self, model: Model, torques: ArrayLike, *, control_dt: float) -> None:
        """`torques` (n, nv), including the wrench on a floating base; `control_dt` [s]."""
        table = checked_array("torques", torques, model.nv)
        if table.ndim != 2:
            raise ShapeError(f"torques has shape {table.shape}; wanted (n, {model.nv})")
        self._set(model=model, torques=table, row_dt=positive_seconds("control_dt", control_dt))

    @checks_types
    def torque(self, measurement: Measurement, setpoint: Setpoint, state: None) -> tuple[Floats, None]:
        """Return the torque (nv,) of the row."""
        row = round(measurement.t / self.row_dt)
        return (self.torques[row] if 0 <= row < len(self.torques) else np.zeros(self.model.nv)), None
