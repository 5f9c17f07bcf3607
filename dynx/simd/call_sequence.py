"""Calls of kernels one after another, each with rows of its own, in a loop of machine code.

A call from Python takes a third of a microsecond and more, as long as a step of a small robot. Here the
addresses of all rows are computed beforehand, a call in each line of a table, and the loop goes from line to
line until a call reports a status in one of its samples.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache, cached_property
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dynx.errors import ArgumentError
from dynx.simd.emit import ENTRY
from dynx.simd.image import Code, Image, compile_text
from dynx.simd.kernel import Kernel
from dynx.simd.program import Port
from dynx.simd.target import host
from dynx.spatial.scalar import Floats

Integers = NDArray[np.int64]

NO_OUTPUTS: Mapping[str, StridedRows] = MappingProxyType({})


@dataclass(frozen=True, eq=False)
class StridedRows:
    """An array of float64 with contiguous rows, and the row used in each call (n,).

    The array is (height, size), and all samples of a call share a row, or (height, samples, size).
    """

    array: Floats
    rows: Integers

    @cached_property
    def addresses(self) -> Integers:
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

    @property
    def stride(self) -> int:
        """Distance between the rows of two samples [bytes]; 0 where they share one."""
        return self.array.strides[1] if self.array.ndim == 3 else 0

    def fits(self, port: Port, n: int, samples: int) -> bool:
        """Return whether n calls can use the array for `port`."""
        array = self.array
        matches = array.dtype == np.float64 and array.ndim in (2, 3) and array.shape[-1] == port.size
        if array.ndim == 3 and array.shape[1] < samples:
            return False
        contiguous = port.size <= 1 or array.strides[-1] == array.itemsize
        return matches and contiguous and self.rows.shape == (n,)


class CallSequence:
    """n prepared calls of `samples` samples, each of one of several kernels."""

    def __init__(
        self,
        kernels: Sequence[Kernel],
        chosen: Integers,
        arrays: Mapping[str, StridedRows],
        samples: int = 1,
        *,
        outputs: Mapping[str, StridedRows] = NO_OUTPUTS,
        status: str | None = None,
        bound: float = 0.0,
    ) -> None:
        """`chosen` (n,) is the number of the kernel of each call, `arrays` are those of its ports by name;
        `outputs` are those of output ports that are not among them, or in other rows.

        The loop ends after a call that writes a number above `bound` to its output `status`. The caller must
        ensure that no call writes a row that another sample of the call reads. Raises ArgumentError for
        arrays whose number, shape or dtype does not fit the ports of a kernel.
        """
        self._samples = max(samples, *(kernel.image.lanes for kernel in kernels))
        ports = [(*kernel.inputs, *kernel.outputs) for kernel in kernels]
        words = np.zeros((len(chosen), 2 + 2 * max(map(len, ports))), dtype=np.int64)
        words[:, 1] = self._samples
        for number, kernel in enumerate(kernels):
            lines: Any = slice(None) if len(kernels) == 1 else np.flatnonzero(chosen == number)
            words[lines, 0] = kernel.address
            for column, port in enumerate(ports[number]):
                writes = column >= len(kernel.inputs)
                rows = outputs.get(port.name) or arrays[port.name] if writes else arrays[port.name]
                self._require(port, rows, len(chosen), writes=writes)
                at = rows.addresses
                words[lines, 2 + 2 * column] = at if len(at) == 1 else at[lines]
                words[lines, 3 + 2 * column] = rows.stride
        self._words, self._kernels, self._chosen, self._arrays = (
            words,
            kernels,
            chosen,
            (dict(arrays), dict(outputs)),
        )
        shared = status is None or arrays[status].stride == 0
        scanned = 0 if status is None else 1 if shared else samples
        at = np.zeros(1, dtype=np.int64) if status is None else arrays[status].addresses
        stride = 8 if status is None or shared else arrays[status].stride
        numbers = [words.ctypes.data, words.strides[0], 0, 0, int(at[0]), scanned, stride, 0]
        self._plan = np.array(numbers, dtype=np.int64)
        self._plan[7:].view(np.float64)[0] = bound
        self._plan_words = self._plan.data
        self._plan_address = self._plan.ctypes.data
        self._loop = _loop()

    def run(self, begin: int, end: int) -> tuple[int, int] | None:
        """Make the calls from `begin` to before `end`; return the number of the call that ended the loop and
        of its first sample with a status, or None after the last call. Does not hold Python's global lock."""
        plan = self._plan_words
        plan[2], plan[3] = begin, end
        stopped = self._loop(self._plan_address)
        return None if stopped < 0 else (stopped, plan[3])

    def single(self, call: int) -> Callable[[], None]:
        """Return a function that makes one call, whatever its status, in less time than `run`."""
        kernel = self._kernels[int(self._chosen[call])]
        entry, address = kernel.entry, self.addresses[call]

        def make(_kept: object = self) -> None:
            entry(address)

        return make

    def repeat_group(self, call: int, first: int) -> None:
        """Make a call again for one group of samples, as many as there are lanes, from number `first` on."""
        kernel = self._kernels[int(self._chosen[call])]
        words = self._words[call, 1:].copy()
        words[0] = kernel.image.lanes
        words[1::2] += first * words[2::2]
        kernel.locked_entry(words.ctypes.data)

    @property
    def addresses(self) -> range:
        """Addresses of the arguments of each call, for `Kernel.locked_entry`."""
        start, step = self._words.ctypes.data + 8, self._words.strides[0]
        return range(start, start + len(self._words) * step, step)

    def _require(self, port: Port, rows: StridedRows, n: int, *, writes: bool) -> None:
        if not rows.fits(port, n, self._samples if rows.array.ndim == 3 else 1):
            raise ArgumentError(
                f"{port.name} is {rows.array.dtype} {rows.array.shape} at {rows.rows.shape} rows; "
                f"wanted float64 (rows, {port.size}) at ({n},)"
            )
        if writes and not rows.array.flags.writeable:
            raise ArgumentError(f"{port.name} is read-only; wanted a writeable array")


