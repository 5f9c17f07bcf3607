"""Files of arrays (NumPy's ``.npz``): written atomically, and read without trust in what they contain.

A file may be damaged, truncated or made by anyone. So no object is unpickled, no array is larger than its
part of the file, every checksum is compared, and whatever fails becomes one error.
"""

from __future__ import annotations

import math
import os
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from dynx.errors import ArgumentError, shown
from dynx.files.reading import checked_path, open_regular, printable, require_size
from dynx.files.writing import atomic_file

WORLD_FILE = b"dynx world "
"""Beginning of the files of worlds, whatever their version."""

SCHEMA_ENTRY = "schema"
"""Entry of a file with the name and version of its layout."""

_LOADERS = {"dynx.rollout": "dynx.Rollout.load", "dynx.rollouts": "dynx.BatchRollouts.load"}
"""Functions that read a file, by the name of its schema."""

_KINDS = "biufU"
"""Kinds of NumPy's types that are read."""

_PIECE = 2**24
"""Length of the pieces in which an array is read [bytes]."""

_VERSION = (1, 0)
"""Version of the format in which NumPy writes arrays of these types."""


@dataclass(frozen=True)
class ArrayFile:
    """Content of a file: its texts and its arrays by name."""

    path: str
    """The path, fit for a message."""
    texts: dict[str, str] = field(default_factory=dict)
    arrays: dict[str, np.ndarray[Any, Any]] = field(default_factory=dict)

    def text(self, name: str) -> str:
        """Return a text. Raises ArgumentError where the file has none of that name."""
        if name not in self.texts:
            raise ArgumentError(f"{self.path} lacks the text {name}")
        return self.texts[name]

    def array(self, name: str, shape: tuple[int | None, ...], kind: type = float) -> Any:
        """Return an array of that type and shape, where None stands for any length.

        Raises ArgumentError where the file has none.
        """
        array = self.arrays.get(name)
        if array is None:
            raise ArgumentError(f"{self.path} lacks {name}")
        fits = len(shape) == array.ndim and all(
            wanted in (None, length) for wanted, length in zip(shape, array.shape, strict=True)
        )
        if not fits or array.dtype != np.dtype(kind):
            lengths = ", ".join("n" if length is None else str(length) for length in shape)
            raise ArgumentError(
                f"{name} in {self.path} is {array.dtype} {array.shape}; wanted {np.dtype(kind)} ({lengths})"
            )
        return array


MAX_REASON = 500
"""Characters of a reason of NumPy that are shown; it repeats headers of any length."""


def write_arrays(path: str | os.PathLike[str], arrays: Mapping[str, Any]) -> None:
    """Write arrays and texts by name, as `atomic_file` does."""
    with atomic_file(path) as file:
        np.savez(file, **arrays)


def read_arrays(path: str | os.PathLike[str], what: str, schema: str | None = None) -> ArrayFile:
    """Read a file of arrays and texts, which must have the `schema` unless that is None.

    Raises ArgumentError for any other file, which says that it cannot be read as `what`.
    """
    content = ArrayFile(printable(checked_path(path)))
    try:
        with open_regular(path) as file:
            if not zipfile.is_zipfile(file):
                file.seek(0)
                head = file.read(len(WORLD_FILE))
                raise ValueError(
                    "it is a file of World.write, which dynx.world.World.read reads"
                    if head == WORLD_FILE
                    else "it is not a .npz file, or it is truncated"
                )
            size = require_size(file)
            with zipfile.ZipFile(file) as archive:
                parts = archive.infolist()
                if sum(part.file_size for part in parts) > size:
                    raise ValueError("its arrays are larger than the file")
                for part in parts:
                    _read(archive, part, content)
    # The parsers of zipfile and NumPy raise more than a dozen types of exceptions for damaged data.
    except Exception as error:
        reason = (
            (error.strerror if isinstance(error, OSError) else None) or str(error) or type(error).__name__
        )
        raise ArgumentError(f"{content.path} cannot be read as {what}: {reason[:MAX_REASON]}") from error
    found = content.texts.get(SCHEMA_ENTRY)
    if schema is not None and found != schema:
        loader = _LOADERS.get(str(found).partition("/")[0])
        raise ArgumentError(
            f"{content.path} does not have the schema {schema!r}, so it cannot be read as {what}"
            + (f"; its schema is {shown(found)}, which {loader} reads" if loader else "")
        )
    return content


def _read(archive: zipfile.ZipFile, part: zipfile.ZipInfo, content: ArrayFile) -> None:
    """Add one entry of the file to its content. Raises any exception for a damaged one."""
    if part.compress_type != zipfile.ZIP_STORED:
        raise ValueError(f"{part.filename} is compressed")
    with archive.open(part) as stream:
        if np.lib.format.read_magic(stream) != _VERSION:
            raise ValueError(f"{part.filename} is an array of another version than {_VERSION}")
        shape, in_columns, dtype = np.lib.format.read_array_header_1_0(stream)
        data = bytearray()
        # Reading to the end compares the checksum; in one piece, the array would be in memory twice.
        while piece := stream.read(_PIECE):
            data += piece
    if dtype.kind not in _KINDS or math.prod(shape) * dtype.itemsize != len(data):
        raise ValueError(f"{part.filename} is {shown(dtype)} {shape} in {len(data)} bytes")
    array: np.ndarray[Any, Any] = np.ndarray(shape, dtype, data, order="F" if in_columns else "C")
    name = part.filename.removesuffix(".npy")
    if dtype.kind == "U" and array.ndim == 0:
        content.texts[name] = str(array.item())
    else:
        content.arrays[name] = array
