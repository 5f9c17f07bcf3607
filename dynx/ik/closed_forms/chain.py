"""The joints between the world and a frame as screw axes at the zero configuration.

With the pose T_zero of the frame there, the pose at any configuration is the product of exponentials
E_1(q_1) ... E_n(q_n) T_zero (Murray, Li and Sastry, eq. 3.3), in which E_i rotates about the axis of joint i
at the zero configuration, or for a prismatic joint translates along it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from dynx.errors import ArgumentError, NoClosedFormError, UnknownNameError, nearest, shown
from dynx.model import Model
from dynx.model.ball_joints import refuse_ball_joints
from dynx.model.mechanism import joint_motion
from dynx.model.numbers import MAX_MAGNITUDE, is_real
from dynx.rbd.kinematics import ancestry
from dynx.spatial.scalar import Floats
from dynx.spatial.se3 import homogeneous
from dynx.spatial.so3 import cross, rotate

MAX_JOINTS = 6
"""Most joints of a closed form."""


@dataclass(frozen=True, eq=False)
class Chain:
    """Axes of the n joints that move a frame, at the zero configuration and in world axes.

    Lengths are divided by `length`.
    """

    joints: tuple[str, ...]
    """Names of the joints, from the world to the frame."""
    columns: tuple[int, ...]
    """Their indices in q."""
    axes: Floats
    """Unit directions (n, 3)."""
    points: Floats
    """A point on each axis (n, 3)."""
    T_zero: Floats
    """Pose of the frame (4, 4)."""
    length: float
    """Length [m] of the chain, from joint to joint and to the frame, with the travels of prismatic joints."""
    given: Mapping[str, float]
    """Positions [rad or m] of the joints that do not move."""
    revolute: tuple[bool, ...]
    """Whether each joint turns about its axis; the others slide along it."""


def chain_to(model: Model, frame: str, given: Mapping[str, float]) -> Chain:
    """Return the chain to a frame, in which the joints `given` are fixed at those positions [rad or m].

    Raises NoClosedFormError for a floating base, and for a joint of the chain that is coupled to another;
    UnknownNameError or ArgumentError for `given`.
    """
    refuse_ball_joints(model, "a closed form of inverse kinematics", "inverse_kinematics of a backend does")
    given = checked_given(model, given)
    if model.floating:
        raise NoClosedFormError(f"{model.name} has a floating base; the closed form needs a fixed one")
    mechanism = model.mechanism
    placed = mechanism.frames[model.frame_index(frame)]
    R, p = np.eye(3), np.zeros(3)
    joints, axes, points = [], [], []
    origins: list[Floats] = []
    revolute: list[bool] = []
    travel = 0.0
    for index in reversed(ancestry(mechanism, placed.body)):
        body = mechanism.bodies[index]
        value = _fixed_position(model, body.joint, given)
        origins.append(p + rotate(R, body.p))
        if value is None:
            joints.append(body.joint)
            axes.append(rotate(R @ body.R, body.axis))
            points.append(origins[-1])
            revolute.append(body.revolute)
            if not body.revolute:
                travel += _travel(model, body.joint)
        R_joint, p_joint = joint_motion(body, np.asarray(0.0 if value is None else value))
        R, p = R @ R_joint, p + rotate(R, p_joint)
    T_zero = homogeneous(R @ placed.R, p + rotate(R, placed.p))
    origins.append(T_zero[:3, 3])
    length = float(sum(np.linalg.norm(b - a) for a, b in pairwise(origins))) + travel or 1.0
    T_zero[:3, 3] /= length
    return Chain(
        tuple(joints),
        tuple(model.coordinate_index(joint) for joint in joints),
        np.array(axes).reshape(-1, 3),
        np.array(points).reshape(-1, 3) / length,
        T_zero,
        length,
        given,
        tuple(revolute),
    )


def _travel(model: Model, joint: str) -> float:
    """Return the largest distance [m] of a prismatic joint from zero, or 0 if it has no limits."""
    at = model.coordinate_index(joint)
    farthest = max(abs(float(model.lower[at])), abs(float(model.upper[at])))
    return farthest if farthest < MAX_MAGNITUDE else 0.0


def _fixed_position(model: Model, name: str, given: Mapping[str, float]) -> float | None:
    """Return the position of a joint that does not move, or None."""
    joint = model.joint(name)
    if joint.mimic is None:
        drives = [j.name for j in model.joints if j.mimic is not None and j.mimic.joint == name]
        if name not in given and drives:
            raise NoClosedFormError(
                f"joint {shown(drives[0])} follows {shown(name)}, which moves the frame", [(name,)]
            )
        return given.get(name)
    driver = joint.mimic.joint
    if driver not in given:
        raise NoClosedFormError(f"joint {shown(name)} follows {shown(driver)}", [(driver,)])
    return joint.mimic.multiplier * given[driver] + joint.mimic.offset


def checked_given(model: Model, given: Mapping[str, float]) -> dict[str, float]:
    """Return positions [rad or m] by joint; UnknownNameError or ArgumentError for others."""
    if not isinstance(given, Mapping):
        raise ArgumentError(f"given is {shown(given)}; wanted positions by joint, such as {{'joint7': 0.3}}")
    for name, value in given.items():
        if name not in model.joint_names:
            if isinstance(name, str):
                model.coordinate_index(name)  # explains joints without a coordinate
            raise UnknownNameError(
                f"no joint {shown(name)} in {model.name}{nearest(name, model.joint_names)}"
            )
        if not is_real(value) or not abs(value) < MAX_MAGNITUDE:
            raise ArgumentError(f"given[{name!r}] is {shown(value)}; wanted a finite number")
    return {name: float(value) for name, value in given.items()}


@dataclass(frozen=True, eq=False)
class SpatialLines:
    """Lines in space: unit directions (n, 3) and a point on each (n, 3)."""

    axes: Floats
    points: Floats

    def reversed(self) -> SpatialLines:
        """Return the lines of the inverse motion: in the opposite order and direction.

        (E_1 ... E_n)^-1 = E_n^-1 ... E_1^-1, and E_i^-1 turns by the same angle about the opposite axis.
        """
        return SpatialLines(-self.axes[::-1], self.points[::-1])


def angle_between(a: Floats, b: Floats) -> float:
    """Return the angle [rad] between two lines along a and b, from 0 to pi/2."""
    return float(np.arctan2(np.linalg.norm(cross(a, b)), abs(a @ b)))


def along(a: Floats, b: Floats) -> Floats:
    """Return a, or -a if that is nearer to b: for directions that are to become parallel."""
    return a if a @ b >= 0.0 else -a


def common_point(lines: SpatialLines) -> tuple[Floats, float]:
    """Return the point nearest to all lines in the least-squares sense, and its largest distance."""
    across = np.eye(3) - lines.axes[:, :, None] * lines.axes[:, None, :]
    A, b = across.sum(axis=0), (across @ lines.points[:, :, None])[..., 0].sum(axis=0)
    x = np.linalg.lstsq(A, b, rcond=1e-9)[0]
    distances = np.linalg.norm((across @ (x - lines.points)[:, :, None])[..., 0], axis=-1)
    return x, float(distances.max())


def normal_feet(a: Floats, p: Floats, b: Floats, q: Floats) -> tuple[Floats, Floats]:
    """Return the feet, on the lines (a, p) and (b, q), of their common normal.

    For parallel lines it is the normal through p.
    """
    n = cross(a, b)
    square = float(n @ n)
    if square < 1e-18:
        return p, q + b * float(b @ (p - q))
    d = q - p
    return p + a * float(cross(d, b) @ n) / square, q + b * float(cross(d, a) @ n) / square
