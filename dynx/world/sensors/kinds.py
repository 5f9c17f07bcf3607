"""The sensors: force and torque, inertial, joint torque, encoder, contact and ray."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from dynx.argument_types import checks_types
from dynx.errors import ArgumentError, UnknownNameError, UnsupportedFeatureError, nearest, shown
from dynx.model import Model, Pose
from dynx.model.elements import IDENTITY, Joint, checked_pose
from dynx.model.numbers import positive_number
from dynx.spatial.scalar import Floats
from dynx.spatial.so3 import cross, rotate, rotate_back
from dynx.steppers.layout import SensorLayout
from dynx.world.sensors.errors import NO_ERRORS, SensorErrors
from dynx.world.sensors.places import SensedParts
from dynx.world.sensors.sensor import AXES, Sensor, SensorChannel

if TYPE_CHECKING:
    from dynx.world.sensors.motion import SensedMotion


@dataclass(frozen=True, kw_only=True)
class PlacedSensor(Sensor):
    """A sensor with a frame of its own, at `pose` in the frame of its part."""

    pose: Pose = IDENTITY

    def __post_init__(self) -> None:
        super().__post_init__()
        object.__setattr__(self, "pose", checked_pose(f"pose of {self}", self.pose))

    def _on_frame(self, robot: str, model: Model, frame: str, joint: Joint | None = None) -> SensorLayout:
        """Return the layout of the sensor on a frame of a robot."""
        found = model.frames[model.frame_index(frame)]
        T = found.placement.matrix @ self.pose.matrix
        return SensorLayout(self.name, self.kind, f"{robot}/{found.link}", T, joint)

    def _on_part(self, parts: SensedParts) -> SensorLayout:
        """Return the layout of the sensor on a link or body."""
        _, robot, name = self.place(parts)
        part = name if robot is None else f"{robot}/{name}"
        return SensorLayout(self.name, self.kind, part, self.pose.matrix)

    def frame(self, T_world_part: Floats) -> tuple[Floats, Floats]:
        """Return the rotations (n, 3, 3) and the origins (n, 3) of the sensor's frame in the world."""
        T = T_world_part @ self.pose.matrix
        return T[:, :3, :3], T[:, :3, 3]


@checks_types
@dataclass(frozen=True, kw_only=True)
class ForceTorqueSensor(PlacedSensor):
    """A sensor of the wrench that a joint transmits, ``force`` [N] and ``torque`` [N m].

    The parent link exerts this wrench on the child link. It is expressed in the axes of the sensor's frame,
    about the origin of this frame. So the sensor of an arm at rest reads a force upwards. `on` names one of

    - a joint, fixed or moving; `pose` is then in the frame of its child link
    - a frame on the child link of a joint; `pose` is then in this frame
    - the root link of a robot with a fixed base; the sensor then reads the wrench of the foundation

    With ``weight=False`` the reading does not contain the weight of the links beyond the joint.
    """

    weight: bool = True
    force: SensorErrors = NO_ERRORS
    torque: SensorErrors = NO_ERRORS

    kind: ClassVar[str] = "force_torque"
    touches: ClassVar[bool] = True
    channels: ClassVar[tuple[SensorChannel, ...]] = (
        SensorChannel("force", "force", AXES, "N"),
        SensorChannel("torque", "torque", AXES, "N m"),
    )

    def require(self, parts: SensedParts) -> None:
        model, name = _robot_part(self, parts)
        self.mounting(model, name)

    def layout(self, parts: SensedParts) -> SensorLayout:
        robot, model, name = _robot_and_part(self, parts)
        number, frame = self.mounting(model, name)
        return self._on_frame(robot, model, frame, None if number is None else model.joints[number])

    def mounting(self, model: Model, name: str) -> tuple[int | None, str]:
        """Return the number of the measured joint (None for the foundation), and the frame in which the
        sensor has its pose."""
        for k, joint in enumerate(model.joints):
            if joint.name == name:
                return k, joint.child
        frame = _frame(self, model, name, "joint or frame")
        link = model.frames[model.frame_index(frame)].link
        number = next((k for k, joint in enumerate(model.joints) if joint.child == link), None)
        if number is None and model.floating:
            raise ArgumentError(f"{self} is on the root of a floating base, which no joint carries")
        return number, frame

    def measure(self, motion: SensedMotion) -> tuple[Floats, ...]:
        robot, name = motion.robot(self.place(motion.parts))
        number, frame = self.mounting(robot.model, name)
        found = robot.transmitted(number)
        if not self.weight:
            found = found - robot.weight(number)
        T = robot.pose(robot.model.root if number is None else robot.model.joints[number].child)
        R, p = self.frame(robot.pose(frame))
        force, moment = rotate(T[:, :3, :3], found[:, :3]), rotate(T[:, :3, :3], found[:, 3:])
        moment = moment + cross(T[:, :3, 3] - p, force)
        return rotate_back(R, force), rotate_back(R, moment)


