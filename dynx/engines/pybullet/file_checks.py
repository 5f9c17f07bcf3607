"""PyBullet's checks of a file: what it cannot load, and its diagonalisation and checks of an ``<inertial>``,
reimplemented in float64.

The loader diagonalises a tensor with products of inertia by Jacobi's method, and sets all moments to zero
where one is negative or exceeds the sum of the others, to the last bit. The tree of inverse dynamics, made
later, shifts the inertia to the origin of the link and checks it again (btMatrix3x3::diagonalize, URDF
importer, btInverseDynamics isValidInertiaMatrix; pybullet 3.2.7).
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np

from dynx.errors import EngineError, ModelError, UnusableEngineError, shown
from dynx.files.reading import read_file
from dynx.loaded.robot import require_file
from dynx.model import Model
from dynx.model.elements import Inertial, Note
from dynx.model.topology import MAX_LINKS
from dynx.model.xml.reading import Element, read_xml
from dynx.spatial.scalar import FLOAT64_EPS, Floats, longdouble
from dynx.spatial.so3 import rotation_from_rpy, skew

_STOP_RATIO = 1e-6
"""Ratio of the largest off-diagonal entry to the trace below which the next rotation is the last."""

_ABSOLUTE = 5 * FLOAT64_EPS
"""Tolerance by which a leading minor may be negative, whatever its unit [a power of kg m^2]."""

MAX_ASYMMETRY = 5 * FLOAT64_EPS
"""Difference of two opposite entries [kg m^2] above which inverse dynamics refuses a tensor."""

_ROUNDING = 8 * FLOAT64_EPS
"""Bound on the rounding of a sum of a few products, relative to the largest."""

CACHE_SIZE = 4096
"""Number of cached inertials. Rules check every link again after every remedy."""


@dataclass(frozen=True, eq=False)
class BulletInertia:
    """Moments (3,) about `axes` (3, 3), columns in the axes of the inertial, as the loader finds them."""

    moments: Floats
    axes: Floats

    @property
    def zeroed(self) -> bool:
        """True if the loader prints "Bad inertia tensor properties" and uses zero instead."""
        x, y, z = self.moments
        return bool(x < 0 or y < 0 or z < 0 or x > y + z or y > x + z or z > x + y)


@lru_cache(maxsize=CACHE_SIZE)
def bullet_reading(inertial: Inertial) -> BulletInertia:
    """Return the principal moments and axes that PyBullet's loader finds, before it checks them."""
    tensor = inertial.tensor
    if not (inertial.ixy or inertial.ixz or inertial.iyz):
        return BulletInertia(np.diagonal(tensor).copy(), np.eye(3))
    return BulletInertia(*_diagonalise(tensor))


@lru_cache(maxsize=CACHE_SIZE)
def diagonalisation_error(inertial: Inertial) -> float:
    """Return the error of the tensor that PyBullet holds, relative to the largest moment of the file."""
    held = bullet_reading(inertial)
    axes, tensor = longdouble(held.axes), longdouble(inertial.tensor)
    size = float(np.max(np.abs(tensor)))
    if size == 0.0:
        return 0.0
    return float(np.max(np.abs((axes * longdouble(held.moments)) @ axes.T - tensor))) / size


def tree_may_reject(inertial: Inertial, *, on_fixed_joint: bool) -> bool:
    """Check whether an inertia is so near the bound of the triangle inequality that Bullet's inverse dynamics
    may refuse the robot.

    Bullet checks no triangle inequality for a link on a fixed joint (`on_fixed_joint`).
    """
    held = bullet_reading(inertial)
    R = longdouble(rotation_from_rpy(np.array(inertial.origin.rpy))) @ longdouble(held.axes)
    lever = R.T @ longdouble(inertial.origin.xyz)
    arm = skew(lever)
    about_origin = longdouble(np.diag(held.moments)) - longdouble(inertial.mass) * (arm @ arm)
    x, y, z = (float(value) for value in np.diagonal(about_origin))
    if not on_fixed_joint:
        squares = np.asarray(inertial.mass * lever * lever, dtype=float)
        # With the centre of mass on one of the axes both sides of a sum get the same number.
        exact = np.count_nonzero(squares > FLOAT64_EPS**2 * np.max(squares)) <= 1
        margin = 0.0 if exact else _ROUNDING * max(x, y, z)
        if x + y < z + margin or y + z < x + margin:
            return True
    minor = float(about_origin[0, 0] * about_origin[1, 1] - about_origin[0, 1] ** 2)
    determinant = float(
        x * (about_origin[1, 1] * about_origin[2, 2] - about_origin[1, 2] ** 2)
        - about_origin[0, 1]
        * (about_origin[0, 1] * about_origin[2, 2] - about_origin[1, 2] * about_origin[0, 2])
        + about_origin[0, 2]
        * (about_origin[0, 1] * about_origin[1, 2] - about_origin[1, 1] * about_origin[0, 2])
    )
    mean = (x + y + z) / 3.0
    return minor < _ROUNDING * x * y - _ABSOLUTE or determinant < _ROUNDING * mean * mean * mean - _ABSOLUTE


