"""The tool behind a force-torque sensor: its inertia and the sensor's bias, identified from readings.

A reading is the wrench that the robot exerts on the tool, about the origin of the sensor in its axes, plus
the bias of the sensor, less what acts on the tool from outside:

    reading = A pi + bias - external wrench,

where A is the wrench regressor of the sensor's motion (`dynx.rbd.regressor`) and pi the ten inertial
parameters of the tool, of which at rest four show (Atkeson, An and Hollerbach, Estimation of inertial
parameters of manipulator loads and links, 1986). Readings without contacts give pi and the bias by least
squares.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from dynx.argument_types import checks_types
from dynx.backends import Backend, backend
from dynx.errors import ArgumentError, DTypeError, ShapeError, shown
from dynx.model import Model, Pose
from dynx.model.numbers import checked_entries, checked_vector, is_real, real_array
from dynx.rbd.parameters import Payload
from dynx.rbd.regressor import PARAMETERS, FrameMotion
from dynx.spatial.inertia import inertia_from_parameters
from dynx.spatial.scalar import Floats
from dynx.spatial.so3 import rotate_back, skew

MAX_CONDITION = 1e3
"""Largest condition number of the scaled equations for which a tool is identified: above, errors of 0.1 % of
the readings would be as large as a parameter."""

BIAS = tuple(f"bias of {part} {axis}" for part in ("force", "torque") for axis in "xyz")
STATIC = 4
"""Number of inertial parameters that show at rest: mass and first moment."""

IDENTITY = Pose()


@dataclass(frozen=True, eq=False)
class SensorMotion:
    """Motion of a force-torque sensor at n instants, in its own axes: what an IMU at its origin reads."""

    acceleration: Floats
    """Proper acceleration (n, 3) of the sensor's origin: the acceleration minus gravity [m/s^2]."""
    angular_velocity: Floats
    """Angular velocity (n, 3) [rad/s]."""
    angular_acceleration: Floats
    """Angular acceleration (n, 3) [rad/s^2]."""

    @classmethod
    @checks_types
    def at_rest(
        cls, T_world_sensor: ArrayLike, gravity: tuple[float, float, float] = (0.0, 0.0, -9.81)
    ) -> SensorMotion:
        """Return the motion of a sensor that rests at poses (n, 4, 4), or at one (4, 4), which is n = 1; only
        their rotations count."""
        T = checked_entries("T_world_sensor", real_array("T_world_sensor", T_world_sensor))
        T = T[None] if T.ndim == 2 else T
        if T.ndim != 3 or T.shape[1:] != (4, 4):
            raise ShapeError(f"T_world_sensor has shape {T.shape}; wanted (n, 4, 4), or (4, 4) for n = 1")
        nothing = np.zeros((len(T), 3))
        return cls(-rotate_back(T[:, :3, :3], checked_vector("gravity", gravity)), nothing, nothing)

    @classmethod
    @checks_types
    def of_robot(
        cls,
        robot: Model | Backend,
        frame: str,
        q: ArrayLike,
        v: ArrayLike | None = None,
        a: ArrayLike | None = None,
        *,
        pose: Pose = IDENTITY,
    ) -> SensorMotion:
        """Return the motion of a sensor at `pose` in a frame of a robot, at q (n, nq), v and a (n, nv), which
        are zero where not given. The gravity is the model's."""
        if isinstance(robot, Model):
            with backend("reference", robot) as engine:
                return cls.of_robot(engine, frame, q, v, a, pose=pose)
        model, positions = robot.model, real_array("q", q)
        if positions.ndim != 2:
            raise ShapeError(f"q has shape {positions.shape}; wanted (n, {model.nq})")
        rest = np.zeros((len(positions), model.nv))
        v, a = (rest if each is None else each for each in (v, a))
        point = pose.matrix[:3, 3]
        R = robot.forward_kinematics(positions, frame)[:, :3, :3] @ pose.matrix[:3, :3]
        acceleration = robot.frame_acceleration(positions, v, a, frame, point=point)
        proper = acceleration[:, :3] - np.asarray(model.gravity)
        velocity = robot.frame_velocity(positions, v, frame, point=point)
        return cls(*(rotate_back(R, x) for x in (proper, velocity[:, 3:], acceleration[:, 3:])))

    @property
    def rests(self) -> bool:
        """True if the sensor does not turn at any instant."""
        return not (self.angular_velocity.any() or self.angular_acceleration.any())

    def regressor(self) -> Floats:
        """Return A (n, 6, 10): A pi is the wrench, about the sensor's origin in its axes, that gives a tool
        with the ten inertial parameters pi this motion."""
        at = np.eye(3), np.zeros(3)
        moving = self.acceleration, self.angular_velocity, self.angular_acceleration
        return np.asarray(FrameMotion.of(*at, *moving).wrench)

    def __len__(self) -> int:
        return len(self.acceleration)


