"""`Quadruped`: what tasks of a walking robot share: joint position targets, in a world with contacts.

Observation, actions and rewards follow the published ones of legged robots (Rudin, Hoeller, Reist and Hutter,
Learning to walk in minutes using massively parallel deep reinforcement learning, 2022): targets about a
standing posture, projected gravity, and a tracked velocity less what costs energy or shakes.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from dynx.envs.ground_task import GroundState, GroundTask
from dynx.envs.library import spaces
from dynx.envs.task import State, camera_at, component_names, refuse_unknown_choice
from dynx.errors import ArgumentError, shown
from dynx.model import Model
from dynx.model.loading import load
from dynx.model.numbers import checked_bool, is_real
from dynx.spatial.scalar import Array
from dynx.spatial.so3 import rotation_from_quat
from dynx.world import Material, Scene, SceneRobot, ground

if TYPE_CHECKING:
    from dynx.steppers.camera import Camera

DOG, GROUND = "dog", "ground"
FEET = ("FR_foot", "FL_foot", "RR_foot", "RL_foot")
CONTACTS = ("all", "feet")
"""Values of the option `contacts`."""
START_HEIGHT, STAND_HEIGHT = 0.3, 0.29
"""Height [m] of the trunk in the posture, with the feet at the ground, and in the middle while it stands."""
POSTURE = (0.0, 0.8, -1.6) * 4
"""Angles [rad] of hip, thigh and calf of the four legs of the A1 while it stands."""
ACTION_SCALE = 0.4
"""Change of a target angle [rad] by an action of 1."""
KP, KD, MAX_TORQUE = 60.0, 2.0, 33.5
"""Gains [N m/rad], [N m s/rad] and limit [N m] of the motors; the limit is that of the A1."""
LEAST_HEIGHT, LEAST_UPRIGHT = 0.16, 0.6
"""Height of the trunk [m], and cosine of its angle from the vertical, below which an episode ends."""
FRICTION = 0.8
MAX_DISTURBANCE = 5.0
"""Largest disturbance of the start, in units of the usual one."""
LARGEST = 100.0
"""Bound of the numbers of an observation."""
SPEED_WIDTH = 0.25
"""Squared error [m^2/s^2] of the velocity at which its reward is 1 / e."""


@dataclass(frozen=True)
class Quadruped(GroundTask):
    """A task of an A1 whose joints follow target angles.

    Action (12,): angles of the joints from the standing posture, in units of 0.4 rad. Observation (45,):
    linear velocity [m/s] and angular velocity [rad/s] of the trunk and the direction of gravity in its axes,
    angles of the joints from the posture [rad], their velocities [rad/s], and the last action; velocities are
    clipped at 100. With `foot_forces` follow the contact forces on the feet, mean over the last control step,
    in the axes of the trunk and in units of the robot's weight (57,). The episode terminates where the trunk
    falls.
    """

    contacts: str = field(default="all", kw_only=True)
    """Links that touch the ground: ``all``, or the ``feet`` alone."""
    foot_forces: bool = field(default=False, kw_only=True)
    """True for observations with the contact forces of the feet."""

    control_dt = 0.02
    substeps = 5
    max_episode_steps = 500
    observation_size: ClassVar[int] = 45
    """Number of entries of the observation without forces."""
    kp = KP
    kd = KD
    max_torque = MAX_TORQUE
    random_size = 34

    def __post_init__(self) -> None:
        refuse_unknown_choice("contacts", self.contacts, CONTACTS)
        checked_bool("foot_forces", self.foot_forces)

    @cached_property
    def model(self) -> Model:
        """The A1, with a floating base."""
        return load("a1", base="floating")

    @cached_property
    def observation_space(self) -> spaces.Box:
        """Velocities, directions, angles and the last action."""
        size = self.observation_size + 3 * len(self.contact_links)
        return spaces.Box(-LARGEST, LARGEST, (size,), dtype=np.float32)

    @property
    def contact_links(self) -> tuple[str, ...]:
        """The feet, if observations have their contact forces."""
        return FEET if self.foot_forces else ()

    @cached_property
    def weight(self) -> float:
        """Weight of the robot [N]."""
        return self.model.total_mass * float(np.linalg.norm(self.model.gravity))

    @property
    def observation_names(self) -> tuple[str, ...]:
        """Names of the entries of the observation."""
        joints = self.model.joint_names
        return (
            *component_names("trunk linear velocity"),
            *component_names("trunk angular velocity"),
            *component_names("gravity direction"),
            *(f"{joint} angle" for joint in joints),
            *(f"{joint} velocity" for joint in joints),
            *(f"{joint} last action" for joint in joints),
            *(name for link in self.contact_links for name in component_names(f"{link} force")),
        )

    @cached_property
    def action_space(self) -> spaces.Box:
        """One number for each joint."""
        return spaces.Box(-1.0, 1.0, (len(POSTURE),), dtype=np.float32)

    def scene(self) -> Scene:
        """Return the robot on a level ground."""
        q = (0.0, 0.0, START_HEIGHT, 0.0, 0.0, 0.0, 1.0, *POSTURE)
        material = Material(friction=FRICTION)
        robot = SceneRobot(DOG, self.model, q=q, material=material)
        passing = () if self.contacts == "all" else self.model.links
        ignored = [(f"{DOG}/{link.name}", GROUND) for link in passing if link.name not in FEET]
        return Scene("quadruped", (robot,), (ground(GROUND, material=material),), ignored=ignored)

    def near_posture(self, random: Array, disturbance: float) -> State:
        """Return a state whose trunk is tilted, turned and pushed, and whose legs are bent, in proportion to
        `disturbance`, from numbers (34,) uniform in [0, 1). The memory has two actions of zero.

        Raises ArgumentError for a disturbance that is no number from 0 to `MAX_DISTURBANCE`.
        """
        self.require_disturbance(disturbance)
        joints, nv = len(POSTURE), self.model.nv
        rpy = disturbance * _between(-0.1, 0.1, random[:3])
        height = START_HEIGHT + disturbance * _between(0.03, 0.06, random[3:4])
        angles = np.array(POSTURE) + disturbance * _between(-0.1, 0.1, random[4 : 4 + joints])
        q = np.concatenate([np.zeros(2), height, _quat_from_rpy(rpy), angles])
        v = disturbance * _between(-0.3, 0.3, random[4 + joints : 4 + joints + nv])
        return State(q, v, np.zeros(2 * joints))

    def targets(self, state: GroundState, action: Array) -> Array:
        """Return the target angles."""
        return target_angles(action)

    def remember(self, state: GroundState, action: Array) -> Array:
        """Return the last two actions, and what follows them."""
        n = len(POSTURE)
        return np.concatenate([action, state.memory[:n], state.memory[2 * n :]])

    def observe(self, state: GroundState) -> Array:
        """Return velocities and gravity in the axes of the trunk, joints, the last action, and foot
        forces."""
        q, v, memory = state
        parts = [v[:6], -vertical_axis(q), q[7:] - np.array(POSTURE), v[6:], memory[: len(POSTURE)]]
        if self.foot_forces:
            parts.append((state.forces @ rotation_from_quat(q[3:7]) / self.weight).ravel())
        return np.asanyarray(np.minimum(np.maximum(np.concatenate(parts), -LARGEST), LARGEST))

    def require_disturbance(self, disturbance: float) -> None:
        """Raise ArgumentError for a disturbance that is no number from 0 to `MAX_DISTURBANCE`."""
        if not is_real(disturbance) or not 0.0 <= disturbance <= MAX_DISTURBANCE:
            raise ArgumentError(
                f"disturbance is {shown(disturbance)}; wanted a number from 0 to {MAX_DISTURBANCE:g}"
            )

    def costs(self, state: GroundState) -> Any:
        """Return the costs of motor power [W] and of changes of the action."""
        q, v, memory = state
        n = len(POSTURE)
        action, action_before = memory[:n], memory[n : 2 * n]
        torque = KP * (target_angles(action) - q[7:]) - KD * v[6:]
        torque = np.minimum(np.maximum(torque, -MAX_TORQUE), MAX_TORQUE)
        change = action - action_before
        return 2e-4 * np.sum(np.abs(torque * v[6:])) + 0.01 * np.sum(change * change)

    def is_over(self, state: GroundState) -> Any:
        """Check whether the trunk is too low, or leans too far."""
        q = state.q
        return (q[2] < LEAST_HEIGHT) | (vertical_axis(q)[2] < LEAST_UPRIGHT)

    @cached_property
    def camera(self) -> Camera:
        """A camera beside the robot."""
        return camera_at((1.2, -1.6, 0.8), (0.0, 0.0, 0.25))


def target_angles(action: Array) -> Array:
    """Return the angles (12,) of an action."""
    return np.array(POSTURE) + ACTION_SCALE * action


def vertical_axis(q: Array) -> Array:
    """Return the upward vertical (3,) in the axes of the trunk."""
    return np.asanyarray(rotation_from_quat(q[3:7])[2])


def with_floor(terms: Mapping[str, Any]) -> dict[str, Any]:
    """Return the terms of a reward that is not below zero, with that which adds to a negative sum."""
    return {**terms, "floor at zero": np.maximum(-sum(terms.values()), 0.0)}


def _between(low: float, high: float, random: Array) -> Array:
    """Return numbers uniform in an interval, from those in [0, 1)."""
    return low + (high - low) * random


def _quat_from_rpy(rpy: Array) -> Array:
    """Return the quaternion (4,) of roll, pitch and yaw."""
    (sr, sp, sy), (cr, cp, cy) = np.sin(0.5 * rpy), np.cos(0.5 * rpy)
    return np.array(
        [
            sr * cp * cy - cr * sp * sy,
            cr * sp * cy + sr * cp * sy,
            cr * cp * sy - sr * sp * cy,
            cr * cp * cy + sr * sp * sy,
        ]
    )
