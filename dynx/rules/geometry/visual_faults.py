"""Faults of visuals for which an engine refuses a file, although no visual changes the dynamics."""

from __future__ import annotations

from collections.abc import Iterator

from dynx.errors import shown
from dynx.model.xml.source import SourceElement
from dynx.rules.text.number_text import is_number

_REQUIRED = {
    "box": ("size",),
    "sphere": ("radius",),
    "cylinder": ("radius", "length"),
    "capsule": ("radius", "length"),
    "mesh": ("filename",),
}
"""The attributes without which PyBullet refuses a shape."""


def visual_faults(visual: SourceElement) -> Iterator[tuple[SourceElement, str]]:
    """Yield the faults of the first shape and the first material of a visual: the element, and a message."""
    geometry = visual.first("geometry")
    for shape in [] if geometry is None else geometry.children[:1]:
        missing = [name for name in _REQUIRED.get(shape.tag, ()) if name not in shape.attributes]
        # An empty size is read as zero, an empty file name as no file.
        if missing or shape.attributes.get("filename") == "":
            yield shape, f"<{shape.tag}> of a visual has no {' and no '.join(missing) or 'filename'}"
    for material in visual.all("material")[:1]:
        color = material.first("color")
        rgba = "" if color is None else color.attributes.get("rgba", "")
        words = rgba.split()
        if "name" not in material.attributes:
            yield material, "the <material> of a visual has no name"
        if color is not None and not (len(words) == 4 and all(map(is_number, words))):
            yield color, f"the colour of a visual is {shown(rgba) if rgba else 'missing'}, not four numbers"


def may_be_refused(visual: SourceElement) -> bool:
    """Check whether an engine may refuse a visual that has a shape (a second material: DX411)."""
    return len(visual.all("material")) > 1 or next(visual_faults(visual), None) is not None
