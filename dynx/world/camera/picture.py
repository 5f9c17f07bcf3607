"""`Picture`: colour, depth and segmentation of what a camera sees, and its PNG files."""

from __future__ import annotations

import os
import struct
import zlib
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dynx.errors import ArgumentError, UnknownNameError, nearest, shown
from dynx.files.reading import checked_path
from dynx.files.writing import write_bytes
from dynx.spatial.scalar import Floats

DEPTH_UNIT = 1e-3
"""Length [m] of one step of the grey values in a PNG file of depths."""


@dataclass(frozen=True, eq=False)
class Picture:
    """A picture of a camera; the first row is the upper one, the first column the left one."""

    rgb: NDArray[np.uint8]
    """Colour (height, width, 3)."""
    depth: Floats
    """Distance along the optical axis (height, width) [m]; infinite where nothing is seen."""
    segmentation: NDArray[np.intp]
    """Number in `names` of the part that is seen (height, width); -1 where nothing is."""
    names: tuple[str, ...]
    """Links as ``robot/link``, and bodies."""

    def mask(self, name: str) -> NDArray[np.bool_]:
        """Return where a body, ``robot/link``, or any link of a robot is seen (height, width).

        Raises UnknownNameError for another name.
        """
        numbers = [k for k, each in enumerate(self.names) if each == name or each.startswith(f"{name}/")]
        if not isinstance(name, str) or not numbers:
            raise UnknownNameError(f"no part {shown(name)} in the picture{nearest(str(name), self.names)}")
        return np.isin(self.segmentation, numbers)

    def write_png(self, path: str | os.PathLike[str], what: str = "rgb") -> None:
        """Write the picture as a PNG file, atomically.

        `what` is ``"rgb"``, ``"depth"`` (16 bits of grey, in millimetres, 65535 for 65.535 m and farther and
        for nothing) or ``"segmentation"`` (16 bits of grey, the number in `names` plus 1, 0 for nothing).
        """
        if not checked_path(path).lower().endswith(".png"):
            raise ArgumentError(f"a picture is written as .png, not as {shown(os.path.basename(path))}")
        pixels: NDArray[Any]
        if what == "rgb":
            pixels = self.rgb
        elif what == "depth":
            pixels = np.minimum(np.rint(self.depth / DEPTH_UNIT), 65535.0).astype(np.uint16)
        elif what == "segmentation":
            pixels = (self.segmentation + 1).astype(np.uint16)
        else:
            raise ArgumentError(f"what is {shown(what)}; wanted 'rgb', 'depth' or 'segmentation'")
        write_bytes(path, png_bytes(pixels))

    def _repr_png_(self) -> bytes:
        return png_bytes(self.rgb)

    def __repr__(self) -> str:
        height, width = self.depth.shape
        seen = sorted({self.names[k] for k in np.unique(self.segmentation) if k >= 0})
        return f"<Picture of {width} x {height} pixels: {', '.join(seen) or 'nothing'}>"


def png_bytes(pixels: NDArray[Any]) -> bytes:
    """Return a PNG file of colours (height, width, 3) of 8 bits, or of grey values (height, width) of 16."""
    height, width = pixels.shape[:2]
    depth, colour_type = (8, 2) if pixels.ndim == 3 else (16, 0)
    rows = np.ascontiguousarray(pixels, ">u2" if depth == 16 else "u1").reshape(height, -1).view(np.uint8)
    # Each row begins with the number of its filter, 0 for none.
    lines = np.concatenate([np.zeros((height, 1), np.uint8), rows], axis=1).tobytes()
    head = struct.pack(">IIBBBBB", width, height, depth, colour_type, 0, 0, 0)
    parts = ((b"IHDR", head), (b"IDAT", zlib.compress(lines)), (b"IEND", b""))
    return b"\x89PNG\r\n\x1a\n" + b"".join(
        struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
        for kind, data in parts
    )
