"""A button that copies a text to the clipboard of whoever looks at the page."""

from __future__ import annotations

from base64 import b64encode
from hashlib import sha256
from html import escape
from typing import Any

_COPY = (
    "const b = this, t = b.dataset.text;"
    "const done = () => { b.textContent = 'copied'; setTimeout(() => { b.textContent = b.title; }, 1500); };"
    # A page from another machine has no clipboard unless it is encrypted; a selection is copied there.
    "const select = () => { const a = document.createElement('textarea'); a.value = t; b.after(a);"
    " a.select(); document.execCommand('copy'); a.remove(); done(); };"
    "navigator.clipboard ? navigator.clipboard.writeText(t).then(done, select) : select();"
)
"""Action of the button. The text is data of the button, never part of a script."""

HANDLER_HASH = f"sha256-{b64encode(sha256(_COPY.encode()).digest()).decode()}"
"""Hash of the action, by which the content security policy of the page lets it run."""

_LOOK = (
    "display: block; box-sizing: border-box; width: calc(100% - 1.6em); margin: 0.4em 0.8em; height: 2em; "
    "border: 0; border-radius: 2px; cursor: pointer; font-size: 0.8em; color: white; "
    "background: var(--mantine-primary-color-filled)"
)


class CopyButton:
    """A button with a label, and the text that it copies."""

    def __init__(self, gui: Any, label: str) -> None:
        self._label = label
        self._node = gui.add_html(self._html(""))

    def put(self, text: str) -> None:
        """Set the text that is copied."""
        self._node.content = self._html(text)

    def _html(self, text: str) -> str:
        label, data = escape(self._label, quote=True), escape(text, quote=True)
        return (
            f'<button type="button" title="{label}" data-text="{data}" style="{_LOOK}" '
            f'onclick="{escape(_COPY, quote=True)}">{label}</button>'
        )
