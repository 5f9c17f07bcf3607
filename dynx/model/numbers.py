"""Checks of numbers and arrays that a user gives, and the bounds on their magnitude."""

from __future__ import annotations

import math
from collections.abc import Mapping
from contextlib import suppress
from typing import TypeGuard

import numpy as np
from numpy.typing import ArrayLike

from dynx.argument_types import is_listed
from dynx.errors import ArgumentError, DTypeError, GainError, NotFiniteError, ShapeError, shown
from dynx.spatial.scalar import Array, Floats

_FLOAT64 = np.dtype(np.float64)
_MAX_FLOAT = float(np.finfo(np.float64).max)

MAX_MAGNITUDE = 1e60
"""Bound on the magnitude of the entries of an array, and of the numbers of a description.

A moment is a product of two lengths, two speeds and a mass. The bound prevents its overflow, with which an
engine would silently return infinity or NaN.
"""

DIVERGENCE_SPEED = 1e8
"""Norm of the velocity [rad/s or m/s] above which a simulation or a world counts as diverged."""

UNIT_NORM_TOLERANCE = 4 * float(np.finfo(np.float64).eps)
"""Largest deviation from 1 of the norm of a quaternion that counts as rounding."""


def checked_array(name: str, value: ArrayLike, length: int) -> Floats:
    """Return `value` as float64 (..., length) with entries below `MAX_MAGNITUDE`.

    Raises DTypeError, ShapeError, NotFiniteError or ArgumentError, naming the argument `name`.
    """
    # One vector of floats, by far the most frequent argument: a norm below the bound has entries below it.
    if (
        type(value) is np.ndarray
        and value.dtype is _FLOAT64
        and value.shape == (length,)
        and math.hypot(*value.tolist()) < MAX_MAGNITUDE
    ):
        return value
    array = real_array(name, value)
    if array.ndim == 0 or array.shape[-1] != length:
        raise ShapeError(f"{name} has shape {array.shape}; wanted (..., {length})")
    return checked_entries(name, array)


def checked_vector(name: str, value: ArrayLike) -> Floats:
    """Return one vector (3,), checked like `checked_array`."""
    array = checked_array(name, value, 3)
    if array.ndim != 1:
        raise ShapeError(f"{name} has shape {array.shape}; wanted (3,)")
    return array


MAX_COUNT = 10**9
"""Largest number of samples, steps or anything else that one call is asked for: more is a mistake, which
would fill the memory or take days."""

MAX_INDEX = 2**53
"""Largest number of a rollout or a step: up to it a float holds all whole numbers."""


def whole_number(name: str, value: object, least: int, most: float = MAX_COUNT) -> int:
    """Return a whole number from `least` to `most`; raise ArgumentError for anything else."""
    if not is_whole(value) or not least <= value <= most:
        # Nobody asks for so many; only who did is told that there is an end.
        too_many = most < MAX_COUNT or (isinstance(value, int) and value > most)
        end = f" and at most {most}" if too_many else ""
        raise ArgumentError(f"{name} is {shown(value)}; wanted a whole number, at least {least}{end}")
    return int(value)


def is_whole(value: object) -> TypeGuard[int]:
    """Check whether a value is one whole number, of Python or NumPy; no truth value, and no span of time,
    which NumPy derives from its integers."""
    return isinstance(value, int | np.integer) and not isinstance(value, bool | np.timedelta64)


def checked_seed(name: str, value: object) -> int:
    """Return a seed of random numbers, a whole number of any size; raise ArgumentError for anything else."""
    return whole_number(name, value, 0, np.inf)


def is_real(value: object) -> TypeGuard[float]:
    """Check whether a value is one real number, of Python or NumPy, that a float can hold; no truth value."""
    if not is_whole(value) and not isinstance(value, float | np.floating):
        return False
    return not isinstance(value, int) or abs(value) <= _MAX_FLOAT


def checked_bool(name: str, value: object) -> bool:
    """Return True or False, of Python or NumPy; raise DTypeError for anything else."""
    if isinstance(value, bool | np.bool_):
        return bool(value)
    raise DTypeError(f"{name} is {shown(value)} ({type(value).__name__}); wanted True or False")


def positive_seconds(name: str, seconds: object) -> float:
    """Return a positive, finite number of seconds as a float, or raise ArgumentError."""
    if is_real(seconds) and 0.0 < float(seconds) < np.inf:
        return float(seconds)
    raise ArgumentError(f"{name} is {shown(seconds)}; wanted a positive number of seconds")


