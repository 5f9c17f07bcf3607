"""Arithmetic of configurations (integrate, difference, sample, clip), and checks of arrays and numbers."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal, TypeGuard

import numpy as np
from numpy.typing import ArrayLike

from dynx.errors import ArgumentError, DTypeError, NotFiniteError, ShapeError, shown
from dynx.model.elements import Pose, Vector
from dynx.model.masks import refuse_mask
from dynx.spatial.scalar import Floats
from dynx.spatial.se3 import se3_exp, se3_log
from dynx.spatial.so3 import quat_product, rotate, rotate_back, rotation_from_quat

if TYPE_CHECKING:
    from dynx.model.model import Model


_MAX_FLOAT = float(np.finfo(np.float64).max)

MAX_MAGNITUDE = 1e60
"""Bound on the magnitude of the entries of an array, and of the numbers of a description.

A moment is a product of two lengths, two speeds and a mass. The bound prevents its overflow, with which an
engine would silently return infinity or NaN.
"""

DIVERGENCE_SPEED = 1e8
"""Norm of the velocity [rad/s or m/s] above which a simulation or a world counts as diverged."""


def checked_array(name: str, value: ArrayLike, length: int) -> Floats:
    """Return `value` as float64 (..., length) with entries below `MAX_MAGNITUDE`.

    Raises DTypeError, ShapeError, NotFiniteError or ArgumentError, naming the argument `name`.
    """
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


UNIT_NORM_TOLERANCE = 4 * float(np.finfo(np.float64).eps)
"""Largest deviation from 1 of the norm of a quaternion that counts as rounding."""


def whole_number(name: str, value: object, least: int, most: float = np.inf) -> int:
    """Return a whole number from `least` to `most`; raise ArgumentError for anything else."""
    if isinstance(value, bool) or not isinstance(value, int | np.integer) or not least <= value <= most:
        end = "" if most == np.inf else f" and at most {most}"
        raise ArgumentError(f"{name} is {shown(value)}; wanted a whole number, at least {least}{end}")
    return int(value)


def is_real(value: object) -> TypeGuard[float]:
    """Check whether a value is one real number, of Python or NumPy, that a float can hold; no truth value."""
    if isinstance(value, bool) or not isinstance(value, int | float | np.integer | np.floating):
        return False
    return not isinstance(value, int) or abs(value) <= _MAX_FLOAT


def positive_seconds(name: str, seconds: object) -> float:
    """Return a positive, finite number of seconds as a float, or raise ArgumentError."""
    if is_real(seconds) and 0.0 < float(seconds) < np.inf:
        return float(seconds)
    raise ArgumentError(f"{name} is {shown(seconds)}; wanted a positive number of seconds")


def real_array(name: str, value: ArrayLike) -> Floats:
    """Return `value` as a float64 array of any shape.

    Raises ShapeError if it is ragged, DTypeError if it is not real or has a mask, which would be lost.
    """
    if type(value) is not np.ndarray:
        refuse_mask(name, value)
    try:
        array = np.asarray(value)
    except ValueError as error:
        raise ShapeError(f"{name} is ragged: {error}") from None
    if array.dtype.kind not in "fiu":
        raise DTypeError(f"{name} has dtype {array.dtype}; wanted real numbers (float64)")
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


def checked_generator(rng: np.random.Generator | int | None) -> np.random.Generator:
    """Return the generator, or that of a seed. Raises ArgumentError for anything else."""
    try:
        return np.random.default_rng(rng)
    except (TypeError, ValueError):
        raise ArgumentError(f"rng is {shown(rng)}; wanted a NumPy generator, or a seed: 0 or more") from None


def checked_size(size: tuple[int, ...] | int) -> tuple[int, ...]:
    """Return the shape of an array of samples. Raises ArgumentError for anything else."""
    shape = tuple(size) if isinstance(size, tuple | list) else (size,)
    if not all(isinstance(n, int | np.integer) and not isinstance(n, bool) and n >= 0 for n in shape):
        raise ArgumentError(f"size is {shown(size)}; wanted a number of samples, or a tuple of them")
    return tuple(int(n) for n in shape)


def checked_q(model: Model, q: ArrayLike, name: str = "q") -> Floats:
    """Return a configuration (..., nq), whose quaternion, if any, must have unit norm to 1e-6.

    If its norm deviates by more than rounding, the quaternion is normalised in a copy, since engines treat
    such quaternions differently.
    """
    array = checked_array(name, q, model.nq)
    if not model.floating:
        return array
    quat = array[..., 3:7]
    unit = checked_quaternion(name, quat, "3:7")
    return array if unit is quat else _join(array[..., :3], unit, array[..., 7:])


def checked_quaternion(name: str, quat_xyzw: Floats, part: str = "") -> Floats:
    """Return unit quaternions (..., 4), normalised in a copy if a norm deviates by more than rounding.

    Raises ArgumentError for a norm that differs from 1 by more than 1e-6; `part` is the index of the
    quaternion on the last axis of `name`.
    """
    norm = np.linalg.norm(quat_xyzw, axis=-1, keepdims=True)
    off = np.abs(norm - 1.0)
    if np.any(off > 1e-6):
        at = np.unravel_index(np.argmax(off), off.shape)[:-1]
        where = ", ".join([*map(str, map(int, at)), *([part] if part else [])])
        raise ArgumentError(
            f"{name}{f'[{where}]' if where else ''} is a quaternion (x, y, z, w) of length "
            f"{float(norm[at][0]):.9g}; wanted length 1"
        )
    return quat_xyzw / norm if np.any(off > UNIT_NORM_TOLERANCE) else quat_xyzw


def checked_base(base: str) -> Literal["fixed", "floating"]:
    """Return `base`; raise ArgumentError unless it is ``"fixed"`` or ``"floating"``."""
    if base == "fixed":
        return "fixed"
    if base == "floating":
        return "floating"
    raise ArgumentError(f"base is {shown(base)}; wanted 'fixed' or 'floating'")


def checked_pose(name: str, pose: Pose | ArrayLike) -> Pose:
    """Return a pose, given as a `Pose` or a matrix (4, 4), with finite floats below `MAX_MAGNITUDE`."""
    if not isinstance(pose, Pose):
        pose = Pose.from_matrix(pose, name)
    xyz, rpy = (checked_vector(f"{part} of {name}", getattr(pose, part)).tolist() for part in ("xyz", "rpy"))
    return Pose(tuple(xyz), tuple(rpy))


def checked_gravity(gravity: ArrayLike) -> Vector:
    """Return gravity as three finite floats [m/s^2]."""
    x, y, z = checked_vector("gravity", gravity).tolist()
    return (x, y, z)


def position_limits(model: Model) -> tuple[Floats, Floats]:
    """Return (lower, upper), each (nq,): each joint's own limits, narrowed by those of joints that mimic it.

    If the lower limit in the file exceeds the upper one, the two are exchanged (the reader adds a note). If
    the limits of a follower leave no range for its driver, the driver's own limits apply.
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
    # Adding 0.0 turns -0.0 into 0.0: NumPy's generator rejects the range from 0.0 to -0.0.
    return lower + 0.0, upper + 0.0


