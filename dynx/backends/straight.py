"""Functions for one sample of a quantity, made once: one check of all arguments, then the engine's hook.

Short arrays are checked where the hook is called, and arguments are written out, because a call of a function
or with ``*arguments`` takes longer than most of what they do.
"""

from __future__ import annotations

from collections.abc import Callable
from math import hypot, isfinite
from typing import Any, NamedTuple

import numpy as np
from numpy import ndarray

from dynx.backends.arguments import MAX_LISTED
from dynx.model import Model
from dynx.model.numbers import MAX_MAGNITUDE, UNIT_NORM_TOLERANCE

SampleHook = Callable[..., Any]
"""Function of a backend and the arrays of one sample that evaluates a hook."""

StraightCall = Callable[[object, tuple[Any, ...]], Any]
"""Function of a backend and the arguments that returns the result of a hook, or None where the arguments are
not one valid sample."""


class BindingCall(NamedTuple):
    """A function of an engine's binding that takes a model, the data of the calling thread and the arrays of
    one sample, and returns a new array."""

    function: Callable[..., Any]
    engine: Any
    workspace: Any
    """Object whose attribute `data` is that of the calling thread."""


_FLOAT64 = np.dtype(np.float64)

MAX_LISTED_OF_ALL = 80
"""Size of all arguments together up to which the same holds for their norm."""

_MAX_SQUARE = MAX_MAGNITUDE**2


def straight_call(
    model: Model,
    hook: SampleHook,
    arguments: int,
    *,
    validate: bool,
    solves: bool = False,
    binding: BindingCall | None = None,
) -> StraightCall:
    """Return the function that checks q and `arguments` - 1 vectors (nv,) and calls a hook with them; without
    `validate`, it checks that each has one axis. For a hook that `solves` for an acceleration it returns None
    where the sum of the result is not finite, too. `binding` is what the hook calls, if it does nothing else.

    The norm of all entries is below a bound only if every entry is, and no entry is NaN. One C loop over
    lists computes it several times faster than NumPy at this size. If the norm is too large, the methods of
    `Arguments` check every entry.
    """
    if not validate:
        return _call_of_arrays_with_one_axis(hook, arguments, solves)
    if model.ball_joints:
        return _call_of_none
    entries_of_all = model.nq + (arguments - 1) * model.nv
    # An empty array may have two axes and no entry that shows it.
    if not model.nv or model.nq > MAX_LISTED or entries_of_all > MAX_LISTED_OF_ALL:
        return _call_of_long_arrays(model, hook, solves)
    nq, nv, fixed = model.nq, model.nv, not model.floating
    if binding is not None and arguments == 3:
        return _binding_call_of_three(nq, nv, binding, fixed=fixed, solves=solves)

    # The entries of an array with two axes are lists, and those of one with none are no list: `hypot` and the
    # stars raise TypeError for them. Comparing lengths takes half of the time of comparing shapes.

    def of_one(backend: object, arguments: tuple[Any, ...]) -> Any:
        (q,) = arguments
        if type(q) is ndarray and q.dtype is _FLOAT64:
            try:
                entries = q.tolist()
                valid = len(q) == nq and hypot(*entries) < MAX_MAGNITUDE and (fixed or _is_unit(entries))
            except TypeError:
                return None
            if valid:
                return hook(backend, q)
        return None

    def of_two(backend: object, arguments: tuple[Any, ...]) -> Any:
        q, v = arguments
        if type(q) is type(v) is ndarray and q.dtype is v.dtype is _FLOAT64:
            try:
                if len(q) != nq or len(v) != nv:
                    return None
                entries = q.tolist()
                valid = hypot(*entries, *v.tolist()) < MAX_MAGNITUDE and (fixed or _is_unit(entries))
            except TypeError:
                return None
            if valid:
                return hook(backend, q, v)
        return None

    def of_three(backend: object, arguments: tuple[Any, ...]) -> Any:
        q, v, a = arguments
        if type(q) is type(v) is type(a) is ndarray and q.dtype is v.dtype is a.dtype is _FLOAT64:
            try:
                if len(q) != nq or len(v) != nv or len(a) != nv:
                    return None
                entries = q.tolist()
                size = hypot(*entries, *v.tolist(), *a.tolist())
                valid = size < MAX_MAGNITUDE and (fixed or _is_unit(entries))
            except TypeError:
                return None
            if valid:
                result = hook(backend, q, v, a)
                return result if not solves or isfinite(sum(result.tolist())) else None
        return None

    return (of_one, of_two, of_three)[arguments - 1]


def _call_of_none(backend: object, arguments: tuple[Any, ...]) -> None:
    """Leave the arguments to `Arguments`, which checks the quaternions of all ball joints."""


def _binding_call_of_three(
    nq: int, nv: int, binding: BindingCall, *, fixed: bool, solves: bool
) -> StraightCall:
    """Return the function `of_three` of `straight_call` without a call of the hook, which takes a tenth of
    the time between the binding and the caller."""
    function, engine, workspace = binding

    def of_three(backend: object, arguments: tuple[Any, ...]) -> Any:
        q, v, a = arguments
        if type(q) is type(v) is type(a) is ndarray and q.dtype is v.dtype is a.dtype is _FLOAT64:
            try:
                if len(q) != nq or len(v) != nv or len(a) != nv:
                    return None
                entries = q.tolist()
                size = hypot(*entries, *v.tolist(), *a.tolist())
                valid = size < MAX_MAGNITUDE and (fixed or _is_unit(entries))
            except TypeError:
                return None
            if valid:
                result = function(engine, workspace.data, q, v, a)
                return result if not solves or isfinite(sum(result.tolist())) else None
        return None

    return of_three


def _is_unit(entries: list[float]) -> bool:
    """Check the quaternion of a floating base."""
    x, y, z, w = entries[3:7]
    return abs(x * x + y * y + z * z + w * w - 1.0) <= UNIT_NORM_TOLERANCE


def _call_of_long_arrays(model: Model, hook: SampleHook, solves: bool) -> StraightCall:
    q_shape, v_shape, fixed = (model.nq,), (model.nv,), not model.floating

    def call(backend: object, arguments: tuple[Any, ...]) -> Any:
        shape = q_shape
        for array in arguments:
            if type(array) is not ndarray or array.dtype is not _FLOAT64 or array.shape != shape:
                return None
            if not np.vdot(array, array) < _MAX_SQUARE:
                return None
            shape = v_shape
        if not (fixed or _is_unit(arguments[0][:7].tolist())):
            return None
        result = hook(backend, *arguments)
        return result if not solves or isfinite(np.vdot(result, result)) else None

    return call


def _call_of_arrays_with_one_axis(hook: SampleHook, arguments: int, solves: bool) -> StraightCall:
    def of_one(backend: object, arguments: tuple[Any, ...]) -> Any:
        (q,) = arguments
        return hook(backend, q) if q.ndim == 1 else None

    def of_two(backend: object, arguments: tuple[Any, ...]) -> Any:
        q, v = arguments
        return hook(backend, q, v) if q.ndim == 1 and v.ndim == 1 else None

    def of_three(backend: object, arguments: tuple[Any, ...]) -> Any:
        q, v, a = arguments
        if not q.ndim == v.ndim == a.ndim == 1:
            return None
        result = hook(backend, q, v, a)
        return result if not solves or isfinite(sum(result.tolist())) else None

    return (of_one, of_two, of_three)[arguments - 1]
