"""Torques from a table: for replaying a record, and for giving several plants the very same input."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from dynx.control.base import Controller, Measurement
from dynx.errors import ArgumentError, ShapeError, shown
from dynx.model import Model
from dynx.model.configuration import checked_array
from dynx.spatial.scalar import Floats
from dynx.trajectory.base import Setpoint


class OpenLoop(Controller[None]):
    """Row k of a table from time k control_dt on; no torque after its end."""

    needs_setpoint = False

    def __init__(self, model: Model, torques: ArrayLike, *, control_dt: float) -> None:
        """`torques` (n, nv), with a floating base also the wrench on it; `control_dt` [s]."""
        self.model = model
        table = np.array(checked_array("torques", torques, model.nv))
        if table.ndim != 2:
            raise ShapeError(f"torques has shape {table.shape}; wanted (n, {model.nv})")
        if not isinstance(control_dt, int | float) or not 0.0 < control_dt < np.inf:
            raise ArgumentError(f"control_dt is {shown(control_dt)}; wanted a positive number of seconds")
        table.setflags(write=False)
        self.torques: Floats = table
        self._row_dt = float(control_dt)
        self._nothing: Floats = np.zeros(model.nv)

    def torque(self, measurement: Measurement, setpoint: Setpoint, state: None) -> tuple[Floats, None]:
        """The torque (nv,) of the row."""
        row = round(measurement.t / self._row_dt)
        return (self.torques[row] if 0 <= row < len(self.torques) else self._nothing), None