def tree_asymmetry(inertial: Inertial) -> float:
    """Return the largest difference [kg m^2] of two opposite entries of the tensor about the link's origin.

    The tree of inverse dynamics computes it in the axes of the inertial frame, as moments minus
    ``(mass * cross) * cross`` with the cross-product matrix of the centre of mass: ``(mass * x) * y`` and
    ``(mass * y) * x`` are rounded differently. The result is exact, to the last bit of Bullet's own.
    """
    R = _basis(inertial.origin.rpy)
    V: list[list[float]] = bullet_reading(inertial).axes.tolist()
    basis = [[row[0] * V[0][k] + row[1] * V[1][k] + row[2] * V[2][k] for k in range(3)] for row in R]
    px, py, pz = inertial.origin.xyz
    x, y, z = (basis[0][k] * px + basis[1][k] * py + basis[2][k] * pz for k in range(3))
    m: float = inertial.mass
    return max(abs((m * a) * b - (m * b) * a) for a, b in ((x, y), (x, z), (y, z)))


def _basis(rpy: tuple[float, float, float]) -> list[list[float]]:
    """Return the rotation of ``rpy`` as Bullet computes it: from a normalised quaternion."""
    (sr, cr), (sp, cp), (sy, cy) = ((math.sin(angle / 2), math.cos(angle / 2)) for angle in rpy)
    quat = (
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
        cr * cp * cy + sr * sp * sy,
    )
    shrink = 1.0 / math.sqrt(sum(each * each for each in quat))
    x, y, z, w = (each * shrink for each in quat)
    s = 2.0 / (x * x + y * y + z * z + w * w)
    xs, ys, zs = x * s, y * s, z * s
    wx, wy, wz = w * xs, w * ys, w * zs
    xx, xy, xz = x * xs, x * ys, x * zs
    yy, yz, zz = y * ys, y * zs, z * zs
    return [
        [1.0 - (yy + zz), xy - wz, xz + wy],
        [xy + wz, 1.0 - (xx + zz), yz - wx],
        [xz - wy, yz + wx, 1.0 - (xx + yy)],
    ]


def _diagonalise(tensor: Floats) -> tuple[Floats, Floats]:
    """Return the eigenvalues and eigenvectors by Jacobi's method, as in Bullet."""
    A, V = tensor.copy(), np.eye(3)
    for step in range(30, 0, -1):
        pairs = ((0, 1, 2), (0, 2, 1), (1, 2, 0))
        p, q, r = max(pairs, key=lambda pair: abs(A[pair[0], pair[1]]))
        largest = abs(A[p, q])
        threshold = _STOP_RATIO * (abs(A[0, 0]) + abs(A[1, 1]) + abs(A[2, 2]))
        last = step == 1 or largest <= threshold
        if largest <= FLOAT64_EPS * threshold:
            break
        tangent, cosine, sine = _rotation((A[q, q] - A[p, p]) / (2 * A[p, q]))
        shift = tangent * A[p, q]
        A[p, q] = A[q, p] = 0.0
        A[p, p] -= shift
        A[q, q] += shift
        at_p, at_q = A[r, p], A[r, q]
        A[r, p] = A[p, r] = cosine * at_p - sine * at_q
        A[r, q] = A[q, r] = cosine * at_q + sine * at_p
        V[:, p], V[:, q] = cosine * V[:, p] - sine * V[:, q], cosine * V[:, q] + sine * V[:, p]
        if last:
            break
    return np.diagonal(A).copy(), V


def _rotation(theta: float) -> tuple[float, float, float]:
    square = theta * theta
    if square * square < 10 / FLOAT64_EPS:
        root = math.sqrt(1 + square)
        tangent = 1 / (theta + root) if theta >= 0 else 1 / (theta - root)
        cosine = 1 / math.sqrt(1 + tangent * tangent)
    else:
        tangent = 1 / (theta * (2 + 0.5 / square))
        cosine = 1 - 0.5 * tangent * tangent
    return tangent, cosine, cosine * tangent


