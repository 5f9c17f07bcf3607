"""Checks of the arguments of a vector environment, and its errors."""

from __future__ import annotations

from typing import Any, NoReturn

import numpy as np
from numpy.typing import NDArray

from dynx.envs.actions import checked_action
from dynx.envs.library import AutoresetMode, Space, spaces
from dynx.errors import (
    ArgumentError,
    DivergedError,
    DTypeError,
    DynxError,
    EpisodeError,
    ShapeError,
    nearest,
    shown,
)
from dynx.spatial.scalar import Floats


def checked_mode(mode: AutoresetMode | str) -> AutoresetMode:
    """Return an autoreset mode, given itself, or by its name or value. Raises ArgumentError for another."""
    for each in AutoresetMode:
        if mode is each or mode in (each.name, each.value):
            return each
    names = [each.value for each in AutoresetMode]
    raise ArgumentError(f"autoreset_mode is {shown(mode)}{nearest(str(mode), names)}")


def checked_reset_mask(mask: Any, n: int, *, started: bool) -> NDArray[np.bool_]:
    """Return which environments start an episode (n,), by default all."""
    if mask is None:
        return np.ones(n, dtype=np.bool_)
    array = np.asarray(mask)
    if array.dtype != np.bool_:
        raise DTypeError(f"reset_mask is {shown(mask)}; wanted an array of bool")
    if array.shape != (n,):
        raise ShapeError(f"reset_mask has shape {array.shape}; wanted ({n},)")
    if not started and not array.all():
        raise EpisodeError("the first reset must start an episode in every environment")
    return array


def checked_actions(kinds: str, shape: tuple[int, ...], actions: Any) -> NDArray[Any]:
    """Return the actions of all environments as an array of this shape, of one of these kinds of dtype.

    Raises ShapeError or DTypeError.
    """
    array = np.asarray(actions)
    if array.dtype.kind not in kinds:
        wanted = "whole numbers" if kinds == "iu" else "numbers"
        raise DTypeError(f"actions are of type {array.dtype}; wanted {wanted}")
    if array.shape != shape:
        raise ShapeError(f"actions have shape {array.shape}; wanted {shape}")
    return array


def raise_defect(space: Space[Any], actions: Floats, defects: NDArray[np.bool_]) -> NoReturn:
    """Raise the error of the first environment with a defect (`dynx.envs.vector.kernels`)."""
    number = int(np.flatnonzero(defects)[0])
    action = int(actions[number]) if isinstance(space, spaces.Discrete) else actions[number]
    try:
        checked_action(space, action)
    except DynxError as error:
        raise type(error)(f"environment {number}: {error}") from None
    raise DivergedError(
        f"the velocity in environment {number} is not finite or too large to be meaningful",
        time=float("nan"),
        step=-1,
        state=(None, None),
    )
