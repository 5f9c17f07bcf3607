"""Inputs of a batch that may have a row for each rollout."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from dynx.errors import ArgumentError, shown
from dynx.model.configuration import checked_array
from dynx.spatial.scalar import Floats


class RolloutRows:
    """Arrays with one row for each rollout, and the number of rollouts that follows from them."""

    def __init__(self, asked: int | None) -> None:
        if asked is not None and (isinstance(asked, bool) or not isinstance(asked, int) or asked < 1):
            raise ArgumentError(f"rollouts is {shown(asked)}; wanted a whole number above 0")
        self._asked = asked
        self._by = "rollouts"

    @property
    def count(self) -> int:
        """The number; 1 where no argument has several rows."""
        return 1 if self._asked is None else self._asked

    def of(self, name: str, values: ArrayLike, size: int, *, spread: bool = False) -> Floats:
        """`values` as (size,) or (n, size), finite; `spread` lets a last axis of 1 stand for all."""
        array = np.asarray(values, dtype=np.float64) if spread else checked_array(name, values, size)
        if spread and array.ndim and array.shape[-1] == 1:
            array = np.broadcast_to(array, (*array.shape[:-1], size))
        array = checked_array(name, array, size)
        if array.ndim > 2:
            raise ArgumentError(f"{name} has shape {array.shape}; wanted ({size},) or one such row a rollout")
        if array.ndim == 2:
            if self._asked is not None and len(array) != self._asked:
                raise ArgumentError(f"{name} has {len(array)} rows, {self._by} says {self._asked}")
            self._asked, self._by = len(array), name
            if not len(array):
                raise ArgumentError(f"{name} has no rows: there would be no rollouts")
        return array

    def spread(self, array: Floats) -> Floats:
        """(n, size)."""
        return np.array(np.broadcast_to(array, (self.count, array.shape[-1])))


def columns_of(values: ArrayLike) -> Floats:
    """(n,) as (n, 1), (n, size) as it is."""
    array = np.asarray(values, dtype=np.float64)
    return array[:, None] if array.ndim == 1 else array
