"""Encoding of many messages of one type in CDR, the encoding of ROS 2.

The messages of a recording have different numbers but the same layout, so each field is a column of bytes
with one row for each message. The encoding is XCDR1 in little-endian order. After four bytes that name the
encoding, each number is aligned to a multiple of its size; a string is its length including the terminating
zero, then its UTF-8 bytes; a sequence is its length, then its elements (DDS-XTypes 1.3, section 7.4.3).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from dynx.spatial.scalar import Floats

LITTLE_ENDIAN = b"\x00\x01\x00\x00"
"""The first four bytes of a message: plain CDR, little-endian."""


class CdrMessages:
    """n messages under construction; fields are appended in the order of the definition."""

    def __init__(self, n: int) -> None:
        self._n = n
        self._size = 0
        self._columns = [np.zeros((n, 0), dtype=np.uint8)]
        self._put_bytes(LITTLE_ENDIAN)
        self._size = 0  # the header does not count for alignment

    def put_int32(self, values: ArrayLike) -> None:
        """Append an int32 field: `values` (), or (n,) for n messages."""
        self._put_numbers(np.asarray(values), "<i4")

    def put_uint32(self, values: ArrayLike) -> None:
        """Append a uint32 field: `values` (), or (n,) for n messages."""
        self._put_numbers(np.asarray(values), "<u4")

    def put_float64s(self, values: Floats) -> None:
        """Append k numbers, as k fields or an array of fixed length: `values` (n, k), or (k,) for all
        messages."""
        self._put_numbers(np.broadcast_to(values, (self._n, values.shape[-1])), "<f8")

    def put_float64_sequence(self, values: Floats) -> None:
        """Append a sequence of k numbers: `values` (n, k)."""
        self.put_uint32(values.shape[-1])
        if values.shape[-1]:  # An empty sequence has no padding.
            self.put_float64s(values)

    def put_string(self, text: str) -> None:
        """Put one string into all messages."""
        encoded = text.encode()
        self.put_uint32(len(encoded) + 1)
        self._put_bytes(encoded + b"\0")

    def put_string_sequence(self, texts: Sequence[str]) -> None:
        """Put one sequence of strings into all messages."""
        self.put_uint32(len(texts))
        for text in texts:
            self.put_string(text)

    def encoded(self) -> list[bytes]:
        """Return the encoded messages."""
        rows = np.concatenate(self._columns, axis=1)
        width, data = rows.shape[1], rows.tobytes()
        return [data[k * width : (k + 1) * width] for k in range(self._n)]

    def _put_numbers(self, values: np.ndarray, kind: str) -> None:
        self._put_bytes(bytes(-self._size % np.dtype(kind).itemsize))
        values = values if values.ndim == 2 else values.reshape(-1, 1)
        columns = np.broadcast_to(values, (self._n, values.shape[1]))
        self._append(np.ascontiguousarray(columns, dtype=kind).view(np.uint8))

    def _put_bytes(self, same: bytes) -> None:
        if same:
            self._append(np.broadcast_to(np.frombuffer(same, dtype=np.uint8), (self._n, len(same))))

    def _append(self, column: np.ndarray) -> None:
        self._columns.append(column)
        self._size += column.shape[1]
