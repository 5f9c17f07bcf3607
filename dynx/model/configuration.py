"""Arithmetic of configurations: integrate, difference, sample, clip."""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from operator import add, sub

import numpy as np
from numpy.typing import ArrayLike

from dynx.errors import ArgumentError, CompileError, ShapeError, shown
from dynx.model.numbers import (
    MAX_MAGNITUDE,
    checked_array,
    checked_generator,
    checked_quaternion,
    checked_size,
)
from dynx.model.tree import Tree
from dynx.spatial import branchless
from dynx.spatial.branchless import FLOATS
from dynx.spatial.scalar import Floats
from dynx.time_limit import not_counted

Step = Callable[[object, object, object], int]
"""Function of two arrays and of the one that it fills, which returns whether both were valid."""

_CODE = "dynx.compiled.configurations"
"""Module above this one with `integrate` and `difference` in machine code."""

MIN_CALLS_TO_COMPILE = 20_000
"""Steps on floats that take about as long as to import the compiler and to compile one."""

_ACCEPTED = 0
"""Result of the machine code for valid arrays: `dynx.simd.arrays.ACCEPTED`, which takes a tenth of a second
to import."""


def checked_q(tree: Tree, q: ArrayLike, name: str = "q") -> Floats:
    """Return a configuration (..., nq), whose quaternions, if any, must have unit norm to 1e-6.

    If its norm deviates by more than rounding, a quaternion is normalised in a copy, since engines treat
    such quaternions differently. The name of one of `Model.configurations` stands for it.
    """
    try:
        array = checked_array(name, np.array(tree.configurations[q]) if isinstance(q, str) else q, tree.nq)
    except ShapeError as error:
        base = "position and quaternion (x, y, z, w) of the base, " if tree.floating else ""
        listed = ", ".join(map(shown, tree.joint_names[:8])) + ", ..." * (len(tree.joint_names) > 8)
        balls = ", ".join(shown(joint.name) for joint in tree.ball_joints[:8])
        of_balls = f", with a quaternion (x, y, z, w) of each ball joint: {balls}" if balls else ""
        raise ShapeError(f"{error}: {base}{listed}{of_balls}") from None
    for first in tree.quaternions:
        quat = array[..., first : first + 4]
        unit = checked_quaternion(name, quat, "3:7" if first == 3 else f"{first}:{first + 4}")
        if unit is not quat:
            array = np.concatenate([array[..., :first], unit, array[..., first + 4 :]], axis=-1)
    return array


def neutral(tree: Tree) -> Floats:
    """Return the configuration (nq,) with every joint at 0, or at the identity, and the base frame at the
    world frame."""
    q = np.zeros(tree.nq)
    for first in tree.quaternions:
        q[first + 3] = 1.0
    return q


def random(
    tree: Tree, rng: np.random.Generator | int | None = None, size: tuple[int, ...] | int = ()
) -> Floats:
    """Sample configurations (*size, nq) uniformly within the limits.

    An angle without limits is in (-pi, pi), a length in (-1, 1). A floating base gets a position in the cube
    [-1, 1]^3 and a uniformly distributed orientation (Shoemake 1992). A ball joint gets an orientation
    uniformly distributed within its largest angle. `rng` is a NumPy generator or a seed.
    """
    rng = checked_generator(rng)
    shape = checked_size(size)
    q = np.empty((*shape, tree.nq))
    for joint in tree.coordinate_joints:
        k = tree.position_index(joint.name)
        if joint.type == "ball":
            q[..., k : k + 4] = _random_rotation(rng, shape, joint.limits.upper)
            continue
        default_range = 1.0 if joint.type == "prismatic" else np.pi
        low, high = sampling_range(float(tree.lower[k]), float(tree.upper[k]), default_range)
        q[..., k] = rng.uniform(low, high, shape)
    if tree.floating:
        q[..., :3] = rng.uniform(-1.0, 1.0, (*shape, 3))
        q[..., 3:7] = _random_rotation(rng, shape, np.inf)
    return q


def _random_rotation(rng: np.random.Generator, shape: tuple[int, ...], largest_angle: float) -> Floats:
    """Sample unit quaternions (*shape, 4) uniformly among the rotations by at most `largest_angle` [rad]."""
    quat = rng.standard_normal((*shape, 4))
    if largest_angle >= np.pi:
        return np.asarray(quat / np.linalg.norm(quat, axis=-1, keepdims=True))
    # The share of rotations by less than an angle x is proportional to x - sin x.
    share = rng.uniform(0.0, largest_angle - np.sin(largest_angle), shape)
    low, high = np.zeros(shape), np.full(shape, largest_angle)
    for _ in range(60):
        middle = 0.5 * (low + high)
        above = middle - np.sin(middle) > share
        low, high = np.where(above, low, middle), np.where(above, middle, high)
    axis = quat[..., :3] / np.linalg.norm(quat[..., :3], axis=-1, keepdims=True)
    half = 0.5 * low[..., None]
    return np.concatenate([axis * np.sin(half), np.cos(half)], axis=-1)


