"""`integrate` and `difference` of one configuration with a floating base, in machine code.

Both are the text of `dynx.spatial.branchless`, with the same results bit for bit as on floats. They are
compiled for robots of any size once a process has computed thousands of them on floats
(`dynx.model.configuration.ConfigurationStep`).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from dynx.model.configuration import Step
from dynx.model.numbers import MAX_MAGNITUDE, UNIT_NORM_TOLERANCE
from dynx.simd.program import Program
from dynx.simd.trace import trace
from dynx.simd.vector_function import vector_function
from dynx.spatial import branchless
from dynx.spatial.branchless import ARRAYS
from dynx.spatial.scalar import Array, less_equal

POSE, TWIST = 7, 6
"""Sizes of the position of a floating base, and of its velocity."""


def integration() -> Step:
    """Return the function of q (nq,), v (nv,) and the configuration (nq,) that it fills."""

    def moved(first: Array, second: Array) -> dict[str, Any]:
        result = branchless.moved(first.tolist(), second.tolist(), ARRAYS)
        return {"result": result, "defect": _magnitude(first, second) + _quaternion(first)}

    def added(first: Array, second: Array) -> dict[str, Any]:
        return {"result": first + second, "defect": _magnitude(first, second)}

    return vector_function(_program(moved, POSE, TWIST), _program(added, 1, 1))


def subtraction() -> Step:
    """Return the function of q0 (nq,), q1 (nq,) and the velocity (nv,) that it fills."""

    def twist(first: Array, second: Array) -> dict[str, Any]:
        result = branchless.twist_between(first.tolist(), second.tolist(), ARRAYS)
        invalid = _quaternion(first) + _quaternion(second)
        return {"result": result, "defect": _magnitude(first, second) + invalid}

    def subtracted(first: Array, second: Array) -> dict[str, Any]:
        return {"result": second - first, "defect": _magnitude(first, second)}

    return vector_function(_program(twist, POSE, POSE), _program(subtracted, 1, 1))


def _program(function: Callable[..., Any], first: int, second: int) -> Program:
    return trace(function, {"first": (first,), "second": (second,)}, simplify=None)


def _magnitude(*arrays: Array) -> Any:
    """Return a number whose sum over all entries is below 1 only if each is below `MAX_MAGNITUDE`."""
    return sum(x * x for array in arrays for x in array.tolist()) * MAX_MAGNITUDE**-2


def _quaternion(pose: Array) -> Any:
    """Return 0 if the quaternion of a pose certainly has unit norm to rounding, otherwise 1.

    The square deviates twice as much as the norm.
    """
    square = sum(x * x for x in pose.tolist()[3:])
    return 1.0 - less_equal(abs(square - 1.0), UNIT_NORM_TOLERANCE)
