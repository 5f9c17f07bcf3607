"""Films have the pictures that they were given, at their rate, or an error names what is missing."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from dynx.errors import ArgumentError, NotInstalledError
from dynx.files.films import write_pictures

COLOUR_ERROR = 12.0
"""Largest error of a flat colour [of 255]: H.264 has 16 to 235, and three rounded components."""


def flat(count: int, height: int, width: int) -> list[NDArray[np.uint8]]:
    """Return pictures of one colour each."""
    rng = np.random.default_rng(3)
    return [np.full((height, width, 3), rng.integers(0, 256, 3), dtype=np.uint8) for _ in range(count)]


# The library leaves the pipe open by which a film is read.
@pytest.mark.filterwarnings("ignore::ResourceWarning")
@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
@pytest.mark.parametrize("size", [(48, 64), (49, 63), (1, 1), (400, 600)])
def test_an_mp4_file_has_the_pictures_at_their_rate(size: tuple[int, int], tmp_path: Path) -> None:
    ffmpeg = pytest.importorskip("imageio_ffmpeg", reason="needs the extra film")
    pictures = flat(7, *size)
    write_pictures(tmp_path / "a.mp4", iter(pictures), 0.04)
    frames = ffmpeg.read_frames(str(tmp_path / "a.mp4"))
    meta = next(frames)
    width, height = meta["size"]
    assert (height, width) == (size[0] + size[0] % 2, size[1] + size[1] % 2)
    assert meta["fps"] == pytest.approx(25.0)
    read = [np.frombuffer(each, dtype=np.uint8).reshape(height, width, 3) for each in frames]
    assert len(read) == len(pictures)
    for seen, given in zip(read, pictures, strict=True):
        middle = seen[height // 2, width // 2].astype(float)
        assert np.abs(middle - given[0, 0]).max() < COLOUR_ERROR
    assert [each.name for each in tmp_path.iterdir()] == ["a.mp4"]


def test_a_gif_file_has_the_pictures_at_their_rate(tmp_path: Path) -> None:
    image = pytest.importorskip("PIL.Image")
    write_pictures(tmp_path / "a.gif", flat(4, 5, 6), 0.05)
    with image.open(tmp_path / "a.gif") as film:
        assert (film.n_frames, film.size, film.info["duration"]) == (4, (6, 5), 50)


@pytest.mark.parametrize(("count", "period"), [(12, 1.0 / 12.0), (30, 1.0 / 30.0), (25, 0.025), (1, 0.1)])
def test_pictures_of_a_gif_file_begin_at_their_times(count: int, period: float, tmp_path: Path) -> None:
    image = pytest.importorskip("PIL.Image")
    write_pictures(tmp_path / "a.gif", flat(count, 5, 6), period)
    ends, elapsed = [], 0
    with image.open(tmp_path / "a.gif") as film:
        assert film.n_frames == count
        for k in range(count):
            film.seek(k)
            elapsed += film.info["duration"]
            ends.append(1e-3 * elapsed)
    # The file counts hundredths of a second.
    assert np.abs(np.array(ends) - period * np.arange(1, count + 1)).max() <= 0.005 + 1e-9


def test_a_webp_file_has_the_colours_of_its_pictures_at_their_rate(tmp_path: Path) -> None:
    image = pytest.importorskip("PIL.Image")
    pictures = flat(3, 16, 16)
    write_pictures(tmp_path / "a.webp", iter(pictures), 0.05)
    with image.open(tmp_path / "a.webp") as film:
        assert (film.n_frames, film.size) == (3, (16, 16))
        for k, given in enumerate(pictures):
            film.seek(k)
            seen = np.asarray(film.convert("RGB")).astype(float)
            assert film.info["duration"] == 50
            assert np.abs(seen[8, 8] - given[0, 0]).max() < COLOUR_ERROR


@pytest.mark.parametrize("name", ["a.avi", "a", "mp4"])
def test_other_suffixes_are_refused_before_a_picture_is_drawn(name: str, tmp_path: Path) -> None:
    def drawn() -> Iterator[NDArray[np.uint8]]:
        raise AssertionError("a picture was drawn")
        yield

    with pytest.raises(ArgumentError, match=r"\.gif, \.webp or \.mp4"):
        write_pictures(tmp_path / name, drawn(), 0.1)


@pytest.mark.parametrize(("name", "package"), [("a.mp4", "imageio_ffmpeg"), ("a.gif", "PIL")])
def test_a_missing_package_is_named_with_its_extra(
    name: str, package: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, package, None)
    with pytest.raises(NotInstalledError, match=r"pip install '\S*\[film\]'"):
        write_pictures(tmp_path / name, flat(1, 4, 4), 0.1)


@pytest.mark.parametrize(("name", "package"), [("a.mp4", "imageio_ffmpeg"), ("a.gif", "PIL")])
def test_a_film_without_pictures_and_one_that_cannot_be_written_are_errors(
    name: str, package: str, tmp_path: Path
) -> None:
    pytest.importorskip(package)
    with pytest.raises(ArgumentError, match="needs a picture"):
        write_pictures(tmp_path / name, [], 0.1)
    with pytest.raises(ArgumentError, match="cannot be written"):
        write_pictures(tmp_path / "none" / name, flat(1, 4, 4), 0.1)
    assert not list(tmp_path.iterdir())


# imageio-ffmpeg leaves the pipe of a process that has ended to the garbage collector.
@pytest.mark.filterwarnings("ignore::ResourceWarning", "ignore::pytest.PytestUnraisableExceptionWarning")
def test_an_encoder_that_fails_is_an_error_without_a_traceback(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("imageio_ffmpeg", reason="needs the extra film")
    monkeypatch.setenv("IMAGEIO_FFMPEG_EXE", "/bin/false" if os.path.exists("/bin/false") else sys.executable)
    with pytest.raises(ArgumentError, match="the film cannot be encoded"):
        write_pictures(tmp_path / "a.mp4", flat(3, 400, 600), 0.1)
    assert not list(tmp_path.iterdir())