MAX_JOINTS = 127
"""Largest number of joints, fixed ones included: from the 128th on Bullet returns no joint state."""

MAX_NAME_LENGTH = 1000
"""Largest length of a name [bytes]: 1,264 of a joint overflow Bullet's stack, 2,000 of a link crash it."""

_OPAQUE = frozenset(["visual", "collision", "transmission", "gazebo", "sensor", "ros2_control"])

_WITHOUT_AXIS = frozenset(["fixed", "floating"])
"""Types of joints whose ``<axis>`` PyBullet does not read."""


def require_harmless(path: Path, model: Model) -> None:
    """Raise EngineError, with the reason, for a file on which PyBullet crashes or its results are undefined.

    Its links and joints must be those of `model`, which dynx has checked to be one tree.
    """
    require_file(path)
    try:
        root = read_xml(
            read_file(str(path)),
            str(path),
            list[Note](),
            opaque=_OPAQUE,
            max_counts={"link": MAX_LINKS, "joint": MAX_LINKS},
        )
    except ModelError as error:
        raise EngineError(f"pybullet cannot load {model.name}: {error}") from error
    for reason in _hazards(root):
        raise UnusableEngineError(f"pybullet would crash on {model.name}: {reason}")
    if tag := _other_tree(root, model):
        raise UnusableEngineError(
            f"pybullet is not compared on {model.name}: the {tag} elements of the file are not those of the "
            "tree that dynx reads"
        )
    for joint in root.all("joint"):
        axis = next(iter(joint.all("axis")), None)
        if (
            axis is not None
            and "xyz" not in axis.attributes
            and joint.attributes["type"] not in _WITHOUT_AXIS
        ):
            raise UnusableEngineError(
                f"pybullet reads the axis of joint {shown(joint.attributes['name'])} from memory that it did "
                f"not initialise (line {axis.line}: <axis> has no xyz), so its results change from run to run"
            )
    joints = len(root.all("joint"))
    if joints > MAX_JOINTS:
        raise UnusableEngineError(
            f"{model.name} has {joints} joints, fixed ones included; pybullet supports at most {MAX_JOINTS}"
        )


def _hazards(root: Element) -> Iterator[str]:
    named = {"robot": [root], "link": root.all("link"), "joint": root.all("joint")}
    for kind, elements in named.items():
        for element in elements:
            name = element.attributes.get("name", "")
            if not name and kind != "robot":
                yield f"line {element.line}: a <{kind}> without a name"
            if "%" in name:
                yield f"line {element.line}: the name of a <{kind}>, {shown(name)}, has a %"
            if len(name.encode("utf-8")) > MAX_NAME_LENGTH:
                yield f"line {element.line}: the name of a <{kind}> has {len(name)} characters"
    for joint in named["joint"]:
        if "type" not in joint.attributes:
            yield f"line {joint.line}: joint {shown(joint.attributes['name'])} has no type"
    ends = list(map(_ends, named["joint"]))
    children = {child for _, _, child in ends}
    if len({name for name, _, _ in ends}) < len(ends):
        yield "two joints have the same name"
    if len(children) < len(ends):
        yield "a link is the child of two joints"
    if len({element.attributes["name"] for element in named["link"]} - children) > 1:
        yield "several links are the child of no joint"


def _other_tree(root: Element, model: Model) -> str | None:
    """Name the elements of the file that are not those of the tree which dynx reads, if any are."""
    # Each added frame is a link on a fixed joint in the file, and the joint has a generated name.
    added = {frame.name for frame in model.extra_frames}
    links = [element.attributes["name"] for element in root.all("link")]
    if sorted(links) != sorted(added.union(link.name for link in model.links)):
        return "<link>"
    joints = sorted(map(_ends, root.all("joint")))
    wanted = {(joint.name, joint.parent, joint.child) for joint in model.joints}
    return None if sorted(wanted) == [each for each in joints if each[2] not in added] else "<joint>"


def _ends(joint: Element) -> tuple[str, str, str]:
    """Name, parent and child of a joint; the first of several ends, as in the reader."""
    ends = [joint.all(role)[:1] for role in ("parent", "child")]
    parent, child = ("".join(element.attributes.get("link", "") for element in end) for end in ends)
    return joint.attributes["name"], parent, child
