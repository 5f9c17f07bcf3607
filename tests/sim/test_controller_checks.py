"""Detection of controllers that change their own attributes."""

from __future__ import annotations

from typing import Any

import numpy as np

from dynx.control.base import Controller, Measurement
from dynx.model import Model
from dynx.model.loading import load
from dynx.sim.controller_checks import MAX_DEPTH, ControllerWatch
from dynx.spatial.scalar import Floats
from dynx.trajectory.base import Setpoint


class Counting(Controller[None]):
    """A controller that hides a count at some depth of its attributes."""

    def __init__(self, model: Model, depth: int) -> None:
        self.model = model
        self.count: Any = [0]
        self.hidden: Any = self.count
        for _ in range(depth):
            self.hidden = [self.hidden]
        del self.__dict__["count"]

    def torque(self, measurement: Measurement, setpoint: Setpoint, state: None) -> tuple[Floats, None]:
        """Return zero torque."""
        return np.zeros(self.model.nv), None


def test_a_change_is_seen_at_every_depth_that_is_compared() -> None:
    for depth in range(MAX_DEPTH):
        controller = Counting(load("pendulum"), depth)
        watch = ControllerWatch(controller)
        assert watch.changed is None
        inner = controller.hidden
        for _ in range(depth):
            inner = inner[0]
        inner[0] += 1
        assert watch.changed is not None
        assert "hidden" in watch.changed
