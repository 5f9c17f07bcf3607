"""A function of two vectors, such as a step of a configuration, in one call of machine code.

Python takes some 15 nanoseconds for a product, and NumPy some hundreds for an operation on a short array or a
check of it. The function checks its arrays by Python's buffer protocol and computes on their numbers in the
order of the traced text, with the C library's sine, cosine and arc tangent, which Python's `math` calls too:
its results are bit for bit those of the same text on Python's floats.

It is compiled anew in each process, since it holds the addresses of C functions.
"""

from __future__ import annotations

import ctypes
import sys
from collections.abc import Callable

from dynx.simd.arrays import ACCEPTED, REFUSED, UNSUITABLE
from dynx.simd.c_interface import (
    DIMENSIONS,
    DOUBLE,
    FLAGS,
    FORMAT,
    OBJECT,
    SHAPE,
    STRIDES,
    VIEW_BYTES,
    address_in_python,
    load,
    operand_of,
    require,
    store,
)
from dynx.simd.emit import ENTRY
from dynx.simd.image import Code, Image, compile_text
from dynx.simd.ir_writer import hex_double
from dynx.simd.program import Program
from dynx.simd.target import host

_BYTES = 8
_NAMES = ("first", "second", "result")

_INSTRUCTIONS = {"add": "fadd", "sub": "fsub", "mul": "fmul", "div": "fdiv"}
_INTRINSICS = {"abs": "fabs", "sqrt": "sqrt"}
_LIBRARY = {"sin": "sin", "cos": "cos", "arctan": "atan"}
_CHOICES = {"min": "olt", "max": "ogt"}
_ORDERS = {"less": "olt", "less_equal": "ole", "equal": "oeq"}


def vector_function(head: Program, tail: Program) -> Callable[[object, object, object], int]:
    """Return a function of two vectors and of the one for the result, which shares no memory with them.

    The first entries of the result are those of `head`, a program of the first entries of both vectors, and
    each further entry is that of `tail`, a program of one further entry of each. Both programs have the
    inputs ``first`` and ``second`` and the outputs ``result`` and ``defect``, a number. Trace them with
    ``simplify=None``, so that the operations remain those of the text. Raises CompileError.

    The function returns ACCEPTED if the sum of all defects is below 1, REFUSED if it is not, and UNSUITABLE
    unless the arrays are contiguous vectors of float64 whose sizes are those of the programs.
    """
    target = host()
    code = Code(Image((), (), target.lanes, target, (compile_text(_text(head, tail), target),)))
    _linked.append(code)
    return ctypes.PYFUNCTYPE(ctypes.c_longlong, *[ctypes.py_object] * len(_NAMES))(code.address)


_linked: list[Code] = []
"""Code of the functions, which lives as long as the process."""


def _text(head: Program, tail: Program) -> str:
    """Return the LLVM module."""
    sizes = [port.size for port in (*head.inputs, head.outputs[0])]
    objects = ", ".join(f"ptr %object{k}" for k in range(len(_NAMES)))
    lines = [f"define i64 @{ENTRY}({objects}) {{", "entry:"]
    lines += ["  %outcome = alloca i64", f"  store i64 {UNSUITABLE}, ptr %outcome"]
    for k in range(len(_NAMES)):
        lines.append(f"  %view{k} = alloca [{VIEW_BYTES} x i8], align 16")
        # A view without an object may be released.
        lines += store("ptr null", f"held{k}", f"view{k}", OBJECT)
    for k, size in enumerate(sizes):
        lines += _vector(k, size)
    lines += [
        *require("sized", f"icmp sge i64 %further{len(sizes) - 1}, 0"),
        "  br label %compute",
        "compute:",
        *_operations(head, "h", [f"%data{k}" for k in range(len(_NAMES))]),
    ]
    for k, size in enumerate(sizes):
        lines.append(f"  %rest{k} = getelementptr double, ptr %data{k}, i64 {size}")
    lines += [
        "  br label %check",
        "check:",
        "  %i = phi i64 [0, %compute], [%next, %each]",
        "  %sum = phi double [%h_defect, %compute], [%total, %each]",
        "  %more = icmp slt i64 %i, %further0",
        "  br i1 %more, label %each, label %judge",
        "each:",
        *(f"  %place{k} = getelementptr double, ptr %rest{k}, i64 %i" for k in range(len(_NAMES))),
        *_operations(tail, "t", [f"%place{k}" for k in range(len(_NAMES))]),
        "  %total = fadd double %sum, %t_defect",
        "  %next = add i64 %i, 1",
        "  br label %check",
        "judge:",
        # If one is NaN, so is the sum, which is then not below the bound.
        "  %good = fcmp olt double %sum, 1.0",
        f"  %judged = select i1 %good, i64 {ACCEPTED}, i64 {REFUSED}",
        "  store i64 %judged, ptr %outcome",
        "  br label %leave",
        "clear:",
        f"  call void {address_in_python('PyErr_Clear')}()",
        "  br label %leave",
        "leave:",
        *(f"  call void {address_in_python('PyBuffer_Release')}(ptr %view{k})" for k in range(len(_NAMES))),
        "  %found = load i64, ptr %outcome",
        "  ret i64 %found",
        "}",
    ]
    declared = [f"declare double @llvm.{name}.f64(double)" for name in _INTRINSICS.values()]
    return "\n".join([*lines, *declared]) + "\n"


