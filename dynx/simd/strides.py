"""A kernel called for one sample after another, each array at a row of its own."""

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
class Walked:
    """An array (height, size) of float64 whose numbers lie side by side, and its row in each call (n,)."""

    array: Floats
    rows: NDArray[np.int64]

    @cached_property
    def addresses(self) -> NDArray[np.int64]:
        """Where the row of each call is. Raises ArgumentError for rows that are not there."""
        array, rows = self.array, self.rows
        if rows.size and not 0 <= rows.min() <= rows.max() < len(array):
            raise ArgumentError(f"an array has {len(array)} rows; asked for {rows.min()} to {rows.max()}")
        return np.asarray(array.ctypes.data + rows * array.strides[0])

    def fits(self, port: Port, n: int) -> bool:
        """Whether n calls can use it for `port`."""
        array = self.array
        right = array.dtype == np.float64 and array.ndim == 2 and array.shape[1] == port.size
        return right and array[:1].flags.c_contiguous and self.rows.shape == (n,)


@dataclass(frozen=True)
class Walk:
    """n calls made ready: call k is ``run(addresses[k])``, and costs little more than a call of C.

    For what takes less than a microsecond: it holds Python's lock.
    """

    run: Callable[[int], None]
    addresses: range
    kept: Any
    """What the calls read and write, for as long as they may be made."""


def walk(kernel: Kernel, inputs: Sequence[Walked], outputs: Sequence[Walked]) -> Walk:
    """Calls of `kernel` whose arrays are taken at the given rows.

    A row that a call writes must not be one that the same call reads; the caller sees to that. Raises
    ArgumentError for arrays that do not fit.
    """
    ports, walked = (*kernel.inputs, *kernel.outputs), (*inputs, *outputs)
    if (len(inputs), len(outputs)) != (len(kernel.inputs), len(kernel.outputs)):
        raise ArgumentError(
            f"a kernel of {len(kernel.inputs)} inputs and {len(kernel.outputs)} outputs was given "
            f"{len(inputs)} and {len(outputs)}"
        )
    n = len(walked[0].rows)
    words = np.zeros((n, 1 + 2 * len(ports)), dtype=np.int64)
    # One sample is evaluated in every lane: row distances of 0.
    words[:, 0] = kernel.image.lanes
    for column, (port, one) in enumerate(zip(ports, walked, strict=True)):
        if not one.fits(port, n):
            raise ArgumentError(
                f"{port.name} is {one.array.dtype} {one.array.shape} at {one.rows.shape} rows; "
                f"wanted float64 (rows, {port.size}) at ({n},)"
            )
        if column >= len(inputs) and not one.array.flags.writeable:
            raise ArgumentError(f"{port.name} is read-only; wanted an array to write into")
        words[:, 1 + 2 * column] = one.addresses
    start, step = words.ctypes.data, words.strides[0]
    return Walk(kernel.brief_entry, range(start, start + n * step, step), (kernel, words, walked))
