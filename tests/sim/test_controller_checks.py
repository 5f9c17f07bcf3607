"""Detection of controllers that change their own attributes."""

from __future__ import annotations

from typing import Any

import numpy as np

from dynx.control.base import Controller, Measurement
from dynx.model import Model
from dynx.model.loading import load
from dynx.sim.controller_checks import MAX_DEPTH, MAX_LISTED_NUMBERS, ControllerWatch, controller_numbers
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


class Tuned(Counting):
    """A controller with public attributes of many kinds."""

    def __init__(self, model: Model, **attributes: Any) -> None:
        super().__init__(model, 0)
        vars(self).update(attributes)


def test_public_numbers_are_kept_in_every_form_that_has_them() -> None:
    kept = {
        "array": np.array([[1.0, 2.0]]),
        "gains": [1.0, 2.5],
        "pair": (3, 4),
        "half": np.float32(0.5),
        "count": np.int64(7),
        "flags": [True, False],
        "name": "soft",
        "nothing": None,
    }
    left_out = {"words": ["a", "b"], "ragged": [[1.0], [2.0, 3.0]], "table": {"a": 1.0}, "_private": 2.0}
    numbers = controller_numbers(Tuned(load("double_pendulum"), **kept, **left_out, many=[0.5] * 100))
    assert numbers.pop("many").startswith("sha256 ")
    assert MAX_LISTED_NUMBERS < 100
    assert {name: numbers[name] for name in kept} == {
        name: value.tolist()
        if isinstance(value, np.ndarray | np.generic)
        else list(value)
        if isinstance(value, tuple)
        else value
        for name, value in kept.items()
    }
    assert not left_out.keys() & numbers.keys()
