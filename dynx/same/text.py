"""Values of elements as text."""

from __future__ import annotations

from collections.abc import Iterable

from dynx.model.elements import Inertial, Pose

ROUNDING = 1e-15
"""Share of the largest number of a vector below which another one is rounding, and written as 0."""


def vector_text(vector: Iterable[float], digits: int = 12) -> str:
    """Write numbers as an attribute has them; those that are rounding beside the largest are 0."""
    numbers = list(vector)
    rounding = ROUNDING * max(map(abs, numbers), default=0.0)
    return " ".join(f"{0.0 if abs(x) < rounding else x + 0.0:.{digits}g}" for x in numbers)


def pose_text(pose: Pose) -> str:
    """Write a pose as position and angles."""
    return f"xyz {vector_text(pose.xyz)}, rpy {vector_text(pose.rpy)}"


def inertial_text(inertial: Inertial | None) -> str:
    """Write an inertial in one line."""
    if inertial is None:
        return "none"
    moments = (inertial.ixx, inertial.iyy, inertial.izz, inertial.ixy, inertial.ixz, inertial.iyz)
    return f"{inertial.mass:.12g} kg at {vector_text(inertial.origin.xyz)}, moments {vector_text(moments)}"
