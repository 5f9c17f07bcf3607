"""A compiled program, ready to be called with arrays."""

from __future__ import annotations

from array import array as packed
from collections.abc import Callable, Sequence
from functools import partial

import numpy as np
from numpy.typing import NDArray

from dynx.errors import ClosedError, CompileError
from dynx.simd.arrays import (
    address_of,
    array_entry,
    check_arrays,
    extent_of,
    is_disjoint,
    make_plan,
    usable_in_place,
)
from dynx.simd.emit import Settings
from dynx.simd.image import Code, Image, compile_image
from dynx.simd.program import Port, Program
from dynx.simd.target import Processor, host
from dynx.simd.threads import run_parts
from dynx.spatial.scalar import Floats

MIN_PART_WORK = 1.2e7
"""Least work of a part that another thread gets, in bytes of code times groups of samples: about 150
microseconds. Dispatching a part takes 20 microseconds, and waking a thread about as long."""

MAX_PART_WORK = 1e10
"""Most work of a part, in bytes of code times groups of samples: some tenths of a second."""

PARTS_PER_THREAD = 4
"""Number of parts per thread; more than 1, so that a delayed thread does not delay the whole batch."""

_FLOAT64_BYTES = 8


class Kernel:
    """A compiled program that evaluates batches of samples.

    Safe to use from several threads. The code is freed after `close`, or when nothing refers to the kernel
    any more; calls in progress complete first. A pickle contains the machine code; unpickling it on a
    different processor raises CompileError.
    """

    _max_single = 1
    """Largest number of samples, below the number of lanes, for which the lanes are not filled."""

    def __init__(
        self,
        source: Program | Image,
        *,
        target: Processor | None = None,
        settings: Settings | None = None,
    ) -> None:
        """Compile a program for `target` (by default this machine), or link an existing image."""
        self.image = source if isinstance(source, Image) else compile_image(source, target, settings)
        self._code: Code | None = Code(self.image)

    @property
    def inputs(self) -> tuple[Port, ...]:
        """Input ports."""
        return self.image.inputs

    @property
    def outputs(self) -> tuple[Port, ...]:
        """Output ports."""
        return self.image.outputs

    def __call__(self, inputs: Sequence[Floats], outputs: Sequence[Floats], *, threads: int = 1) -> None:
        """Fill `outputs` from `inputs`, float64 arrays (n, size of the port), with at most `threads` threads.

        Rows may have any stride, also 0 in an input, which repeats one sample. An array whose rows are not
        contiguous is copied first; an output that shares memory with another array is computed in a copy.
        Results are bit for bit independent of the number of threads and of the other samples. Raises
        ArgumentError, DTypeError or ShapeError for arrays that do not fit, and writes nothing then.
        """
        code = self._open_code()
        n = check_arrays(self.inputs, self.outputs, inputs, outputs)
        if n == 0 or not outputs:
            return
        sources = [array if usable_in_place(array) else np.ascontiguousarray(array) for array in inputs]
        places = [extent_of(array) for array in (*sources, *outputs)]
        targets = [
            out
            if usable_in_place(out) and is_disjoint(places, len(sources) + k, out)
            else np.empty(out.shape)
            for k, out in enumerate(outputs)
        ]
        lanes = self.image.lanes
        if self._max_single < n < lanes:
            # Fill the lanes by repeating the last sample.
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
        """Call the code for n samples, where n is 1 or at least the number of lanes."""
        arrays = (*inputs, *outputs)
        lanes = self.image.lanes
        words = [max(n, lanes)]
        for array in arrays:
            # A single sample is evaluated in every lane.
            words += [address_of(array), array.strides[0] if n > 1 else 0]
        parts = part_count(n, lanes, self.image.size, threads)
        if parts == 1:
            packed_words = packed("q", words)
            code.entry(packed_words.buffer_info()[0])
            return
        arguments = arguments_of_parts(words, n, lanes, parts)
        start, step = arguments.ctypes.data, arguments.strides[0]

        def call(part: int, _alive: object = (arrays, arguments)) -> None:
            code.entry(start + part * step)

        run_parts(call, parts, threads)

    def workspace(self, samples: int = 1) -> Workspace:
        """Return a workspace for up to `samples` samples, for callers that evaluate few at a time."""
        return Workspace(self._open_code(), self.image, samples)

    def max_samples_of_one_part(self, threads: int) -> int:
        """Return the largest number of samples that a call does not divide into parts."""
        return max_samples_of_one_part(self.image.lanes, self.image.size, threads)

    @property
    def locked_entry(self) -> Callable[[int], None]:
        """Machine code called with the address of its arguments (`dynx.simd.emit`), global lock held."""
        return self._open_code().locked_entry

    @property
    def entry(self) -> Callable[[int], None]:
        """Machine code called with the address of its arguments, which does not hold the global lock."""
        return self._open_code().entry

    @property
    def address(self) -> int:
        """Address of the machine code, which is called with the address of its arguments."""
        return self._open_code().address

    def close(self) -> None:
        """Release the code; later calls raise ClosedError."""
        self._code = None

    def _open_code(self) -> Code:
        code = self._code
        if code is None:
            raise ClosedError("this kernel was closed")
        return code

    def __reduce__(self) -> tuple[object, ...]:
        return _unpickle, (self.image,)


