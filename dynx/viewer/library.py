"""Imports of viser (the page), rich (its prints), fast-simplification (meshes) and Pillow (films)."""

from __future__ import annotations

import io
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stdout

import rich

from dynx.errors import NotInstalledError

try:
    import viser
    from fast_simplification import simplify
    from PIL import Image
    from viser import uplot
except ImportError as error:
    raise NotInstalledError(f"the viewer needs viser: pip install 'dynx[viewer]' ({error})") from error

__all__ = ["HOTKEYS", "Image", "silent", "simplify", "uplot", "viser"]

HOTKEYS = (
    *(chr(code) for code in range(ord("A"), ord("Z") + 1)),
    *(str(digit) for digit in range(10)),
    *("space", "enter", "escape", "tab", "backspace", "delete", "insert", "home", "end"),
    *("pageup", "pagedown", "arrowup", "arrowdown", "arrowleft", "arrowright"),
)
"""Keys of which viser's page tells."""


@contextmanager
def silent() -> Iterator[None]:
    """Suppress what viser prints, which is its addresses and its end, also when it is told not to.

    In a notebook rich displays it instead of printing it.
    """
    console = rich.get_console()
    before = console.quiet
    console.quiet = True
    try:
        with redirect_stdout(io.StringIO()):
            yield
    finally:
        console.quiet = before
