"""Content of the code of a class outside dynx, by which classes are compared: equal code computes the same.

The content is the bytecode of the methods with their constants, default values, the values of enclosing
functions, and the numbers and functions of the module that they use. Line numbers, file names and docstrings
are ignored. Bytecode depends on the version of Python, so code of two versions is never equal.
"""

from __future__ import annotations

import functools
import sys
import uuid
from collections.abc import Mapping
from hashlib import sha256
from types import BuiltinFunctionType, CodeType, FunctionType, MethodType, ModuleType
from typing import Any

import numpy as np

from dynx.control.content import attributes_of

PROCESS = uuid.uuid4().hex
"""Identifier of this process, which is part of the identity of objects that cannot be compared by content."""

LIBRARIES = frozenset({"dynx", "numpy", "scipy"})
"""Packages, besides the standard library, whose classes and functions are identified by name."""

IGNORED = frozenset(
    {
        *("__module__", "__qualname__", "__doc__", "__dict__", "__weakref__", "__annotations__"),
        *("__dataclass_fields__", "__dataclass_params__", "__match_args__", "__parameters__"),
        *("__orig_bases__", "__abstractmethods__", "_abc_impl", "__slots__", "__firstlineno__"),
        *("__static_attributes__", "__annotate__", "__annotate_func__", "__annotations_cache__"),
        "__slotnames__",  # copying an object adds it
    }
)
"""Attributes of a class that are not its code."""


Seen = dict[int, tuple[int, Any]]
"""Classes, functions and objects visited so far, by identity, each with its number."""


def is_foreign(kind: type) -> bool:
    """Check whether a class belongs neither to dynx nor to one of `LIBRARIES`."""
    return is_foreign_module(kind.__module__)


def digest_of_code(kind: type) -> str:
    """Return the checksum of the code of a class and of its base classes outside dynx."""
    return sha256(repr(_class(kind, {})).encode()).hexdigest()


def digest_of_function(function: FunctionType) -> str:
    """Return the checksum of the code of one function, as `digest_of_code` makes it."""
    return sha256(repr(_function(function, {})).encode()).hexdigest()


def is_foreign_module(module: str | None) -> bool:
    """Check whether a module belongs neither to dynx nor to one of `LIBRARIES`."""
    root = (module or "").partition(".")[0]
    return root not in LIBRARIES and root not in sys.stdlib_module_names


def _place(thing: Any, seen: Seen) -> str | None:
    """Return a reference to an object visited before; record a new object."""
    if id(thing) in seen:
        return f"see {seen[id(thing)][0]}"
    seen[id(thing)] = (len(seen), thing)
    return None


def _class(kind: type, seen: Seen) -> Any:
    found = _place(kind, seen)
    if found is not None:
        return found
    own = [each for each in kind.__mro__ if is_foreign(each)]
    named = [_name(each) for each in kind.__mro__]
    return named, [
        (name, _value(value, seen))
        for each in own
        for name, value in sorted(vars(each).items())
        if name not in IGNORED and not _is_generated(each, name, value)
    ]


def _is_generated(kind: type, name: str, value: Any) -> bool:
    """Check whether `dataclasses` generated a method from the fields, which are compared separately."""
    if not isinstance(value, FunctionType) or "__dataclass_fields__" not in vars(kind):
        return False
    return name.startswith("__") and value.__code__.co_filename == "<string>"


def _function(function: FunctionType, seen: Seen) -> Any:
    if not is_foreign_module(function.__module__):
        return _name(function)
    found = _place(function, seen)
    if found is not None:
        return found
    code, known = function.__code__, function.__globals__
    enclosed = [cell.cell_contents for cell in function.__closure__ or () if _is_filled(cell)]
    outside = {
        name: _value(known[name], seen)
        for name in sorted(_names(code))
        if name in known and _is_compared(known[name])
    }
    defaults = _value((function.__defaults__, function.__kwdefaults__), seen)
    return _code(code, function.__doc__), defaults, [_value(each, seen) for each in enclosed], outside


def _is_filled(cell: Any) -> bool:
    try:
        _ = cell.cell_contents
    except ValueError:
        return False
    return True


def _is_compared(value: Any) -> bool:
    """Check whether a value of a module is compared: numbers, text, arrays and functions are."""
    return isinstance(value, bool | int | float | complex | str | bytes | tuple | np.ndarray | FunctionType)


def _names(code: CodeType) -> set[str]:
    inner = (each for each in code.co_consts if isinstance(each, CodeType))
    return {*code.co_names, *(name for each in inner for name in _names(each))}


def _code(code: CodeType, docstring: str | None) -> Any:
    constants = code.co_consts
    if constants and docstring is not None and constants[0] == docstring:
        constants = constants[1:]
    return (
        code.co_code.hex(),
        code.co_names,
        (code.co_argcount, code.co_kwonlyargcount, code.co_flags, code.co_freevars, code.co_cellvars),
        [_code(each, None) if isinstance(each, CodeType) else _value(each, {}) for each in constants],
    )


def _value(value: Any, seen: Seen) -> Any:
    """Return the content of a value that code refers to, or the identity of one that cannot be compared."""
    kind = _name(type(value))
    if value is None or isinstance(value, bool | int | float | complex | str | bytes):
        return kind, repr(value)
    if isinstance(value, np.ndarray | np.generic) and value.dtype != object:
        return kind, value.dtype.str, value.shape, value.tobytes().hex()
    if isinstance(value, list | tuple):
        return kind, [_value(each, seen) for each in value]
    if isinstance(value, set | frozenset):
        return kind, sorted(repr(_value(each, seen)) for each in value)
    if isinstance(value, Mapping):
        return kind, [(_value(key, seen), _value(each, seen)) for key, each in value.items()]
    if isinstance(value, FunctionType):
        return kind, _function(value, seen)
    if isinstance(value, MethodType | staticmethod | classmethod):
        bound = getattr(value, "__self__", None) if isinstance(value, MethodType) else None
        return kind, _value(value.__func__, seen), _value(bound, seen)
    if isinstance(value, property):
        return kind, [_value(each, seen) for each in (value.fget, value.fset, value.fdel)]
    if isinstance(value, functools.cached_property):
        return kind, _value(value.func, seen)
    if isinstance(value, functools.partial):
        return kind, [_value(each, seen) for each in (value.func, value.args, value.keywords)]
    if isinstance(value, type):
        return kind, _class(value, seen) if is_foreign(value) else _name(value)
    if isinstance(value, ModuleType):
        return kind, value.__name__
    if isinstance(value, np.ufunc | BuiltinFunctionType):
        return kind, _name(value)
    return kind, _object(value, seen)


def _object(value: Any, seen: Seen) -> Any:
    found = _place(value, seen)
    if found is not None:
        return found
    foreign = is_foreign(type(value))
    try:
        attributes = attributes_of(value)
    except TypeError:
        return PROCESS, id(value)
    if not attributes and not foreign:
        return PROCESS, id(value)
    code = _class(type(value), seen) if foreign else ""
    return code, [(name, _value(attributes[name], seen)) for name in sorted(attributes)]


def _name(thing: Any) -> str:
    module = getattr(thing, "__module__", None)
    return f"{module}:{getattr(thing, '__qualname__', getattr(thing, '__name__', ''))}"
