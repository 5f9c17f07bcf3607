"""Films: pictures one after the other, as files by their suffix. Imports Pillow (GIF, WebP) and
imageio-ffmpeg (MP4)."""

from __future__ import annotations

import io
import os
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dynx.errors import ArgumentError, importing, shown
from dynx.files.reading import checked_path
from dynx.files.temporary import temporary_folder
from dynx.files.writing import write_bytes

COLOURS = 128
"""Number of colours of a picture in a GIF file."""

SHORTEST = 20
"""Shortest time between two pictures of a GIF file that browsers keep to [ms]."""

WEBP_QUALITY = 80
"""Quality of a WebP file, from 0 to 100."""

QUALITY = 8
"""Quality of an MP4 file, from 0 to 10: edges of flat colours stay sharp."""


def film_suffix(path: str | os.PathLike[str]) -> str:
    """Return the suffix of a file for a film. Raises ArgumentError for a suffix that is none of a film, and
    NotInstalledError without the package that writes it."""
    suffix = os.path.splitext(checked_path(path))[1].lower()
    if suffix not in WRITERS:
        name = os.path.basename(os.fspath(path))
        wanted = "a film is written as .gif, .webp or .mp4"
        raise ArgumentError(f"{shown(name)} has no suffix of a film; {wanted}")
    if suffix == ".mp4":
        _ffmpeg()
    else:
        _pillow()
    return suffix


def write_pictures(
    path: str | os.PathLike[str], pictures: Iterable[NDArray[np.uint8]], period: float
) -> None:
    """Write pictures (height, width, 3) as a film that shows one every `period` [s]: ``.gif`` or ``.webp``,
    which begin again at their end, or ``.mp4`` (H.264). A WebP file has all colours, and about a fifth of the
    size of a GIF file.

    All pictures have one size; an odd number of rows or columns of an MP4 file gets one more. The first
    picture is asked for when the suffix is known to be that of a film. Raises ArgumentError for another
    suffix, without a picture, and for a file that cannot be written; NotInstalledError without the package
    that writes it (extra ``film``).
    """
    data = WRITERS[film_suffix(path)](pictures, period)
    if data is None:
        raise ArgumentError("a film needs a picture; there is none")
    write_bytes(path, data)


def _gif(pictures: Iterable[NDArray[np.uint8]], period: float) -> bytes | None:
    # One table of colours for all pictures would lose the shades of the later ones.
    drawn = [_pillow().fromarray(each).quantize(COLOURS) for each in pictures]
    if not drawn:
        return None
    stream = io.BytesIO()
    drawn[0].save(
        stream,
        format="GIF",
        save_all=True,
        append_images=drawn[1:],
        duration=_delays(len(drawn), period),
        loop=0,
    )
    return stream.getvalue()


def _delays(count: int, period: float) -> list[int]:
    """Return how long each picture of a GIF file is shown [ms]: multiples of 10, so that each picture begins
    as near to its time as that allows."""
    ends = np.rint(100.0 * period * np.arange(count + 1))
    delays: list[int] = np.maximum(SHORTEST, 10 * np.diff(ends)).astype(int).tolist()
    return delays


def _webp(pictures: Iterable[NDArray[np.uint8]], period: float) -> bytes | None:
    drawn = [_pillow().fromarray(each) for each in pictures]
    if not drawn:
        return None
    stream = io.BytesIO()
    drawn[0].save(
        stream,
        format="WEBP",
        save_all=True,
        append_images=drawn[1:],
        duration=_delays(len(drawn), period),
        loop=0,
        quality=WEBP_QUALITY,
        method=4,
    )
    return stream.getvalue()


def _mp4(pictures: Iterable[NDArray[np.uint8]], period: float) -> bytes | None:
    encoder: Any = None
    # The encoder wants the name of a file, which must be complete before it gets that of the caller.
    with temporary_folder() as folder:
        path = folder / "film.mp4"
        try:
            for each in pictures:
                # The colours of 2 x 2 pixels are stored once.
                even = np.pad(each, ((0, each.shape[0] % 2), (0, each.shape[1] % 2), (0, 0)), mode="edge")
                with _encoding():
                    if encoder is None:
                        encoder = _encoder(path, even.shape[1], even.shape[0], 1.0 / period)
                    encoder.send(np.ascontiguousarray(even))
        finally:
            if encoder is not None:
                with _encoding():
                    encoder.close()
        if encoder is None:
            return None
        with _encoding():
            return path.read_bytes()


def _encoder(path: Path, width: int, height: int, rate: float) -> Any:
    """Return a generator that is sent the pictures."""
    encoder = _ffmpeg().write_frames(
        str(path), (width, height), fps=rate, quality=QUALITY, macro_block_size=2, ffmpeg_log_level="error"
    )
    try:
        encoder.send(None)
    except IndexError as error:
        # It takes the list of codecs apart without a look at whether ffmpeg printed one.
        raise RuntimeError("ffmpeg lists no codecs") from error
    return encoder


@contextmanager
def _encoding() -> Iterator[None]:
    """Raise ArgumentError where ffmpeg is not found, or ends with an error."""
    try:
        yield
    except (OSError, RuntimeError) as error:
        lines = str(error).strip().splitlines() or [type(error).__name__]
        raise ArgumentError(f"the film cannot be encoded: {shown(lines[-1], 300)}") from error


WRITERS: dict[str, Callable[[Iterable[NDArray[np.uint8]], float], bytes | None]] = {
    ".gif": _gif,
    ".webp": _webp,
    ".mp4": _mp4,
}
"""Functions that return the content of a file, by its suffix; None without a picture."""


def _pillow() -> Any:
    with importing("a film as .gif or .webp needs Pillow: pip install 'dynx[film]'"):
        from PIL import Image
    return Image


def _ffmpeg() -> Any:
    with importing("a film as .mp4 needs imageio-ffmpeg: pip install 'dynx[film]'; .gif needs Pillow alone"):
        import imageio_ffmpeg
    return imageio_ffmpeg
