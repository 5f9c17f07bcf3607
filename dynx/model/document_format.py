"""Formats of the documents that describe robots."""

from __future__ import annotations

from typing import Literal

Format = Literal["mjcf", "sdf", "urdf"]
"""Format of the document of a robot."""


def format_of_root(tag: str) -> Format:
    """Return the format of a document by the tag of its root; every other tag is read as URDF."""
    if tag == "mujoco":
        return "mjcf"
    return "sdf" if tag == "sdf" else "urdf"
