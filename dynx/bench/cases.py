"""Benchmark cases, which consist of a quantity and the numbers of samples and threads; and the samples."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import prod

import numpy as np

from dynx.argument_types import checks_types
from dynx.backends.quantities import QUANTITIES
from dynx.errors import ArgumentError, UnknownNameError, nearest, shown
from dynx.model import Model
from dynx.simd import machine
from dynx.spatial.scalar import Floats

BENCHMARK_QUANTITIES = (
    "forward_kinematics",
    "jacobian",
    "inverse_dynamics",
    "forward_dynamics",
    "mass_matrix",
)
"""The quantities of the table that are timed by default. Quantities of frames are timed at one frame, at its
origin and in the axes of the world."""

MAX_POSITION = 2.0 * np.pi
"""Bound on the drawn positions [rad or m], which are also within the limits."""


@checks_types
@dataclass(frozen=True)
class BenchmarkCase:
    """`quantity` at `batch` samples in one call; a batch of 1 is one sample without a batch axis.

    `threads` is the largest number of threads that an implementation uses.
    """

    quantity: str
    batch: int
    threads: int = 1

    def __post_init__(self) -> None:
        if self.quantity not in QUANTITIES:
            raise UnknownNameError(f"no quantity {shown(self.quantity)}{nearest(self.quantity, QUANTITIES)}")
        for name, count in (("batch", self.batch), ("threads", self.threads)):
            if count < 1:
                raise ArgumentError(f"{name} is {count}; wanted at least 1")


@dataclass(frozen=True)
class Batch:
    """n samples of a model: q (n, nq), v, a, tau (n, nv), row-major float64."""

    model: Model
    frame: str
    q: Floats
    v: Floats
    a: Floats
    tau: Floats

    def __len__(self) -> int:
        return len(self.q)

    def arguments(self, quantity: str) -> tuple[Floats, ...]:
        """Return the arguments of `quantity`."""
        return tuple(getattr(self, name) for name in QUANTITIES[quantity].arguments)

    def first(self, count: int) -> Batch:
        """Return the first `count` samples."""
        return self._replaced(slice(count))

    def take(self, rows: Sequence[int]) -> Batch:
        """Return a copy of the samples with the given numbers."""
        return self._replaced(list(rows))

    def _replaced(self, rows: slice | list[int]) -> Batch:
        return Batch(self.model, self.frame, self.q[rows], self.v[rows], self.a[rows], self.tau[rows])


def draw_batch(model: Model, frame: str, count: int, seed: int = 0) -> Batch:
    """Return `count` samples of `model`, the same for equal arguments."""
    rng = np.random.default_rng(seed)
    q = np.ascontiguousarray(model.random(rng, count))
    base = 7 if model.floating else 0
    np.clip(q[:, base:], -MAX_POSITION, MAX_POSITION, out=q[:, base:])
    v, a, tau = (rng.uniform(-2.0, 2.0, (count, model.nv)) for _ in range(3))
    return Batch(model, frame, q, v, a, tau)


def require_memory(model: Model, case: BenchmarkCase) -> None:
    """Raise ArgumentError for a batch whose arrays need more than the share of memory allowed for a batch."""
    # Two arrays of results: one that all implementations share, and one that a backend makes itself.
    state = np.dtype(np.float64).itemsize * (model.nq + 3 * model.nv)
    result = np.dtype(np.float64).itemsize * prod(QUANTITIES[case.quantity].shape_of(model))
    needed = case.batch * (state + 2 * result)
    machine.require_memory(f"{case.batch} samples of {case.quantity}", needed)