def neutral(model: Model) -> Floats:
    """Return the configuration (nq,) with every joint at 0 and the base frame at the world frame."""
    q = np.zeros(model.nq)
    if model.floating:
        q[6] = 1.0
    return q


def random(
    model: Model, rng: np.random.Generator | int | None = None, size: tuple[int, ...] | int = ()
) -> Floats:
    """Sample configurations (*size, nq) uniformly within the limits.

    An angle without limits is in (-pi, pi), a length in (-1, 1). A floating base gets a position in the cube
    [-1, 1]^3 and a uniformly distributed orientation (Shoemake 1992). `rng` is a NumPy generator or a seed.
    """
    rng = checked_generator(rng)
    shape = checked_size(size)
    q = np.empty((*shape, model.nq))
    base = 7 if model.floating else 0
    for k, joint in enumerate(model.coordinate_joints, start=base):
        default_range = 1.0 if joint.type == "prismatic" else np.pi
        low, high = sampling_range(float(model.lower[k]), float(model.upper[k]), default_range)
        q[..., k] = rng.uniform(low, high, shape)
    if model.floating:
        q[..., :3] = rng.uniform(-1.0, 1.0, (*shape, 3))
        quat = rng.standard_normal((*shape, 4))
        q[..., 3:7] = quat / np.linalg.norm(quat, axis=-1, keepdims=True)
    return q


def integrate(model: Model, q: ArrayLike, v: ArrayLike) -> Floats:
    """Return the configuration reached from `q` (..., nq) with velocity `v` (..., nv) in unit time.

    A floating base moves along the exponential of its body twist.
    """
    q, v = checked_q(model, q), checked_array("v", v, model.nv)
    if not model.floating:
        return np.asarray(q + v)
    position, quat = se3_exp(v[..., :3], v[..., 3:6])
    position = q[..., :3] + rotate(rotation_from_quat(q[..., 3:7]), position)
    quat = quat_product(q[..., 3:7], quat)
    quat = quat / np.linalg.norm(quat, axis=-1, keepdims=True)
    joints = q[..., 7:] + v[..., 6:]
    return _join(position, quat, joints)


def difference(model: Model, q0: ArrayLike, q1: ArrayLike) -> Floats:
    """Return the velocity v (..., nv) with integrate(q0, v) = q1, whose rotation angle is at most pi."""
    q0, q1 = checked_q(model, q0, "q0"), checked_q(model, q1, "q1")
    if not model.floating:
        return np.asarray(q1 - q0)
    conjugate = q0[..., 3:7] * np.array([-1.0, -1.0, -1.0, 1.0])
    quat = quat_product(conjugate, q1[..., 3:7])
    position = rotate_back(rotation_from_quat(q0[..., 3:7]), q1[..., :3] - q0[..., :3])
    linear, angular = se3_log(position, quat)
    return _join(linear, angular, q1[..., 7:] - q0[..., 7:])


def clip(model: Model, q: ArrayLike) -> Floats:
    """Return `q` (..., nq) clipped to the position limits, with a normalised quaternion."""
    array = np.clip(checked_array("q", q, model.nq), model.lower, model.upper)
    if model.floating:
        norm = np.linalg.norm(array[..., 3:7], axis=-1, keepdims=True)
        if np.any(norm == 0.0):
            raise ArgumentError("q[3:7] is the zero quaternion; wanted an attitude")
        array[..., 3:7] /= norm
    return array


def sampling_range(low: float, high: float, default_range: float) -> tuple[float, float]:
    """Return the range to sample: the limits; with one limit, twice `default_range` from it; with none, from
    minus to plus `default_range`."""
    bounded_below, bounded_above = low > -MAX_MAGNITUDE, high < MAX_MAGNITUDE
    if bounded_below and bounded_above:
        return low, high
    if not (bounded_below or bounded_above):
        return -default_range, default_range
    return (low, low + 2.0 * default_range) if bounded_below else (high - 2.0 * default_range, high)


def _join(*parts: Floats) -> Floats:
    shape = np.broadcast_shapes(*(part.shape[:-1] for part in parts))
    return np.concatenate([np.broadcast_to(part, (*shape, part.shape[-1])) for part in parts], axis=-1)