def integrate(tree: Tree, q: ArrayLike, v: ArrayLike) -> Floats:
    """Return the configuration reached from `q` (..., nq) with velocity `v` (..., nv) in unit time.

    A floating base moves along the exponential of its body twist, and a ball joint turns along that of its
    angular velocity.
    """
    if tree.floating and not tree.ball_joints and type(q) is type(v) is np.ndarray:
        moved = np.empty(tree.nq)
        if _integration.function(q, v, moved) == _ACCEPTED:
            return moved
    q, v = checked_q(tree, q), checked_array("v", v, tree.nv)
    if not tree.quaternions:
        return q + v
    if tree.ball_joints or not q.ndim == v.ndim == 1:
        from dynx.spatial.manifold import integrate as move  # most robots have no quaternions

        return move(*_broadcast(q, v), floating=tree.floating, balls=tree.ball_places)
    start, step = q.tolist(), v.tolist()
    return np.array(branchless.moved(start[:7], step[:6], FLOATS) + list(map(add, start[7:], step[6:])))


def difference(tree: Tree, q0: ArrayLike, q1: ArrayLike) -> Floats:
    """Return the velocity v (..., nv) with integrate(q0, v) = q1. Its angles of rotation are at most pi."""
    if tree.floating and not tree.ball_joints and type(q0) is type(q1) is np.ndarray:
        velocity = np.empty(tree.nv)
        if _subtraction.function(q0, q1, velocity) == _ACCEPTED:
            return velocity
    q0, q1 = checked_q(tree, q0, "q0"), checked_q(tree, q1, "q1")
    if not tree.quaternions:
        return q1 - q0
    if tree.ball_joints or not q0.ndim == q1.ndim == 1:
        from dynx.spatial.manifold import difference as subtract  # most robots have no quaternions

        return subtract(*_broadcast(q0, q1), floating=tree.floating, balls=tree.ball_places)
    start, end = q0.tolist(), q1.tolist()
    return np.array(branchless.twist_between(start[:7], end[:7], FLOATS) + list(map(sub, end[7:], start[7:])))


def clip(tree: Tree, q: ArrayLike) -> Floats:
    """Return `q` (..., nq) clipped to the position limits, with normalised quaternions.

    A ball joint beyond its largest angle is turned back about the same axis.
    """
    array = np.clip(checked_array("q", q, tree.nq), tree.lower, tree.upper)
    for first in tree.quaternions:
        quat = array[..., first : first + 4]
        norm = np.linalg.norm(quat, axis=-1, keepdims=True)
        if np.any(norm == 0.0):
            raise ArgumentError(f"q[{first}:{first + 4}] is the zero quaternion; wanted an attitude")
        quat /= norm
    for joint in tree.ball_joints:
        if joint.limits.upper < np.pi:
            first = tree.position_index(joint.name)
            rotation = branchless.quat_log(array[..., first : first + 4])
            angle = np.linalg.norm(rotation, axis=-1, keepdims=True)
            beyond = angle > joint.limits.upper
            kept = branchless.quat_exp(rotation * (joint.limits.upper / np.where(beyond, angle, 1.0)))
            array[..., first : first + 4] = np.where(beyond, kept, array[..., first : first + 4])
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


class ConfigurationStep:
    """A step in machine code, from its call number `MIN_CALLS_TO_COMPILE` on and where it can be compiled.

    Until then its `function` accepts nothing, so that the caller computes on floats, with the same bits.
    """

    def __init__(self, name: str) -> None:
        self._name = name
        self._left = MIN_CALLS_TO_COMPILE
        self.function: Step = self._count

    def compile(self) -> None:
        """Replace `function` by machine code."""
        with not_counted():
            self.function = getattr(import_module(_CODE), self._name)()

    def _count(self, first: object, second: object, result: object) -> int:
        self._left -= 1
        if self._left <= 0:
            try:
                self.compile()
            except CompileError:
                self.function = _refuse
        return ~_ACCEPTED


def _refuse(first: object, second: object, result: object) -> int:
    return ~_ACCEPTED


_integration, _subtraction = ConfigurationStep("integration"), ConfigurationStep("subtraction")


def _broadcast(a: Floats, b: Floats) -> tuple[Floats, Floats]:
    """Return two arrays with the same leading axes."""
    shape = np.broadcast_shapes(a.shape[:-1], b.shape[:-1])
    return np.broadcast_to(a, (*shape, a.shape[-1])), np.broadcast_to(b, (*shape, b.shape[-1]))