_NO_ARRAY = (TypeError, RuntimeError, AttributeError, LookupError, ArithmeticError)
"""Errors of classes with ``__array__`` that have no numbers, such as a tensor of PyTorch with a gradient."""


def array_of(name: str, value: object) -> Array:
    """Return an array of any dtype. Raises ShapeError if it is ragged, DTypeError if it has a mask, which
    would be lost, or if its class has no numbers."""
    if type(value) is not np.ndarray:
        refuse_mask(name, value)
    try:
        return np.asarray(value)
    except ValueError as error:
        raise ShapeError(f"{name} is ragged, {shown(value)}; wanted rows of one length: {error}") from None
    except _NO_ARRAY as error:
        raise DTypeError(
            f"{name} is {shown(value)}, of type {type(value).__name__}, which is no array: {error}; wanted "
            "real numbers (float64)"
        ) from error


def real_array(name: str, value: ArrayLike) -> Floats:
    """Return `value` as a float64 array of any shape.

    Raises ShapeError if it is ragged, DTypeError if it is not real or has a mask, which would be lost.
    """
    array = array_of(name, value)
    if array.dtype.kind not in "fiu":
        origin = "" if array is value else f" (it is {shown(value)}, of type {type(value).__name__})"
        if isinstance(value, Mapping):
            origin += "; set entries by joint: q[model.position_index(name)], v[model.coordinate_index(name)]"
        raise DTypeError(f"{name} has dtype {array.dtype}; wanted real numbers (float64){origin}")
    return np.asarray(array, dtype=np.float64)


def checked_entries(name: str, array: Floats) -> Floats:
    """Return `array`; raise an error naming an entry that is not finite or not below `MAX_MAGNITUDE`."""
    if not np.isfinite(array).all():
        where = tuple(int(i) for i in np.argwhere(~np.isfinite(array))[0])
        raise NotFiniteError(
            f"{name}[{', '.join(map(str, where))}] is {array[where]}; wanted a finite number"
        )
    if np.max(np.abs(array), initial=0.0) >= MAX_MAGNITUDE:
        where = tuple(int(i) for i in np.argwhere(np.abs(array) >= MAX_MAGNITUDE)[0])
        raise ArgumentError(
            f"{name}[{', '.join(map(str, where))}] is {array[where]}; wanted less than {MAX_MAGNITUDE:g} "
            "in magnitude, since products of larger numbers overflow"
        )
    return array


def checked_gain(name: str, gain: ArrayLike, length: int, *, per: str = "one for each coordinate") -> Floats:
    """Return `gain` as an array (length,) of finite numbers that are not negative, or a GainError.

    The array is a read-only copy.
    """
    try:
        array = real_array(name, gain)
    except ArgumentError as error:
        raise GainError(str(error)) from None
    if array.shape not in ((), (length,)):
        several = f", or {length}, {per}" if length > 1 else ""
        raise GainError(f"{name} has shape {array.shape}; wanted one number{several}")
    if not np.isfinite(array).all():
        raise GainError(f"{name} is not finite")
    if (array < 0.0).any():
        raise GainError(f"{name} is negative ({float(array.min()):g}); wanted 0 or more")
    return read_only(np.broadcast_to(array, (length,)))


def read_only(array: Floats) -> Floats:
    """Return a read-only copy of `array`."""
    copy = np.array(array, dtype=np.float64)
    copy.setflags(write=False)
    return copy


def checked_generator(rng: np.random.Generator | int | None) -> np.random.Generator:
    """Return the generator, or that of a seed. Raises ArgumentError for anything else."""
    # NumPy's own reading of a list that holds itself ends the process.
    numbers = is_listed(rng) and isinstance(rng, list | tuple | np.ndarray) and all(map(is_whole, rng))
    sources = np.random.Generator | np.random.BitGenerator | np.random.SeedSequence
    if rng is None or is_whole(rng) or numbers or isinstance(rng, sources):
        with suppress(ValueError):
            return np.random.default_rng(rng)
    raise ArgumentError(f"rng is {shown(rng)}; wanted a NumPy generator, or a seed: 0 or more")


def checked_size(size: tuple[int, ...] | int) -> tuple[int, ...]:
    """Return the shape of an array of samples. Raises ArgumentError for anything else."""
    shape = tuple(size) if isinstance(size, tuple | list) else (size,)
    if not all(is_whole(n) and n >= 0 for n in shape):
        raise ArgumentError(f"size is {shown(size)}; wanted a number of samples, or a tuple of them")
    if math.prod(shape) > MAX_COUNT:
        raise ArgumentError(f"size is {shown(size)}; wanted at most {MAX_COUNT:g} samples")
    return tuple(int(n) for n in shape)


