"""Imports of viser (the page), rich (its prints), fast-simplification (meshes) and Pillow (films), and the
start of viser's server."""

from __future__ import annotations

import io
import threading
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stdout
from pathlib import Path
from typing import Any

import rich

from dynx.errors import NotInstalledError

try:
    import viser
    from fast_simplification import __version__ as SIMPLIFY_VERSION
    from fast_simplification import simplify
    from PIL import Image
    from viser import uplot
except ImportError as error:
    raise NotInstalledError(f"the viewer needs viser: pip install 'dynx[viewer]' ({error})") from error

__all__ = ["CLIENT", "HOTKEYS", "SIMPLIFY_VERSION", "Image", "serve", "silent", "simplify", "uplot"]

CLIENT = Path(viser.__file__).parent / "client" / "build" / "index.html"
"""The page of viser."""

_starting = threading.Lock()

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


def serve(host: str, port: int, title: str, folder: Path) -> Any:
    """Start a server of viser, with the page in a folder instead of its own.

    viser takes no folder, so the class that serves it is replaced while the server starts. A version of viser
    that serves in another way shows its own page.
    """
    infra: Any = viser.infra
    with _starting, silent():
        original: Any = getattr(infra, "WebsockServer", None)

        def from_folder(*arguments: Any, **given: Any) -> Any:
            if "http_server_root" in given:
                given["http_server_root"] = folder
            return original(*arguments, **given)

        if original is not None:
            infra.WebsockServer = from_folder
        try:
            return viser.ViserServer(host, port, label=title, verbose=False)
        finally:
            if original is not None:
                infra.WebsockServer = original
