"""Numbers, vectors, attitudes, poses and wrenches: half of them round, half of them arbitrary."""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np
from hypothesis import strategies as st

from dynx.errors import ArgumentError, DTypeError, NotFiniteError, shown
from dynx.model.elements import Pose, Vector
from dynx.spatial.scalar import Floats
from dynx.spatial.se3 import homogeneous
from dynx.spatial.so3 import rotation_from_quat

Strategy = st.SearchStrategy

Z_AXIS: Vector = (0.0, 0.0, 1.0)
CARDINAL_AXES: tuple[Vector, ...] = (
    Z_AXIS,
    (1.0, 0.0, 0.0),
    (0.0, 1.0, 0.0),
    (0.0, 0.0, -1.0),
    (-1.0, 0.0, 0.0),
    (0.0, -1.0, 0.0),
)
SMALL_STEPS = (0.0, 1e-12, -1e-9, 1e-6, -1e-3)
"""Distances from a singular attitude or posture, at which cancellation affects different digits."""


# These strategies are cached, because composite strategies use them repeatedly, and making and validating a
# strategy takes longer than drawing from it.


@lru_cache(maxsize=64)
def numbers(reach: float) -> Strategy[float]:
    """Draw a number in [-reach, reach]: quarters of the reach, or any with nine digits. Shrinks to 0."""
    rounded = st.integers(-4, 4).map(lambda n: n * reach / 4)
    anything = st.floats(-1.0, 1.0, allow_nan=False).map(lambda x: round(x, 9) * reach)
    return st.one_of(rounded, anything)


def angles() -> Strategy[float]:
    """Draw an angle [rad] in [-pi, pi]: multiples of pi/4, or any. Shrinks to 0."""
    return numbers(math.pi)


def vectors(reach: float = 1.0) -> Strategy[Vector]:
    """Draw three numbers in [-reach, reach]. Shrinks to the zero vector."""
    return _vectors(checked_reach("reach", reach))


@lru_cache(maxsize=64)
def _vectors(reach: float) -> Strategy[Vector]:
    number = numbers(reach)
    return st.one_of(st.just((0.0, 0.0, 0.0)), st.tuples(number, number, number))


@lru_cache(maxsize=1)
def unit_vectors() -> Strategy[Vector]:
    """Draw a direction: one of the six along the axes, or any other. Shrinks to z."""
    return st.one_of(
        st.sampled_from(CARDINAL_AXES),
        st.builds(_on_sphere, st.floats(0.0, 2.0, allow_nan=False), angles()),
    )


@lru_cache(maxsize=1)
def quaternions() -> Strategy[Floats]:
    """Draw a unit quaternion (x, y, z, w), either of the two of its attitude. Shrinks to the identity.

    Among them are half turns and attitudes next to the identity and next to half turns.
    """
    turn = st.one_of(
        angles(),
        st.builds(
            lambda base, step: base + step, st.sampled_from((0.0, math.pi)), st.sampled_from(SMALL_STEPS)
        ),
    )
    return st.builds(_quaternion, unit_vectors(), turn, st.sampled_from((1.0, -1.0)))


def poses(reach: float = 1.0) -> Strategy[Floats]:
    """Draw T_AB (4, 4), a position [m] within `reach` on each axis and any attitude.

    Shrinks to the identity.
    """
    return st.builds(_homogeneous, vectors(reach), quaternions())


@lru_cache(maxsize=8)
def origins(reach: float = 1.0) -> Strategy[Pose]:
    """Draw a URDF origin: translation [m] and roll-pitch-yaw [rad]. Shrinks to the identity."""
    rpy = st.one_of(st.just((0.0, 0.0, 0.0)), st.tuples(angles(), angles(), angles()))
    return st.builds(Pose, vectors(reach), rpy)


def wrenches(force: float = 10.0, moment: float = 5.0) -> Strategy[Floats]:
    """Draw the force [N] then moment [N m] (6,), each component within its bound. Shrinks to zero."""
    return _wrenches(checked_reach("force", force), checked_reach("moment", moment))


@lru_cache(maxsize=64)
def _wrenches(force: float, moment: float) -> Strategy[Floats]:
    return st.builds(lambda f, m: np.array(f + m), vectors(force), vectors(moment))


def checked_reach(name: str, value: float) -> float:
    """Return `value` as a positive finite float, or raise an error that names it."""
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        raise DTypeError(f"{name} is {shown(value)}; wanted a positive number")
    if not math.isfinite(value):
        raise NotFiniteError(f"{name} is {value}; wanted a positive finite number")
    if value <= 0:
        raise ArgumentError(f"{name} is {value}; wanted a positive number")
    return float(value)


def _on_sphere(below: float, azimuth: float) -> Vector:
    """Return the direction at height 1 - below (uniform height is uniform on the sphere: Archimedes)."""
    height = 1.0 - below
    ring = math.sqrt(max(0.0, 1.0 - height * height))
    x, y = ring * math.cos(azimuth), ring * math.sin(azimuth)
    length = math.sqrt(x * x + y * y + height * height)
    return (x / length, y / length, height / length)


def _quaternion(axis: Vector, turn: float, sign: float) -> Floats:
    s, c = math.sin(turn / 2), math.cos(turn / 2)
    quat = sign * np.array([axis[0] * s, axis[1] * s, axis[2] * s, c])
    return np.asarray(quat / np.linalg.norm(quat))


def _homogeneous(position: Vector, quat_xyzw: Floats) -> Floats:
    return homogeneous(rotation_from_quat(quat_xyzw), np.array(position))
