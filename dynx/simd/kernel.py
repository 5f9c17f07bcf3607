"""A compiled program, ready to be called with arrays."""

from __future__ import annotations

from array import array as packed
from collections.abc import Callable, Sequence
from ctypes import addressof, c_char
from functools import partial
from typing import Any

import numpy as np

from dynx.errors import ArgumentError, ClosedError, CompileError, DTypeError, ShapeError
from dynx.simd.emit import Settings
from dynx.simd.image import Code, Image, compiled
from dynx.simd.program import Port, Program
from dynx.simd.target import Target, host
from dynx.simd.threads import run_parts
from dynx.spatial.scalar import Floats

PART = 1.2e7
"""Least work of a part that is worth handing to another thread, in bytes of code times groups of
samples: about 150 microseconds. Handing parts out costs 20, waking a thread as much again."""

LONGEST_PART = 1e10
"""Most work of a part, in the same units: some tenths of a second."""

PARTS_PER_THREAD = 4
"""More parts than threads, so that a thread which the system held up does not hold up the rest."""

_NUMBER = 8
_FLOAT64 = np.dtype(np.float64)
_first_byte: Any = c_char.from_buffer


class Kernel:
    """Evaluates a program for batches of samples.

    Safe to use from several threads. Its code is freed after `close`, or when nothing refers to the
    kernel; a call that is under way then ends as it would have. A pickle holds the machine code and
    is refused by a machine that cannot run it.
    """

    def __init__(
        self, source: Program | Image, *, target: Target | None = None, settings: Settings | None = None
    ) -> None:
        """Compile a program (for `target`, by default this machine), or take an image as it stands."""
        self.image = source if isinstance(source, Image) else compiled(source, target, settings)
        self._code: Code | None = Code(self.image)

    @property
    def inputs(self) -> tuple[Port, ...]:
        """What it reads."""
        return self.image.inputs

    @property
    def outputs(self) -> tuple[Port, ...]:
        """What it writes."""
        return self.image.outputs

    def __call__(self, inputs: Sequence[Floats], outputs: Sequence[Floats], *, threads: int = 1) -> None:
        """Fill `outputs` from `inputs`, float64 arrays (n, size of the port), on at most `threads`.

        Rows may lie any distance apart, also 0 in an input, which repeats one sample. An array whose
        rows are not contiguous, and an output that shares memory with another array, goes through a
        copy. Results are the same bit for bit whatever the number of threads, and whatever the other
        samples are. Raises errors of `dynx.errors` for arrays that do not fit, and writes nothing then.
        """
        code = self._opened()
        n = _checked(self.inputs, self.outputs, inputs, outputs)
        if n == 0 or not outputs:
            return
        sources = [array if _direct(array) else np.ascontiguousarray(array) for array in inputs]
        places = [_extent(array) for array in (*sources, *outputs)]
        targets = [
            out if _direct(out) and _apart(places, len(sources) + k, out) else np.empty(out.shape)
            for k, out in enumerate(outputs)
        ]
        lanes = self.image.lanes
        if 1 < n < lanes:
            # As many samples as there are lanes, the last one repeated.
            rows = np.minimum(np.arange(lanes), n - 1)
            padded = [np.empty((lanes, out.shape[1])) for out in outputs]
            self._run(code, [array[rows] for array in sources], padded, lanes, 1)
            targets = [array[:n] for array in padded]
        else:
            self._run(code, sources, targets, n, threads)
        for out, found in zip(outputs, targets, strict=True):
            if found is not out:
                out[...] = found

    def _run(
        self, code: Code, inputs: Sequence[Floats], outputs: Sequence[Floats], n: int, threads: int
    ) -> None:
        """Call the code for n samples, n = 1 or at least as many as there are lanes."""
        arrays = (*inputs, *outputs)
        lanes = self.image.lanes
        words = [max(n, lanes)]
        for array in arrays:
            # One sample alone is evaluated in every lane.
            words += [_address(array), array.strides[0] if n > 1 else 0]
        groups = n // lanes
        work = groups * len(self.image.code)
        # Ctrl-C is heard between two parts.
        parts = max(1, min(int(work / LONGEST_PART) + 1, groups))
        if threads > 1:
            parts = max(parts, min(int(work / PART), threads * PARTS_PER_THREAD, groups))
        if parts == 1:
            alone = packed("q", words)
            code.entry(alone.buffer_info()[0])
            return
        arguments = np.empty((parts, len(words)), dtype=np.int64)
        arguments[:] = words
        first = np.arange(parts + 1) * groups // parts * lanes
        first[-1] = n
        arguments[:, 0] = np.diff(first)
        arguments[:, 1::2] += first[:-1, None] * arguments[:, 2::2]
        start, step = arguments.ctypes.data, arguments.strides[0]

        def call(part: int, _alive: object = (arrays, arguments)) -> None:
            code.entry(start + part * step)

        run_parts(call, parts, threads)

    def bound(self, inputs: Sequence[Floats], outputs: Sequence[Floats]) -> Callable[[], None]:
        """A call that fills these `outputs` from these `inputs` each time, whatever they hold by then.

        For loops of many calls: everything is checked here and nothing afterwards. Wants at least as
        many samples as there are `lanes`, rows whose numbers lie side by side, and outputs that share
        memory with nothing; raises ArgumentError for others, and what a plain call raises.
        """
        code, arrays = self._opened(), (*inputs, *outputs)
        n = _checked(self.inputs, self.outputs, inputs, outputs)
        if n < self.image.lanes:
            raise ArgumentError(f"a bound call wants at least {self.image.lanes} samples, not {n}")
        for array in arrays:
            if not _direct(array):
                raise ArgumentError("a bound call wants arrays whose rows are contiguous")
        places = [_extent(array) for array in arrays]
        if not all(_apart(places, len(inputs) + k, out) for k, out in enumerate(outputs)):
            raise ArgumentError("an output of a bound call shares memory with another array")
        words = [n]
        for array in arrays:
            words += [array.ctypes.data, array.strides[0]]
        arguments = np.array(words, dtype=np.int64)
        start = arguments.ctypes.data

        def call(_alive: object = (arrays, arguments)) -> None:
            code.entry(start)

        return call

    def workspace(self, samples: int = 1) -> Workspace:
        """Room for at most so many samples, for callers that ask for few at a time."""
        return Workspace(self._opened(), self.image, samples)

    @property
    def brief_entry(self) -> Callable[[int], None]:
        """The code itself, called with the address of its arguments (`dynx.simd.emit`), lock held."""
        return self._opened().brief_entry

    def close(self) -> None:
        """Let go of the code; further calls raise ClosedError."""
        self._code = None

    def _opened(self) -> Code:
        code = self._code
        if code is None:
            raise ClosedError("this kernel was closed")
        return code

    def __reduce__(self) -> tuple[object, ...]:
        return _unpickled, (self.image,)


