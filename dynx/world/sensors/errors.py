"""Errors of an instrument: scale, misalignment, bias, white noise, resolution and saturation.

The random numbers are those of `dynx.steppers.random`: each depends on the seed and the name of the sensor,
on the number of the rollout and on the number of the sample, and on nothing that was drawn before.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, fields
from hashlib import sha256

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dynx.argument_types import checks_types
from dynx.errors import ArgumentError, GainError
from dynx.model.numbers import checked_gain, real_array
from dynx.spatial.scalar import Floats
from dynx.steppers.random import BLOCK_STEPS, Purpose, Streams

Integers = NDArray[np.int64]

_SIGNED = frozenset(("bias", "scale", "cross_axis"))
"""Errors that may be negative."""


def _tuples(value: object) -> object:
    """Return nested lists as tuples, which compare and hash, as scenes do."""
    return tuple(map(_tuples, value)) if isinstance(value, list) else value


@checks_types
@dataclass(frozen=True)
class SensorErrors:
    """Errors of one measured vector (m,), in its unit. Each error is one number, or one for each component.

    The reading of the true value x in sample k is

        saturated(rounded(x + scale x + cross_axis x + bias + walk[k] + deviation * normal[k]))

    The normal numbers are independent in time and between components. walk[0] is 0, and walk[k + 1] - walk[k]
    has the standard deviation ``random_walk * sqrt(T)``, where T [s] is the period of the sensor. This is the
    usual model of a gyroscope (IEEE Std 952, annex C; Woodman, An introduction to inertial navigation,
    2007, section 3).

    Raises ArgumentError and its subclasses for numbers that are not finite, negative deviations, a resolution
    or a saturation below 0, and for both kinds of white noise at once.
    """

    noise: ArrayLike = 0.0
    """Standard deviation of the white noise of each sample, whatever the rate."""
    noise_density: ArrayLike = 0.0
    """Density of the white noise [unit/sqrt(Hz)]: a sample has the standard deviation ``noise_density *
    sqrt(rate)``. It replaces `noise`."""
    bias: ArrayLike = 0.0
    """Constant error."""
    random_walk: ArrayLike = 0.0
    """Density of the rate of the bias [unit/s/sqrt(Hz)]: after t seconds the bias has the standard deviation
    ``random_walk * sqrt(t)``."""
    scale: ArrayLike = 0.0
    """Relative error: a reading also contains this fraction of the true value."""
    cross_axis: ArrayLike = 0.0
    """Fractions of the other components that a component also contains: a matrix (m, m) with a diagonal of
    zeros, or one number for all pairs of components."""
    resolution: ArrayLike = 0.0
    """Step to whose multiples the reading is rounded; 0 for none."""
    saturation: ArrayLike = math.inf
    """Largest magnitude of a reading."""

    def __post_init__(self) -> None:
        for each in fields(self):
            value = real_array(each.name, getattr(self, each.name))
            unlimited = each.name == "saturation" and (value == np.inf).all()
            if not np.isfinite(value).all() and not unlimited:
                raise GainError(f"{each.name} of a sensor is {value.tolist()}; wanted finite numbers")
            if each.name not in _SIGNED and (value < 0.0).any():
                raise GainError(f"{each.name} of a sensor is {value.tolist()}; wanted numbers of at least 0")
            object.__setattr__(self, each.name, _tuples(value.tolist()))
        if np.any(self.noise) and np.any(self.noise_density):
            raise ArgumentError("noise and noise_density of a sensor are both given; wanted one of them")
        matrix = np.array(self.cross_axis)
        if matrix.ndim == 2 and np.diagonal(matrix).any():
            raise ArgumentError(
                f"cross_axis has the diagonal {np.diagonal(matrix).tolist()}; wanted zeros (see scale)"
            )

    @checks_types
    def require(self, name: str, size: int) -> None:
        """Raise GainError unless the numbers fit a vector of `size` components."""
        for each in fields(self):
            value = np.array(getattr(self, each.name), dtype=np.float64)
            if each.name == "cross_axis":
                if size == 1 and value.any():
                    raise GainError(
                        f"cross_axis of {name} is {value.tolist()}; wanted 0, because it measures one number"
                    )
                if value.shape not in ((), (size, size)):
                    raise GainError(
                        f"cross_axis of {name} has shape {value.shape}; wanted one number or a matrix "
                        f"({size}, {size})"
                    )
            elif each.name not in ("saturation", "bias", "scale"):
                checked_gain(f"{each.name} of {name}", value, size, per="one for each component")
            elif value.shape not in ((), (size,)):
                raise GainError(f"{each.name} of {name} has shape {value.shape}; wanted one number or {size}")

    @property
    def random(self) -> bool:
        """True if readings depend on random numbers."""
        return bool(np.any(self.noise) or np.any(self.noise_density) or np.any(self.random_walk))

    @property
    def walks(self) -> bool:
        """True if the bias changes."""
        return bool(np.any(self.random_walk))

    def deviation(self, period: float) -> Floats:
        """Return the standard deviation, () or (m,), of the white noise of samples `period` [s] apart."""
        return np.asarray(np.array(self.noise) + np.array(self.noise_density) / math.sqrt(period))

    def applied(self, true: Floats, period: float, normal: Floats, walk: Floats) -> Floats:
        """Return the readings of `true` values (n, m), from the normal numbers (n, m) of the noise and the
        sums (n, m) of the normal numbers of the random walk; samples are `period` [s] apart."""
        found = true + np.array(self.bias) + np.array(self.scale) * true
        cross = np.array(self.cross_axis)
        if cross.any():
            m = true.shape[1]
            found = found + true @ (cross if cross.ndim else cross * (1.0 - np.eye(m))).T
        if self.random:
            found = (
                found
                + self.deviation(period) * normal
                + np.array(self.random_walk) * math.sqrt(period) * walk
            )
        step = np.broadcast_to(np.array(self.resolution), (true.shape[1],))
        coarse = step > 0.0
        found[:, coarse] = np.rint(found[:, coarse] / step[coarse]) * step[coarse]
        return np.asarray(np.clip(found, -np.array(self.saturation), np.array(self.saturation)))


NO_ERRORS = SensorErrors()


class SampleNumbers:
    """Random numbers of the samples of one sensor, drawn a block at a time.

    Each sample has a normal number and the sum of those of the samples before it, for every component.
    """

    def __init__(self, name: str, seed: int, lane: int, size: int) -> None:
        """`lane` is the number of the rollout."""
        # The name is part of the seed, so that no sensor changes the numbers of another.
        digest = int.from_bytes(sha256(name.encode()).digest()[:16], "little")
        self._streams = Streams((digest << 64) + seed)
        self._lane, self._size = lane, size
        self._drawn = np.empty((BLOCK_STEPS, 2, size))
        self._forget()

    def _forget(self) -> None:
        self._block, self._after = -1, np.zeros(self._size)
        self._sums = np.zeros((BLOCK_STEPS, self._size))

    def at(self, samples: Integers, *, summed: bool) -> tuple[Floats, Floats]:
        """Return the normal numbers (n, size) of samples (n,) of at least 0, and their sums (n, size), zeros
        unless `summed`; the sums take a time that grows with the number of the sample, once."""
        normals, sums = np.empty((len(samples), self._size)), np.zeros((len(samples), self._size))
        order = np.argsort(samples, kind="stable")
        blocks = samples[order] // BLOCK_STEPS
        ends = np.flatnonzero(np.diff(blocks, append=-1))
        begin = 0
        for end in (ends + 1).tolist():
            self._draw(int(blocks[begin]), summed)
            rows = order[begin:end]
            places = samples[rows] % BLOCK_STEPS
            normals[rows], sums[rows] = self._drawn[places, 0], self._sums[places]
            begin = end
        return normals, sums

    def _draw(self, block: int, summed: bool) -> None:
        """Draw a block; sums are carried on from the block before."""
        if block < self._block:
            self._forget()
        for each in range(self._block + 1, block + 1) if summed else [block] * (block != self._block):
            self._streams.normal(Purpose.SENSOR, self._lane, each, self._drawn)
            if summed:
                # One after the other, so that the sums do not depend on where they were begun.
                sums = np.cumsum(np.concatenate([self._after[None], self._drawn[:, 1]]), axis=0)
                self._sums, self._after = sums[:-1], sums[-1]
        self._block = block


def apply_errors(
    errors: Mapping[str, SensorErrors],
    true: Mapping[str, Floats],
    samples: Integers,
    period: float,
    numbers: SampleNumbers,
) -> dict[str, Floats]:
    """Return the readings of the true values (n, m) of each channel in samples (n,)."""
    found: dict[str, Floats] = {}
    if any(each.random for each in errors.values()):
        normals, sums = numbers.at(samples, summed=any(each.walks for each in errors.values()))
    else:
        normals = sums = np.zeros((len(samples), sum(rows.shape[1] for rows in true.values())))
    first = 0
    for name, rows in true.items():
        part = slice(first, first + rows.shape[1])
        found[name] = errors[name].applied(rows, period, normals[:, part], sums[:, part])
        first = part.stop
    return found
