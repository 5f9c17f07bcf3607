"""`Quadruped`: what tasks of a walking robot share: joint position targets, in a world with contacts.

Observation, actions and rewards follow the published ones of legged robots (Rudin, Hoeller, Reist and Hutter,
Learning to walk in minutes using massively parallel deep reinforcement learning, 2022): targets about a
standing posture, projected gravity, and a tracked velocity less what costs energy or shakes.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from dynx.envs.library import spaces
from dynx.envs.task import Episode, WorldTask, camera_at, component_names
from dynx.errors import ArgumentError, shown
from dynx.model import Model
from dynx.model.loading import load
from dynx.model.numbers import is_real
from dynx.model.rotations import quat_from_rpy
from dynx.spatial.plain import Vector3, rotation_rows
from dynx.spatial.scalar import Floats
from dynx.world import Material, PositionMotor, Scene, SceneRobot, ground

if TYPE_CHECKING:
    from dynx.steppers.camera import Camera

DOG, GROUND = "dog", "ground"
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
class Quadruped(WorldTask):
    """A task of an A1 whose joints follow target angles.

    Action (12,): angles of the joints from the standing posture, in units of 0.4 rad. Observation (45,):
    linear velocity [m/s] and angular velocity [rad/s] of the trunk and the direction of gravity in its axes,
    angles of the joints from the posture [rad], their velocities [rad/s], and the last action; velocities are
    clipped at 100. The episode terminates where the trunk falls.
    """

    control_dt = 0.02
    substeps = 5
    max_episode_steps = 500
    observation_size: ClassVar[int] = 45
    """Number of entries of the observation."""

    @cached_property
    def model(self) -> Model:
        """The A1, with a floating base."""
        return load("a1", base="floating")

    @cached_property
    def observation_space(self) -> spaces.Box:
        """Velocities, directions, angles and the last action."""
        return spaces.Box(-LARGEST, LARGEST, (self.observation_size,), dtype=np.float32)

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
        return Scene("quadruped", (robot,), (ground(GROUND, material=material),))

    def start_near_posture(self, episode: Episode, disturbance: float) -> None:
        """Tilt, turn and push the trunk, and bend the legs, at random in proportion to `disturbance`.

        Raises ArgumentError for a disturbance that is no number from 0 to `MAX_DISTURBANCE`.
        """
        self.require_disturbance(disturbance)
        rng, memory = episode.rng, episode.memory
        rpy = disturbance * rng.uniform(-0.1, 0.1, 3)
        height = START_HEIGHT + disturbance * rng.uniform(0.03, 0.06)
        joints = np.array(POSTURE) + disturbance * rng.uniform(-0.1, 0.1, len(POSTURE))
        q = np.concatenate([[0.0, 0.0, height], quat_from_rpy(rpy), joints])
        v = disturbance * rng.uniform(-0.3, 0.3, self.model.nv)
        episode.world.set_state(robots={DOG: (q, v)})
        memory.action = memory.action_before = np.zeros(len(POSTURE))

    def loads(self, episode: Episode, action: Any) -> Mapping[str, Any]:
        """Return motors that hold the target angles."""
        target = np.array(POSTURE) + ACTION_SCALE * np.asarray(action, dtype=np.float64)
        return {"motors": {DOG: PositionMotor(target, kp=KP, kd=KD, max_force=MAX_TORQUE)}}

    def settle(self, episode: Episode, action: Any) -> None:
        """Keep the last two actions."""
        memory = episode.memory
        memory.action_before, memory.action = memory.action, np.asarray(action, dtype=np.float64)

    def observation(self, episode: Episode) -> NDArray[np.float32]:
        """Return velocities and gravity in the axes of the trunk, joints, and the last action."""
        q, v = episode.world.state.robots[DOG]
        down = [-x for x in vertical_axis(q)]
        parts = [v[:6], down, q[7:] - POSTURE, v[6:], episode.memory.action]
        return np.concatenate(parts).clip(-LARGEST, LARGEST).astype(np.float32)

    def require_disturbance(self, disturbance: float) -> None:
        """Raise ArgumentError for a disturbance that is no number from 0 to `MAX_DISTURBANCE`."""
        if not is_real(disturbance) or not 0.0 <= disturbance <= MAX_DISTURBANCE:
            raise ArgumentError(
                f"disturbance is {shown(disturbance)}; wanted a number from 0 to {MAX_DISTURBANCE:g}"
            )

    def costs(self, episode: Episode) -> float:
        """Return the costs of motor power [W] and of changes of the action."""
        memory = episode.memory
        q, v = episode.world.state.robots[DOG]
        target = np.array(POSTURE) + ACTION_SCALE * memory.action
        torque = np.clip(KP * (target - q[7:]) - KD * v[6:], -MAX_TORQUE, MAX_TORQUE)
        change = memory.action - memory.action_before
        return float(2e-4 * np.abs(torque * v[6:]).sum() + 0.01 * change @ change)

    def terminated(self, episode: Episode) -> bool:
        """Check whether the trunk is too low, or leans too far."""
        q = episode.world.state.robots[DOG].q
        return bool(q[2] < LEAST_HEIGHT or vertical_axis(q)[2] < LEAST_UPRIGHT)

    @cached_property
    def camera(self) -> Camera:
        """A camera beside the robot."""
        return camera_at((1.2, -1.6, 0.8), (0.0, 0.0, 0.25))


def vertical_axis(q: Floats) -> Vector3:
    """Return the upward vertical (3,) in the axes of the trunk."""
    return rotation_rows(*q[3:7].tolist())[2]


def with_floor(terms: Mapping[str, float]) -> dict[str, float]:
    """Return the terms of a reward that is not below zero, with that which adds to a negative sum."""
    return {**terms, "floor at zero": max(-sum(terms.values()), 0.0)}