@checks_types
@dataclass(frozen=True, kw_only=True)
class Imu(PlacedSensor):
    """An inertial measurement unit: specific force ``acceleration`` [m/s^2] and ``angular_velocity`` [rad/s].

    Both quantities are those of the sensor's frame, in its axes. `pose` is the pose of this frame in the
    frame `on` of a robot or body. The specific force is the acceleration of the frame's origin minus gravity:
    at rest 9.81 m/s^2 upwards, in free fall 0 (Groves, Principles of GNSS, inertial and multisensor
    integrated navigation systems, 2013, eq. 2.76).
    """

    accelerometer: SensorErrors = NO_ERRORS
    gyroscope: SensorErrors = NO_ERRORS

    kind: ClassVar[str] = "imu"
    channels: ClassVar[tuple[SensorChannel, ...]] = (
        SensorChannel("acceleration", "accelerometer", AXES, "m/s^2"),
        SensorChannel("angular_velocity", "gyroscope", AXES, "rad/s"),
    )

    def require(self, parts: SensedParts) -> None:
        _, robot, name = self.place(parts)
        if robot is not None:
            _frame(self, parts.robots[robot], name, "frame")

    def layout(self, parts: SensedParts) -> SensorLayout:
        _, robot, name = self.place(parts)
        if robot is None:
            return self._on_part(parts)
        return self._on_frame(robot, parts.robots[robot], name)

    def measure(self, motion: SensedMotion) -> tuple[Floats, ...]:
        T, velocity, acceleration, gravity = motion.frame_motion(self.place(motion.parts))
        R, p = self.frame(T)
        omega, alpha, lever = velocity[:, 3:], acceleration[:, 3:], p - T[:, :3, 3]
        proper = acceleration[:, :3] - gravity
        proper = proper + cross(alpha, lever) + cross(omega, cross(omega, lever))
        return rotate_back(R, proper), rotate_back(R, omega)


@checks_types
@dataclass(frozen=True, kw_only=True)
class JointTorqueSensor(Sensor):
    """A sensor of the ``torque`` that a joint transmits to its child link, along the axis of the joint: [N
    m], or a force [N] for a prismatic joint.

    The sensor is between the gear and the link. Its reading does not contain friction and armature of the
    joint, which act on the other side of the gear. The torque of the motor is `Rollout.tau` or
    `World.torque`.
    """

    torque: SensorErrors = NO_ERRORS

    kind: ClassVar[str] = "joint_torque"
    touches: ClassVar[bool] = True
    channels: ClassVar[tuple[SensorChannel, ...]] = (SensorChannel("torque", "torque", ("",), "N m or N"),)

    def require(self, parts: SensedParts) -> None:
        _moving_joint(self, *_robot_part(self, parts))

    def layout(self, parts: SensedParts) -> SensorLayout:
        return _layout_of_joint(self, parts)

    def measure(self, motion: SensedMotion) -> tuple[Floats, ...]:
        robot, name = motion.robot(self.place(motion.parts))
        joint = _moving_joint(self, robot.model, name)
        wrench = robot.transmitted(robot.model.joints.index(joint))
        part = wrench[:, :3] if joint.type == "prismatic" else wrench[:, 3:]
        return ((part @ np.array(joint.axis))[:, None],)


@checks_types
@dataclass(frozen=True, kw_only=True)
class Encoder(Sensor):
    """An encoder of a joint: ``position`` [rad or m] and ``velocity`` [rad/s or m/s].

    On a mimic joint the encoder reads the mimic joint, not the joint that it follows."""

    position: SensorErrors = NO_ERRORS
    velocity: SensorErrors = NO_ERRORS

    kind: ClassVar[str] = "encoder"
    channels: ClassVar[tuple[SensorChannel, ...]] = (
        SensorChannel("position", "position", ("",), "rad or m"),
        SensorChannel("velocity", "velocity", ("",), "rad/s or m/s"),
    )

    def require(self, parts: SensedParts) -> None:
        _moving_joint(self, *_robot_part(self, parts))

    def layout(self, parts: SensedParts) -> SensorLayout:
        return _layout_of_joint(self, parts)

    def measure(self, motion: SensedMotion) -> tuple[Floats, ...]:
        robot, name = motion.robot(self.place(motion.parts))
        joint = _moving_joint(self, robot.model, name)
        position, velocity = robot.joint_state(joint)
        return position[:, None], velocity[:, None]


