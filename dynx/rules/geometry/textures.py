"""Textures of the materials of a robot: which of them Drake finds when it parses the file."""

from __future__ import annotations

import os
from collections.abc import Iterator
from urllib.parse import unquote, urlsplit

from dynx.errors import shown
from dynx.model.xml.source import Edit, SourceElement, XmlSource

GREY = '<color rgba="0.5 0.5 0.5 1"/>'
"""Colour in place of a texture."""


def robot_textures(source: XmlSource) -> Iterator[tuple[SourceElement, SourceElement]]:
    """Yield the ``<material>`` elements directly in the robot that name a texture, each with its texture."""
    for material in source.root.all("material"):
        texture = material.first("texture")
        if texture is not None and texture.attributes.get("filename"):
            yield material, texture


def visual_textures(link: SourceElement) -> Iterator[SourceElement]:
    """Yield the ``<texture>`` elements in the materials of the visuals of a link."""
    for visual in link.all("visual"):
        for material in visual.all("material"):
            yield from material.all("texture")


def missing_texture(texture: SourceElement, source: str) -> str | None:
    """Return the reason why Drake does not find a texture of the description `source` (a path), or None.

    None also where that cannot be known: a relative path in a text that was read from no file.
    """
    filename = texture.attributes["filename"]
    if filename.startswith("package://"):
        package = filename.removeprefix("package://").partition("/")[0]
        return f"Drake does not know the package {shown(package)} of the texture {shown(filename, 200)}"
    if filename.startswith("file://"):
        path = unquote(urlsplit(filename).path)
        return None if os.path.isfile(path) else f"no texture {shown(filename, 200)}"
    if "://" in filename:
        return f"Drake cannot read the texture {shown(filename, 200)} from there"
    here = os.path.isfile(os.path.join(os.path.dirname(source), filename))
    return None if here or not os.path.isfile(source) else f"no texture {shown(filename, 200)}"


def texture_replacements(source: XmlSource) -> Iterator[Edit]:
    """Replace each texture of the robot that exists by a colour: a copy of the file elsewhere loads alike."""
    for material, texture in robot_textures(source):
        if missing_texture(texture, source.source) is None:
            has_color = material.first("color") is not None
            yield source.removal(texture) if has_color else source.replacement(texture, GREY)
