"""What is timed: a quantity, at how many samples, on how many threads; and the samples themselves."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import prod

import numpy as np

from dynx.errors import ArgumentError, UnknownNameError, nearest, shown
from dynx.model import Model
from dynx.simd.machine import MAX_MEMORY_SHARE, memory_size
from dynx.spatial.scalar import Floats

ARGUMENTS: dict[str, tuple[str, ...]] = {
    "forward_kinematics": ("q",),
    "jacobian": ("q",),
    "inverse_dynamics": ("q", "v", "a"),
    "forward_dynamics": ("q", "v", "tau"),
    "mass_matrix": ("q",),
}
"""The quantities that can be timed, by the names that backends give them, and what each is asked with.

The first two are asked of one frame; the Jacobian is that at its origin, in the axes of the world.
"""

OF_A_FRAME = frozenset({"forward_kinematics", "jacobian"})

REACH = 2.0 * np.pi
"""Positions are drawn within the limits, and no farther than this from zero [rad or m]."""


@dataclass(frozen=True)
class Work:
    """`quantity` at `batch` samples in one call; a batch of 1 is one sample without a batch axis.

    `threads` is what a way that has threads may use.
    """

    quantity: str
    batch: int
    threads: int = 1

    def __post_init__(self) -> None:
        if self.quantity not in ARGUMENTS:
            raise UnknownNameError(f"no quantity {shown(self.quantity)}{nearest(self.quantity, ARGUMENTS)}")
        for name, count in (("batch", self.batch), ("threads", self.threads)):
            if count < 1:
                raise ArgumentError(f"{name} is {count}; wanted at least 1")


@dataclass(frozen=True)
class Batch:
    """n samples of a model as a user has them: q (n, nq), v, a, tau (n, nv), row-major float64."""

    model: Model
    frame: str
    q: Floats
    v: Floats
    a: Floats
    tau: Floats

    def __len__(self) -> int:
        return len(self.q)

    def arguments(self, quantity: str) -> tuple[Floats, ...]:
        """What `quantity` is asked with."""
        return tuple(getattr(self, name) for name in ARGUMENTS[quantity])

    def first(self, count: int) -> Batch:
        """The first `count` samples."""
        return self._replaced(slice(count))

    def take(self, rows: Sequence[int]) -> Batch:
        """The samples of these numbers, in a copy."""
        return self._replaced(list(rows))

    def _replaced(self, rows: slice | list[int]) -> Batch:
        return Batch(self.model, self.frame, self.q[rows], self.v[rows], self.a[rows], self.tau[rows])


def draw_batch(model: Model, frame: str, count: int, seed: int = 0) -> Batch:
    """`count` samples of `model`, the same for equal arguments."""
    rng = np.random.default_rng(seed)
    q = np.ascontiguousarray(model.random(rng, count))
    base = 7 if model.floating else 0
    np.clip(q[:, base:], -REACH, REACH, out=q[:, base:])
    v, a, tau = (rng.uniform(-2.0, 2.0, (count, model.nv)) for _ in range(3))
    return Batch(model, frame, q, v, a, tau)


def answer_shape(model: Model, quantity: str) -> tuple[int, ...]:
    """The shape of one sample's answer."""
    n = model.nv
    return {
        "forward_kinematics": (4, 4),
        "jacobian": (6, n),
        "inverse_dynamics": (n,),
        "forward_dynamics": (n,),
        "mass_matrix": (n, n),
    }[quantity]


def require_memory(model: Model, work: Work) -> None:
    """Raise ArgumentError for a batch whose arrays would not fit beside what else the machine does."""
    # Two arrays of answers: one that all ways share, and one that a backend makes itself.
    state = np.dtype(np.float64).itemsize * (model.nq + 3 * model.nv)
    answer = np.dtype(np.float64).itemsize * prod(answer_shape(model, work.quantity))
    needed = work.batch * (state + 2 * answer)
    if needed > MAX_MEMORY_SHARE * memory_size():
        raise ArgumentError(
            f"{work.quantity} at a batch of {work.batch} needs {needed / 1e9:.3g} GB; this machine has "
            f"{memory_size() / 1e9:.3g} GB, of which a batch may take {MAX_MEMORY_SHARE:.0%}"
        )
