"""Edits that rename a link or a joint wherever a document names it."""

from __future__ import annotations

from collections.abc import Collection

from dynx.model.xml.source import Edit, SourceElement, XmlSource


def fresh_name(wanted: str, taken: Collection[str]) -> str:
    """Return the name `wanted`, with a number appended where it is taken."""
    name, number = wanted, 1
    while name in taken:
        number += 1
        name = f"{wanted}_{number}"
    return name


def link_rename(source: XmlSource, old: str, new: str) -> list[Edit]:
    """Return the edits that rename a link in its element, in joints and in Gazebo references."""
    edits = []
    for element in source.root.walk():
        if element.tag == "link" and element.parent is source.root:
            edits += _rename(source, element, "name", old, new)
        elif element.tag in ("parent", "child"):
            edits += _rename(source, element, "link", old, new)
        elif element.tag == "gazebo":
            edits += _rename(source, element, "reference", old, new)
    return edits


def joint_rename(source: XmlSource, old: str, new: str) -> list[Edit]:
    """Return the edits that rename a joint in its element, mimics, transmissions and Gazebo references."""
    links = {link.attributes.get("name") for link in source.root.all("link")}
    edits = []
    for element in source.root.walk():
        if element.tag == "joint" and element.parent is not None:
            edits += _rename(source, element, "name", old, new)
        elif element.tag == "mimic":
            edits += _rename(source, element, "joint", old, new)
        elif element.tag == "gazebo" and old not in links:
            edits += _rename(source, element, "reference", old, new)
    return edits


def _rename(source: XmlSource, element: SourceElement, name: str, old: str, new: str) -> list[Edit]:
    return [source.attribute_edit(element, name, new)] if element.attributes.get(name) == old else []
