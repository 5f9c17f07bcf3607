"""Parts of a robot description, as stated in the document.

Values are those of the file, in SI units; inertias are neither merged nor diagonalised nor repaired here.
`line` is the line of the XML element, or None for a part created by a program.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from itertools import chain
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from dynx.argument_types import checks_types
from dynx.errors import ArgumentError, DTypeError, NotFiniteError, ShapeError, shown
from dynx.model.numbers import (
    array_of,
    checked_entries,
    checked_quaternion,
    checked_vector,
    real_array,
)
from dynx.registry import door
from dynx.spatial.scalar import Array, Floats
from dynx.spatial.se3 import homogeneous
from dynx.spatial.so3 import rotation_from_quat, rotation_from_rpy, rpy_from_rotation

JointType = Literal["revolute", "continuous", "prismatic", "ball", "fixed"]
Vector = tuple[float, float, float]

ZERO: Vector = (0.0, 0.0, 0.0)
INFINITY = float("inf")

RIGIDITY_TOLERANCE = 1e-6
"""Largest accepted deviation from orthonormality of a rotation matrix."""


def matrix_of_pair(pose: Any, name: str) -> Any:
    """Return the poses (..., 4, 4) of a pair: positions (..., 3) [m] and unit quaternions (x, y, z, w)
    (..., 4); or those (n, ..., 4, 4) of n such pairs. Anything else is returned as it is.

    Raises ArgumentError for a quaternion whose length differs from 1 by more than 1e-6, NotFiniteError and
    its kinds for numbers.
    """
    if not _is_pair(pose):
        # The first alone is looked at, because a path may have thousands of other targets.
        if not (isinstance(pose, tuple | list) and pose and _is_pair(pose[0]) and all(map(_is_pair, pose))):
            return pose
        poses = [matrix_of_pair(each, f"{name}[{k}]") for k, each in enumerate(pose)]
        if len({each.shape for each in poses}) > 1:
            raise ShapeError(
                f"{name} has pairs of poses with shapes {sorted({each.shape for each in poses})}"
            )
        return np.stack(poses)
    position, quat_xyzw = (checked_entries(name, real_array(name, part)) for part in pose)
    try:
        np.broadcast_shapes(position.shape[:-1], quat_xyzw.shape[:-1])
    except ValueError:
        from dynx.model.pose_errors import refuse_pair

        refuse_pair(name, position, quat_xyzw)
    return homogeneous(rotation_from_quat(checked_quaternion(name, quat_xyzw)), position)


def _is_pair(pose: Any) -> bool:
    """Check whether an object is a pair of positions (..., 3) and quaternions (..., 4)."""
    if not isinstance(pose, tuple | list) or len(pose) != 2:
        return False
    try:
        return [np.shape(part)[-1:] for part in pose] == [(3,), (4,)]
    except ValueError:  # ragged
        return False


def rigid_matrix(T: ArrayLike, name: str) -> Floats:
    """Return a homogeneous matrix (4, 4) as a float64 array, as it is: not with the nearest rotation.

    A pair of a position (3,) and a unit quaternion (x, y, z, w) (4,) is one, too. `name` is how errors call
    it. Raises ArgumentError unless T is a rigid transform to 1e-6.
    """
    try:
        entries = array_of(name, matrix_of_pair(T, name))
        if entries.dtype.kind == "c":
            raise DTypeError(f"{name} has dtype {entries.dtype}; wanted real numbers (float64)")
        array = np.asarray(entries, dtype=np.float64)
    except (TypeError, ValueError, OverflowError) as error:
        if isinstance(error, ArgumentError):
            raise
        raise ArgumentError(
            f"{name} is {shown(T)}; wanted a Pose or a matrix (4, 4), or a position and a quaternion"
        ) from None
    if array.shape != (4, 4):
        from dynx.model.pose_errors import refuse_matrix

        refuse_matrix(name, array)
    rows: list[list[float]] = array.tolist()
    if not all(map(math.isfinite, chain.from_iterable(rows))):
        raise NotFiniteError(f"{name} has an entry that is NaN or infinite; wanted finite numbers")
    (a, b, c, _), (d, e, f, _), (g, h, i, _), bottom = rows
    lengths = (a * a + d * d + g * g, b * b + e * e + h * h, c * c + f * f + i * i)
    angles = (a * b + d * e + g * h, b * c + e * f + h * i, c * a + f * d + i * g)
    off = max(map(abs, (*(x - 1.0 for x in lengths), *angles, *bottom[:3], bottom[3] - 1.0)))
    determinant = a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g)
    if not off < RIGIDITY_TOLERANCE or determinant < 0.0:
        raise ArgumentError(f"{name} is not a rigid transform: wanted [[R, p], [0, 1]] with R a rotation")
    return array


@dataclass(frozen=True)
class Pose:
    """A pose as in URDF's ``<origin>``: translation `xyz` [m] and rotation `rpy` (roll, pitch, yaw) [rad].

    Raises ShapeError if `xyz` or `rpy` does not have three entries.
    """

    xyz: Vector = ZERO
    rpy: Vector = ZERO

    def __post_init__(self) -> None:
        for name, part in (("xyz", self.xyz), ("rpy", self.rpy)):
            if type(part) is not tuple or len(part) != 3:
                from dynx.model.pose_errors import refuse_part

                refuse_part(name, part)

    @classmethod
    def from_matrix(cls, T: ArrayLike, name: str = "T") -> Pose:
        """Return the pose of a homogeneous matrix (4, 4), such as `forward_kinematics` returns, or of a pair
        of a position and a quaternion (x, y, z, w).

        `name` is how errors call it. Raises ArgumentError unless T is a rigid transform to 1e-6.
        """
        array = rigid_matrix(T, name)
        R = array[:3, :3]
        x, y, z = (array[:3, 3] + 0.0).tolist()
        roll, pitch, yaw = (rpy_from_rotation(R) + 0.0).tolist()
        return cls((x, y, z), (roll, pitch, yaw))

    @cached_property
    def matrix(self) -> Floats:
        """Homogeneous matrix (4, 4) of the pose."""
        return homogeneous(rotation_from_rpy(np.array(self.rpy)), np.array(self.xyz))

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> Floats:
        """Return a copy of `matrix`, so that NumPy takes a pose wherever a matrix (4, 4) is taken."""
        return np.array(self.matrix, dtype=dtype)


IDENTITY = Pose()


@dataclass(frozen=True)
class Inertial:
    """Mass [kg], pose of the inertial frame in the link, central inertia tensor in that frame [kg m^2]."""

    mass: float = 0.0
    origin: Pose = Pose()
    ixx: float = 0.0
    ixy: float = 0.0
    ixz: float = 0.0
    iyy: float = 0.0
    iyz: float = 0.0
    izz: float = 0.0
    line: int | None = field(default=None, compare=False)

    @door("dynx.model.replaced_inertials:inertial_from_parameters")
    @classmethod
    def from_parameters(cls, parameters: ArrayLike) -> Inertial:
        """Return the inertial that has ten inertial parameters (10,): m [kg], m cx, m cy, m cz [kg m], Ixx,
        Ixy, Ixz, Iyy, Iyz, Izz [kg m^2].

        First moments and tensor are about the origin of the link frame, in its axes. The order is that of the
        columns of `Backend.inertial_regressor`, and of `dynx.inertial_parameters`. The numbers are used as
        they are, also those that no body has. Raises ArgumentError for first moments without a mass.
        """
        raise NotImplementedError

    @property
    def tensor(self) -> Floats:
        """Inertia tensor (3, 3) about the centre of mass [kg m^2], in the axes of `origin`."""
        return np.array(
            [
                [self.ixx, self.ixy, self.ixz],
                [self.ixy, self.iyy, self.iyz],
                [self.ixz, self.iyz, self.izz],
            ]
        )

    @property
    def link_tensor(self) -> Floats:
        """Inertia tensor (3, 3) about the centre of mass [kg m^2], in the axes of the link."""
        R = self.origin.matrix[:3, :3]
        return np.asarray(R @ self.tensor @ R.T)


@dataclass(frozen=True)
class Link:
    """A rigid link; without `inertial` it has no mass."""

    name: str
    inertial: Inertial | None = None
    line: int | None = field(default=None, compare=False)


@dataclass(frozen=True)
class Limits:
    """Range of a joint position [rad or m], largest speed [rad/s or m/s] and largest effort [N m or N].

    `upper` of a ball joint is its largest angle of rotation [rad], whatever the axis, and `lower` is 0; speed
    and effort are the limits about each axis of the child.
    """

    lower: float = -INFINITY
    upper: float = INFINITY
    velocity: float = INFINITY
    effort: float = INFINITY


@dataclass(frozen=True)
class JointDynamics:
    """Viscous damping, Coulomb friction, armature (reflected rotor inertia) and spring of a joint (see
    `Backend`).

    The torque of the spring is ``-stiffness (q - spring_reference)``; `stiffness` is in N m/rad or N/m,
    `spring_reference` in rad or m. Without a spring both are 0. A ball joint has no spring; its damping,
    friction and armature act about each axis of its child link.
    """

    damping: float = 0.0
    friction: float = 0.0
    armature: float = 0.0
    stiffness: float = 0.0
    spring_reference: float = 0.0

    def __post_init__(self) -> None:
        if isinstance(self.stiffness, float | int) and self.stiffness == 0.0:
            object.__setattr__(self, "spring_reference", 0.0)


class JointSprings(NamedTuple):
    """Springs (..., nv) of the model's coordinates, for any scalar; 0 for a floating base."""

    stiffness: Array
    preload: Array
    """Torque with which the springs pull at position 0 [N m or N]."""
    places: tuple[int, ...] | None = None
    """Index in q of each coordinate, in a robot with ball joints; otherwise they are the last ones of q."""

    def positions(self, q: Array) -> Array:
        """Return the position (..., nv) of each coordinate in q (..., nq), and any number for those without
        stiffness: base and ball joints."""
        if self.places is not None:
            return np.asarray(q[..., list(self.places)])
        return np.asarray(q[..., q.shape[-1] - self.stiffness.shape[-1] :])

    def torque(self, q: Array) -> Array:
        """Return the torque (..., nv) with which the springs pull at q (..., nq)."""
        return np.asarray(self.preload - self.stiffness * self.positions(q))