@checks_types
@dataclass(frozen=True, kw_only=True)
class ContactSensor(PlacedSensor):
    """A sensor of the sum of the contact forces on a link or body, ``force`` [N] in the axes of the sensor's
    frame."""

    force: SensorErrors = NO_ERRORS

    kind: ClassVar[str] = "contact"
    touches: ClassVar[bool] = True
    channels: ClassVar[tuple[SensorChannel, ...]] = (SensorChannel("force", "force", AXES, "N"),)

    def require(self, parts: SensedParts) -> None:
        _link_or_body(self, parts)

    def layout(self, parts: SensedParts) -> SensorLayout:
        return self._on_part(parts)

    def measure(self, motion: SensedMotion) -> tuple[Floats, ...]:
        place = self.place(motion.parts)
        R, _ = self.frame(motion.pose(place))
        return (rotate_back(R, motion.contact_force(place)),)


@checks_types
@dataclass(frozen=True, kw_only=True)
class RaySensor(PlacedSensor):
    """A sensor of the ``distance`` [m] to the first shape that a ray along the z axis of the sensor's frame
    hits.

    Without a hit within `length` [m] the sensor reads `length`. The sensor is on a link or body, and the ray
    passes through the shapes of this link or body.
    """

    length: float = 10.0
    distance: SensorErrors = NO_ERRORS

    kind: ClassVar[str] = "ray"
    channels: ClassVar[tuple[SensorChannel, ...]] = (SensorChannel("distance", "distance", ("",), "m"),)

    def __post_init__(self) -> None:
        super().__post_init__()
        object.__setattr__(self, "length", positive_number(f"length of {self}", self.length))

    def require(self, parts: SensedParts) -> None:
        _link_or_body(self, parts)

    def layout(self, parts: SensedParts) -> SensorLayout:
        return self._on_part(parts)

    def measure(self, motion: SensedMotion) -> tuple[Floats, ...]:
        place = self.place(motion.parts)
        R, p = self.frame(motion.pose(place))
        found = motion.ray_distances(place, p, R[:, :, 2], self.length)
        return (np.minimum(found, self.length)[:, None],)


KINDS: dict[str, type[Any]] = {
    each.kind: each for each in (ForceTorqueSensor, Imu, JointTorqueSensor, Encoder, ContactSensor, RaySensor)
}
"""Classes of sensors by their names in a document."""


def _robot_and_part(sensor: Sensor, parts: SensedParts) -> tuple[str, Model, str]:
    """Return the robot of a sensor, its model, and the name of the joint or frame; ArgumentError for a sensor
    on a body."""
    _, robot, name = sensor.place(parts)
    if robot is None:
        raise ArgumentError(
            f"{sensor} is on the body {shown(name)}, which no joint carries; wanted a part of a robot (an "
            "Imu, a ContactSensor or a RaySensor can be on a body)"
        )
    return robot, parts.robots[robot], name


def _robot_part(sensor: Sensor, parts: SensedParts) -> tuple[Model, str]:
    return _robot_and_part(sensor, parts)[1:]


def _layout_of_joint(sensor: Sensor, parts: SensedParts) -> SensorLayout:
    """Return the layout of a sensor on a joint that moves."""
    robot, model, name = _robot_and_part(sensor, parts)
    joint = _moving_joint(sensor, model, name)
    return SensorLayout(sensor.name, sensor.kind, f"{robot}/{joint.child}", np.eye(4), joint)


def _link_or_body(sensor: Sensor, parts: SensedParts) -> None:
    _, robot, name = sensor.place(parts)
    if robot is not None:
        links = [link.name for link in parts.robots[robot].links]
        if name not in links:
            raise UnknownNameError(f"{sensor} is on {shown(sensor.on)}; wanted a link{nearest(name, links)}")


def _frame(sensor: Sensor, model: Model, name: str, wanted: str) -> str:
    if name not in model.frame_names:
        known = [*model.frame_names, *(joint.name for joint in model.joints if wanted != "frame")]
        raise UnknownNameError(
            f"{sensor} is on {shown(name)}, which {model.name} does not have; wanted a {wanted}"
            f"{nearest(name, known)}"
        )
    return name


def _moving_joint(sensor: Sensor, model: Model, name: str) -> Joint:
    joints = {joint.name: joint for joint in model.joints if joint.moves}
    if name not in joints:
        fixed = any(joint.name == name for joint in model.joints)
        raise UnknownNameError(
            f"{sensor} is on {shown(name)}, which {'is a fixed joint' if fixed else 'is no joint'} of "
            f"{model.name}; wanted a joint that moves{nearest(name, joints)}"
        )
    if joints[name].type == "ball":
        raise UnsupportedFeatureError(
            f"{sensor} is on {shown(name)}, a ball joint of {model.name}, which has no single position or "
            "axis; a ForceTorqueSensor on it and an Imu on its child measure its wrench and its rotation"
        )
    return joints[name]