@dataclass(frozen=True, eq=False)
class Tool:
    """Tool that a force-torque sensor carries, and the bias of the sensor.

    `identify_tool` returns a tool. If you know the data of the tool, give the first three arguments."""

    mass: float
    """Mass [kg]."""
    center: Floats
    """Centre of mass (3,) in the sensor's frame [m]."""
    inertia: Floats | None = None
    """Inertia (3, 3) about the centre of mass, in the sensor's axes [kg m^2]. None if it was not identified;
    `wrench` and `payload` then use zero."""
    bias: Floats = field(default_factory=lambda: np.zeros(6))
    """Force [N] and torque [N m] (6,) that the sensor reads without any load."""
    condition: float = 1.0
    """Condition number of the scaled equations: errors of readings may grow by this factor."""
    residual: float = 0.0
    """Root mean square of the differences between readings and fit [N, N m]."""

    def __post_init__(self) -> None:
        if not is_real(self.mass):
            raise DTypeError(f"mass of a tool: got {shown(self.mass)}; wanted a number [kg]")
        for name, shape in (("center", (3,)), ("bias", (6,)), ("inertia", (3, 3))):
            if name == "inertia" and self.inertia is None:
                continue
            numbers = checked_entries(name, real_array(name, getattr(self, name)))
            if numbers.shape != shape:
                raise ShapeError(f"{name} of a tool has shape {numbers.shape}; wanted {shape}")
            object.__setattr__(self, name, numbers)

    @checks_types
    def wrench(self, motion: SensorMotion) -> Floats:
        """Return the wrench (n, 6) that the robot exerts on the tool in a motion without contacts."""
        c = skew(self.center)
        tensor = -self.mass * c @ c + (0.0 if self.inertia is None else self.inertia)
        upper = [tensor[i, j] for i, j in ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2))]
        return np.asarray(motion.regressor() @ np.array([self.mass, *(self.mass * self.center), *upper]))

    @checks_types
    def compensate(self, readings: ArrayLike, motion: SensorMotion) -> Floats:
        """Return readings (n, 6) without bias, weight and inertia forces of the tool: the negative of the
        wrench that acts on the tool from outside."""
        return np.asarray(_checked_readings(readings, motion) - self.bias - self.wrench(motion))

    def payload(self, frame: str) -> Payload:
        """Return the tool as a payload of a robot, for `dynx.simulate` and `plant_model`; `frame` is that of
        the sensor."""
        return Payload(frame, self.mass, tuple(self.center.tolist()), self.inertia)

    def __repr__(self) -> str:
        center = ", ".join(f"{x:.4g}" for x in self.center)
        return f"<Tool of {self.mass:.4g} kg at ({center}) m, condition {self.condition:.3g}>"


