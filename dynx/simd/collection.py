"""Pause of Python's garbage collection while a program is traced and compiled.

Both allocate hundreds of thousands of objects that stay, in no cycles. The collector looks through all of
them again and again, which takes up to a fifth of the time.
"""

from __future__ import annotations

import gc
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def collection_paused() -> Iterator[None]:
    """Pause the collection of cycles in a ``with`` block, or leave it off if it is."""
    if not gc.isenabled():
        yield
        return
    # In several threads the first block that ends switches it on again, which costs time and nothing else.
    gc.disable()
    try:
        yield
    finally:
        gc.enable()
