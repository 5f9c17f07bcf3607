"""What is written down while a robot moves, in arrays that are there before it starts."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dynx.spatial.scalar import Floats


@dataclass
class Record:
    """States at n + 1 times, what acted in the n steps between, and how many steps were taken."""

    q: Floats
    v: Floats
    a: Floats
    tau: Floats
    steps: int = 0

    @classmethod
    def begin(cls, q: Floats, v: Floats, n: int) -> Record:
        """For n steps from the state (q, v)."""
        nv = len(v)
        record = cls(
            np.empty((n + 1, len(q))),
            np.empty((n + 1, nv)),
            np.empty((n, nv)),
            np.empty((n, nv)),
        )
        record.q[0], record.v[0] = q, v
        return record

    def __len__(self) -> int:
        """How many steps there is room for."""
        return len(self.tau)
