"""Refusal of masked arrays, whose masks NumPy's functions would drop without a word."""

from __future__ import annotations

import numpy as np

from dynx.errors import DTypeError


def refuse_mask(name: str, value: object) -> None:
    """Raise DTypeError for a masked array, or a list or tuple with one inside."""
    if isinstance(value, list | tuple):
        for each in value:
            if not isinstance(each, float | int):
                refuse_mask(name, each)
    elif isinstance(value, np.ma.MaskedArray):
        raise DTypeError(
            f"{name} is a masked array; wanted an array without a mask, such as its method filled returns"
        )
