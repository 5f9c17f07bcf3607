"""Films as GIF files, from pictures."""

from __future__ import annotations

import io
import os
from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from dynx.errors import ArgumentError
from dynx.files.writing import write_bytes
from dynx.viewer.library import Image

COLOURS = 128
"""Number of colours of a picture of a film."""

SHORTEST = 20
"""Shortest time between two pictures that browsers keep to [ms]."""


def write_gif(path: str | os.PathLike[str], pictures: Iterable[NDArray[np.uint8]], period: float) -> None:
    """Write pictures (height, width, 3) as a GIF file that shows one every `period` [s], again and again.

    Raises ArgumentError without a picture, and for a file that cannot be written.
    """
    # One table of colours for all pictures would lose the shades of the later ones.
    drawn = [Image.fromarray(each).quantize(COLOURS) for each in pictures]
    if not drawn:
        raise ArgumentError("a film needs a picture; there is none")
    stream = io.BytesIO()
    drawn[0].save(
        stream,
        format="GIF",
        save_all=True,
        append_images=drawn[1:],
        duration=max(SHORTEST, round(1e3 * period)),
        loop=0,
    )
    write_bytes(path, stream.getvalue())