class Workspace:
    """A few samples' inputs and outputs at a fixed place, and calls bound to them.

    For one sample, write into `inputs` at the slices `places` (one for each port), call `run()`, and
    read `results`, an array for each output port in its own shape, or `numbers` at `found_places`.
    For n samples, write into the first n of `input_rows`, call `run_rows(n)`, and read the first n of
    `output_rows`, arrays (samples, *shape).

    For one thread at a time. The calls hold Python's lock: they are meant for what takes microseconds.
    """

    __slots__ = (
        "_arguments",
        "_kept",
        "_lanes",
        "_run_rows",
        "found_places",
        "input_rows",
        "inputs",
        "numbers",
        "output_rows",
        "places",
        "results",
        "run",
    )

    def __init__(self, code: Code, image: Image, samples: int) -> None:
        self._lanes = image.lanes
        samples = max(samples, image.lanes)
        rows, places, views, words = [], [], [], [image.lanes]
        for ports in (image.inputs, image.outputs):
            block = np.zeros(samples * sum(port.size for port in ports))
            views.append(block.data)
            first = 0
            for port in ports:
                places.append(slice(first, first + port.size))
                words += [block.ctypes.data + _NUMBER * first, _NUMBER * port.size]
                rows.append(block[first : first + samples * port.size].reshape(samples, *port.shape))
                first += samples * port.size
        self.inputs, self.numbers = views
        n = len(image.inputs)
        self.places, self.found_places = tuple(places[:n]), tuple(places[n:])
        self.input_rows, self.output_rows = tuple(rows[:n]), tuple(rows[n:])
        self.results = tuple(array[0, ...] for array in self.output_rows)
        several = np.array(words, dtype=np.int64)
        # One sample alone is evaluated in every lane.
        one = several.copy()
        one[2::2] = 0
        self._kept = (code, one)
        self._arguments = several.data
        self.run: Callable[[], None] = partial(code.brief_entry, one.ctypes.data)
        self._run_rows: Callable[[], None] = partial(code.brief_entry, several.ctypes.data)

    def run_rows(self, n: int) -> None:
        """Evaluate the first n samples, and what else there is up to the number of lanes."""
        self._arguments[0] = max(n, self._lanes)
        self._run_rows()


