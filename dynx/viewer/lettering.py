"""Words in pictures: names and numbers at their points, and how large the tiles of the ground are. Imports
Pillow."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dynx.errors import importing
from dynx.spatial.scalar import Floats
from dynx.steppers.camera import Camera
from dynx.viewer.node_shapes import Words

with importing("words on pictures need Pillow: pip install 'dynx[viewer]'"):
    from PIL import Image, ImageDraw, ImageFont

_LETTERS = 0.021
"""Size of the letters, as a share of the height of the picture."""

_LEAST = 11.0
"""Least size of the letters [pixels]."""

_PAGE_HEIGHT = 700.0
"""Height of a page [pixels] in which text of a size of its own is as large as in a picture."""

_PAPER, _INK = (255, 255, 255, 215), (20, 24, 30, 255)
"""Colours of the border of words and of their letters."""


def write_words(rgb: NDArray[np.uint8], words: Sequence[Words], camera: Camera) -> NDArray[np.uint8]:
    """Return a picture (height, width, 3) of a camera with words at their points, above everything else.

    The first of two that would overlap is moved above its point, and one without room is left out.
    """
    if not words:
        return rgb
    letters = _Letters(rgb)
    T = camera.pose.matrix
    columns, rows = np.array(camera.size)
    for each in words:
        x, y, z = T[:3, :3].T @ (np.asarray(each.point) - T[:3, 3])
        if z < camera.near:
            continue
        place = camera.focal_length * np.array([x, y]) / z + 0.5 * np.array([columns, rows])
        size = None if each.size is None else each.size * rows / _PAGE_HEIGHT
        letters.write(each.text, place, each.colour, size)
    return letters.picture()


def write_caption(rgb: NDArray[np.uint8], text: str) -> NDArray[np.uint8]:
    """Return a picture (height, width, 3) with text in its lower right corner."""
    letters = _Letters(rgb)
    letters.write_in_corner(text)
    return letters.picture()


def length_text(length: float) -> str:
    """Return a length [m] in a unit that suits it."""
    if length >= 1.0:
        return f"{length:g} m"
    return f"{100.0 * length:g} cm" if length >= 0.01 else f"{1000.0 * length:g} mm"


class _Letters:
    """A picture on which words are written, none over another."""

    def __init__(self, rgb: NDArray[np.uint8]) -> None:
        self._image: Any = Image.fromarray(rgb)
        self._draw: Any = ImageDraw.Draw(self._image, "RGBA")
        self._height, self._width = rgb.shape[:2]
        self._size = max(_LEAST, _LETTERS * self._height)
        self._taken: list[tuple[float, float, float, float]] = []

    def picture(self) -> NDArray[np.uint8]:
        return np.asarray(self._image, dtype=np.uint8)

    def write(self, text: str, place: Floats, colour: str | None, size: float | None) -> None:
        font = ImageFont.load_default(size or self._size)
        left, top, right, bottom = self._draw.textbbox((0, 0), text, font=font)
        border = 0.3 * self._size if colour is None else 0.0
        wide, high = right - left + 2.0 * border, bottom - top + 2.0 * border
        for up, back in ((0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0)):
            x, y = place[0] - back * wide, place[1] - up * high
            box = (x, y, x + wide, y + high)
            if not any(_overlap(box, other) for other in self._taken):
                break
        else:
            return
        if box[2] < 0 or box[3] < 0 or box[0] > self._width or box[1] > self._height:
            return
        self._taken.append(box)
        if colour is None:
            self._draw.rounded_rectangle(box, radius=border, fill=_PAPER)
        self._draw.text((x + border - left, y + border - top), text, font=font, fill=colour or _INK)

    def write_in_corner(self, text: str) -> None:
        font = ImageFont.load_default(1.1 * self._size)
        gap, border = 0.8 * self._size, 0.4 * self._size
        lines = [""]
        for clause in text.split("; "):
            longer = f"{lines[-1]}; {clause}" if lines[-1] else clause
            if self._draw.textlength(longer, font=font) <= self._width - 2.0 * (gap + border):
                lines[-1] = longer
            else:
                lines.append(clause)
        text = "\n".join(line for line in lines if line)
        left, top, right, bottom = self._draw.textbbox((0, 0), text, font=font)
        x, y = self._width - gap - border - (right - left), self._height - gap - border - (bottom - top)
        box = (x - border, y - border, x + right - left + border, y + bottom - top + border)
        self._draw.rounded_rectangle(box, radius=border, fill=(255, 255, 255, 150))
        self._draw.text((x - left, y - top), text, font=font, fill=_INK)


def _overlap(a: tuple[float, float, float, float], b: tuple[float, float, float, float]) -> bool:
    return a[0] < b[2] and b[0] < a[2] and a[1] < b[3] and b[1] < a[3]
