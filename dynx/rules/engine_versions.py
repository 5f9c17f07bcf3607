"""The versions of the engines in which the rules of the catalogue were measured."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

EVERY_ENGINE: Mapping[str, str] = MappingProxyType(
    {"pinocchio": ">=4.1.0", "pybullet": ">=3.2.7", "mujoco": ">=4.0.0", "drake": ">=1.51.1"}
)
"""All engines: `Rule.engines` of a cause that none of them reads as dynx does."""


def measured_on(*engines: str, **versions: str) -> Mapping[str, str]:
    """Return `Rule.engines` for these engines, in the versions of `EVERY_ENGINE` or in `versions` of their
    own."""
    return {engine: EVERY_ENGINE[engine] for engine in engines} | versions
