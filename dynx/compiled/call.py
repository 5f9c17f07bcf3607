"""From arguments with any leading axes to a kernel, and its answer back in their shape.

One sample is copied into a workspace, evaluated and copied out, which together costs about a
microsecond. A batch is read where it lies.
"""

from __future__ import annotations

from collections.abc import Callable
from math import prod
from typing import Any

import numpy as np

from dynx.backends.evaluation import common_batch
from dynx.compiled.kernels import MAX_DEFECT, evaluated, kernel_quantity
from dynx.errors import ArgumentError, DTypeError, ShapeError
from dynx.model import Mechanism
from dynx.simd.kernel import Kernel, Workspace
from dynx.spatial.scalar import Floats

Check = Callable[..., Floats]
"""Turns what a user passed into a float64 array (..., size) or raises: slow, and says what is wrong."""

FEW = 256
"""Most samples that are copied rather than read where they lie, which saves looking up addresses."""

FEW_NUMBERS = 16384
"""Most numbers in one array of such samples."""

_FLOAT64 = np.dtype(np.float64)
_ABSENT = object()

_ODD = (TypeError, ValueError, NotImplementedError, BufferError)
"""What a memory view raises for something that is not one sample of float64."""


class KernelCall:
    """A quantity of one robot, asked with arguments of any leading axes.

    `checks` are those of the arguments, in their order. The kernel says whether arguments are sound;
    only if they are not, or no float64 arrays, do the checks look at them. `place`, if given, is what
    the kernel takes after the arguments, for all samples alike. `refuse` raises for answers that are
    none; it is asked where the kernel found something and arguments are not to blame.
    """

    __slots__ = (
        "_checks",
        "_defect",
        "_few",
        "_first",
        "_kernel",
        "_place",
        "_refuse",
        "_rooms",
        "_second",
        "_shape",
        "_sizes",
        "_third",
        "_threads",
        "_trusting",
        "_validate",
    )

    def __init__(
        self,
        kernel: Kernel,
        checks: tuple[Check, ...],
        *,
        threads: int,
        validate: bool,
        place: Floats | None = None,
        refuse: Check | None = None,
    ) -> None:
        self._kernel, self._checks, self._threads, self._validate = kernel, checks, threads, validate
        self._place, self._refuse = place, refuse
        self._trusting = not validate and refuse is None
        self._sizes = [port.size for port in kernel.inputs[: len(checks)]]
        self._shape = kernel.outputs[0].shape
        largest = max(port.size for port in (*kernel.inputs, *kernel.outputs))
        self._few = min(FEW, max(1, FEW_NUMBERS // largest))
        room = self._room()
        self._first, self._second, self._third = (*room.input_slices, slice(0), slice(0))[:3]
        self._defect = room.output_slices[1].start
        # Taken and given back, rather than one for each thread: also safe where a signal handler or a
        # destructor calls in the middle of a call.
        self._rooms = [room]

    def answer(self, q: Any, v: Any = _ABSENT, a: Any = _ABSENT, out: Floats | None = None) -> Floats:
        """The answer (..., *shape), in `out` if that is given.

        `out` is a C-contiguous float64 array of the answer's shape; what it holds after an error is
        not defined. Raises ShapeError, DTypeError or ArgumentError.
        """
        try:
            room = self._rooms.pop()
        except IndexError:
            room = self._room()
        numbers = room.inputs
        try:
            numbers[self._first] = q
            if v is not _ABSENT:
                numbers[self._second] = v
            if a is not _ABSENT:
                numbers[self._third] = a
        except _ODD:
            return self._rows_answered(room, tuple(x for x in (q, v, a) if x is not _ABSENT), out)
        room.run()
        if room.output_values[self._defect] < MAX_DEFECT or self._trusting:
            if out is None:
                out = room.results[0].copy()
            else:
                _checked_out(out, self._shape)[...] = room.results[0]
            self._rooms.append(room)
            return out
        self._rooms.append(room)
        return self._batch(tuple(x for x in (q, v, a) if x is not _ABSENT), out)

    def _rows_answered(self, room: Workspace, arguments: tuple[Any, ...], out: Floats | None) -> Floats:
        """A batch (n, size), by way of the workspace if it is small."""
        n = len(arguments[0]) if _is_float64(arguments[0], self._sizes[0]) else 0
        few = 0 < n <= self._few
        if few:
            for rows, array, size in zip(room.input_rows, arguments, self._sizes, strict=False):
                if not _is_float64(array, size) or array.shape != (n, size):
                    few = False
                    break
                rows[:n] = array
        if few:
            room.run_rows(n)
            # Not negative, so that the sum is below the bound only if each is, and none is NaN.
            if sum(room.output_rows[1][:n, 0].tolist()) < MAX_DEFECT or self._trusting:
                if out is None:
                    out = room.output_rows[0][:n].copy()
                else:
                    _checked_out(out, (n, *self._shape))[...] = room.output_rows[0][:n]
                self._rooms.append(room)
                return out
        self._rooms.append(room)
        return self._batch(arguments, out)

    def _room(self) -> Workspace:
        room = self._kernel.workspace(self._few)
        if self._place is not None:
            room.input_rows[-1][...] = self._place
        return room

    def _batch(self, arguments: tuple[Any, ...], out: Floats | None) -> Floats:
        arrays = [
            argument if _is_float64(argument, size) else check(argument)
            for argument, size, check in zip(arguments, self._sizes, self._checks, strict=True)
        ]
        batch = common_batch(*arrays)
        shape = (*batch, *self._shape)
        answer = np.empty(shape) if out is None else _checked_out(out, shape)
        if out is not None and any(np.may_share_memory(out, array) for array in arrays):
            # The arguments may be needed once more.
            answer = np.empty(shape)
        defect = self._evaluate(arrays, batch, answer)
        if not self._trusting and not defect.max(initial=0.0) < MAX_DEFECT:
            if self._validate:
                checked = [check(array) for array, check in zip(arrays, self._checks, strict=True)]
                if any(new is not old for new, old in zip(checked, arrays, strict=True)):
                    self._evaluate(checked, batch, answer)
            # Unchecked numbers that are none give answers that are none, in their rows alone.
            if self._refuse is not None and (self._validate or all(np.isfinite(x).all() for x in arrays)):
                self._refuse(answer)
        if out is None or answer is out:
            return answer
        out[...] = answer
        return out

    def _evaluate(self, arrays: list[Floats], batch: tuple[int, ...], answer: Floats) -> Floats:
        n = prod(batch)
        defect = np.empty((n, 1))
        rows = [_rows(array, batch, n) for array in arrays]
        if self._place is not None:
            rows.append(np.broadcast_to(self._place, (n, len(self._place))))
        self._kernel(
            rows,
            [answer.reshape(n, prod(self._shape)), defect],
            threads=self._threads,
        )
        return defect


class NumericCall:
    """The same for a quantity that is not worth compiling: NumPy evaluates what would be traced."""

    def __init__(
        self,
        mechanism: Mechanism,
        quantity: str,
        details: tuple[Any, ...],
        checks: tuple[Check, ...],
        *,
        tree: bool,
        refuse: Check | None = None,
    ) -> None:
        self._mechanism, self._quantity, self._details = mechanism, quantity, details
        self._checks, self._tree, self._refuse = checks, tree, refuse

    def answer(self, q: Any, v: Any = _ABSENT, a: Any = _ABSENT, out: Floats | None = None) -> Floats:
        """As `KernelCall.answer` does."""
        arguments = (x for x in (q, v, a) if x is not _ABSENT)
        arrays = [check(argument) for check, argument in zip(self._checks, arguments, strict=True)]
        batch = common_batch(*arrays)
        spread = [np.broadcast_to(array, (*batch, array.shape[-1])) for array in arrays]
        # A configuration without an acceleration divides by zero; the caller sees it in the result.
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            found = evaluated(self._mechanism, self._quantity, self._details, *spread, tree=self._tree)
        # What no coordinate moves comes without the batch.
        own = len(kernel_quantity(self._quantity).shape)
        shape = (*batch, *found.shape[found.ndim - own :])
        whole = found.shape == shape and found.flags.c_contiguous and found.flags.writeable
        answer = found if whole else np.array(np.broadcast_to(found, shape))
        if self._refuse is not None:
            self._refuse(answer)
        return into(out, answer)


def into(out: Floats | None, answer: Floats) -> Floats:
    """`answer`, or `out` filled with it if that is given."""
    if out is None:
        return answer
    _checked_out(out, answer.shape)[...] = answer
    return out


def _is_float64(argument: Any, size: int) -> bool:
    return (
        isinstance(argument, np.ndarray)
        and argument.dtype is _FLOAT64
        and argument.ndim > 0
        and argument.shape[-1] == size
    )


def _rows(array: Floats, batch: tuple[int, ...], n: int) -> Floats:
    """(n, size), a view wherever there is one: a sample for the whole batch is not copied."""
    if array.shape[:-1] == batch:
        return array.reshape(n, array.shape[-1])
    if array.ndim == 1:
        return np.broadcast_to(array, (n, *array.shape))
    return np.broadcast_to(array, (*batch, array.shape[-1])).reshape(n, array.shape[-1])


def _checked_out(out: Any, shape: tuple[int, ...]) -> Floats:
    if type(out) is np.ndarray and out.shape == shape and out.dtype is _FLOAT64 and out.flags.carray:
        return out
    if not isinstance(out, np.ndarray):
        raise ArgumentError(f"out is of type {type(out).__name__}; wanted an array")
    if out.dtype != np.float64:
        raise DTypeError(f"out has dtype {out.dtype}; wanted float64")
    if out.shape != shape:
        raise ShapeError(f"out has shape {out.shape}; wanted {shape}")
    if not out.flags.writeable:
        raise ArgumentError("out is read-only; wanted an array to write into")
    if not out.flags.carray:
        raise ArgumentError("out is not C-contiguous and aligned; wanted an array without gaps")
    return out