@cache
def _loop() -> ctypes._CFunctionType:
    """Return the loop. Its argument is the address of a plan: address and length of the table's lines, the
    first line and the end, address, number and distance of the status of the samples, and the bound.

    It returns the number of the line that ended it, or -1, and writes the number of the sample into the plan.
    """
    target = host()
    code = Code(Image((), (), target.lanes, target, (compile_text(_LOOP, target),)))
    _linked.append(code)
    return ctypes.CFUNCTYPE(ctypes.c_longlong, ctypes.c_void_p)(code.address)


_linked: list[Code] = []
"""Code of the loop, which lives as long as the process."""

_FIELDS = ("table", "bytes", "begin", "end", "status", "scanned", "distance", "bound")
_KINDS = {"table": "ptr", "status": "ptr", "bound": "double"}

_LOOP = "\n".join(
    [
        f"define i64 @{ENTRY}(ptr %plan) {{",
        "entry:",
        *(
            f"  %{name}_at = getelementptr i64, ptr %plan, i64 {k}\n"
            f"  %{name} = load {_KINDS.get(name, 'i64')}, ptr %{name}_at"
            for k, name in enumerate(_FIELDS)
        ),
        "  %some = icmp slt i64 %begin, %end",
        "  br i1 %some, label %call, label %done",
        "call:",
        "  %k = phi i64 [%begin, %entry], [%next, %passed]",
        "  %offset = mul i64 %k, %bytes",
        "  %line = getelementptr i8, ptr %table, i64 %offset",
        "  %kernel = load ptr, ptr %line",
        "  %arguments = getelementptr i64, ptr %line, i64 1",
        "  call void %kernel(ptr %arguments)",
        "  br label %scan",
        "scan:",
        "  %i = phi i64 [0, %call], [%i_next, %good]",
        "  %left = icmp slt i64 %i, %scanned",
        "  br i1 %left, label %compare, label %passed",
        "compare:",
        "  %far = mul i64 %i, %distance",
        "  %at = getelementptr i8, ptr %status, i64 %far",
        "  %found = load double, ptr %at",
        "  %above = fcmp ogt double %found, %bound",
        "  %i_next = add i64 %i, 1",
        "  br i1 %above, label %stop, label %good",
        "good:",
        "  br label %scan",
        "passed:",
        "  %next = add i64 %k, 1",
        "  %more = icmp slt i64 %next, %end",
        "  br i1 %more, label %call, label %done",
        "stop:",
        "  store i64 %i, ptr %end_at",
        "  ret i64 %k",
        "done:",
        "  ret i64 -1",
        "}",
    ]
)
