"""The shapes that engines know, as the children of ``<geometry>``."""

from __future__ import annotations

from dynx.model.xml.source import SourceElement

KNOWN = frozenset(["box", "sphere", "cylinder", "capsule", "mesh"])
"""Shapes that every engine knows."""

BULLET_ONLY = frozenset(["plane", "cdf"])
"""Extensions of PyBullet."""


def shapes_in(shape: SourceElement) -> list[str]:
    """Return the tags in the first ``<geometry>`` of a ``<visual>`` or ``<collision>``."""
    geometry = shape.first("geometry")
    return [] if geometry is None else [child.tag for child in geometry.children]


def has_shape(shape: SourceElement) -> bool:
    """Check whether a ``<visual>`` or ``<collision>`` has a shape that PyBullet knows."""
    return any(tag in KNOWN or tag in BULLET_ONLY for tag in shapes_in(shape))
