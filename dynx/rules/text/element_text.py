"""Text between the tags of an element."""

from __future__ import annotations

from dynx.model.xml.source import SourceElement, XmlSource


def text_in(source: XmlSource, element: SourceElement) -> str:
    """Return the text of an element that holds no other; empty for any other element."""
    if element.empty or element.children:
        return ""
    inside = source.data[element.start_tag.end : element.span.end]
    return inside.decode("utf-8").rpartition("</")[0].strip()
