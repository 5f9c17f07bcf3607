"""Formats of the documents that describe robots."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Literal

Format = Literal["mjcf", "sdf", "urdf"]
"""Format of the document of a robot."""


SUFFIXES: Mapping[Format, tuple[str, ...]] = {
    "mjcf": (".xml", ".mjcf"),
    "sdf": (".sdf",),
    "urdf": (".urdf",),
}
"""Suffixes of the files of each format; the first is that of a file without a name."""


def format_of_root(tag: str) -> Format:
    """Return the format of a document by the tag of its root; every other tag is read as URDF."""
    if tag == "mujoco":
        return "mjcf"
    return "sdf" if tag == "sdf" else "urdf"
