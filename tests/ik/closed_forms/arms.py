"""Random six-axis arms with a closed form, in frames of any orientation."""

from __future__ import annotations

import numpy as np

from dynx.model import Joint, Limits, Link, Model, Pose
from dynx.model.elements import JointType
from dynx.spatial.scalar import Floats

FAMILIES = (
    "spherical: axes 2 and 3 parallel",
    "spherical: axes 1 and 2 intersecting",
    "spherical: axes 1 and 2 parallel",
    "spherical: general",
    "parallel: axes 5 and 6 intersecting",
    "parallel: axes 5 and 6 parallel",
    "parallel: general",
    "outer: axes 4 and 5 intersecting",
    "outer: axes 4 and 5 parallel",
    "outer: axes 5 and 6 parallel",
    "outer: axes 5 and 6 intersecting",
    "outer: general",
)

LENGTH = 0.5
"""Standard deviation [m] of coordinates of points on the axes."""


def random_arm(family: str, rng: np.random.Generator, deviation: float = 0.0, limit: float = np.pi) -> Model:
    """Return an arm, in the direction of the family or in the inverse one, with limits +-limit [rad].

    Its axes are moved by `deviation` [m, rad] from where they meet and are parallel.
    """
    axes, points = _lines(family, rng)
    if rng.random() < 0.5:
        axes, points = axes[::-1], points[::-1]
    points = points + deviation * rng.normal(size=(6, 3))
    axes = axes + deviation * rng.normal(size=(6, 3))
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    return arm_of(axes, points, "RRRRRR", rng, limit)


def arm_of(axes: Floats, points: Floats, kinds: str, rng: np.random.Generator, limit: float) -> Model:
    """Return an arm of joints R (revolute) and P (prismatic), with limits +-limit [rad or m], whose frames
    have any orientation."""
    links, joints, T = [Link("base")], [], np.eye(4)
    for k, (axis, point) in enumerate(zip(axes, points, strict=True)):
        T_joint = _random_pose(rng)
        T_joint[:3, 3] = point + 0.2 * rng.normal() * axis
        child, (x, y, z) = f"link{k + 1}", (T_joint[:3, :3].T @ axis).tolist()
        origin, limits = Pose.from_matrix(np.linalg.solve(T, T_joint)), Limits(-limit, limit)
        kind: JointType = "revolute" if kinds[k] == "R" else "prismatic"
        joints.append(Joint(f"joint{k + 1}", kind, links[-1].name, child, origin, (x, y, z), limits))
        links.append(Link(child))
        T = T_joint
    arm = Model.build("arm", links, joints)
    return arm.with_frame("tool", links[-1].name, _random_pose(rng))


def _lines(family: str, rng: np.random.Generator) -> tuple[Floats, Floats]:
    axes, points = rng.normal(size=(6, 3)), LENGTH * rng.normal(size=(6, 3))
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    kind, _, details = family.partition(": ")
    if kind == "spherical":
        points[3:] = points[3]
        pairs = {"axes 2 and 3 parallel": (1, 2), "axes 1 and 2 parallel": (0, 1)}
        meeting = {"axes 1 and 2 intersecting": (0, 1)}
    elif kind == "outer":
        axes[1], axes[2] = axes[0] * rng.choice([-1, 1]), axes[0] * rng.choice([-1, 1])
        pairs = {"axes 4 and 5 parallel": (3, 4), "axes 5 and 6 parallel": (4, 5)}
        meeting = {"axes 4 and 5 intersecting": (3, 4), "axes 5 and 6 intersecting": (4, 5)}
    else:
        axes[2], axes[3] = axes[1] * rng.choice([-1, 1]), axes[1] * rng.choice([-1, 1])
        pairs, meeting = {"axes 5 and 6 parallel": (4, 5)}, {"axes 5 and 6 intersecting": (4, 5)}
    if details in pairs:
        first, second = pairs[details]
        axes[second] = axes[first] * rng.choice([-1, 1])
    if details in meeting:
        first, second = meeting[details]
        points[second] = points[first]
    return axes, points


def _random_pose(rng: np.random.Generator) -> Floats:
    T = np.eye(4)
    Q, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    T[:3, :3] = Q * np.linalg.det(Q)
    T[:3, 3] = 0.2 * rng.normal(size=3)
    return T


def angle_difference(a: Floats, b: Floats) -> Floats:
    """Return the largest difference (...,) [rad] of angles (..., n), modulo full turns."""
    turns = (a - b) / (2.0 * np.pi)
    return np.asarray(2.0 * np.pi * np.abs(turns - np.round(turns)).max(axis=-1))


def pose_difference(T: Floats, S: Floats) -> Floats:
    """Return the largest difference of the entries of poses (..., 4, 4)."""
    return np.asarray(np.abs(T - S).max(axis=(-1, -2)))
