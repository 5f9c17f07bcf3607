"""Colours of the viewer, told apart by readers with any colour vision (Okabe and Ito 2008)."""

from __future__ import annotations

RGB = tuple[int, int, int]

GREY: RGB = (160, 160, 160)
"""Shapes without a colour of their own."""
ORANGE: RGB = (230, 159, 0)
"""Collision shapes, and the lines of robots without shapes."""
SKY_BLUE: RGB = (86, 180, 233)
"""The second motion of two, and references."""
GREEN: RGB = (0, 158, 115)
"""Curves only: to deuteranopes it is nearly grey."""
BLUE: RGB = (0, 114, 178)
"""Inertia, ellipsoids of manipulability, and traces of parts."""
VERMILION: RGB = (213, 94, 0)
"""Contact forces and torques; inertia that no body can have."""
YELLOW: RGB = (240, 228, 66)
"""Centres of mass."""

SERIES: tuple[RGB, ...] = (BLUE, ORANGE, GREEN, SKY_BLUE)
"""Curves of a plot, in their order; further ones have `DASHES`."""
DASHES: tuple[tuple[str, tuple[float, ...] | None], ...] = (
    ("solid", None),
    ("dashed", (8.0, 4.0)),
    ("dotted", (2.0, 3.0)),
)
"""Names, and lengths of strokes and gaps [pixels], of the curves that use the colours for the first, second
and third time."""

NAMED: dict[str, RGB] = {
    "black": (0, 0, 0),
    "blue": BLUE,
    "green": GREEN,
    "grey": GREY,
    "orange": ORANGE,
    "red": (200, 40, 40),
    "sky blue": SKY_BLUE,
    "vermilion": VERMILION,
    "white": (255, 255, 255),
    "yellow": YELLOW,
}
"""Colours that a program may give by name."""


def css(colour: RGB) -> str:
    """Return a colour as CSS writes it."""
    return f"rgb({colour[0]}, {colour[1]}, {colour[2]})"
