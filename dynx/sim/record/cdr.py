"""Encoding of many messages of one type in CDR, the encoding of ROS 2, and decoding of one message.

The messages of a recording have different numbers but the same layout, so each field is a column of bytes
with one row for each message. The encoding is XCDR1 in little-endian order. After four bytes that name the
encoding, each number is aligned to a multiple of its size; a string is its length including the terminating
zero, then its UTF-8 bytes; a sequence is its length, then its elements (DDS-XTypes 1.3, section 7.4.3).
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from dynx.spatial.scalar import Floats

LITTLE_ENDIAN = b"\x00\x01\x00\x00"
"""The first four bytes of a message: plain CDR, little-endian."""

Bytes = NDArray[np.uint8]
Field = str | int | NDArray[np.int64] | Floats
"""Part of n messages: a text or a number for all, whole numbers of four bytes (n,), or float64 (n, k)."""


def encode_messages(n: int, fields: Iterable[Field]) -> list[bytes]:
    """Encode n messages whose fields follow each other; a sequence is its length and then its elements."""
    columns, size = [_repeated(n, LITTLE_ENDIAN)], 0  # the header does not count for alignment
    for field in fields:
        text = field.encode() + b"\0" if isinstance(field, str) else b""
        numbers = np.asarray(len(text) if isinstance(field, str) else field)
        kind = np.dtype("<f8" if numbers.dtype.kind == "f" else "<u4")
        values = numbers if numbers.ndim == 2 else numbers.reshape(-1, 1)
        rows = np.broadcast_to(values, (n, values.shape[1])).astype(kind, order="C")
        for column in (_repeated(n, bytes(-size % kind.itemsize)), rows.view(np.uint8), _repeated(n, text)):
            columns.append(column)
            size += column.shape[1]
    whole = np.concatenate(columns, axis=1)
    width, data = whole.shape[1], whole.tobytes()
    return [data[k * width : (k + 1) * width] for k in range(n)]


def _repeated(n: int, data: bytes) -> Bytes:
    return np.broadcast_to(np.array(list(data), dtype=np.uint8), (n, len(data)))


class MessageReader:
    """The fields of one message, read one after the other.

    Each method raises ValueError where the message ends before the field does.
    """

    def __init__(self, data: bytes) -> None:
        """Raises ValueError for another encoding than plain CDR in little-endian order."""
        if data[:4] != LITTLE_ENDIAN:
            raise ValueError(f"a message has the encoding {data[:4]!r}; wanted little-endian CDR")
        self._data, self._at = memoryview(data)[4:], 0

    def whole(self) -> int:
        """Return a whole number of four bytes."""
        return int.from_bytes(self._bytes(4, 4), "little")

    def text(self) -> str:
        """Return a text."""
        return bytes(self._bytes(self.whole(), 1)).removesuffix(b"\0").decode()

    def texts(self) -> tuple[str, ...]:
        """Return a sequence of texts."""
        return tuple(self.text() for _ in range(self.whole()))

    def numbers(self, count: int | None = None) -> Floats:
        """Return so many float64, or those of a sequence, which begins with their number."""
        n = self.whole() if count is None else count
        return np.frombuffer(self._bytes(8 * n, 8), "<f8").astype(np.float64) if n else np.zeros(0)

    def _bytes(self, size: int, alignment: int) -> memoryview:
        begin = self._at + -self._at % alignment
        if begin + size > len(self._data):
            raise ValueError(f"a message of {len(self._data)} bytes ends before its fields do")
        self._at = begin + size
        return self._data[begin : self._at]
