"""Base of peers that compile a function of a batch."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from dynx.bench.cases import Batch
from dynx.bench.implementations import Implementation, Role
from dynx.errors import EngineLimitError
from dynx.model import Model
from dynx.reference.backend import ReferenceBackend
from dynx.spatial.scalar import Floats

EASY_JOINTS = 8
"""Up to so many joints these peers take `most_samples` in a call of two seconds at most (measured)."""


class CompilingPeer(Implementation):
    """A peer that takes whole batches once it has compiled a function for them.

    `compile_seconds` is how long it took to make the function last prepared, which no timing contains.
    """

    role: Role = "peer"
    whole = True
    most_samples: ClassVar[int] = 65536

    def __init__(self, model: Model, threads: int) -> None:
        if model.mechanism.coupling is not None:
            raise EngineLimitError(
                f"{self.name} supports no mimic joints: lock them for every implementation"
            )
        if model.floating:
            raise EngineLimitError(f"{self.name} is timed on a fixed base only")
        self.threads = threads
        self.compile_seconds = 0.0

    def samples(self, batch: Batch) -> Batch:
        """Fewer samples of a large robot: what these peers take grows with the square of its joints."""
        most = self.most_samples * min(1.0, (EASY_JOINTS / batch.model.nv) ** 2)
        return batch.first(min(len(batch), int(most)))


def place_on_last_link(model: Model, frame: str) -> Floats:
    """The pose (4, 4) of a frame in the link that the last joint moves."""
    last = [joint.child for joint in model.joints if joint.moves][-1]
    with ReferenceBackend(model) as reference:
        q = np.zeros(model.nq)
        T_world_last, T_world_frame = (reference.forward_kinematics(q, name) for name in (last, frame))
    return np.asarray(np.linalg.solve(T_world_last, T_world_frame), dtype=np.float64)
