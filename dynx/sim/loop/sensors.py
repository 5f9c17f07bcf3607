"""Measurements of the state, with delay and noise."""

from __future__ import annotations

from dynx.control.base import Measurement
from dynx.model import Model
from dynx.sim.clock import Clock
from dynx.sim.loop.noise import Noise
from dynx.spatial.scalar import Floats


class Sensors:
    """Measurements at the control steps, from the recorded states."""

    def __init__(self, model: Model, clock: Clock, noise: Noise | None) -> None:
        """Raises GainError for an invalid standard deviation, ArgumentError for an invalid seed."""
        self._model = model
        self._clock = clock
        self.noise = None if noise is None else noise.rows(model, clock.n_controls)
        """The noise of q and of v at each control step (n_controls, nv)."""

    @property
    def plain(self) -> bool:
        """Whether measurements have neither delay nor noise."""
        return self.noise is None and not self._clock.delay_steps

    def __call__(self, step: int, q: Floats, v: Floats) -> Measurement:
        """Return the measurement at physics step `step`, from the states (n, nq), (n, nv) until then.

        With a delay it is the state at the earlier time, or the initial state while the delay has not passed.
        """
        seen = max(step - self._clock.delay_steps, 0)
        measurement = Measurement(step * self._clock.dt, q[seen], v[seen])
        if self.noise is None:
            return measurement
        number = step // self._clock.steps_per_control
        off_q, off_v = self.noise[0][number], self.noise[1][number]
        return Measurement(measurement.t, self._model.integrate(measurement.q, off_q), measurement.v + off_v)
