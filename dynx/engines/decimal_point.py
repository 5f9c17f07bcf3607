"""Numbers with a decimal point, whatever the locale of the program.

C libraries read numbers by the locale in force: where a program has called
``locale.setlocale(locale.LC_ALL, "de_DE.UTF-8")``, PyBullet 3.2.7 reads 1.5 as 1. Pinocchio, MuJoCo and Drake
read numbers by rules of their own.
"""

from __future__ import annotations

import ctypes
import locale
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from threading import RLock
from typing import Any

_LC_NUMERIC_MASK = 1 << 4 if sys.platform == "darwin" else 1 << 1
"""LC_NUMERIC_MASK of <locale.h>."""

_PROCESS_LOCALE = RLock()


@contextmanager
def decimal_point() -> Iterator[None]:
    """Let C functions of this thread read numbers with a decimal point.

    Other threads keep their locale where the system has locales of threads (POSIX 2008). Elsewhere the locale
    of the process is changed and restored, by one thread at a time.
    """
    c = _posix()
    if c is None:
        with _PROCESS_LOCALE:
            before = locale.setlocale(locale.LC_NUMERIC)
            locale.setlocale(locale.LC_NUMERIC, "C")
            try:
                yield
            finally:
                locale.setlocale(locale.LC_NUMERIC, before)
        return
    before = c.uselocale(None)
    copy = c.duplocale(before)
    changed = c.newlocale(_LC_NUMERIC_MASK, b"C", copy) if copy else None
    if not changed:  # out of memory
        raise MemoryError("no memory for a locale")
    c.uselocale(changed)
    try:
        yield
    finally:
        c.uselocale(before)
        c.freelocale(changed)


@cache
def _posix() -> Any:
    """Return the C library with the functions for locales of threads, or None where it has none."""
    try:
        library = ctypes.PyDLL(None)
        functions = library.uselocale, library.duplocale, library.newlocale, library.freelocale
    except (OSError, TypeError, AttributeError):  # Windows
        return None
    for function in functions:
        function.restype = ctypes.c_void_p
    library.uselocale.argtypes = library.duplocale.argtypes = library.freelocale.argtypes = [ctypes.c_void_p]
    library.newlocale.argtypes = [ctypes.c_int, ctypes.c_char_p, ctypes.c_void_p]
    library.freelocale.restype = None
    return library
