"""Errors for ball joints of a description with numbers that no ball joint has."""

from __future__ import annotations

from typing import NoReturn

from dynx.errors import DescriptionError, UnsupportedFeatureError, shown
from dynx.model.elements import Joint


def refuse_numbers(joint: Joint, source: str) -> NoReturn:
    """Raise DescriptionError for a largest angle below 0, or else UnsupportedFeatureError for a spring."""
    if not joint.limits.upper >= 0.0:
        raise DescriptionError(
            f"the largest angle of ball joint {shown(joint.name)} is {joint.limits.upper}; wanted at least 0",
            source=source,
            line=joint.line,
        )
    raise UnsupportedFeatureError(
        f"ball joint {shown(joint.name)} has a spring of {joint.dynamics.stiffness:g} N m/rad; ball joints "
        "have none in dynx",
        source=source,
        line=joint.line,
    )
