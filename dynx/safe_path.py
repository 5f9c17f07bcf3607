"""Child processes of Python that import nothing from the current folder.

``python -c`` puts the current folder in front of Python's own modules, so a file ``struct.py`` there would be
executed. That is how glfw, which MuJoCo imports, looks for its library, and how `multiprocessing` starts its
processes. Python 3.11 and later leave the folder out where the environment says so.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager

_VARIABLE = "PYTHONSAFEPATH"
"""Environment variable by which Python does not search the current folder for modules."""


def isolate_children() -> None:
    """Keep the current folder out of every process of Python that this one starts from now on."""
    os.environ[_VARIABLE] = "1"


@contextmanager
def isolated_children() -> Iterator[None]:
    """Keep the current folder out of the processes of Python that are started in the block."""
    before = os.environ.get(_VARIABLE)
    isolate_children()
    try:
        yield
    finally:
        if before is None:
            os.environ.pop(_VARIABLE, None)
        else:
            os.environ[_VARIABLE] = before
