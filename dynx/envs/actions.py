"""Checks of actions, so that no engine gets one that is not in the action space."""

from __future__ import annotations

from typing import Any

import numpy as np

from dynx.envs.library import Space, spaces
from dynx.errors import ArgumentError, DTypeError, NotFiniteError, ShapeError, shown


def checked_action(space: Space[Any], action: Any) -> Any:
    """Return an action of one environment: an int for a `Discrete` space, an array of float64 in the space's
    shape for a `Box`.

    A number of a Box beyond the bounds is refused, not clipped. Raises ShapeError, DTypeError, NotFiniteError
    or ArgumentError, each with what was got and what is wanted.
    """
    if isinstance(space, spaces.Discrete):
        return _checked_choice(space, action)
    if isinstance(space, spaces.Box):
        return _checked_numbers(space, action)
    if not space.contains(action):
        raise ArgumentError(f"action is {shown(action)}; wanted an element of {space}")
    return action


def _checked_choice(space: spaces.Discrete, action: Any) -> int:
    first, last = int(space.start), int(space.start + space.n - 1)
    if type(action) is not int:
        array = np.asarray(action)
        if array.dtype.kind not in "iu":
            raise DTypeError(f"action is {shown(action)}; wanted a whole number from {first} to {last}")
        if array.size != 1 or array.ndim > 1:
            raise ShapeError(f"action has shape {array.shape}; wanted one whole number")
        action = int(array.item())
    if not first <= action <= last:
        raise ArgumentError(f"action is {action}; wanted a whole number from {first} to {last}")
    return int(action)


def _checked_numbers(space: spaces.Box, action: Any) -> Any:
    array = np.asarray(action)
    if array.dtype.kind not in "fiu":
        raise DTypeError(f"action is {shown(action)}; wanted numbers of shape {space.shape}")
    if array.shape != space.shape:
        raise ShapeError(f"action has shape {array.shape}; wanted {space.shape}")
    # Bounds are of the space's dtype: 0.7 of float64 is within a bound of 0.7 of float32.
    rounded = array.astype(space.dtype)
    inside = (rounded >= space.low) & (rounded <= space.high)
    if not inside.all():
        place = tuple(int(k) for k in np.argwhere(~inside)[0])
        name = f"action[{', '.join(map(str, place))}]"
        value, low, high = (float(each[place]) for each in (array, space.low, space.high))
        if not np.isfinite(value):
            raise NotFiniteError(f"{name} is {value}; wanted numbers from {low:g} to {high:g}")
        raise ArgumentError(f"{name} is {value:g}; wanted numbers from {low:g} to {high:g}")
    return array.astype(np.float64, copy=False)
