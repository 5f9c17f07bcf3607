"""Rows of numbers in which a vector environment keeps the state of each of its environments."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from dynx.envs.robot.array_task import ArrayTask
from dynx.envs.robot.state import State
from dynx.spatial.scalar import Array


class Layout(NamedTuple):
    """Sizes of the parts of a row: q, v and memory."""

    nq: int
    nv: int
    memory: int

    @classmethod
    def of(cls, task: ArrayTask) -> Layout:
        """Return the layout for a task."""
        state = task.start(np.zeros(task.random_size))
        return cls(len(state.q), len(state.v), len(state.memory))

    @property
    def size(self) -> int:
        """Number of entries of a row."""
        return self.nq + self.nv + self.memory

    def state(self, row: Array) -> State:
        """Return the state in a row, or in rows (..., size)."""
        first, second = self.nq, self.nq + self.nv
        return State(row[..., :first], row[..., first:second], row[..., second:])

    def row(self, state: State) -> list[Any]:
        """Return the entries of a row."""
        return [*state.q, *state.v, *state.memory]