def checked_quaternion(name: str, quat_xyzw: Floats, part: str = "") -> Floats:
    """Return unit quaternions (..., 4); those whose norm deviates by more than rounding are normalised, in a
    copy.

    Raises ArgumentError for a norm that differs from 1 by more than 1e-6; `part` is the index of the
    quaternion on the last axis of `name`.
    """
    if quat_xyzw.ndim == 1 and abs(math.hypot(*quat_xyzw.tolist()) - 1.0) <= UNIT_NORM_TOLERANCE:
        return quat_xyzw
    norm = np.linalg.norm(quat_xyzw, axis=-1, keepdims=True)
    off = np.abs(norm - 1.0)
    if np.any(off > 1e-6):
        at = np.unravel_index(np.argmax(off), off.shape)[:-1]
        where = ", ".join([*map(str, map(int, at)), *([part] if part else [])])
        raise ArgumentError(
            f"{name}{f'[{where}]' if where else ''} is a quaternion (x, y, z, w) of length "
            f"{float(norm[at][0]):.9g}; wanted length 1"
        )
    rough = off > UNIT_NORM_TOLERANCE
    return np.where(rough, quat_xyzw / norm, quat_xyzw) if np.any(rough) else quat_xyzw


def checked_gravity(gravity: ArrayLike) -> tuple[float, float, float]:
    """Return gravity as three finite floats [m/s^2]."""
    x, y, z = checked_vector("gravity", gravity).tolist()
    return (x, y, z)


MAX_AXES = 64
"""Largest number of axes of an array, as of NumPy."""


def refuse_mask(name: str, value: object, axes: int = 0) -> None:
    """Raise DTypeError for a masked array, or a list or tuple with one inside; ShapeError for lists nested
    deeper than an array can be, such as one that holds itself."""
    if isinstance(value, list | tuple):
        if axes == MAX_AXES:
            kind = type(value).__name__
            raise ShapeError(f"{name} is a {kind} nested more than {MAX_AXES} times; wanted an array")
        for each in value:
            if not isinstance(each, float | int):
                refuse_mask(name, each, axes + 1)
    elif isinstance(value, np.ma.MaskedArray):
        raise DTypeError(
            f"{name} is a masked array; wanted an array without a mask, such as its method filled returns"
        )


# Checks of the sizes of shapes, with the name of the size in each error.


def positive_number(name: str, value: object) -> float:
    """Return a positive number below `MAX_MAGNITUDE`; raise ArgumentError for anything else."""
    if is_real(value) and 0.0 < float(value) < MAX_MAGNITUDE:
        return float(value)
    raise ArgumentError(f"{name} is {shown(value)}; wanted a positive number below {MAX_MAGNITUDE:g}")


def finite_numbers(name: str, values: object, count: int) -> tuple[float, ...]:
    """Return `count` finite numbers below `MAX_MAGNITUDE`; raise ArgumentError for anything else."""
    array = checked_array(name, values, count)  # type: ignore[arg-type]  # anything is checked
    if array.ndim != 1:
        raise ShapeError(f"{name} has shape {array.shape}; wanted ({count},)")
    return tuple(array.tolist())


def finite_vector(name: str, values: object) -> tuple[float, float, float]:
    """Return three finite numbers below `MAX_MAGNITUDE`; raise ArgumentError for anything else."""
    x, y, z = finite_numbers(name, values, 3)
    return (x, y, z)


def positive_numbers(name: str, values: object, count: int) -> tuple[float, ...]:
    """Return `count` positive numbers below `MAX_MAGNITUDE`; raise ArgumentError for anything else."""
    numbers = finite_numbers(name, values, count)
    for index, number in enumerate(numbers):
        if number <= 0.0:
            raise ArgumentError(f"{name}[{index}] is {number}; wanted a positive number")
    return numbers


def colour(name: str, values: object) -> tuple[float, float, float, float]:
    """Return red, green, blue and opacity, each from 0 to 1; raise ArgumentError for anything else."""
    red, green, blue, opacity = numbers = finite_numbers(name, values, 4)
    for index, number in enumerate(numbers):
        if not 0.0 <= number <= 1.0:
            raise ArgumentError(f"{name}[{index}] is {number}; wanted a number from 0 to 1")
    return (red, green, blue, opacity)
