"""Images on surfaces, read by Pillow, which no other module below the viewer imports."""

from __future__ import annotations

import io
from collections.abc import Callable
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dynx.errors import importing, shown
from dynx.spatial.scalar import Floats

MAX_PIXELS = 2**24
"""Largest number of pixels of an image, such as 4096 x 4096."""

_FORMATS = ("PNG", "JPEG", "BMP", "TGA", "GIF", "WEBP", "TIFF", "PPM")

_LARGEST_SENT = 2048
"""Largest width and height of an image that is sent to a page [pixels]."""


class Texture:
    """An image that is shown on a surface: (0, 0) is its lower left corner, (1, 1) the upper right one."""

    def __init__(self, pixels: NDArray[np.uint8], wraps: tuple[bool, bool] = (True, True)) -> None:
        """`pixels` (height, width, 3) are red, green and blue, the upper row first; `wraps` tells whether
        the image repeats along u and v, or its border continues."""
        self.pixels = pixels
        self.wraps = wraps

    @cached_property
    def levels(self) -> list[NDArray[np.uint8]]:
        """The image, and its means over 2 x 2, 4 x 4, ... pixels, until one side has one pixel."""
        found = [self.pixels]
        while min(found[-1].shape[:2]) > 1:
            height, width = (2 * (side // 2) for side in found[-1].shape[:2])
            blocks = found[-1][:height, :width].reshape(height // 2, 2, width // 2, 2, 3)
            found.append(np.rint(blocks.mean(axis=(1, 3), dtype=np.float32)).astype(np.uint8))
        return found

    def colours(self, uv: Floats, extent: Floats) -> Floats:
        """Return the colours (n, 3), from 0 to 1, at places (n, 2), interpolated between pixels; `extent`
        (n,) is the number of pixels of the image that are seen as one, along each side."""
        level = np.rint(np.log2(np.clip(np.nan_to_num(extent, nan=1.0), 1.0, 2.0**30))).astype(np.intp)
        level = np.minimum(level, len(self.levels) - 1)
        found = np.empty((len(uv), 3))
        for k in np.unique(level):
            chosen = level == k
            found[chosen] = self._interpolated(self.levels[k], uv[chosen])
        return found / 255.0

    def _interpolated(self, pixels: NDArray[np.uint8], uv: Floats) -> Floats:
        height, width = pixels.shape[:2]
        places = []
        for share, side, wraps in ((uv[:, 0], width, self.wraps[0]), (1.0 - uv[:, 1], height, self.wraps[1])):
            place = (share % 1.0 if wraps else np.clip(share, 0.0, 1.0)) * side - 0.5
            low = np.floor(place).astype(np.intp)
            both = np.stack([low, low + 1])
            places.append((both % side if wraps else np.clip(both, 0, side - 1), place - low))
        (columns, right), (rows, below) = places
        upper, lower = (
            pixels[row, columns[0]] * (1.0 - right[:, None]) + pixels[row, columns[1]] * right[:, None]
            for row in rows
        )
        return np.asarray(upper * (1.0 - below[:, None]) + lower * below[:, None])

    @cached_property
    def png(self) -> bytes:
        """The image as a PNG file, with no side above 2048 pixels."""
        small = next((each for each in self.levels if max(each.shape) <= _LARGEST_SENT), self.levels[-1])
        stream = io.BytesIO()
        _pillow().fromarray(small).save(stream, format="PNG")
        return stream.getvalue()


def read_texture(content: bytes, wraps: tuple[bool, bool] = (True, True)) -> Texture:
    """Return the image in a PNG, JPEG, BMP, TGA, GIF, WebP, TIFF or PPM file, without its opacity.

    Raises ValueError for a file that is damaged, too large or of another format, NotInstalledError without
    Pillow.
    """
    return Texture(_read(content, _FORMATS, lambda image: np.array(image.convert("RGB"))), wraps)


def read_levels(content: bytes) -> NDArray[np.uint8]:
    """Return the levels (rows, columns), from 0 to 255, of a PNG file of greys: of one with colours the red,
    of one with 16 bits the upper 8, as MuJoCo reads heights. Raises the errors of `read_texture`."""

    def levels(image: Any) -> NDArray[np.uint8]:
        if image.mode.startswith("I"):
            return np.asarray(np.array(image).astype(np.uint32) >> 8, dtype=np.uint8)
        return np.array(image.convert("RGB"))[:, :, 0]

    return _read(content, ("PNG",), levels)


def _read(
    content: bytes, formats: tuple[str, ...], pixels: Callable[[Any], NDArray[np.uint8]]
) -> NDArray[np.uint8]:
    library = _pillow()
    try:
        image = library.open(io.BytesIO(content), formats=formats)
        if image.width * image.height > MAX_PIXELS:
            raise ValueError(f"it has {image.width} x {image.height} pixels; at most {MAX_PIXELS} are read")
        return pixels(image)
    except ValueError:
        raise
    except library.UnidentifiedImageError:
        raise ValueError(f"it cannot be read: it is none of {', '.join(formats)}") from None
    # Pillow raises whatever exception damaged data lead to.
    except Exception as error:
        raise ValueError(f"it cannot be read: {shown(str(error) or type(error).__name__, 200)}") from None


def _pillow() -> Any:
    with importing("images on meshes are read by Pillow: pip install 'dynx[viewer]'"):
        from PIL import Image
    return Image
