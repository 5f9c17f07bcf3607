"""Parts that a robot description states beside links, joints and frames, as data."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from dynx.model.elements import IDENTITY, INFINITY, ZERO, Pose, Vector
from dynx.spatial.scalar import Floats

Polynomial = tuple[float, float, float, float, float]
LINEAR: Polynomial = (0.0, 1.0, 0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Actuator:
    """Actuator of a joint or tendon, as a robot description states it. It acts in no simulation by itself:
    `Model.actuator_forces` computes the torques that you pass on.

    With the command u, and the position q and velocity v of the joint, the force is
    ``f = gain u + bias[0] + bias[1] gear q + bias[2] gear v``, and the effort is ``gear f`` [N m or N], as in
    MuJoCo. MuJoCo limits u to `control_range` and f to `force_range`. `name` may be empty. If the actuator
    acts on a `tendon`, `joint` is empty, and q, v and the effort are those of the tendon: length, velocity
    and tension.
    """

    name: str
    joint: str
    gear: float = 1.0
    gain: float = 1.0
    bias: Vector = ZERO
    control_range: tuple[float, float] = (-INFINITY, INFINITY)
    force_range: tuple[float, float] = (-INFINITY, INFINITY)
    line: int | None = field(default=None, compare=False)
    tendon: str = ""


@dataclass(frozen=True)
class StatedSensor:
    """Sensor of a robot, as its description states it. It is only data: dynx simulates only the sensors of
    scenes and simulations (`dynx.world.sensors`).

    `type` is MuJoCo's name of the type, such as ``"gyro"``. `object` names the object of the sensor, and
    `object_type` the kind of this object: ``"site"`` (a frame of the model), ``"xbody"`` (a link), ``"body"``
    (a link; MuJoCo senses the frame of its inertia), ``"geom"``, ``"joint"``, ``"tendon"``, ``"actuator"``,
    ``"camera"``, or ``""`` for nothing. `reference` and `reference_type` are the second object of a sensor
    with two objects. `cutoff` bounds the absolute value, unless it is 0, and `noise` is a standard deviation,
    both in the unit of the reading. `name` may be empty.
    """

    name: str
    type: str
    object_type: str = ""
    object: str = ""
    reference_type: str = ""
    reference: str = ""
    cutoff: float = 0.0
    noise: float = 0.0
    line: int | None = field(default=None, compare=False)

    @property
    def objects(self) -> tuple[tuple[str, str], ...]:
        """Kind and name of each object."""
        both = (self.object_type, self.object), (self.reference_type, self.reference)
        return tuple(each for each in both if each[0])


@dataclass(frozen=True)
class StatedTendon:
    """Fixed tendon of a robot, as its description states it. It is data: no tendon pulls in dynx.

    `terms` are pairs of a joint and a coefficient. The length of the tendon is the sum of coefficient times
    position of the joint [rad or m], and its velocity follows. The limits `range` are those of the length.
    `spring_length` is a range of lengths without a spring force; it is 0 if `stiffness` is 0. In MuJoCo a
    tendon shorter than this range has the tension ``stiffness (spring_length[0] - length)``, and a longer
    tendon ``stiffness (spring_length[1] - length)``. Damping and dry friction add ``-damping velocity`` and
    `friction` to the tension. The effort of each joint is the coefficient times the tension. `armature` adds
    ``armature coefficient_i coefficient_j`` to the mass matrix. `force_range` bounds the sum of the forces of
    actuators. `name` may be empty.
    """

    name: str
    terms: tuple[tuple[str, float], ...]
    range: tuple[float, float] = (-INFINITY, INFINITY)
    stiffness: float = 0.0
    spring_length: tuple[float, float] = (0.0, 0.0)
    damping: float = 0.0
    friction: float = 0.0
    armature: float = 0.0
    force_range: tuple[float, float] = (-INFINITY, INFINITY)
    line: int | None = field(default=None, compare=False)

    def __post_init__(self) -> None:
        if not self.stiffness:
            object.__setattr__(self, "spring_length", (0.0, 0.0))

    @property
    def joints(self) -> tuple[str, ...]:
        """Names of the joints, in the order of the terms."""
        return tuple(joint for joint, _ in self.terms)


@dataclass(frozen=True)
class StatedEquality:
    """Equality constraint of a robot, as its description states it. It is data: in dynx a loop that it closes
    stays open, and joints that it couples move independently.

    `type` is that of MuJoCo: ``"connect"``, ``"weld"``, ``"joint"`` or ``"tendon"``. `first` and `second`
    name the two objects, and `object_type` their kind: ``"site"`` (frames of the model), ``"xbody"`` (links,
    and ``"world"`` for the world), ``"joint"`` or ``"tendon"``. If the constraint holds one joint or tendon
    alone, `second` is empty.

    `first_pose` is a pose in the first link, `second_pose` a pose in the second link; for frames, both are
    the identity. A ``connect`` makes the origins of both poses coincide, and a ``weld`` the poses themselves.
    `torque_scale` weighs the rotation of a ``weld`` against its translation.

    A coupling of joints or tendons is ``y - references[0] = p(x - references[1])``, with the polynomial p of
    the five coefficients `polynomial`, the constant one first. y and x are the positions [rad or m] of the
    first and the second joint, or the lengths of the tendons. Without a second object, y is constant.

    MuJoCo ignores a constraint that is not `active`. `solref` and `solimp` are its parameters of softness,
    empty for MuJoCo's defaults. `name` may be empty.
    """

    name: str
    type: str
    object_type: str
    first: str
    second: str = ""
    first_pose: Pose = IDENTITY
    second_pose: Pose = IDENTITY
    torque_scale: float = 1.0
    polynomial: Polynomial = LINEAR
    references: tuple[float, float] = (0.0, 0.0)
    active: bool = True
    solref: tuple[float, ...] = ()
    solimp: tuple[float, ...] = ()
    line: int | None = field(default=None, compare=False)

    @cached_property
    def absolute_polynomial(self) -> Floats:
        """Coefficients (5,) of the polynomial p with ``y = p(x)``, without references."""
        y, x = self.references
        moved = np.polynomial.Polynomial(self.polynomial)(np.polynomial.Polynomial([-x, 1.0]))
        found = np.zeros(5)
        found[: len(moved.coef)] = moved.coef
        found[0] += y
        return found

    @property
    def objects(self) -> tuple[str, ...]:
        """Names of what is coupled."""
        return (self.first, self.second) if self.second else (self.first,)


@dataclass(frozen=True)
class StatedGravityCompensation:
    """Gravity compensation of a link, as a robot description states it. It is data: dynx compensates nothing.

    MuJoCo applies the force ``-factor mass gravity`` at the centre of mass of the link. So a link with the
    factor 1 is weightless, and one with a larger factor rises.
    """

    link: str
    factor: float
    line: int | None = field(default=None, compare=False)


@dataclass(frozen=True)
class NamedConfiguration:
    """A configuration that a robot description names, such as a keyframe of MJCF.

    `positions` are the positions of joints by name: one number [rad or m], or the unit quaternion (x, y, z,
    w) of a ball joint. `base` is the pose of a floating base in the world: position [m] and unit quaternion
    (x, y, z, w). Joints without an entry, and a base without a pose, are neutral.
    """

    name: str
    positions: tuple[tuple[str, tuple[float, ...]], ...] = ()
    base: tuple[float, ...] | None = None
    line: int | None = field(default=None, compare=False)
