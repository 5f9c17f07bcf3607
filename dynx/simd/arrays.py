"""NumPy arrays as arguments of kernels: their checks and addresses, in Python and in machine code.

Python takes a third of a microsecond to check an array and find its address, and longer to add the numbers
of an output; for small batches that is more than the kernel takes. The function `array_entry` does both, by
Python's buffer protocol, and evaluates the batch in the same call. It is compiled anew in each process, in a
hundredth of a second, since it holds the addresses of C functions.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Sequence
from ctypes import addressof, c_char
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dynx.errors import ArgumentError, DTypeError, ShapeError
from dynx.simd.c_interface import (
    DIMENSIONS,
    DOUBLE,
    FLAGS,
    FORMAT,
    LENGTH,
    OBJECT,
    SHAPE,
    STRIDES,
    VIEW_BYTES,
    address_in_python,
    load,
    require,
    store,
)
from dynx.simd.emit import ENTRY
from dynx.simd.image import Code, Image, compile_text
from dynx.simd.program import Port
from dynx.simd.target import host
from dynx.spatial.scalar import Floats

_FLOAT64_BYTES = 8
_FLOAT64 = np.dtype(np.float64)
_first_byte: Any = c_char.from_buffer

ACCEPTED, REFUSED, DESCRIBED, UNSUITABLE = range(4)
"""Outcomes of a call: evaluated, with a sum below the bound, or not below it; only described in the words of
the workspace, because there are too many samples; arrays that the code cannot use, or that share memory."""

_ARGUMENTS, _KERNEL, _MOST, _ADDENDS, _RESULT, _BOUND, _SIZES = range(7)
"""Positions in the plan, an array of 64-bit words: addresses of the kernel's arguments and of its code, most
samples to evaluate, address of the addends, position of the output among the arguments, the bound as a
double, and the sizes of the inputs."""


def make_plan(
    arguments: int,
    kernel: int,
    max_samples: int,
    addends: int,
    result: int,
    bound: float,
    sizes: Sequence[int],
) -> NDArray[np.int64]:
    """Return the plan of a call."""
    words = [arguments, kernel, max_samples, addends, result, np.float64(bound).view(np.int64), *sizes]
    return np.array(words, dtype=np.int64)


@cache
def array_entry(n_inputs: int) -> Callable[..., int]:
    """Return the function for calls with `n_inputs` arrays and one output, which returns the outcome.

    Its arguments are the address of a plan and NumPy arrays: inputs (n, size), of at least as many samples
    as lanes, and an output, contiguous and of the right size, which is not checked. Up to the plan's most
    samples are evaluated, with Python's global lock held. The addends, one number for each sample that is not
    negative, are then added and compared with the bound.
    """
    target = host()
    code = Code(Image((), (), target.lanes, target, (compile_text(_text(n_inputs, target.lanes), target),)))
    objects = [ctypes.py_object] * (n_inputs + 1)
    function = ctypes.PYFUNCTYPE(ctypes.c_longlong, ctypes.c_void_p, *objects)(code.address)
    _linked.append(code)
    return function


_linked: list[Code] = []
"""Code of the functions, which lives as long as the process."""


def _text(n_inputs: int, lanes: int) -> str:
    """Return the LLVM module of the function."""
    views = range(n_inputs + 1)
    objects = ", ".join(f"ptr %object{k}" for k in views)
    lines = [f"define i64 @{ENTRY}(ptr %plan, {objects}) {{", "entry:"]
    lines += ["  %outcome = alloca i64", f"  store i64 {UNSUITABLE}, ptr %outcome"]
    for k in views:
        lines += [f"  %view{k} = alloca [{VIEW_BYTES} x i8], align 16"]
        # A view without an object may be released.
        lines += store("ptr null", f"held{k}", f"view{k}", OBJECT)
    lines += load("arguments", "plan", 8 * _ARGUMENTS, "ptr") + load("result", "plan", 8 * _RESULT)
    for k in views:
        get = f"call i32 {address_in_python('PyObject_GetBuffer')}(ptr %object{k}, ptr %view{k}, i32 {FLAGS})"
        lines += [
            f"  %failed{k} = {get}",
            f"  %got{k} = icmp eq i32 %failed{k}, 0",
            f"  br i1 %got{k}, label %got_{k}, label %clear",
            f"got_{k}:",
            *load(f"data{k}", f"view{k}", 0),
        ]
        lines += _describe_input(k) if k < n_inputs else _describe_output(n_inputs)
    lines += [
        f"  store i64 {DESCRIBED}, ptr %outcome",
        *load("most", "plan", 8 * _MOST),
        "  %few = icmp sle i64 %n, %most",
        "  br i1 %few, label %evaluate, label %leave",
        "evaluate:",
        *_evaluate(lanes),
        "  br label %leave",
        "clear:",
        f"  call void {address_in_python('PyErr_Clear')}()",
        "  br label %leave",
        "leave:",
    ]
    # The references of the caller keep the memory alive for the evaluation in Python of what is described.
    lines += [f"  call void {address_in_python('PyBuffer_Release')}(ptr %view{k})" for k in views]
    lines += ["  %found = load i64, ptr %outcome", "  ret i64 %found", "}"]
    reduced = f"declare double @llvm.vector.reduce.fadd.v{lanes}f64(double, <{lanes} x double>)"
    return "\n".join([*lines, reduced]) + "\n"


def _describe_input(k: int) -> list[str]:
    """Return the code that checks input number k and writes its address and its stride to the arguments."""
    view = f"view{k}"
    lines = [
        *load(f"dimensions{k}", view, DIMENSIONS, "i32"),
        *require(f"dimensions{k}_", f"icmp eq i32 %dimensions{k}, 2"),
        *load(f"format{k}", view, FORMAT, "ptr"),
        f"  %characters{k} = load i16, ptr %format{k}, align 1",
        *require(f"format{k}_", f"icmp eq i16 %characters{k}, {DOUBLE}"),
        *load(f"shape{k}", view, SHAPE, "ptr"),
        *load(f"strides{k}", view, STRIDES, "ptr"),
        *load(f"rows{k}", f"shape{k}", 0),
        *load(f"columns{k}", f"shape{k}", 8),
        *load(f"stride{k}", f"strides{k}", 0),
        *load(f"step{k}", f"strides{k}", 8),
        *load(f"size{k}", "plan", 8 * (_SIZES + k)),
        *require(f"columns{k}_", f"icmp eq i64 %columns{k}, %size{k}"),
    ]
    lines += require(f"rows{k}_", f"icmp eq i64 %rows{k}, %rows0")
    # The stride of a single column is any number.
    lines += [f"  %near{k} = icmp eq i64 %step{k}, 8", f"  %narrow{k} = icmp sle i64 %columns{k}, 1"]
    lines += require(f"step{k}_", f"or i1 %near{k}, %narrow{k}")
    lines += require(f"upward{k}_", f"icmp sge i64 %stride{k}, 0")
    lines += [f"  %offset{k} = or i64 %data{k}, %stride{k}", f"  %odd{k} = and i64 %offset{k}, 7"]
    lines += require(f"aligned{k}_", f"icmp eq i64 %odd{k}, 0")
    lines += store(f"i64 %data{k}", f"address{k}", "arguments", 8 * (1 + 2 * k))
    lines += store(f"i64 %stride{k}", f"distance{k}", "arguments", 8 * (2 + 2 * k))
    return [
        *lines,
        f"  %below{k} = sub i64 %rows{k}, 1",
        f"  %height{k} = mul i64 %below{k}, %stride{k}",
        f"  %width{k} = shl i64 %columns{k}, 3",
        f"  %extent{k} = add i64 %height{k}, %width{k}",
        f"  %end{k} = add i64 %data{k}, %extent{k}",
    ]


def _describe_output(number: int) -> list[str]:
    """Return the code that writes the address of the output, if it shares no memory with an input."""
    lines = [
        "  %n = add i64 %rows0, 0",
        *load("bytes", f"view{number}", LENGTH),
        f"  %end{number} = add i64 %data{number}, %bytes",
    ]
    for k in range(number):
        lines += [
            f"  %before{k} = icmp ule i64 %end{k}, %data{number}",
            f"  %after{k} = icmp uge i64 %data{k}, %end{number}",
            *require(f"apart{k}_", f"or i1 %before{k}, %after{k}"),
        ]
    return [
        *lines,
        "  %result_word = getelementptr i64, ptr %arguments, i64 %result",
        f"  store i64 %data{number}, ptr %result_word",
    ]


def _evaluate(lanes: int) -> list[str]:
    """Return the code that runs the kernel on n samples and compares the sum of the addends."""
    vector = f"<{lanes} x double>"
    return [
        *load("kernel", "plan", 8 * _KERNEL, "ptr"),
        *load("addends", "plan", 8 * _ADDENDS, "ptr"),
        *load("bound", "plan", 8 * _BOUND, "double"),
        "  store i64 %n, ptr %arguments",
        "  %addends_word = getelementptr i64, ptr %result_word, i64 2",
        "  store ptr %addends, ptr %addends_word",
        "  call void %kernel(ptr %arguments)",
        f"  %last = sub i64 %n, {lanes}",
        "  br label %add",
        "add:",
        "  %i = phi i64 [0, %evaluate], [%next, %add]",
        f"  %total = phi {vector} [zeroinitializer, %evaluate], [%sum, %add]",
        # The last vector may overlap the one before: adding a number twice makes the sum no smaller.
        "  %late = icmp sgt i64 %i, %last",
        "  %first = select i1 %late, i64 %last, i64 %i",
        "  %place = getelementptr double, ptr %addends, i64 %first",
        f"  %some = load {vector}, ptr %place, align 8",
        f"  %sum = fadd {vector} %total, %some",
        f"  %next = add i64 %i, {lanes}",
        "  %more = icmp slt i64 %next, %n",
        "  br i1 %more, label %add, label %compare",
        "compare:",
        f"  %all = call reassoc double @llvm.vector.reduce.fadd.v{lanes}f64(double 0.0, {vector} %sum)",
        # If one is NaN, so is the sum, which is then not below the bound.
        "  %good = fcmp olt double %all, %bound",
        f"  %judged = select i1 %good, i64 {ACCEPTED}, i64 {REFUSED}",
        "  store i64 %judged, ptr %outcome",
    ]


# -- in Python ------------------------------------------------------------


def check_arrays(
    input_ports: Sequence[Port],
    output_ports: Sequence[Port],
    inputs: Sequence[Floats],
    outputs: Sequence[Floats],
) -> int:
    """Check number, shapes and dtypes of all arrays; return the number of samples."""
    ports, arrays = (*input_ports, *output_ports), (*inputs, *outputs)
    if len(inputs) != len(input_ports) or len(outputs) != len(output_ports):
        raise ArgumentError(
            f"a kernel of {len(input_ports)} inputs and {len(output_ports)} outputs was given "
            f"{len(inputs)} and {len(outputs)}"
        )
    n = len(arrays[-1]) if arrays and arrays[-1].ndim else 0
    for port, array in zip(ports, arrays, strict=True):
        if array.dtype is not _FLOAT64 and (array.dtype != _FLOAT64 or not array.dtype.isnative):
            raise DTypeError(f"{port.name} has dtype {array.dtype}; wanted float64")
        if array.shape != (n, port.size):
            raise ShapeError(f"{port.name} has shape {array.shape}; wanted ({n}, {port.size})")
    for port, array in zip(output_ports, outputs, strict=True):
        if not array.flags.writeable:
            raise ArgumentError(f"{port.name} is read-only; wanted a writeable array")
    return n


def usable_in_place(array: Floats) -> bool:
    """Return whether the code can use an array without copying: aligned numbers, contiguous rows."""
    return array.flags.aligned and (array.shape[1] <= 1 or array.strides[1] == _FLOAT64_BYTES)


def address_of(array: Floats) -> int:
    """Return the address of the first number of an array."""
    try:
        # This takes a third of the time of `array.ctypes`, but needs a contiguous, writeable array.
        return addressof(_first_byte(array))
    except (TypeError, ValueError, BufferError):
        return array.ctypes.data


def extent_of(array: Floats) -> tuple[int, int]:
    """Return the first address of an array (n, size) and the first one after it."""
    first = address_of(array)
    rows, columns = array.shape
    row_stride, column_stride = array.strides
    height, width = (rows - 1) * row_stride, (columns - 1) * column_stride
    return first + min(height, 0) + min(width, 0), first + max(height, 0) + max(width, 0) + _FLOAT64_BYTES


def is_disjoint(extents: Sequence[tuple[int, int]], own: int, out: Floats) -> bool:
    """Return whether neither another array nor another row of its own shares memory with `out`.

    `extents` are those of all arrays, of which number `own` is that of `out`.
    """
    if len(out) > 1 and abs(out.strides[0]) < _FLOAT64_BYTES * out.shape[1]:
        return False
    first, end = extents[own]
    return all(k == own or low >= end or high <= first for k, (low, high) in enumerate(extents))
