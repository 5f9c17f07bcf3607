"""Stand and walk with a quadruped: joint position targets, in a world with contacts.

Observation, actions and rewards follow the published ones of legged robots (Rudin, Hoeller, Reist and Hutter,
Learning to walk in minutes using massively parallel deep reinforcement learning, 2022): targets about a
standing posture, projected gravity, and a tracked velocity less what costs energy or shakes.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dynx.envs.library import spaces
from dynx.envs.world.scene_task import Episode
from dynx.envs.world.task import WorldTask
from dynx.errors import ArgumentError, shown
from dynx.model import Model
from dynx.model.configuration import MAX_MAGNITUDE, is_real
from dynx.model.loading import load
from dynx.model.rotations import quat_from_rpy
from dynx.spatial.scalar import Floats
from dynx.spatial.so3 import rotation_from_quat
from dynx.world import Camera, Material, PositionMotor, Scene, SceneRobot, ground

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
class Stand(WorldTask):
    """Stand still from a disturbed start.

    Action (12,): angles of the joints from the standing posture, in units of 0.4 rad. Observation (45,):
    linear velocity [m/s] and angular velocity [rad/s] of the trunk and the direction of gravity in its axes,
    angles of the joints from the posture [rad], their velocities [rad/s], and the last action; velocities are
    clipped at 100. Reward: up to 1 for a trunk that is upright, high and at rest, less the power of the
    motors and changes of the action. The episode terminates where the trunk falls.
    ``reset(options={"disturbance": 0.0})`` starts at rest in the posture.
    """

    control_dt = 0.02
    substeps = 5
    max_episode_steps = 500

    @cached_property
    def model(self) -> Model:
        """The A1, with a floating base."""
        return load("a1", base="floating")

    @property
    def observation_size(self) -> int:
        """Number of entries of the observation."""
        return 45

    @cached_property
    def observation_space(self) -> spaces.Box:
        """Velocities, directions, angles and the last action."""
        return spaces.Box(-LARGEST, LARGEST, (self.observation_size,), dtype=np.float32)

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

    def start(self, episode: Episode, disturbance: float = 1.0) -> None:
        """Tilt, turn and push the trunk, and bend the legs, at random in proportion to `disturbance`."""
        if not is_real(disturbance) or not 0.0 <= disturbance <= MAX_DISTURBANCE:
            raise ArgumentError(
                f"disturbance is {shown(disturbance)}; wanted a number from 0 to {MAX_DISTURBANCE:g}"
            )
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
        down = -rotation_from_quat(q[3:7])[2]
        parts = [v[:6], down, q[7:] - POSTURE, v[6:], episode.memory.action]
        return np.concatenate(parts).clip(-LARGEST, LARGEST).astype(np.float32)

    def reward(self, episode: Episode, action: Any) -> float:
        """Return the reward for standing, less the costs of the motion."""
        q, v = episode.world.state.robots[DOG]
        upright = float(rotation_from_quat(q[3:7])[2, 2])
        high = float(np.exp(-((q[2] - STAND_HEIGHT) ** 2) / 0.01))
        still = float(np.exp(-(v[:6] @ v[:6]) / SPEED_WIDTH))
        return max(upright, 0.0) * high * (0.5 + 0.5 * still) - self.costs(episode)

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
        return bool(q[2] < LEAST_HEIGHT or rotation_from_quat(q[3:7])[2, 2] < LEAST_UPRIGHT)

    @cached_property
    def camera(self) -> Camera:
        """A camera beside the robot."""
        return Camera.look_at((1.2, -1.6, 0.8), (0.0, 0.0, 0.25))


@dataclass(frozen=True)
class Walk(Stand):
    """Walk with a velocity that each episode draws.

    Action and observation are those of `Stand`; the observation ends with the wanted velocity (48,): forward
    and to the left [m/s], and the yaw rate [rad/s], in the axes of the trunk. Reward: exp(-error^2 / 0.25) of
    the velocity, half of that of the yaw rate, less vertical motion, roll and pitch rates, a leaning trunk,
    motor power and changes of the action. ``reset(options={"velocity": (0.5, 0.0, 0.0)})`` sets the velocity.
    """

    max_speed: float = 0.6
    """Largest wanted velocity forward [m/s]; to the side a half of it."""
    max_yaw_rate: float = 0.6
    """Largest wanted yaw rate [rad/s]."""

    def __post_init__(self) -> None:
        for name in ("max_speed", "max_yaw_rate"):
            number = getattr(self, name)
            if not is_real(number) or not 0.0 <= number < MAX_MAGNITUDE:
                raise ArgumentError(f"{name} is {shown(number)}; wanted a number of at least 0")

    @property
    def observation_size(self) -> int:
        """Number of entries of the observation."""
        return 48

    def start(
        self, episode: Episode, disturbance: float = 0.2, velocity: tuple[float, float, float] | None = None
    ) -> None:
        """Start near the posture, and draw the wanted velocity unless it is given."""
        super().start(episode, disturbance)
        largest = (self.max_speed, 0.5 * self.max_speed, self.max_yaw_rate)
        drawn = episode.rng.uniform(-1.0, 1.0, 3) * largest
        episode.memory.velocity = checked_velocity(drawn if velocity is None else velocity)

    def observation(self, episode: Episode) -> NDArray[np.float32]:
        """Return the observation of `Stand`, and the wanted velocity."""
        return np.concatenate([super().observation(episode), episode.memory.velocity.astype(np.float32)])

    def reward(self, episode: Episode, action: Any) -> float:
        """Return the reward for the velocity, less the costs of the motion."""
        q, v = episode.world.state.robots[DOG]
        error, turning = v[:2] - episode.memory.velocity[:2], v[5] - episode.memory.velocity[2]
        R = rotation_from_quat(q[3:7])
        tracking = np.exp(-(error @ error) / SPEED_WIDTH) + 0.5 * np.exp(-(turning**2) / SPEED_WIDTH)
        shaking = 2.0 * v[2] ** 2 + 0.05 * (v[3:5] @ v[3:5]) + 0.5 * (R[2, :2] @ R[2, :2])
        return float(tracking - shaking) - self.costs(episode)

    def info(self, episode: Episode) -> dict[str, Any]:
        """Return the wanted ``velocity`` (3,)."""
        return {"velocity": episode.memory.velocity.copy()}


def checked_velocity(velocity: Any) -> Floats:
    """Return a wanted velocity (3,). Raises ArgumentError for anything but three finite numbers."""
    try:
        array = np.array(velocity, dtype=np.float64)
    except (TypeError, ValueError):
        array = np.zeros(0)
    if array.shape != (3,) or not np.isfinite(array).all():
        raise ArgumentError(
            f"velocity is {shown(velocity)}; wanted forward, left [m/s] and yaw rate [rad/s], three numbers"
        )
    return array