class JointCoefficients(NamedTuple):
    """Damping, dry friction, armature and springs (..., nv) of the model's coordinates, 0 for a floating
    base."""

    damping: Array
    friction: Array
    armature: Array
    springs: JointSprings | None = None
    """None for a robot without springs."""

    @property
    def present(self) -> bool:
        """True if a coefficient is not 0."""
        return self.springs is not None or any(each.any() for each in self[:3])


@dataclass(frozen=True)
class Mimic:
    """Coupling to another joint: ``value = multiplier * value_of(joint) + offset``."""

    joint: str
    multiplier: float = 1.0
    offset: float = 0.0


@checks_types
@dataclass(frozen=True)
class Joint:
    """A joint from link `parent` to link `child`.

    `origin` is the pose of the joint frame in the frame of the parent, at position 0.

    `axis` is a unit vector in the joint frame; that of a ball joint is the default. `locked_at` is the
    position at which a joint was locked; its type is then ``fixed``, and `origin` includes this position. A
    joint that is ``fixed`` in the description always has the default axis, limits, dynamics and mimic, which
    have no meaning for such a joint.
    """

    name: str
    type: JointType
    parent: str
    child: str
    origin: Pose = Pose()
    axis: Vector = (1.0, 0.0, 0.0)
    limits: Limits = Limits()
    dynamics: JointDynamics = JointDynamics()
    mimic: Mimic | None = None
    locked_at: float | None = None
    line: int | None = field(default=None, compare=False)

    def __post_init__(self) -> None:
        if self.type == "fixed" and self.locked_at is None:
            for each in fields(self):
                if each.name in ("axis", "limits", "dynamics", "mimic"):
                    object.__setattr__(self, each.name, each.default)
        elif self.type == "ball":
            object.__setattr__(self, "axis", (1.0, 0.0, 0.0))
            object.__setattr__(self, "limits", replace(self.limits, lower=0.0))

    @property
    def moves(self) -> bool:
        """True if the joint can move, independently or by following another."""
        return self.type != "fixed"

    @property
    def n_positions(self) -> int:
        """Number of entries of q: 4 of a ball joint, whose position is a unit quaternion (x, y, z, w)."""
        return 4 if self.type == "ball" else int(self.moves)

    @property
    def n_rates(self) -> int:
        """Number of entries of v: 3 of a ball joint, the angular velocity of the child relative to the
        parent, in the axes of the child."""
        return 3 if self.type == "ball" else int(self.moves)

    @property
    def unit(self) -> Literal["rad", "m"]:
        """Unit of the position."""
        return "m" if self.type == "prismatic" else "rad"


@dataclass(frozen=True)
class Frame:
    """A named frame fixed to a link; every link has one with its own name at the identity."""

    name: str
    link: str
    placement: Pose = Pose()


@dataclass(frozen=True)
class Note:
    """A remark on an ambiguity in the description and how it was interpreted."""

    message: str
    line: int | None = None

    def __str__(self) -> str:
        return self.message if self.line is None else f"line {self.line}: {self.message}"


def checked_pose(name: str, pose: Pose | ArrayLike) -> Pose:
    """Return a pose, given as a `Pose`, a matrix (4, 4) or a pair of a position and a quaternion
    (x, y, z, w), with finite floats below `MAX_MAGNITUDE`."""
    if not isinstance(pose, Pose):
        pose = Pose.from_matrix(pose, name)
    xyz, rpy = (checked_vector(f"{part} of {name}", getattr(pose, part)).tolist() for part in ("xyz", "rpy"))
    return Pose(tuple(xyz), tuple(rpy))
