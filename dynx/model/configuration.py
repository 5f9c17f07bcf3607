"""Arithmetic of configurations, so that nobody adds quaternions by hand."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import ArrayLike

from dynx.errors import ArgumentError, DTypeError, NotFiniteError, ShapeError, shown
from dynx.model.elements import Vector
from dynx.spatial.scalar import Floats
from dynx.spatial.se3 import se3_exp, se3_log
from dynx.spatial.so3 import quat_product, rotate, rotate_back, rotation_from_quat

if TYPE_CHECKING:
    from dynx.model.model import Model


MAX_MAGNITUDE = 1e70
"""Bound on the entries of an array: a moment is a product of two lengths, two speeds and a mass, and it
must not overflow, or an engine would answer infinity or NaN and say nothing."""


def checked_array(name: str, value: ArrayLike, length: int) -> Floats:
    """`value` as float64 (..., length) of numbers below `MAX_MAGNITUDE`, or an error that says why not."""
    array = real_array(name, value)
    if array.ndim == 0 or array.shape[-1] != length:
        raise ShapeError(f"{name} has shape {array.shape}; wanted (..., {length})")
    return checked_entries(name, array)


def checked_vector(name: str, value: ArrayLike) -> Floats:
    """One vector (3,), read as `checked_array` does, or an error that says why not."""
    array = checked_array(name, value, 3)
    if array.ndim != 1:
        raise ShapeError(f"{name} has shape {array.shape}; wanted (3,)")
    return array


UNIT = 4 * float(np.finfo(np.float64).eps)
"""How far from 1 rounding leaves the length of a unit quaternion."""


def real_array(name: str, value: ArrayLike) -> Floats:
    """`value` as a float64 array of any shape; ShapeError if it is ragged, DTypeError if not real."""
    try:
        array = np.asarray(value)
    except ValueError as error:
        raise ShapeError(f"{name} is ragged: {error}") from None
    if array.dtype.kind not in "fiu":
        raise DTypeError(f"{name} has dtype {array.dtype}; wanted real numbers (float64)")
    return np.asarray(array, dtype=np.float64)


def checked_entries(name: str, array: Floats) -> Floats:
    """`array` itself, or an error that names an entry which is not finite or not below `MAX_MAGNITUDE`."""
    if not np.isfinite(array).all():
        where = tuple(int(i) for i in np.argwhere(~np.isfinite(array))[0])
        raise NotFiniteError(
            f"{name}[{', '.join(map(str, where))}] is {array[where]}; wanted a finite number"
        )
    if np.max(np.abs(array), initial=0.0) >= MAX_MAGNITUDE:
        where = tuple(int(i) for i in np.argwhere(np.abs(array) >= MAX_MAGNITUDE)[0])
        raise ArgumentError(
            f"{name}[{', '.join(map(str, where))}] is {array[where]}; wanted less than {MAX_MAGNITUDE:g} "
            "in size, for products of such numbers overflow"
        )
    return array


def checked_q(model: Model, q: ArrayLike, name: str = "q") -> Floats:
    """A configuration (..., nq) whose quaternion, if it has one, is of unit length to 1e-6.

    A quaternion that is off by more than rounding is scaled to unit length, in a copy: engines would
    each make something else of it.
    """
    array = checked_array(name, q, model.nq)
    if not model.floating:
        return array
    norm = np.linalg.norm(array[..., 3:7], axis=-1, keepdims=True)
    off = np.abs(norm - 1.0)
    if np.any(off > 1e-6):
        at = np.unravel_index(np.argmax(off), off.shape)[:-1]
        where = ", ".join([*map(str, map(int, at)), "3:7"])
        raise ArgumentError(
            f"{name}[{where}] is a quaternion (x, y, z, w) of length {float(norm[at][0]):.9g}; "
            "wanted length 1"
        )
    if np.any(off > UNIT):
        array = np.array(array)
        array[..., 3:7] /= norm
    return array


def checked_base(base: str) -> Literal["fixed", "floating"]:
    """`base` itself, or an error for a word that is no kind of base."""
    if base == "fixed":
        return "fixed"
    if base == "floating":
        return "floating"
    raise ArgumentError(f"base is {shown(base)}; wanted 'fixed' or 'floating'")


def checked_gravity(gravity: ArrayLike) -> Vector:
    """Gravity as three finite floats [m/s^2]."""
    x, y, z = checked_vector("gravity", gravity).tolist()
    return (x, y, z)


def position_limits(model: Model) -> tuple[Floats, Floats]:
    """(lower, upper), each (nq,): the joint's own limits, narrowed by those of joints that mimic it.

    A file whose lower limit exceeds its upper one is read with the two exchanged (the reader notes
    it). Where a follower leaves its driver no room, the driver's own limits stand.
    """
    base = 7 if model.floating else 0
    lower, upper = np.full(model.nq, -np.inf), np.full(model.nq, np.inf)
    index = {name: base + k for k, name in enumerate(model.joint_names)}
    for joint in model.coordinate_joints:
        k = index[joint.name]
        lower[k] = min(joint.limits.lower, joint.limits.upper)
        upper[k] = max(joint.limits.lower, joint.limits.upper)
    for joint in model.joints:
        if joint.mimic is None or joint.mimic.multiplier == 0.0:
            continue
        k = index[joint.mimic.joint]
        ends = sorted(
            (limit - joint.mimic.offset) / joint.mimic.multiplier
            for limit in (joint.limits.lower, joint.limits.upper)
        )
        low, high = max(lower[k], ends[0]), min(upper[k], ends[1])
        if low <= high:
            lower[k], upper[k] = low, high
    # Without -0.0: NumPy's generator refuses the range from 0.0 to -0.0.
    return lower + 0.0, upper + 0.0


def neutral(model: Model) -> Floats:
    """Zeros, and the identity quaternion for a floating base."""
    q = np.zeros(model.nq)
    if model.floating:
        q[6] = 1.0
    return q


def random(
    model: Model, rng: np.random.Generator | int | None = None, size: tuple[int, ...] | int = ()
) -> Floats:
    """Uniform within the limits; (-pi, pi) for an angle without limits, (-1, 1) for a length.

    A floating base gets a position in the unit cube around the origin and a uniform attitude
    (Shoemake 1992). `rng` is a NumPy generator or a seed.
    """
    rng = np.random.default_rng(rng)
    shape = (size,) if isinstance(size, int) else tuple(size)
    q = np.empty((*shape, model.nq))
    base = 7 if model.floating else 0
    for k, joint in enumerate(model.coordinate_joints, start=base):
        reach = 1.0 if joint.type == "prismatic" else np.pi
        low, high = _bounded(float(model.lower[k]), float(model.upper[k]), reach)
        q[..., k] = rng.uniform(low, high, shape)
    if model.floating:
        q[..., :3] = rng.uniform(-1.0, 1.0, (*shape, 3))
        quat = rng.standard_normal((*shape, 4))
        q[..., 3:7] = quat / np.linalg.norm(quat, axis=-1, keepdims=True)
    return q


def integrate(model: Model, q: ArrayLike, v: ArrayLike) -> Floats:
    """q plus v for unit time: the base moves along the exponential of its body twist."""
    q, v = checked_q(model, q), checked_array("v", v, model.nv)
    if not model.floating:
        return np.asarray(q + v)
    position, quat = se3_exp(v[..., :3], v[..., 3:6])
    moved = q[..., :3] + rotate(rotation_from_quat(q[..., 3:7]), position)
    turned = quat_product(q[..., 3:7], quat)
    turned = turned / np.linalg.norm(turned, axis=-1, keepdims=True)
    joints = q[..., 7:] + v[..., 6:]
    return _join(moved, turned, joints)


def difference(model: Model, q0: ArrayLike, q1: ArrayLike) -> Floats:
    """The v with integrate(q0, v) = q1; the rotation is the shorter way round."""
    q0, q1 = checked_q(model, q0, "q0"), checked_q(model, q1, "q1")
    if not model.floating:
        return np.asarray(q1 - q0)
    conjugate = q0[..., 3:7] * np.array([-1.0, -1.0, -1.0, 1.0])
    turned = quat_product(conjugate, q1[..., 3:7])
    moved = rotate_back(rotation_from_quat(q0[..., 3:7]), q1[..., :3] - q0[..., :3])
    linear, angular = se3_log(moved, turned)
    return _join(linear, angular, q1[..., 7:] - q0[..., 7:])


def clip(model: Model, q: ArrayLike) -> Floats:
    """q within the position limits; the quaternion is scaled to unit length."""
    array = np.clip(checked_array("q", q, model.nq), model.lower, model.upper)
    if model.floating:
        norm = np.linalg.norm(array[..., 3:7], axis=-1, keepdims=True)
        if np.any(norm == 0.0):
            raise ArgumentError("q[3:7] is the zero quaternion; wanted an attitude")
        array[..., 3:7] /= norm
    return array


def _bounded(low: float, high: float, reach: float) -> tuple[float, float]:
    """Ends to draw between: those given, and within `reach` of 0 or of the one end where one is not."""
    bounded_below, bounded_above = low > -MAX_MAGNITUDE, high < MAX_MAGNITUDE
    if bounded_below and bounded_above:
        return low, high
    if not (bounded_below or bounded_above):
        return -reach, reach
    return (low, low + 2.0 * reach) if bounded_below else (high - 2.0 * reach, high)


def _join(*parts: Floats) -> Floats:
    shape = np.broadcast_shapes(*(part.shape[:-1] for part in parts))
    return np.concatenate([np.broadcast_to(part, (*shape, part.shape[-1])) for part in parts], axis=-1)
