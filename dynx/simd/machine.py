"""Number of processors and size of the memory of this machine."""

from __future__ import annotations

import ctypes
import os
import sys
from functools import cache

from dynx.errors import ArgumentError

MAX_MEMORY_SHARE = 0.5
"""Largest fraction of the machine's memory that the arrays of one computation may take."""


@cache
def core_count() -> int:
    """Return the number of processors that this process may use."""
    if hasattr(os, "process_cpu_count"):
        return int(os.process_cpu_count() or 1)
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def require_memory(what: str, size: float) -> None:
    """Raise ArgumentError if the arrays of `what`, of `size` bytes, are too large for this machine."""
    if size > MAX_MEMORY_SHARE * memory_size():
        raise ArgumentError(
            f"{what} need about {size / 1e9:.3g} GB; this machine has {memory_size() / 1e9:.3g} GB, of which "
            f"one computation may take {MAX_MEMORY_SHARE:.0%}"
        )


def memory_size() -> float:
    """Return the size of the machine's memory [bytes], or infinity if the system does not report it."""
    if sys.platform == "win32":
        kilobytes = ctypes.c_ulonglong(0)
        known = ctypes.windll.kernel32.GetPhysicallyInstalledSystemMemory(ctypes.byref(kilobytes))
        return 1024.0 * kilobytes.value if known else float("inf")
    try:
        return float(os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES"))
    except (OSError, ValueError):
        return float("inf")
