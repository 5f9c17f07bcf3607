"""Python's C interface in machine code: fields of a buffer, addresses of C functions, loads and stores."""

from __future__ import annotations

import ctypes

VIEW_BYTES = 80
"""Size of C's structure ``Py_buffer``."""

OBJECT, LENGTH, DIMENSIONS, FORMAT, SHAPE, STRIDES = 8, 16, 36, 40, 48, 56
"""Offsets of its fields; the address of the data is the first."""

FLAGS = 0x1C
"""Flags of ``PyObject_GetBuffer``: shape, strides and format."""

DOUBLE = ord("d")
"""Format of float64 in the machine's byte order: this character and the end of the string."""


def address_in_python(function: str) -> str:
    """Return the address of a function of Python's C interface as an operand."""
    return operand_of(getattr(ctypes.pythonapi, function))


def operand_of(function: ctypes._CFunctionType) -> str:
    """Return the address of a C function as an operand."""
    return f"inttoptr (i64 {ctypes.cast(function, ctypes.c_void_p).value} to ptr)"


def load(name: str, base: str, offset: int, kind: str = "i64") -> list[str]:
    """Return the code that loads a value at an offset [bytes] from an address."""
    return [_at(f"{name}_at", base, offset), f"  %{name} = load {kind}, ptr %{name}_at"]


def store(value: str, name: str, base: str, offset: int) -> list[str]:
    """Return the code that stores a value, given with its type, at an offset [bytes] from an address."""
    return [_at(f"{name}_at", base, offset), f"  store {value}, ptr %{name}_at"]


def require(name: str, condition: str) -> list[str]:
    """Return the code that leaves, with the outcome stored so far, unless a condition holds."""
    return [f"  %{name} = {condition}", f"  br i1 %{name}, label %{name}yes, label %leave", f"{name}yes:"]


def _at(name: str, base: str, offset: int) -> str:
    return f"  %{name} = getelementptr i8, ptr %{base}, i64 {offset}"
