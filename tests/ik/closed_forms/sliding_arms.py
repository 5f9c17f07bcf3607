"""Random arms with prismatic joints, or of parallel axes alone, that have a closed form."""

from __future__ import annotations

import numpy as np

from dynx.model import Model
from dynx.spatial.scalar import Floats
from dynx.spatial.so3 import cross
from tests.ik.closed_forms.arms import LENGTH, arm_of

FAMILIES = (
    "PPPRRR", "PPPRR", "PPPR", "PPP", "RPPRPR", "RRPPRP",
    "RRPR parallel", "RPRR parallel", "PRRR parallel", "RRRP parallel", "RRR parallel",
    "PPR wrist", "PRP wrist", "RPP wrist", "RRP wrist, meeting", "RRP wrist, axes 1 and 2 parallel",
    "RPR wrist", "RPR wrist, level", "RPR wrist, axes 1 and 3 parallel",
    "PRR wrist", "PRR wrist, level", "PRR wrist, axes 2 and 3 parallel",
)  # fmt: skip
"""Kinds of the joints before a spherical wrist, or of all joints, and the properties of their axes."""


def random_sliding_arm(family: str, rng: np.random.Generator, deviation: float = 0.0) -> Model:
    """Return an arm, in the direction of the family or in the inverse one; joints move by +-pi [rad or m]."""
    kinds, _, rest = family.partition(" ")
    kinds += "RRR" * rest.startswith("wrist")
    axes = rng.normal(size=(len(kinds), 3))
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    points = LENGTH * rng.normal(size=(len(kinds), 3))
    if rest == "parallel":
        axes = axes[0] * rng.choice([-1.0, 1.0], size=(len(kinds), 1))
    elif rest:
        points[3:] = points[3]
        _arrange(family, axes, points, rng)
    if rng.random() < 0.5:
        axes, points, kinds = axes[::-1], points[::-1], kinds[::-1]
    axes = axes + deviation * rng.normal(size=axes.shape)
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    return arm_of(axes, points + deviation * rng.normal(size=points.shape), kinds, rng, np.pi)


def _arrange(family: str, axes: Floats, points: Floats, rng: np.random.Generator) -> None:
    """Give the axes the properties of a family."""
    before, slide = (0, 1) if family.startswith("RPR") else (1, 0)
    if "meeting" in family:
        points[1] = points[0] + axes[1] * rng.normal()
    if "level" in family:
        level = cross(axes[before], axes[slide])
        axes[slide] = level / np.linalg.norm(level)
    if "axes 1 and 2" in family:
        axes[1] = axes[0] * rng.choice([-1.0, 1.0])
    if "axes 1 and 3" in family or "axes 2 and 3" in family:
        axes[2] = axes[before] * rng.choice([-1.0, 1.0])
