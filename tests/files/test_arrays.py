"""A file of arrays is read to the last bit, and any other file gives one error that names it."""

from __future__ import annotations

import io
import os
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dynx.errors import ArgumentError
from dynx.files.arrays import ArrayFile, read_arrays, write_arrays

ARRAYS: dict[str, Any] = {
    "numbers": np.arange(12.0).reshape(3, 4),
    "columns": np.asfortranarray(np.arange(6.0).reshape(2, 3)),
    "whole": np.arange(3),
    "truths": np.array([True, False]),
    "words": np.array(["a", "bc"]),
    "nothing": np.zeros((0, 5)),
    "one": np.array(1.5),
}
TEXTS = {"schema": "x/1", "text": "\u00e4\U0001f916", "empty": ""}


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    path = tmp_path_factory.mktemp("written") / "arrays.npz"
    write_arrays(path, {**ARRAYS, **TEXTS})
    return path.read_bytes()


def read(data: bytes, folder: Path) -> ArrayFile:
    path = folder / "arrays.npz"
    path.write_bytes(data)
    return read_arrays(path, "an example", "x/1")


def refused_or_read(data: bytes, folder: Path) -> ArrayFile | str:
    """Return the content, or the message of the one error that may come instead."""
    try:
        return read(data, folder)
    except ArgumentError as error:
        return str(error)


def require_whole(content: ArrayFile) -> None:
    assert content.texts == TEXTS
    assert content.arrays.keys() == ARRAYS.keys()
    for name, array in ARRAYS.items():
        np.testing.assert_array_equal(content.arrays[name], array, strict=True)


def test_arrays_and_texts_are_read_as_they_were_written(written: bytes, tmp_path: Path) -> None:
    content = read(written, tmp_path)
    require_whole(content)
    assert all(array.flags.writeable for array in content.arrays.values())
    assert content.arrays["columns"].flags.f_contiguous


@given(data=st.data())
def test_a_file_that_is_damaged_or_truncated_is_refused_or_whole(
    written: bytes, tmp_path_factory: pytest.TempPathFactory, data: st.DataObject
) -> None:
    folder = tmp_path_factory.getbasetemp()
    damaged = bytearray(written)
    for _ in range(data.draw(st.integers(1, 3))):
        place = data.draw(st.integers(0, len(written) - 1))
        damaged[place] ^= data.draw(st.integers(1, 255))
    length = data.draw(st.sampled_from([len(written)]) | st.integers(0, len(written)))
    found = refused_or_read(bytes(damaged[:length]), folder)
    if isinstance(found, ArrayFile):
        # A byte that says nothing about the content, such as a date, or a renamed entry.
        assert len(found.texts) + len(found.arrays) <= len(TEXTS) + len(ARRAYS)
    else:
        assert "arrays.npz" in found


@given(data=st.data())
def test_a_damaged_array_with_a_valid_checksum_is_refused_or_read(
    written: bytes, tmp_path_factory: pytest.TempPathFactory, data: st.DataObject
) -> None:
    """The checksums do not protect from a file that was made to do harm."""
    folder = tmp_path_factory.getbasetemp()
    changed = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(written)) as source, zipfile.ZipFile(changed, "w") as target:
        victim = data.draw(st.sampled_from(source.namelist()))
        for name in source.namelist():
            content = bytearray(source.read(name))
            if name == victim:
                for _ in range(data.draw(st.integers(1, 3))):
                    content[data.draw(st.integers(0, len(content) - 1))] ^= data.draw(st.integers(1, 255))
                content = content[: data.draw(st.sampled_from([len(content)]) | st.integers(0, len(content)))]
            target.writestr(name, bytes(content))
    found = refused_or_read(changed.getvalue(), folder)
    assert isinstance(found, ArrayFile) or "arrays.npz" in found


def header(shape: str, kind: str = "<f8") -> bytes:
    """Return the start of an array of that shape."""
    text = f"{{'descr': '{kind}', 'fortran_order': False, 'shape': {shape}, }}".ljust(117) + "\n"
    return b"\x93NUMPY\x01\x00" + len(text).to_bytes(2, "little") + text.encode()


@pytest.mark.parametrize(
    ("entry", "said"),
    [
        (header("(1000000000000,)"), "in 8 bytes"),
        (header("(-1, -1)"), "in 8 bytes|negative"),
        (header("(1,)", "|O"), "in 8 bytes"),
        (header("(" * 900 + "1,"), "arrays.npz"),
        (header("()", "<U2") + b"\xff" * 8, "in 16 bytes"),
        (header("()", "<U4") + b"\xff" * 8, "arrays.npz"),
        (b"\x93NUMPY\x03\x00", "another version"),
        (b"", "magic"),
    ],
)
def test_entries_that_were_made_to_do_harm(tmp_path: Path, entry: bytes, said: str) -> None:
    path = tmp_path / "arrays.npz"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("schema.npy", entry + bytes(8))
    with pytest.raises(ArgumentError, match=said):
        read_arrays(path, "an example", "x/1")


def test_a_compressed_file_is_refused_unread(tmp_path: Path) -> None:
    path = tmp_path / "bomb.npz"
    np.savez_compressed(path, zeros=np.zeros(10_000_000))
    with pytest.raises(ArgumentError, match=r"larger than the file|compressed"):
        read_arrays(path, "an example")


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="this system has no FIFOs")
def test_fifos_devices_and_folders_are_refused_unopened(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.npz")
    for path in (tmp_path / "pipe.npz", tmp_path, Path("/dev/zero")):
        with pytest.raises(ArgumentError, match=r"is a .*; wanted a"):
            read_arrays(path, "an example")


@pytest.mark.parametrize("path", ["gone.npz", "a\0b.npz", "x" * 10_000, 3, None])
def test_paths_of_no_file(path: Any) -> None:
    with pytest.raises(ArgumentError, match=r"cannot be read as an ex|wanted (a str|one without)") as caught:
        read_arrays(path, "an example")
    assert str(caught.value).isprintable()


def test_an_entry_of_another_form_is_named(written: bytes, tmp_path: Path) -> None:
    content = read(written, tmp_path)
    np.testing.assert_array_equal(content.array("numbers", (None, 4)), ARRAYS["numbers"])
    for name, shape, kind in (("numbers", (4, 4), float), ("whole", (3,), float), ("gone", (), float)):
        with pytest.raises(ArgumentError, match=name):
            content.array(name, shape, kind)
    with pytest.raises(ArgumentError, match="lacks the text"):
        content.text("numbers")
    with pytest.raises(ArgumentError, match="does not have the schema 'x/2'"):
        read_arrays(tmp_path / "arrays.npz", "an example", "x/2")
