"""Functions for one sample of a quantity, made once: one check of all arguments, then the engine's hook.

They write out the arguments, because a call with ``*arguments`` takes longer than all else that they do.
"""

from __future__ import annotations

from collections.abc import Callable
from math import hypot
from typing import Any

import numpy as np
from numpy import ndarray

from dynx.backends.arguments import MAX_LISTED
from dynx.model import Model
from dynx.model.configuration import MAX_MAGNITUDE, UNIT_NORM_TOLERANCE

SampleCheck = Callable[..., bool]
"""Function of q and what follows that checks whether they are float64 arrays of one valid sample."""

StraightCall = Callable[[object, tuple[Any, ...]], Any]
"""Function of a backend and the arguments that returns the result of a hook, or None where the arguments are
not one valid sample."""

_FLOAT64 = np.dtype(np.float64)

MAX_LISTED_OF_ALL = 80
"""Size of all arguments together up to which the same holds for their norm."""

_MAX_SQUARE = MAX_MAGNITUDE**2


def sample_check(model: Model, arguments: int, *, validate: bool) -> SampleCheck:
    """Return the check of q and `arguments` - 1 vectors (nv,); without `validate`, that each has one axis.

    The norm of all entries is below a bound only if every entry is, and no entry is NaN. One C loop over
    lists computes it several times faster than NumPy at this size. If the norm is too large, the methods of
    `Arguments` check every entry.
    """
    if not validate:
        return _have_one_axis
    entries_of_all = model.nq + (arguments - 1) * model.nv
    # An empty array may have two axes and no entry that shows it.
    if not model.nv or model.nq > MAX_LISTED or entries_of_all > MAX_LISTED_OF_ALL:
        return _check_of_long_arrays(model)
    nq, nv, fixed = model.nq, model.nv, not model.floating

    # The entries of an array with two axes are lists, and those of one with none are no list: `hypot` and the
    # stars raise TypeError for them. Comparing lengths takes half of the time of comparing shapes.

    def one(q: Any) -> bool:
        if type(q) is ndarray and q.dtype is _FLOAT64:
            try:
                entries = q.tolist()
                return len(q) == nq and hypot(*entries) < MAX_MAGNITUDE and (fixed or _is_unit(entries))
            except TypeError:
                pass
        return False

    def two(q: Any, v: Any) -> bool:
        if type(q) is type(v) is ndarray and q.dtype is v.dtype is _FLOAT64:
            try:
                if len(q) == nq and len(v) == nv:
                    entries = q.tolist()
                    size = hypot(*entries, *v.tolist())
                    return size < MAX_MAGNITUDE and (fixed or _is_unit(entries))
            except TypeError:
                pass
        return False

    def three(q: Any, v: Any, a: Any) -> bool:
        if type(q) is type(v) is type(a) is ndarray and q.dtype is v.dtype is a.dtype is _FLOAT64:
            try:
                if len(q) == nq and len(v) == nv == len(a):
                    entries = q.tolist()
                    size = hypot(*entries, *v.tolist(), *a.tolist())
                    return size < MAX_MAGNITUDE and (fixed or _is_unit(entries))
            except TypeError:
                pass
        return False

    checks: tuple[SampleCheck, ...] = one, two, three
    return checks[arguments - 1]


def _is_unit(entries: list[float]) -> bool:
    """Check the quaternion of a floating base."""
    x, y, z, w = entries[3:7]
    return abs(x * x + y * y + z * z + w * w - 1.0) <= UNIT_NORM_TOLERANCE


def _check_of_long_arrays(model: Model) -> SampleCheck:
    q_shape, v_shape, fixed = (model.nq,), (model.nv,), not model.floating

    def are_sample(*arguments: Any) -> bool:
        shape = q_shape
        for array in arguments:
            if type(array) is not ndarray or array.dtype is not _FLOAT64 or array.shape != shape:
                return False
            if not np.vdot(array, array) < _MAX_SQUARE:
                return False
            shape = v_shape
        return fixed or _is_unit(arguments[0][:7].tolist())

    return are_sample


def _have_one_axis(q: Any, v: Any = None, a: Any = None) -> bool:
    return q.ndim == 1 and (v is None or v.ndim == 1) and (a is None or a.ndim == 1)


def straight_call(
    hook: Callable[..., Any], arguments: int, details: tuple[Any, ...], are_sample: SampleCheck
) -> StraightCall:
    """Return the function that checks `arguments` arrays and calls a hook with them and `details`: none, a
    frame, or a frame and a reference."""
    if arguments == 1:
        return _call_of_q(hook, details, are_sample)
    frame, reference = details or (None, None)

    def of_two(backend: object, arguments: tuple[Any, ...]) -> Any:
        q, v = arguments
        return hook(backend, q, v) if are_sample(q, v) else None

    def of_two_in_frame(backend: object, arguments: tuple[Any, ...]) -> Any:
        q, v = arguments
        return hook(backend, q, v, frame, reference) if are_sample(q, v) else None

    def of_three(backend: object, arguments: tuple[Any, ...]) -> Any:
        q, v, a = arguments
        return hook(backend, q, v, a) if are_sample(q, v, a) else None

    def of_three_in_frame(backend: object, arguments: tuple[Any, ...]) -> Any:
        q, v, a = arguments
        return hook(backend, q, v, a, frame, reference) if are_sample(q, v, a) else None

    if arguments == 2:
        return of_two_in_frame if details else of_two
    return of_three_in_frame if details else of_three


def _call_of_q(hook: Callable[..., Any], details: tuple[Any, ...], is_sample: SampleCheck) -> StraightCall:
    frame, reference = (*details, None, None)[:2]

    def of_one(backend: object, arguments: tuple[Any, ...]) -> Any:
        (q,) = arguments
        return hook(backend, q) if is_sample(q) else None

    def at_frame(backend: object, arguments: tuple[Any, ...]) -> Any:
        (q,) = arguments
        return hook(backend, q, frame) if is_sample(q) else None

    def in_frame(backend: object, arguments: tuple[Any, ...]) -> Any:
        (q,) = arguments
        return hook(backend, q, frame, reference) if is_sample(q) else None

    return (of_one, at_frame, in_frame)[len(details)]
