"""What a file of a mesh says about its surface: triangles, and the normals, materials and colours on them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dynx.spatial.scalar import Floats

Colour = tuple[float, float, float, float]


MAX_TRIANGLES = 2_000_000
"""Largest number of triangles of a mesh."""


class ImageFile(NamedTuple):
    """An image that a file names or holds."""

    name: str
    """Path relative to the folder of the file, or what the image is called in messages."""
    content: bytes | None = None
    """Bytes of an image within the file."""
    wraps: tuple[bool, bool] = (True, True)
    """Whether the image repeats along u and v; its border continues otherwise."""


class FileMaterial(NamedTuple):
    """A material; the image, where it can be read, is shown instead of the colour."""

    rgba: Colour | None = None
    """Red, green, blue and opacity from 0 to 1; None for a material without a colour."""
    image: ImageFile | None = None
    tint: Colour = (1.0, 1.0, 1.0, 1.0)
    """Factors of the colours of the image, and of those of corners."""


class FileSurface(NamedTuple):
    """The surface that a file of a mesh describes, unscaled."""

    vertices: Floats
    """Shape (n, 3) [m]."""
    faces: NDArray[np.intp]
    """Vertices of each triangle (m, 3)."""
    normals: Floats | None = None
    """Normal at each corner (m, 3, 3), of any length, NaN for none; None for a file without any."""
    uv: Floats | None = None
    """Place of each corner in the image (m, 3, 2): (0, 0) is lower left in it, (1, 1) upper right."""
    colours: Floats | None = None
    """Red, green and blue of each corner (m, 3, 3) from 0 to 1, NaN for none."""
    materials: tuple[FileMaterial, ...] = (FileMaterial(),)
    material_of: NDArray[np.intp] | None = None
    """Number of the material of each triangle (m,); None where all have the first."""
    notes: tuple[str, ...] = ()
    """What of the file is not drawn, one clause each."""