class Workspace:
    """Preallocated inputs and outputs of a few samples, and calls bound to them.

    For one sample, write into `inputs` at `input_slices` (one slice for each port), call `run()`, and
    read `results`, an array for each output port in its own shape, or `output_values` at `output_slices`.
    For n samples, write into the first n of `input_rows`, call `run_rows(n)`, and read the first n of
    `output_rows`, arrays (samples, *shape). For contiguous rows elsewhere, write the number of samples, at
    least that of lanes, and their addresses into `batch_words`, and call `run_batch()`, which does not hold
    Python's global lock: the words are the number, then an address and the distance of rows for each array.

    After `accept_arrays`, `run_arrays` takes NumPy arrays and writes the words itself.

    Not safe for several threads at a time. The other calls hold the lock: they are meant for evaluations
    that take microseconds.
    """

    __slots__ = (
        "_arguments",
        "_batch",
        "_code",
        "_kept",
        "_lanes",
        "_plan",
        "_run_rows",
        "batch_words",
        "input_rows",
        "input_slices",
        "inputs",
        "output_rows",
        "output_slices",
        "output_values",
        "results",
        "run",
        "run_arrays",
        "run_batch",
    )

    def __init__(
        self,
        code: Code,
        image: Image,
        samples: int,
        *,
        single: Code | None = None,
        more_words: Sequence[int] = (),
        kept: object = None,
    ) -> None:
        """`single` is code for one sample, if there is any; `more_words` follow the arguments that describe
        the arrays; `kept` is whatever the code refers to."""
        self._lanes = image.lanes
        samples = max(samples, image.lanes)
        rows, places, views, words = [], [], [], [image.lanes]
        for ports in (image.inputs, image.outputs):
            block = np.zeros(samples * sum(port.size for port in ports))
            views.append(block.data)
            first = 0
            for port in ports:
                places.append(slice(first, first + port.size))
                words += [block.ctypes.data + _FLOAT64_BYTES * first, _FLOAT64_BYTES * port.size]
                rows.append(block[first : first + samples * port.size].reshape(samples, *port.shape))
                first += samples * port.size
        self.inputs, self.output_values = views
        n = len(image.inputs)
        self.input_slices, self.output_slices = tuple(places[:n]), tuple(places[n:])
        self.input_rows, self.output_rows = tuple(rows[:n]), tuple(rows[n:])
        self.results = tuple(array[0, ...] for array in self.output_rows)
        several = np.array([*words, *more_words], dtype=np.int64)
        one = several.copy()
        if single is None:
            # A single sample is evaluated in every lane.
            one[2::2] = 0
        else:
            one[0] = 1
        batch = several.copy()
        self._code, self._batch, self._kept = code, batch, (one, kept)
        self._arguments, self.batch_words = several.data, batch.data
        self.run_arrays: Callable[..., int] | None = None
        self.run: Callable[[], None] = partial((single or code).locked_entry, one.ctypes.data)
        self._run_rows: Callable[[], None] = partial(code.locked_entry, several.ctypes.data)
        self.run_batch: Callable[[], None] = partial(code.entry, batch.ctypes.data)

    def accept_arrays(self, sizes: Sequence[int], max_samples: int, bound: float) -> Callable[..., int]:
        """Return `run_arrays`, a function of the first inputs, arrays (n, size) of these `sizes`, and of the
        first output, an array (n, ...), which returns an outcome (`dynx.simd.arrays`).

        Up to `max_samples` are evaluated; the sum of the second output, a number for each sample, is compared
        with `bound`. More than that are only described in `batch_words`.
        """
        addends = np.empty(max_samples)
        plan = make_plan(
            self._batch.ctypes.data,
            self._code.address,
            max_samples,
            addends.ctypes.data,
            1 + 2 * len(self.input_rows),
            bound,
            sizes,
        )
        self._plan = (plan, addends)
        self.run_arrays = partial(array_entry(len(sizes)), plan.ctypes.data)
        return self.run_arrays

    def repeat_input(self, number: int) -> None:
        """Let `run_batch` use the first row of an input of this workspace for all samples."""
        self.batch_words[2 + 2 * number] = 0

    def run_rows(self, n: int) -> None:
        """Evaluate the first n samples, or as many as there are lanes if that is more."""
        self._arguments[0] = max(n, self._lanes)
        self._run_rows()


def max_samples_of_one_part(lanes: int, group_work: int, threads: int) -> int:
    """Return the largest number of samples that are certainly not divided into parts."""
    least = MAX_PART_WORK if threads == 1 else MIN_PART_WORK
    return int(least / max(1, group_work)) * lanes


def part_count(n: int, lanes: int, group_work: int, threads: int) -> int:
    """Return the number of parts of a batch of n samples.

    `group_work` is the work of one group of `lanes` samples, in bytes of code.
    """
    groups = n // lanes
    work = groups * group_work
    # Ctrl-C takes effect between two parts.
    parts = max(1, min(int(work / MAX_PART_WORK) + 1, groups))
    if threads > 1:
        parts = max(parts, min(int(work / MIN_PART_WORK), threads * PARTS_PER_THREAD, groups))
    return parts


def arguments_of_parts(words: Sequence[int], n: int, lanes: int, parts: int) -> NDArray[np.int64]:
    """Return the arguments of each part (parts, len(words)), from those of the whole batch.

    The first word is the number of samples; then follow pairs of an address and the distance between the
    addresses of two samples.
    """
    arguments = np.empty((parts, len(words)), dtype=np.int64)
    arguments[:] = words
    first = np.arange(parts + 1) * (n // lanes) // parts * lanes
    first[-1] = n
    arguments[:, 0] = np.diff(first)
    arguments[:, 1::2] += first[:-1, None] * arguments[:, 2::2]
    return arguments


def _unpickle(image: Image) -> Kernel:
    if image.target != host():
        raise CompileError(
            f"this kernel was compiled for {image.target.cpu} ({image.target.triple}), "
            f"which this machine, {host().cpu} ({host().triple}), may not be able to run"
        )
    return Kernel(image)
