"""Calls of a kernel for one sample after another, each reading and writing its own row of each array."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dynx.errors import ArgumentError
from dynx.simd.kernel import Kernel
from dynx.simd.program import Port
from dynx.spatial.scalar import Floats


@dataclass(frozen=True, eq=False)
class StridedRows:
    """An array (height, size) of float64 with contiguous rows, and the row used in each call (n,)."""

    array: Floats
    rows: NDArray[np.int64]

    @cached_property
    def addresses(self) -> NDArray[np.int64]:
        """Address of the row of each call (n,), or the only one (1,) where the rows are one number that was
        broadcast. Raises ArgumentError for rows out of range."""
        array, rows = self.array, self.rows
        if rows.strides == (0,):
            rows = rows[:1]
        if rows.size and not 0 <= rows.min() <= rows.max() < len(array):
            raise ArgumentError(
                f"an array has {len(array)} rows; rows {rows.min()} to {rows.max()} were requested"
            )
        return np.asarray(array.ctypes.data + rows * array.strides[0])

    def fits(self, port: Port, n: int) -> bool:
        """Return whether n calls can use the array for `port`."""
        array = self.array
        matches = array.dtype == np.float64 and array.ndim == 2 and array.shape[1] == port.size
        return matches and array[:1].flags.c_contiguous and self.rows.shape == (n,)


@dataclass(frozen=True)
class CallSequence:
    """n prepared calls: call k is ``run(addresses[k])``, which costs little more than a call in C.

    A call holds Python's global lock, so it should take less than a microsecond.
    """

    run: Callable[[int], None]
    addresses: range
    kept: Any
    """References that keep the memory used by the calls alive."""


def prepare_calls(
    kernel: Kernel, inputs: Sequence[StridedRows], outputs: Sequence[StridedRows]
) -> CallSequence:
    """Prepare calls of `kernel`, one for each row index of the given arrays.

    The caller must ensure that no call writes a row that the same call reads. Raises ArgumentError for
    arrays whose number, shape or dtype does not fit the ports of the kernel.
    """
    ports, arrays = (*kernel.inputs, *kernel.outputs), (*inputs, *outputs)
    if (len(inputs), len(outputs)) != (len(kernel.inputs), len(kernel.outputs)):
        raise ArgumentError(
            f"a kernel of {len(kernel.inputs)} inputs and {len(kernel.outputs)} outputs was given "
            f"{len(inputs)} and {len(outputs)}"
        )
    n = len(arrays[0].rows)
    words = np.zeros((n, 1 + 2 * len(ports)), dtype=np.int64)
    # Every lane evaluates the same sample: row strides of 0.
    words[:, 0] = kernel.image.lanes
    for column, (port, rows) in enumerate(zip(ports, arrays, strict=True)):
        if not rows.fits(port, n):
            raise ArgumentError(
                f"{port.name} is {rows.array.dtype} {rows.array.shape} at {rows.rows.shape} rows; "
                f"wanted float64 (rows, {port.size}) at ({n},)"
            )
        if column >= len(inputs) and not rows.array.flags.writeable:
            raise ArgumentError(f"{port.name} is read-only; wanted a writeable array")
        words[:, 1 + 2 * column] = rows.addresses
    start, step = words.ctypes.data, words.strides[0]
    return CallSequence(kernel.locked_entry, range(start, start + n * step, step), (kernel, words, arrays))
