"""What sensors sense: robots at n instants, and in a scene what is around them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from dynx.backends import Backend, backend
from dynx.errors import UnsupportedFeatureError, shown
from dynx.model import Model
from dynx.model.elements import Joint
from dynx.spatial.scalar import Floats
from dynx.spatial.so3 import cross
from dynx.steppers.layout import BodyLayout
from dynx.steppers.state import BodyState
from dynx.world.sensors.places import SensedParts, SensorPlace


@dataclass(frozen=True, eq=False)
class RobotMotion:
    """A robot at n instants: state, acceleration, and the external wrenches, contacts included."""

    model: Model
    q: Floats
    """Configurations (n, nq)."""
    v: Floats
    """Velocities (n, nv)."""
    a: Floats
    """Accelerations (n, nv)."""
    external_forces: Mapping[str, Floats]
    """Wrenches (n, 6) by frames, about the origin of the world in its axes [N, N m]."""
    unknown: str = ""
    """Why what joints transmit is not known."""
    unknown_base: str = ""
    """Why what the foundation transmits is not known."""

    @cached_property
    def _bodies(self) -> Backend:
        return backend("reference", self.model)

    @cached_property
    def _poses(self) -> dict[str, Floats]:
        return {}

    def pose(self, frame: str) -> Floats:
        """Return the poses (n, 4, 4) of a frame in the world."""
        if frame not in self._poses:
            self._poses[frame] = self._bodies.forward_kinematics(self.q, frame)
        return self._poses[frame]

    def velocity(self, frame: str) -> Floats:
        """Return the velocities (n, 6) of a frame, in world axes at its origin."""
        return self._bodies.frame_velocity(self.q, self.v, frame)

    def acceleration(self, frame: str) -> Floats:
        """Return the classical accelerations (n, 6) of a frame, in world axes at its origin."""
        return self._bodies.frame_acceleration(self.q, self.v, self.a, frame)

    def joint_state(self, joint: Joint) -> tuple[Floats, Floats]:
        """Return the position and the velocity (n,) of a joint, also of a mimic joint."""
        if joint.mimic is None:
            in_q, in_v = self.model.position_index(joint.name), self.model.coordinate_index(joint.name)
            return self.q[:, in_q], self.v[:, in_v]
        driver = next(each for each in self.model.joints if each.name == joint.mimic.joint)
        position, velocity = self.joint_state(driver)
        return joint.mimic.multiplier * position + joint.mimic.offset, joint.mimic.multiplier * velocity

    def transmitted(self, joint: int | None) -> Floats:
        """Return the wrenches (n, 6) that a joint transmits to its child, in the frame of the child link;
        for None those of the foundation of a fixed base, in the frame of the root link.

        Raises UnsupportedFeatureError where that is not known.
        """
        unknown = self.unknown_base if joint is None else self.unknown
        if unknown:
            raise UnsupportedFeatureError(unknown)
        return self._base_wrench if joint is None else self._joint_wrenches[:, joint]

    def weight(self, joint: int | None) -> Floats:
        """Return the part (n, 6) of `transmitted` that carries the weight of the links beyond the joint."""
        return self._base_weight if joint is None else self._joint_weights[:, joint]

    @cached_property
    def _joint_wrenches(self) -> Floats:
        return self._bodies.joint_wrenches(
            self.q, self.v, self.a, external_forces=self.external_forces, force_reference="world"
        )

    @cached_property
    def _base_wrench(self) -> Floats:
        return self._bodies.base_wrench(
            self.q, self.v, self.a, external_forces=self.external_forces, force_reference="world"
        )

    @cached_property
    def _joint_weights(self) -> Floats:
        rest = np.zeros_like(self.v)
        return self._bodies.joint_wrenches(self.q, rest, rest)

    @cached_property
    def _base_weight(self) -> Floats:
        rest = np.zeros_like(self.v)
        return self._bodies.base_wrench(self.q, rest, rest)


@dataclass(frozen=True, eq=False)
class SensedBody:
    """A body that no joint carries, at n instants: velocity and acceleration (n, 6) of the origin of its
    frame, linear, then angular, in world axes."""

    velocity: Floats
    acceleration: Floats

    @classmethod
    def of_step(cls, body: BodyLayout, before: BodyState, after: BodyState, h: float) -> SensedBody:
        """Return the motion at the beginning of a step of `h` [s], from the states before and after it.

        The acceleration is that at the beginning of a step of semi-implicit Euler, in which the velocity of
        the centre of mass and the angular velocity change as `MeanAcceleration` has it for robots.
        """
        at, at_next = (state.T_world_body[:3, :3] @ body.center for state in (before, after))
        omega, omega_next = before.twist[3:], after.twist[3:]
        rising = after.twist[:3] + cross(omega_next, at_next) - before.twist[:3] - cross(omega, at)
        alpha = (omega_next - omega) / h
        linear = rising / h - cross(alpha, at) - cross(omega, cross(omega, at))
        return cls(before.twist[None], np.concatenate([linear, alpha])[None])


class SensedFrame(NamedTuple):
    """A frame of a robot or a body at n instants."""

    T: Floats
    """Poses (n, 4, 4) in the world."""
    velocity: Floats
    """Velocities (n, 6) of its origin, linear, then angular, in world axes."""
    acceleration: Floats
    """Classical accelerations (n, 6), likewise."""
    gravity: Floats
    """Gravity (3,) in world axes [m/s^2]."""


class SensedMotion:
    """Robots at the instants `t` (n,) [s], the beginnings of steps of `h` [s]."""

    def __init__(self, t: Floats, h: float, robots: Mapping[str, RobotMotion], alone: str | None) -> None:
        self.t, self.h = t, h
        self.robots = robots
        self.parts = SensedParts({name: robot.model for name, robot in robots.items()}, (), alone)

    def robot(self, place: SensorPlace) -> tuple[RobotMotion, str]:
        """Return the robot of a place, and the name of the joint or frame."""
        if place.robot is None or place.robot not in self.robots:
            raise UnsupportedFeatureError(
                f"{place.sensor} is on {shown(place.robot or place.name)}, whose acceleration is not recorded"
            )
        return self.robots[place.robot], place.name

    def pose(self, place: SensorPlace) -> Floats:
        """Return the poses (n, 4, 4) of a link or body in the world."""
        robot, name = self.robot(place)
        return robot.pose(name)

    def frame_motion(self, place: SensorPlace) -> SensedFrame:
        """Return the motion of a frame of a robot, or of a body; UnsupportedFeatureError where it is not
        recorded."""
        robot, frame = self.robot(place)
        gravity = np.array(robot.model.gravity)
        return SensedFrame(robot.pose(frame), robot.velocity(frame), robot.acceleration(frame), gravity)

    def contact_force(self, place: SensorPlace) -> Floats:
        """Return the sum (n, 3) of the contact forces on a link or body, in world axes [N]."""
        raise place.without_scene

    def ray_distances(self, place: SensorPlace, origins: Floats, directions: Floats, length: float) -> Floats:
        """Return the distances (n,) [m] from the origins (n, 3) along unit directions (n, 3) to what is hit
        first within `length` [m], other than the link or body of the sensor; infinity without a hit."""
        raise place.without_scene
