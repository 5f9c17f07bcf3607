"""Colours of the viewer, told apart by readers with any colour vision (Okabe and Ito 2008)."""

from __future__ import annotations

RGB = tuple[int, int, int]

GREY: RGB = (160, 160, 160)
"""Shapes without a colour of their own."""
ORANGE: RGB = (230, 159, 0)
"""Collision shapes."""
SKY_BLUE: RGB = (86, 180, 233)
"""The second motion of two, and references."""
GREEN: RGB = (0, 158, 115)
"""Traces of frames, and friction forces."""
BLUE: RGB = (0, 114, 178)
"""Inertia, and ellipsoids of manipulability."""
VERMILION: RGB = (213, 94, 0)
"""Contact forces and torques; inertia that no body can have."""
PURPLE: RGB = (204, 121, 167)
"""Centres of mass."""

SERIES: tuple[RGB, ...] = (BLUE, VERMILION, GREEN, ORANGE, SKY_BLUE, PURPLE, (120, 120, 120))
"""Curves of a plot, in their order."""


def css(colour: RGB) -> str:
    """Return a colour as CSS writes it."""
    return f"rgb({colour[0]}, {colour[1]}, {colour[2]})"
