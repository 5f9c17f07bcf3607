"""How the numbers of ``dynx sim`` are written: in one style for each column, and no wider than they say."""

from __future__ import annotations

import math
from collections.abc import Sequence

_PLAIN = (1e-3, 1e5)
"""A column whose largest number lies in between is written without exponents."""


def error_text(error: float | None) -> str:
    """An error in two digits, ``-`` where there is none."""
    if error is None:
        return "-"
    return "0" if error == 0.0 else f"{error:.1e}"


def column_text(values: Sequence[float]) -> list[str]:
    """Numbers of one quantity: four digits of the largest, and as many decimals of the others."""
    largest = max(values, default=0.0)
    if largest == 0.0:
        return ["0"] * len(values)
    if not _PLAIN[0] <= largest < _PLAIN[1]:
        return [f"{value:.1e}" for value in values]
    decimals = max(0, 3 - math.floor(math.log10(largest)))
    return [f"{value:.{decimals}f}" for value in values]


def share_text(share: float) -> str:
    """A share as per cent in two digits; ``<0.01 %`` for less, ``>9999 %`` for what is beyond sense."""
    percent = 100.0 * share
    if percent == 0.0:
        return "0 %"
    if percent < 0.01:
        return "<0.01 %"
    if percent < 9.95:
        return f"{percent:.2f} %" if percent < 0.995 else f"{percent:.1f} %"
    return f"{percent:.0f} %" if percent < 9999.5 else ">9999 %"
