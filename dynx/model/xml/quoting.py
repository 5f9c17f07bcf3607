"""Attribute values of XML text."""

from __future__ import annotations

_ESCAPES = str.maketrans({"&": "&amp;", "<": "&lt;", ">": "&gt;", "\n": "&#10;", "\r": "&#13;", "\t": "&#9;"})


def quoteattr(text: str) -> str:
    """Return a text as the value of an attribute, in quotes, as `xml.sax.saxutils.quoteattr` does.

    That module imports an HTTP client, which takes a sixth of the time in which models are imported.
    """
    escaped = text.translate(_ESCAPES)
    if '"' not in escaped:
        return f'"{escaped}"'
    if "'" not in escaped:
        return f"'{escaped}'"
    return '"' + escaped.replace('"', "&quot;") + '"'
