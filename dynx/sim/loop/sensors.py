"""What the controller gets to see: the state, late and noisy if so asked."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from dynx.control.base import Measurement
from dynx.control.gains import checked_gain
from dynx.errors import ArgumentError, shown
from dynx.model import Model
from dynx.sim.clock import Clock
from dynx.spatial.scalar import Floats


@dataclass(frozen=True)
class Noise:
    """Gaussian noise on what is measured: standard deviations of `q` [rad or m] and `v`, and a seed.

    One number, or one for each coordinate (nv,); that of a floating base's pose is a displacement along
    its own axes. Equal seeds give equal noise, in every plant.
    """

    q: ArrayLike = 0.0
    v: ArrayLike = 0.0
    seed: int = 0


class Sensors:
    """Measurements at the control steps, from the recorded states."""

    def __init__(self, model: Model, clock: Clock, noise: Noise | None) -> None:
        """Raises GainError for a standard deviation, ArgumentError for a seed, that is none."""
        self._model = model
        self._clock = clock
        self.noise: tuple[Floats, Floats] | None = None
        """What is added to q and to v at each control step (n_controls, nv)."""
        if noise is not None:
            if not isinstance(noise.seed, int) or noise.seed < 0:
                raise ArgumentError(f"seed is {shown(noise.seed)}; wanted a whole number, 0 or more")
            # Drawn at once, so that the noise of a step does not depend on where a rollout began.
            drawn = np.random.default_rng(noise.seed).standard_normal((clock.n_controls, 2, model.nv))
            self.noise = (
                drawn[:, 0] * checked_gain("noise.q", noise.q, model.nv),
                drawn[:, 1] * checked_gain("noise.v", noise.v, model.nv),
            )

    @property
    def plain(self) -> bool:
        """Whether the state itself is what is measured."""
        return self.noise is None and not self._clock.delay_steps

    def __call__(self, step: int, q: Floats, v: Floats) -> Measurement:
        """The measurement at physics step `step`, from the states (n, nq), (n, nv) until then.

        With a delay it is the state of that long ago; before the start, the state at the start.
        """
        seen = max(step - self._clock.delay_steps, 0)
        measurement = Measurement(step * self._clock.dt, q[seen], v[seen])
        if self.noise is None:
            return measurement
        number = step // self._clock.steps_per_control
        off_q, off_v = self.noise[0][number], self.noise[1][number]
        return Measurement(measurement.t, self._model.integrate(measurement.q, off_q), measurement.v + off_v)
