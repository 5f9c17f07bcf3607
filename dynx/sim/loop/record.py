"""Buffers that a simulation writes its states to."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dynx.spatial.scalar import Floats


@dataclass
class StateBuffers:
    """States at n + 1 times, torques and accelerations of the n steps between, and the count of steps."""

    q: Floats
    v: Floats
    a: Floats
    tau: Floats
    steps: int = 0

    @classmethod
    def begin(cls, q: Floats, v: Floats, n: int) -> StateBuffers:
        """Make buffers for n steps from the state (q, v)."""
        nv = len(v)
        record = cls(
            np.empty((n + 1, len(q))),
            np.empty((n + 1, nv)),
            np.empty((n, nv)),
            np.empty((n, nv)),
        )
        record.q[0], record.v[0] = q, v
        return record

    def copy(self) -> StateBuffers:
        """Return a copy of the steps taken."""
        n = self.steps
        return StateBuffers(
            self.q[: n + 1].copy(), self.v[: n + 1].copy(), self.a[:n].copy(), self.tau[:n].copy(), n
        )

    def take(self, other: StateBuffers, n: int) -> None:
        """Replace all steps by the first n of another record."""
        self.q[: n + 1], self.v[: n + 1] = other.q[: n + 1], other.v[: n + 1]
        self.a[:n], self.tau[:n] = other.a[:n], other.tau[:n]
        self.steps = n

    def extended(self, n: int) -> StateBuffers:
        """Return a copy of the steps taken, in buffers for n steps."""
        larger = StateBuffers.begin(self.q[0], self.v[0], n)
        larger.take(self, self.steps)
        return larger

    def __len__(self) -> int:
        """Return the number of steps that the buffers hold."""
        return len(self.tau)
