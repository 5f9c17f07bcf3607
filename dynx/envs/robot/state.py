"""`State` of a task of one robot."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from dynx.spatial.scalar import Array

NO_MEMORY: Array = np.zeros(0)
NO_MEMORY.setflags(write=False)


class State(NamedTuple):
    """Configuration and velocity of the robot, and what else the task keeps during an episode.

    The arrays hold floats, or in a compiled kernel symbols.
    """

    q: Array
    """Configuration (nq,) [rad or m]."""
    v: Array
    """Velocity (nv,) [rad/s or m/s]."""
    memory: Array = NO_MEMORY
    """Numbers of the task's own (k,), such as the goal of the episode."""
