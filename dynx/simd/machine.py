"""What the machine has besides processors."""

from __future__ import annotations

import os

LARGEST_SHARE = 0.5
"""Of the machine's memory, that the arrays of one work may take."""


def memory() -> float:
    """Bytes of memory that the machine has; infinity where the system does not say."""
    try:
        return float(os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES"))
    except (AttributeError, OSError, ValueError):
        return float("inf")