@checks_types
def identify_tool(
    readings: ArrayLike, motion: SensorMotion, *, bias: bool = True, inertia: bool | None = None
) -> Tool:
    """Return the tool and the bias that explain readings (n, 6) best: force [N], then torque [N m].

    During the readings nothing may touch the tool. At rest, three orientations determine mass, centre and
    bias. The tips of the three vectors of gravity, in the sensor's axes, must not lie on one line.
    `bias=False` assumes a bias of zero. With `inertia=True` the function also identifies the inertia tensor;
    the default is True if the sensor rotates.

    Raises ArgumentError for readings that do not determine the tool (the error names the missing parameters),
    and for a mass that is not positive. A negative mass shows that the readings have the opposite sign.
    """
    rows = _checked_readings(readings, motion)
    tensor = not motion.rests if inertia is None else inertia
    count = len(PARAMETERS) if tensor else STATIC
    A = motion.regressor()[:, :, :count]
    names = [*PARAMETERS[:count], *(BIAS if bias else ())]
    if bias:
        A = np.concatenate([A, np.broadcast_to(np.eye(6), (len(A), 6, 6))], axis=-1)
    A = A.reshape(-1, A.shape[-1])
    scale, sizes, V = _scaled(A, count)
    if len(sizes) < len(scale) or not sizes[-1] * MAX_CONDITION > sizes[0]:
        raise ArgumentError(_lack(motion, names, sizes, V, bias))
    x, *_ = np.linalg.lstsq(A / scale, rows.ravel(), rcond=None)
    x = x / scale
    mass = float(x[0])
    if not mass > 0.0:
        raise ArgumentError(
            f"the readings give a mass of {mass:.4g} kg; wanted the wrench that the robot exerts on the "
            "tool, whose force at rest points upwards"
        )
    center = x[1:STATIC] / mass
    about_center: Floats | None = None
    if tensor:
        c = skew(center)
        full = np.concatenate([x[:count], np.zeros(len(PARAMETERS) - count)])
        about_center = inertia_from_parameters(full).rotational_inertia + mass * c @ c
        # A payload is refused where rounding left its tensor unsymmetric.
        about_center = np.asarray(0.5 * (about_center + about_center.T))
    residual = float(np.sqrt(np.mean((A @ x - rows.ravel()) ** 2)))
    of_sensor = x[count:] if bias else np.zeros(6)
    return Tool(mass, center, about_center, of_sensor, float(sizes[0] / sizes[-1]), residual)


def _checked_readings(readings: ArrayLike, motion: SensorMotion) -> Floats:
    rows = checked_entries("readings", real_array("readings", readings))
    if rows.shape != (len(motion), 6):
        raise ShapeError(f"readings have shape {rows.shape}; wanted ({len(motion)}, 6), as the motion has")
    return rows


def _scaled(A: Floats, count: int) -> tuple[Floats, Floats, Floats]:
    """Return scales of the columns that make mass, first moment, tensor, and both biases alike, and the
    singular values and right singular vectors of the scaled matrix."""
    sizes = np.linalg.norm(A, axis=0)
    groups = [slice(0, 1), slice(1, STATIC), slice(STATIC, count), slice(count, count + 3)]
    groups.append(slice(count + 3, count + 6))
    scale = np.ones(A.shape[1])
    for group in groups:
        scale[group] = max(float(np.max(sizes[group], initial=0.0)), 1e-300)
    # All right singular vectors are needed, those of columns beyond the number of rows too.
    _, values, V = np.linalg.svd(A / scale, full_matrices=len(A) < len(scale))
    return scale, values, V


def _lack(motion: SensorMotion, names: list[str], sizes: Floats, V: Floats, bias: bool) -> str:
    """Return what readings do not determine, and what they lack."""
    shown_directions = int(np.sum(sizes * MAX_CONDITION > sizes.max(initial=0.0)))
    blind = np.linalg.norm(V[shown_directions:], axis=0)
    lost = [name for name, size in zip(names, blind.tolist(), strict=True) if size > 0.05]
    directions = motion.acceleration
    spread = np.linalg.svd(directions - directions.mean(axis=0), compute_uv=False) if bias else None
    if spread is None:
        spread = np.linalg.svd(directions, compute_uv=False)
    gravity = float(np.linalg.norm(directions, axis=1).max(initial=1e-300))
    dimensions = int(np.sum(spread > gravity * np.sqrt(len(directions)) / MAX_CONDITION))
    needs = []
    if dimensions < 2:
        kind = "lie on a line" if bias else "are parallel"
        what = "are one" if dimensions == 0 and bias else kind
        needs.append(
            f"the directions of gravity in its axes {what}; turn it about a horizontal axis, and then about "
            "another"
        )
    if any(name.startswith("I") for name in lost):
        needs.append("it hardly turns about some axes; turn it faster about all three, or give inertia=False")
    where = "; ".join(needs) or "its motion repeats itself"
    return f"{len(directions)} readings do not determine {shown(', '.join(lost))} of the sensor: {where}"
