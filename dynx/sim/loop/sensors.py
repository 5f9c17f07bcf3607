"""Measurements of the state, with delay and noise, and the random numbers of the controller."""

from __future__ import annotations

from typing import Any

from dynx.control.base import Controller, Measurement
from dynx.model import Model
from dynx.sim.loop.noise import Noise
from dynx.sim.step import measure
from dynx.spatial.scalar import Floats
from dynx.steppers.clock import Clock
from dynx.steppers.random import Purpose


class Sensors:
    """Measurements at the control steps, from the recorded states."""

    def __init__(
        self, model: Model, clock: Clock, noise: Noise | None, controller: Controller[Any] | None = None
    ) -> None:
        """Raises GainError for an invalid standard deviation, ArgumentError for an invalid seed."""
        self._model = model
        self._clock = clock
        self.noise: tuple[Floats, Floats] | None = None
        """The noise of q and of v at each control step (n_controls, nv)."""
        if noise is not None and noise.on_measurements(model.nv):
            self.noise = noise.rows(model, clock.n_controls)
        size = 0 if controller is None else controller.random_size
        self.random = (
            (noise or Noise()).numbers(Purpose.CONTROLLER, (clock.n_controls, size)) if size else None
        )
        """The random numbers of the controller at each control step (n_controls, random_size)."""

    @property
    def plain(self) -> bool:
        """True if measurements have no delay, no noise and no random numbers."""
        return self.noise is None and self.random is None and not self._clock.delay_steps

    def __call__(self, step: int, q: Floats, v: Floats) -> Measurement:
        """Return the measurement at physics step `step`, from the states (n, nq), (n, nv) until then."""
        clock = self._clock
        seen, number = clock.measured_step(step), clock.control_number(step)
        noise = None if self.noise is None else (self.noise[0][number], self.noise[1][number])
        random = None if self.random is None else self.random[number]
        return measure(self._model, step * clock.dt, q[seen], v[seen], noise, random)
