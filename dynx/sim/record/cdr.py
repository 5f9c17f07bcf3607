"""Many messages of one type in CDR, the encoding of ROS 2, all at once.

The messages of a recording differ in their numbers and not in their layout, so each field is a column of
bytes with one row for each message. The encoding is XCDR1 in little-endian order: a number lies at a
multiple of its size, counted from behind the four bytes that name the encoding; a string is its length
with the closing zero, and its UTF-8 bytes; a sequence is its length and its elements (DDS-XTypes 1.3,
section 7.4.3).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from dynx.spatial.scalar import Floats

LITTLE_ENDIAN = b"\x00\x01\x00\x00"
"""The four bytes in front: plain CDR, little-endian."""


class CdrMessages:
    """n messages under construction; fields are appended in the order of the definition."""

    def __init__(self, n: int) -> None:
        self._n = n
        self._size = 0
        self._columns = [np.zeros((n, 0), dtype=np.uint8)]
        self._put_bytes(LITTLE_ENDIAN)
        self._size = 0  # the header does not count for alignment

    def put_int32(self, values: ArrayLike) -> None:
        """`values` () or (n,)."""
        self._put_numbers(np.asarray(values), "<i4")

    def put_uint32(self, values: ArrayLike) -> None:
        """`values` () or (n,)."""
        self._put_numbers(np.asarray(values), "<u4")

    def put_float64s(self, values: Floats) -> None:
        """The k numbers of `values` (n, k), or (k,) for all, as k fields or an array of fixed length."""
        self._put_numbers(np.broadcast_to(values, (self._n, values.shape[-1])), "<f8")

    def put_float64_sequence(self, values: Floats) -> None:
        """A sequence of the k numbers of `values` (n, k)."""
        self.put_uint32(values.shape[-1])
        if values.shape[-1]:  # what is not there is not aligned either
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
        """Return the messages."""
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
