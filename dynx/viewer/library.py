"""The only imports of viser (the page), fast-simplification (reduced meshes) and Pillow (films)."""

from __future__ import annotations

from dynx.errors import NotInstalledError

try:
    import viser
    from fast_simplification import simplify
    from PIL import Image
    from viser import uplot
except ImportError as error:
    raise NotInstalledError(f"the viewer needs viser: pip install 'dynx[viewer]' ({error})") from error

__all__ = ["HOTKEYS", "Image", "simplify", "uplot", "viser"]

HOTKEYS = (
    *(chr(code) for code in range(ord("A"), ord("Z") + 1)),
    *(str(digit) for digit in range(10)),
    *("space", "enter", "escape", "tab", "backspace", "delete", "insert", "home", "end"),
    *("pageup", "pagedown", "arrowup", "arrowdown", "arrowleft", "arrowright"),
)
"""Keys of which viser's page tells."""
