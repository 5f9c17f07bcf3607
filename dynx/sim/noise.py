"""Measurement noise and random numbers of controllers: normal numbers of a stream for each rollout.

The numbers depend only on the seed, the rollout and the control step. So a rollout of a batch has the same
noise in any partition of the batch, on any processor and thread, and when it is simulated alone.
"""

from __future__ import annotations

from dataclasses import dataclass

from numpy.typing import ArrayLike

from dynx.argument_types import checks_types
from dynx.model import Model
from dynx.model.numbers import checked_gain, checked_seed, checked_size, whole_number
from dynx.spatial.scalar import Floats
from dynx.steppers.random import Purpose, stream_normals

MAX_COORDINATES = 10**6
"""Largest number of coordinates of a robot with noise, far above any."""

MAX_ROLLOUT = 2**63 - 1
"""Largest number of a rollout: half of the range of a word of the generator's key, so that the numbers of
a batch, which follow it, still fit."""


@checks_types
@dataclass(frozen=True)
class Noise:
    """Gaussian noise on measurements: standard deviations of `q` [rad or m] and `v`, and a seed.

    A standard deviation is one number, or one number for each coordinate (nv,). For the pose of a floating
    base it belongs to a displacement along the axes of the base. Equal seeds give equal noise on every plant.
    A single rollout with ``Noise(..., rollout=17)`` has the noise of rollout 17 of a batch with the
    same seed. For a batch, `rollout` is the number of its first rollout. Seed and rollout also determine the
    random numbers of a controller (`Controller.random_size`).
    """

    q: ArrayLike = 0.0
    v: ArrayLike = 0.0
    seed: int = 0
    rollout: int = 0

    @checks_types
    def deviations(self, nv: int) -> tuple[Floats, Floats]:
        """Return the standard deviations (nv,) of q and v.

        Raises GainError for an invalid standard deviation, ArgumentError for an invalid seed or rollout.
        """
        whole_number("nv", nv, 0, MAX_COORDINATES)
        checked_seed("seed", self.seed)
        whole_number("rollout", self.rollout, 0, MAX_ROLLOUT)
        return checked_gain("noise.q", self.q, nv), checked_gain("noise.v", self.v, nv)

    @checks_types
    def on_measurements(self, nv: int) -> bool:
        """Check whether a standard deviation is above zero."""
        return any(each.any() for each in self.deviations(nv))

    @checks_types
    def rows(self, model: Model, n_controls: int) -> tuple[Floats, Floats]:
        """Return the noise of q and of v at each control step (n_controls, nv)."""
        whole_number("n_controls", n_controls, 0)
        deviations = self.deviations(model.nv)
        drawn = self.numbers(Purpose.MEASUREMENT, (n_controls, 2, model.nv))
        return drawn[:, 0] * deviations[0], drawn[:, 1] * deviations[1]

    @checks_types
    def numbers(self, purpose: Purpose, shape: tuple[int, ...]) -> Floats:
        """Return the normal numbers of this rollout, with a row for each control step."""
        return stream_normals(self.seed, purpose, self.rollout, checked_size(shape))
