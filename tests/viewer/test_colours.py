"""Colours that stand beside each other, as readers without one kind of cone see them."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest

from dynx.spatial.scalar import Floats
from dynx.viewer.colours import BLUE, GREY, ORANGE, RGB, SERIES, SKY_BLUE, VERMILION, YELLOW

TOLD_APART = 20.0
"""Distance in CIELAB; from about 2 on a difference is seen at all."""

# Machado, Oliveira and Fernandes (2009), severity 1, for linear RGB.
DICHROMATS = {
    "protanope": [
        [0.152286, 1.052583, -0.204868],
        [0.114503, 0.786281, 0.099216],
        [-0.003882, -0.048116, 1.051998],
    ],
    "deuteranope": [
        [0.367322, 0.860646, -0.227968],
        [0.280085, 0.672501, 0.047413],
        [-0.011820, 0.042940, 0.968881],
    ],
}

XYZ = np.array(
    [[0.4124564, 0.3575761, 0.1804375], [0.2126729, 0.7151522, 0.0721750], [0.0193339, 0.1191920, 0.9503041]]
)
"""CIE XYZ of the primaries of linear sRGB, as columns."""


def seen(colour: RGB, cones: Floats) -> Floats:
    """Return a colour in CIELAB (3,) as a dichromat sees it."""
    c = np.array(colour) / 255.0
    linear = np.where(c <= 0.04045, c / 12.92, ((c + 0.055) / 1.055) ** 2.4)
    x = XYZ @ np.clip(cones @ linear, 0.0, 1.0) / XYZ.sum(axis=1)
    f = np.where(x > 216 / 24389, np.cbrt(x), (24389 / 27 * x + 16) / 116)
    return np.array([116 * f[1] - 16, 500 * (f[0] - f[1]), 200 * (f[1] - f[2])])


def distance(a: RGB, b: RGB, kind: str) -> float:
    cones = np.array(DICHROMATS[kind])
    return float(np.linalg.norm(seen(a, cones) - seen(b, cones)))


@pytest.mark.parametrize("kind", DICHROMATS)
def test_dichromats_tell_marks_from_shapes_and_curves_from_each_other(kind: str) -> None:
    beside_shapes = [(GREY, mark) for mark in (ORANGE, SKY_BLUE, BLUE, VERMILION, YELLOW)]
    together = [
        (BLUE, VERMILION),
        (BLUE, YELLOW),
        (SKY_BLUE, YELLOW),
        (SKY_BLUE, BLUE),
        (SKY_BLUE, VERMILION),
    ]
    for a, b in [*beside_shapes, *together, *combinations(SERIES, 2)]:
        assert distance(a, b, kind) > TOLD_APART, (a, b)


def test_the_measure_finds_colours_that_are_confused() -> None:
    reddish_purple, bluish_green = (204, 121, 167), (0, 158, 115)
    assert distance(GREY, reddish_purple, "deuteranope") < 10.0
    assert distance(GREY, bluish_green, "deuteranope") < TOLD_APART
