"""The versions of the engines on which the catalogue was measured."""

from __future__ import annotations

from collections.abc import Mapping

EVERY_ENGINE: Mapping[str, str] = {
    "pinocchio": ">=4.1.0",
    "pybullet": ">=3.2.7",
    "mujoco": ">=4.0.0",
    "drake": ">=1.51.1",
}
"""All four from those versions on: `Rule.engines` of a cause that none of them reads as dynx does."""
