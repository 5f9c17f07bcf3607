"""Repetition of a step for the rollouts in which it did not settle whether joints stick or slide.

A kernel corrects the modes of the law of friction (`dynx.sim.plants.friction_law`) once, which mostly
suffices. For the other rollouts it is called again with the corrected modes, until they are right. A rollout
whose modes are right gives the same bits again, so no result depends on its neighbours.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from dynx.sim.plants.friction_solver import BLOCK_CORRECTIONS, MAX_SOLUTIONS


class Settling:
    """Arrays of a kernel that concern the modes of dry friction."""

    def __init__(self, rows: int, joints: int) -> None:
        self.inputs = {"modes": np.zeros((rows, joints)), "one_by_one": np.zeros((rows, 1))}
        """Change of the modes from the signs of the velocities; whether they are corrected one at a time."""
        self.outputs = {"next_modes": np.zeros((rows, joints)), "unsettled": np.zeros((rows, 1))}

    def __call__(self, evaluate_group: Callable[[int], None], lanes: int) -> None:
        """Repeat a step where necessary; `evaluate_group` does so for `lanes` rows from a given one."""
        unsettled = self.outputs["unsettled"][:, 0]
        wrong = np.flatnonzero(unsettled > 0.0)
        for first in np.unique(np.minimum(wrong // lanes * lanes, len(unsettled) - lanes)).tolist():
            group = slice(first, first + lanes)
            modes, one_by_one = (array[group] for array in self.inputs.values())
            for count in range(MAX_SOLUTIONS):
                modes[:] = self.outputs["next_modes"][group]
                one_by_one[:] = count >= BLOCK_CORRECTIONS
                evaluate_group(first)
                if not (unsettled[group] > 0.0).any():
                    break
            modes[:] = one_by_one[:] = 0.0
