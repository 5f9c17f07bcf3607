"""Calls of kernels with arguments of any leading axes, whose results have the same leading axes.

A single sample is copied into a workspace, evaluated and copied out, which takes about a microsecond. A batch
is read in place.

`CoupledCall` evaluates a quantity of a robot with mimic joints by routines in tree coordinates.
"""

from __future__ import annotations

from collections.abc import Callable
from math import prod
from typing import Any

import numpy as np

from dynx.backends.evaluation import HookEvaluation, batch_rows, common_batch
from dynx.backends.straight import straight_call
from dynx.compiled.defect import MAX_DEFECT
from dynx.compiled.kernels import evaluate_quantity, kernel_quantity
from dynx.errors import ArgumentError, DTypeError, ShapeError
from dynx.model import Mechanism, Model
from dynx.simd.arrays import ACCEPTED, DESCRIBED, REFUSED, address_of
from dynx.simd.kernel import Kernel, Workspace
from dynx.spatial.scalar import Floats

Check = Callable[..., Floats]
"""Function that converts an argument to a float64 array (..., size), or raises an error that names it."""

MAX_COPIED_SAMPLES = 256
"""Largest batch that is copied to the workspace if its rows are not contiguous."""

MAX_COPIED_SIZE = 16384
"""Largest size of one array of such a batch."""

MAX_LOCKED_WORK = 4e6
"""Most work of a batch that is evaluated with Python's global lock held, in bytes of code times groups of
samples: some 20 microseconds."""

DEFECT_SCALE = 2.0**-300
"""Factor by which defects are scaled before they are added."""

SCALES = np.full(8192, DEFECT_SCALE)
"""Factors of a scalar product. A library may divide a longer one over threads."""

_FLOAT64 = np.dtype(np.float64)
ABSENT = object()
"""Argument that a quantity does not have."""

_NDARRAY = np.ndarray

_NOT_ONE_SAMPLE = (TypeError, ValueError, NotImplementedError, BufferError)
"""Exceptions that a memory view raises for anything but one sample of float64."""


