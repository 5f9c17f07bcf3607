"""Edits that rename a link or a joint wherever a document names it."""

from __future__ import annotations

from collections.abc import Collection

from dynx.model.xml.source import Edit, SourceElement, XmlSource


def fresh_name(wanted: str, taken: Collection[str]) -> str:
    """The name `wanted`, with a number appended where it is taken."""
    name, number = wanted, 1
    while name in taken:
        number += 1
        name = f"{wanted}_{number}"
    return name


def renaming_link(source: XmlSource, old: str, new: str) -> list[Edit]:
    """Edits that rename a link in its element, in joints and in Gazebo references."""
    edits = []
    for element in source.root.walk():
        if element.tag == "link" and element.parent is source.root:
            edits += _where(source, element, "name", old, new)
        elif element.tag in ("parent", "child"):
            edits += _where(source, element, "link", old, new)
        elif element.tag == "gazebo":
            edits += _where(source, element, "reference", old, new)
    return edits


def renaming_joint(source: XmlSource, old: str, new: str) -> list[Edit]:
    """Edits that rename a joint in its element, in mimic joints, transmissions and Gazebo references."""
    links = {link.attributes.get("name") for link in source.root.all("link")}
    edits = []
    for element in source.root.walk():
        if element.tag == "joint" and element.parent is not None:
            edits += _where(source, element, "name", old, new)
        elif element.tag == "mimic":
            edits += _where(source, element, "joint", old, new)
        elif element.tag == "gazebo" and old not in links:
            edits += _where(source, element, "reference", old, new)
    return edits


def _where(source: XmlSource, element: SourceElement, attribute: str, old: str, new: str) -> list[Edit]:
    return [source.setting(element, attribute, new)] if element.attributes.get(attribute) == old else []