def _checked(
    inputs: Sequence[Port], outputs: Sequence[Port], given: Sequence[Floats], wanted: Sequence[Floats]
) -> int:
    """The number of samples, if all arrays agree on one."""
    ports, arrays = (*inputs, *outputs), (*given, *wanted)
    if len(given) != len(inputs) or len(wanted) != len(outputs):
        raise ArgumentError(
            f"a kernel of {len(inputs)} inputs and {len(outputs)} outputs was given "
            f"{len(given)} and {len(wanted)}"
        )
    n = len(arrays[-1]) if arrays and arrays[-1].ndim else 0
    for port, array in zip(ports, arrays, strict=True):
        if array.dtype is not _FLOAT64 and (array.dtype != _FLOAT64 or not array.dtype.isnative):
            raise DTypeError(f"{port.name} has dtype {array.dtype}; wanted float64")
        if array.shape != (n, port.size):
            raise ShapeError(f"{port.name} has shape {array.shape}; wanted ({n}, {port.size})")
    for port, array in zip(outputs, wanted, strict=True):
        if not array.flags.writeable:
            raise ArgumentError(f"{port.name} is read-only; wanted an array to write into")
    return n


def _direct(array: Floats) -> bool:
    """Whether the code can use an array where it lies: aligned numbers, side by side within a row."""
    return array.flags.aligned and (array.shape[1] <= 1 or array.strides[1] == _NUMBER)


def _address(array: Floats) -> int:
    """Where the first number of an array is."""
    try:
        # A third of the time of the way below; for arrays without gaps that may be written to.
        return addressof(_first_byte(array))
    except (TypeError, ValueError, BufferError):
        return array.ctypes.data


def _extent(array: Floats) -> tuple[int, int]:
    """The addresses between which the numbers of an array (n, size) lie."""
    first = _address(array)
    rows, columns = array.shape
    down, across = array.strides
    reach, wide = (rows - 1) * down, (columns - 1) * across
    return first + min(reach, 0) + min(wide, 0), first + max(reach, 0) + max(wide, 0) + _NUMBER


def _apart(places: Sequence[tuple[int, int]], own: int, out: Floats) -> bool:
    """Whether no other array, nor another row of its own, shares memory with `out`, which lies at `own`."""
    if len(out) > 1 and abs(out.strides[0]) < _NUMBER * out.shape[1]:
        return False
    first, end = places[own]
    return all(k == own or low >= end or high <= first for k, (low, high) in enumerate(places))


def _unpickled(image: Image) -> Kernel:
    if image.target != host():
        raise CompileError(
            f"this kernel was compiled for {image.target.cpu} ({image.target.triple}), "
            f"which this machine, {host().cpu} ({host().triple}), may not be able to run"
        )
    return Kernel(image)