class KernelCall:
    """A quantity of one robot, evaluated by its kernel.

    `checks` are the checks of the arguments, in order. They are called only for arguments that are not
    float64 arrays, or if the kernel's defect shows an invalid sample. `place`, if given, is the last input of
    the kernel, the same for all samples. `check_result` raises for results that are not finite; it is called
    if the defect is too large although the arguments are valid.
    """

    __slots__ = (
        "_check_result",
        "_checks",
        "_defect",
        "_first",
        "_kernel",
        "_lanes",
        "_max_in_place",
        "_max_locked",
        "_max_rows",
        "_place",
        "_result_word",
        "_second",
        "_shape",
        "_sizes",
        "_third",
        "_threads",
        "_unchecked",
        "_validate",
        "_workspaces",
    )

    def __init__(
        self,
        kernel: Kernel,
        checks: tuple[Check, ...],
        *,
        threads: int,
        validate: bool,
        place: Floats | None = None,
        check_result: Check | None = None,
    ) -> None:
        self._kernel, self._checks, self._threads, self._validate = kernel, checks, threads, validate
        self._place, self._check_result = place, check_result
        self._unchecked = not validate and check_result is None
        self._sizes = [port.size for port in kernel.inputs[: len(checks)]]
        self._shape = kernel.outputs[0].shape
        largest = max(port.size for port in (*kernel.inputs, *kernel.outputs))
        self._lanes = kernel.image.lanes
        self._result_word = 1 + 2 * len(kernel.inputs)
        self._max_in_place = kernel.max_samples_of_one_part(threads)
        self._max_rows = min(MAX_COPIED_SAMPLES, max(1, MAX_COPIED_SIZE // largest))
        self._max_locked = max(1, int(MAX_LOCKED_WORK / kernel.image.size)) * self._lanes
        workspace = self._workspace()
        self._first, self._second, self._third = (*workspace.input_slices, slice(0), slice(0))[:3]
        self._defect = workspace.output_slices[1].start
        # Calls take a workspace from this list and return it. Unlike one workspace per thread, this is safe
        # even if a signal handler or a destructor makes a call during another call.
        self._workspaces = [workspace]

    def evaluate(self, q: Any, v: Any = ABSENT, a: Any = ABSENT, out: Floats | None = None) -> Floats:
        """Return the result (..., *shape), in `out` if that is given.

        `out` is a C-contiguous float64 array of the shape of the result; its content after an error is
        undefined. Raises ShapeError, DTypeError or ArgumentError.
        """
        try:
            workspace = self._workspaces.pop()
        except IndexError:
            workspace = self._workspace()
        if type(q) is _NDARRAY and q.ndim == 2:
            return self._evaluate_rows(workspace, given_arguments(q, v, a), out)
        numbers = workspace.inputs
        try:
            numbers[self._first] = q
            # The buffer of a masked array has no mask.
            if v is ABSENT:
                plain = type(q) is _NDARRAY
            else:
                numbers[self._second] = v
                if a is ABSENT:
                    plain = type(q) is type(v) is _NDARRAY
                else:
                    numbers[self._third] = a
                    plain = type(q) is type(v) is type(a) is _NDARRAY
            if not plain:
                return self._evaluate_rows(workspace, given_arguments(q, v, a), out)
        except _NOT_ONE_SAMPLE:
            return self._evaluate_rows(workspace, given_arguments(q, v, a), out)
        workspace.run()
        if workspace.output_values[self._defect] < MAX_DEFECT or self._unchecked:
            if out is None:
                out = workspace.results[0].copy()
            else:
                _checked_out(out, self._shape)[...] = workspace.results[0]
            self._workspaces.append(workspace)
            return out
        self._workspaces.append(workspace)
        return self._batch(given_arguments(q, v, a), out)

    def for_one_sample(self) -> Callable[..., Floats]:
        """Return a function of one sample, contiguous float64 arrays, which it does not check.

        It is for one thread, and returns the same array in every call. A sample whose defect is too large is
        evaluated by `evaluate`.
        """
        # The functions keep the workspace alive, because `run` has only addresses of its arrays.
        workspace = self._workspace()
        inputs: Any = workspace.inputs
        run, result = workspace.run, workspace.results[0]
        defects, place = workspace.output_values, self._defect
        first, second, third = self._first, self._second, self._third
        evaluate = self.evaluate

        def of_one(q: Floats, _kept: object = workspace) -> Floats:
            inputs[first] = q
            run()
            return result if defects[place] < MAX_DEFECT else evaluate(q)

        def of_two(q: Floats, v: Floats, _kept: object = workspace) -> Floats:
            inputs[first], inputs[second] = q, v
            run()
            return result if defects[place] < MAX_DEFECT else evaluate(q, v)

        def of_three(q: Floats, v: Floats, a: Floats, _kept: object = workspace) -> Floats:
            inputs[first], inputs[second], inputs[third] = q, v, a
            run()
            return result if defects[place] < MAX_DEFECT else evaluate(q, v, a)

        functions: tuple[Callable[..., Floats], ...] = (of_one, of_two, of_three)
        return functions[len(self._sizes) - 1]

    def _evaluate_rows(self, workspace: Workspace, arguments: tuple[Any, ...], out: Floats | None) -> Floats:
        """Evaluate a batch and return its results; arrays (n, size) take the fastest paths."""
        first = arguments[0]
        n = len(first) if type(first) is _NDARRAY and first.ndim == 2 else 0
        found = None
        if self._lanes <= n <= self._max_in_place:
            found = self._evaluate_in_place(workspace, n, arguments, out)
        if found is None and 0 < n <= self._max_rows:
            found = self._evaluate_copies(workspace, n, arguments, out)
        self._workspaces.append(workspace)
        return self._batch(arguments, out) if found is None else found

    def _evaluate_in_place(
        self, workspace: Workspace, n: int, arguments: tuple[Any, ...], out: Floats | None
    ) -> Floats | None:
        """Evaluate contiguous rows (n, size) where they are.

        Return None if the arguments are others, or one may be invalid.
        """
        for array in arguments:
            # The buffer of a masked array has no mask.
            if type(array) is not _NDARRAY:
                return None
        shape = (n, *self._shape)
        result = np.empty(shape) if out is None else _checked_out(out, shape)
        run = workspace.run_arrays or workspace.accept_arrays(self._sizes, self._max_locked, MAX_DEFECT)
        outcome = run(*arguments, result)
        if outcome == DESCRIBED:
            defects = np.empty((n, 1))
            words = workspace.batch_words
            words[0], words[self._result_word + 2] = n, address_of(defects)
            workspace.run_batch()
            outcome = ACCEPTED if self._unchecked or self._are_valid(defects, n) else REFUSED
        return result if outcome == ACCEPTED or (outcome == REFUSED and self._unchecked) else None

    def _evaluate_copies(
        self, workspace: Workspace, n: int, arguments: tuple[Floats, ...], out: Floats | None
    ) -> Floats | None:
        """Evaluate rows that are copied to the workspace.

        Return None if they are not (n, size) float64, or one may be invalid.
        """
        for array, size in zip(arguments, self._sizes, strict=True):
            if not _is_float64(array, size) or array.shape != (n, size):
                return None
        for rows, array in zip(workspace.input_rows, arguments, strict=False):
            rows[:n] = array
        workspace.run_rows(n)
        if not (self._unchecked or self._are_valid(workspace.output_rows[1], n)):
            return None
        result = np.empty((n, *self._shape)) if out is None else _checked_out(out, (n, *self._shape))
        result[...] = workspace.output_rows[0][:n]
        return result

    def _are_valid(self, defects: Floats, n: int) -> bool:
        """Check whether the first n of `defects` (rows, 1) are below the bound."""
        defects = defects[:n, 0]
        if n > len(SCALES):
            return bool(defects.max() < MAX_DEFECT)
        # Defects are not negative, so their sum is below the bound only if each one is and none is NaN.
        # A scalar product is the fastest sum of few numbers; the factors keep it from overflowing.
        return bool(defects.dot(SCALES[:n]) < MAX_DEFECT * DEFECT_SCALE)

    def _workspace(self) -> Workspace:
        workspace = self._kernel.workspace(self._max_rows)
        if self._place is not None:
            workspace.input_rows[-1][...] = self._place
            workspace.repeat_input(len(workspace.input_rows) - 1)
        return workspace

    def _batch(self, arguments: tuple[Any, ...], out: Floats | None) -> Floats:
        arrays = [
            argument if _is_float64(argument, size) else check(argument)
            for argument, size, check in zip(arguments, self._sizes, self._checks, strict=True)
        ]
        batch = common_batch(*arrays)
        shape = (*batch, *self._shape)
        result = np.empty(shape) if out is None else _checked_out(out, shape)
        if out is not None and any(np.may_share_memory(out, array) for array in arrays):
            # The arguments are needed again if they have to be checked.
            result = np.empty(shape)
        defect = self._evaluate(arrays, batch, result)
        if not self._unchecked and not defect.max(initial=0.0) < MAX_DEFECT:
            if self._validate:
                checked = [check(array) for array, check in zip(arrays, self._checks, strict=True)]
                if any(new is not old for new, old in zip(checked, arrays, strict=True)):
                    self._evaluate(checked, batch, result)
            # Without validation, an argument that is not finite affects the results of its own sample only.
            valid = self._validate or all(np.isfinite(x).all() for x in arrays)
            if self._check_result is not None and valid:
                self._check_result(result)
        if out is None or result is out:
            return result
        out[...] = result
        return out

    def _evaluate(self, arrays: list[Floats], batch: tuple[int, ...], result: Floats) -> Floats:
        n = prod(batch)
        defect = np.empty((n, 1))
        rows = [batch_rows(array, batch) for array in arrays]
        if self._place is not None:
            rows.append(np.broadcast_to(self._place, (n, len(self._place))))
        self._kernel(
            rows,
            [result.reshape(n, prod(self._shape)), defect],
            threads=self._threads,
        )
        return defect


class NumericCall:
    """A quantity whose code is too long to compile, evaluated by NumPy with the interface of `KernelCall`."""

    def __init__(
        self,
        mechanism: Mechanism,
        quantity: str,
        details: tuple[Any, ...],
        checks: tuple[Check, ...],
        *,
        check_result: Check | None = None,
    ) -> None:
        self._mechanism, self._quantity, self._details = mechanism, quantity, details
        self._checks, self._check_result = checks, check_result

    def evaluate(self, q: Any, v: Any = ABSENT, a: Any = ABSENT, out: Floats | None = None) -> Floats:
        """Return the result (..., *shape), as `KernelCall.evaluate` does."""
        arguments = (x for x in (q, v, a) if x is not ABSENT)
        arrays = [check(argument) for check, argument in zip(self._checks, arguments, strict=True)]
        batch = common_batch(*arrays)
        spread = [np.broadcast_to(array, (*batch, array.shape[-1])) for array in arrays]
        # A singular mass matrix divides by zero; the result is then checked.
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            found = evaluate_quantity(self._mechanism, self._quantity, self._details, *spread)
        # A result that depends on no coordinate lacks the batch axes.
        own = len(kernel_quantity(self._quantity).shape)
        shape = (*batch, *found.shape[found.ndim - own :])
        whole = found.shape == shape and found.flags.c_contiguous and found.flags.writeable
        result = found if whole else np.array(np.broadcast_to(found, shape))
        if self._check_result is not None:
            self._check_result(result)
        return write_into(out, result)


def write_into(out: Floats | None, result: Floats) -> Floats:
    """Return `result`; if `out` is given, copy the result into it and return `out`."""
    if out is None:
        return result
    _checked_out(out, result.shape)[...] = result
    return out


def given_arguments(q: Any, v: Any, a: Any) -> tuple[Any, ...]:
    """Return the arguments of a call without those that were left out."""
    if v is ABSENT:
        return (q,)
    return (q, v) if a is ABSENT else (q, v, a)


def _is_float64(argument: Any, size: int) -> bool:
    return (
        type(argument) is np.ndarray
        and argument.dtype is _FLOAT64
        and argument.ndim > 0
        and argument.shape[-1] == size
    )


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


MIN_BLOCK, BLOCK_NUMBERS = 32, 2**16
"""Least number of samples, and of numbers in tree coordinates, of a block in which each thread evaluates a
batch: results of a larger one would leave the caches before they are reduced."""


class CoupledCall:
    """A quantity of a robot with mimic joints, evaluated in tree coordinates by a call without them, whose
    results have the shape `shape`."""

    def __init__(
        self,
        model: Model,
        mechanism: Mechanism,
        quantity: str,
        in_tree: Callable[..., Floats],
        checks: tuple[Check, ...],
        *,
        shape: tuple[int, ...],
        threads: int,
        validate: bool,
    ) -> None:
        described = kernel_quantity(quantity)
        self._evaluation = HookEvaluation(mechanism, vectorized=True)
        self._reduce = self._evaluation.reduction(
            rows=described.reduces_rows, columns=described.reduces_columns
        )
        self._in_tree, self._shape, self._checks = in_tree, shape, checks
        self._block = threads * max(MIN_BLOCK, BLOCK_NUMBERS // prod(shape))
        of_sample = self._evaluation.of_sample(lambda _, *sample: in_tree(*sample), self._reduce)
        self._straight = straight_call(model, of_sample, len(checks), validate=validate)

    def evaluate(self, q: Any, v: Any = ABSENT, a: Any = ABSENT, out: Floats | None = None) -> Floats:
        """Return the result (..., *shape), as `KernelCall.evaluate` does."""
        arguments = given_arguments(q, v, a)
        result: Floats | None = self._straight(None, arguments)
        if result is None:
            arrays = [check(argument) for check, argument in zip(self._checks, arguments, strict=True)]
            result = self._batch(arrays)
        return write_into(out, result)

    def _batch(self, arrays: list[Floats]) -> Floats:
        batch = common_batch(*arrays)
        n = prod(batch)
        if n < 2 * self._block:
            return self._evaluation(self._in_tree, self._shape, *arrays, reduce=self._reduce)
        rows = [batch_rows(array, batch) for array in arrays]
        blocks = [
            self._evaluation(
                self._in_tree,
                self._shape,
                *(array[first : first + self._block] for array in rows),
                reduce=self._reduce,
            )
            for first in range(0, n, self._block)
        ]
        result = np.concatenate(blocks)
        return result.reshape(*batch, *result.shape[1:])