def _vector(k: int, size: int) -> list[str]:
    """Return the code that checks vector number k, which has as many further entries as the first."""
    view = f"view{k}"
    get = f"call i32 {address_in_python('PyObject_GetBuffer')}(ptr %object{k}, ptr %{view}, i32 {FLAGS})"
    return [
        f"  %failed{k} = {get}",
        f"  %got{k} = icmp eq i32 %failed{k}, 0",
        f"  br i1 %got{k}, label %got_{k}, label %clear",
        f"got_{k}:",
        *load(f"data{k}", view, 0, "ptr"),
        *load(f"dimensions{k}", view, DIMENSIONS, "i32"),
        *require(f"vector{k}_", f"icmp eq i32 %dimensions{k}, 1"),
        *load(f"format{k}", view, FORMAT, "ptr"),
        f"  %characters{k} = load i16, ptr %format{k}, align 1",
        *require(f"double{k}_", f"icmp eq i16 %characters{k}, {DOUBLE}"),
        *load(f"shape{k}", view, SHAPE, "ptr"),
        *load(f"entries{k}", f"shape{k}", 0),
        f"  %further{k} = sub i64 %entries{k}, {size}",
        *require(f"alike{k}_", f"icmp eq i64 %further{k}, %further0"),
        *load(f"strides{k}", view, STRIDES, "ptr"),
        *load(f"stride{k}", f"strides{k}", 0),
        *require(f"contiguous{k}_", f"icmp eq i64 %stride{k}, {_BYTES}"),
    ]


def _operations(program: Program, stem: str, places: list[str]) -> list[str]:
    """Return the code of a program: its inputs and its result lie at `places`, its defect gets a name."""
    owners = [
        (place, entry)
        for place, port in zip(places, program.inputs, strict=False)
        for entry in range(port.size)
    ]
    lines: list[str] = []
    names: list[str] = []
    for number, node in enumerate(program.nodes):
        name = f"%{stem}{number}"
        arguments = [names[k] for k in node.args]
        if node.op == "constant":
            names.append(hex_double(node.value))
            continue
        names.append(name)
        if node.op == "input":
            place, entry = owners[node.slot]
            lines.append(f"  {name}_at = getelementptr double, ptr {place}, i64 {entry}")
            lines.append(f"  {name} = load double, ptr {name}_at, align 1")
        else:
            lines += _operation(node.op, name, arguments)
    *result, defect = (names[k] for k in program.results)
    for entry, value in enumerate(result):
        lines.append(f"  %{stem}_result{entry} = getelementptr double, ptr {places[-1]}, i64 {entry}")
        lines.append(f"  store double {value}, ptr %{stem}_result{entry}, align 1")
    return [*lines, f"  %{stem}_defect = fadd double {defect}, 0.0"]


def _operation(op: str, name: str, arguments: list[str]) -> list[str]:
    """Return the code of one operation on doubles."""
    listed = ", ".join(f"double {each}" for each in arguments)
    if op in _INSTRUCTIONS:
        return [f"  {name} = {_INSTRUCTIONS[op]} double {', '.join(arguments)}"]
    if op == "neg":
        return [f"  {name} = fneg {listed}"]
    if op in _INTRINSICS:
        return [f"  {name} = call double @llvm.{_INTRINSICS[op]}.f64({listed})"]
    if op in _LIBRARY:
        return [f"  {name} = call double {operand_of(getattr(_c_library(), _LIBRARY[op]))}({listed})"]
    if op in _CHOICES:
        first, second = arguments
        return [
            f"  {name}_holds = fcmp {_CHOICES[op]} double {first}, {second}",
            f"  {name} = select i1 {name}_holds, double {first}, double {second}",
        ]
    if op in _ORDERS:
        return [
            f"  {name}_holds = fcmp {_ORDERS[op]} double {', '.join(arguments)}",
            f"  {name} = select i1 {name}_holds, double 1.0, double 0.0",
        ]
    assert op == "select", op
    return [
        f"  {name}_holds = fcmp une double {arguments[0]}, 0.0",
        f"  {name} = select i1 {name}_holds, double {arguments[1]}, double {arguments[2]}",
    ]


def _c_library() -> ctypes.CDLL:
    """Return the C library whose functions Python's `math` calls."""
    return ctypes.CDLL("ucrtbase" if sys.platform == "win32" else None)
