"""Evaluation of the candidates of all branches for a batch of poses, by NumPy."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from dynx.ik.closed_form.branches import N_BRANCHES, SIGNS
from dynx.ik.closed_form.candidates import N_MEASURES, Candidates
from dynx.ik.closed_form.chain import N_JOINTS
from dynx.spatial.scalar import Floats

_CHUNK = 4096
"""Number of poses that NumPy evaluates at once, so that its intermediate arrays stay in the cache."""


class Evaluation(Protocol):
    """Function from poses (n, 3, 4) to angles (n, 8, 6) and measures (n, 8, 5), one row for each branch."""

    def __call__(self, pose: Floats) -> tuple[Floats, Floats]:
        """Return angles and measures, as `Candidates` defines them."""


class NumpyEvaluation:
    """Evaluation on arrays."""

    def __init__(self, candidates: Candidates) -> None:
        self._candidates = candidates

    def __call__(self, pose: Floats) -> tuple[Floats, Floats]:
        angles = np.empty((len(pose), N_BRANCHES, N_JOINTS))
        measures = np.empty((len(pose), N_BRANCHES, N_MEASURES))
        for first in range(0, len(pose), _CHUNK):
            rows = slice(first, first + _CHUNK)
            found = self._candidates(pose[rows, None], SIGNS)
            angles[rows], measures[rows] = found["q"], found["measures"]
        return angles, measures
