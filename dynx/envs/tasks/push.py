"""Push a cube to a goal with the hand of an arm: the task of Fetch and Panda environments, in a world.

Plappert et al., Multi-goal reinforcement learning: challenging robotics environments and request for
research, 2018 (``FetchPush``), with a Franka Panda as in Gallouédec et al., panda-gym, 2021.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dynx.backends import Backend, backend
from dynx.envs.library import spaces
from dynx.envs.task import Episode, WorldTask, camera_at, component_names
from dynx.errors import ArgumentError, nearest, shown
from dynx.model import Model, Pose
from dynx.model.loading import load
from dynx.model.numbers import checked_array
from dynx.registry import DEFAULT_ENGINE
from dynx.spatial.scalar import Floats
from dynx.spatial.so3 import cross
from dynx.world import Material, Scene, SceneRobot, VelocityMotor, box, ground

if TYPE_CHECKING:
    from dynx.steppers.camera import Camera

ARM, CUBE, TABLE = "arm", "cube", "table"
HAND, TIP = ("panda_hand", "panda_leftfinger", "panda_rightfinger"), "panda_hand_tcp"
START = (0.0, 0.24827, 0.0, -2.83596, 0.0, 3.08423, 0.785328)
"""Configuration [rad] with the finger tips at (0.35, 0, 0.03), pointing down."""
TIP_START = (0.35, 0.0, 0.03)
WORKSPACE = ((0.28, -0.35, 0.02), (0.75, 0.35, 0.3))
"""Corners [m] of the box in which the finger tips stay."""
SIZE, MASS, FRICTION = 0.05, 0.3, 0.5
"""Edge [m], mass [kg] and friction of the cube; the friction is also that of the table and of the hand."""
CUBE_AREA = ((0.43, -0.1), (0.57, 0.1))
GOAL_AREA = ((0.4, -0.2), (0.65, 0.2))
"""Corners [m] of the areas in which cube and goal are at the start."""
LEAST_DISTANCE = 0.08
"""Least distance [m] of the goal from the cube at the start."""
NEAR = 0.05
"""Distance [m] from the goal at which the cube is there."""
SPEED = 0.4
"""Speed of the finger tips [m/s] by an action of 1."""
POSE_GAIN = 5.0
"""Rate [1/s] at which an error of the finger tips' pose is removed."""
DAMPING = 1e-3
"""Damping of the least squares for the joint velocities [1]."""
MOTOR_KD = 300.0
"""Torque of the motors to an error of the velocity [N m s/rad]."""
EFFORT = (87.0, 87.0, 87.0, 87.0, 12.0, 12.0, 12.0)
"""Torques of the Panda's motors [N m]."""
DOWN = np.diag([1.0, -1.0, -1.0])
"""Rotation of fingers that point down."""
LARGEST = 100.0
"""Bound of the numbers of an observation."""
REWARDS = ("shaped", "dense", "sparse")
FINGER_WEIGHT = 0.25
"""Reward for a metre from the finger tips to where they push, over that for a metre from cube to goal."""


@dataclass(frozen=True)
class Push(WorldTask):
    """Push a cube on a table to a goal with the closed fingers of a Panda.

    Action (3,): velocity of the finger tips along the axes of the world, in units of 0.4 m/s; the fingers
    keep pointing down and stay in a box above the table. Observation (24,): position and velocity of the
    finger tips; position of the cube, the first two rows of its rotation, its linear and angular velocity
    (clipped at 100); the goal [m, m/s, rad/s]. Reward: minus the distance [m] of the cube from the goal
    (``dense``); that less a quarter of the distance of the finger tips from the side of the cube that is away
    from the goal (``shaped``), because random motions seldom touch the cube, and till then nothing else
    changes; or -1 until it is within 5 cm and 0 there (``sparse``). ``info["is_success"]`` tells whether it
    is. Episodes do not terminate; ``reset(options={"cube": (0.5, 0.0), "goal": (0.6, 0.1)})`` sets the
    places.
    """

    reward_kind: str = "shaped"

    control_dt = 0.05
    substeps = 10
    max_episode_steps = 100

    def __post_init__(self) -> None:
        if self.reward_kind not in REWARDS:
            raise ArgumentError(
                f"reward_kind is {shown(self.reward_kind)}{nearest(str(self.reward_kind), REWARDS)}"
            )

    @cached_property
    def model(self) -> Model:
        """The Panda with closed fingers."""
        return load("panda", lock={"panda_finger_joint1": 0.0})

    @cached_property
    def kinematics(self) -> Backend:
        """The backend that evaluates the pose and the Jacobian of the finger tips."""
        return backend(DEFAULT_ENGINE, self.model, validate=False)

    @cached_property
    def observation_space(self) -> spaces.Box:
        """Positions, velocities and rotations."""
        return spaces.Box(-LARGEST, LARGEST, (24,), dtype=np.float32)

    @property
    def observation_names(self) -> tuple[str, ...]:
        """Names of the entries of the observation."""
        return (
            *component_names("finger tip position"),
            *component_names("finger tip velocity"),
            *component_names("cube position"),
            *component_names("cube rotation", ("xx", "xy", "xz", "yx", "yy", "yz")),
            *component_names("cube linear velocity"),
            *component_names("cube angular velocity"),
            *component_names("goal"),
        )

    @cached_property
    def action_space(self) -> spaces.Box:
        """A velocity."""
        return spaces.Box(-1.0, 1.0, (3,), dtype=np.float32)

    def scene(self) -> Scene:
        """Return the arm, the cube and the table, whose surface is z = 0.

        Of the arm, the hand alone collides: the rest does not reach the table within the workspace.
        """
        material = Material(friction=FRICTION)
        paint = Material(friction=FRICTION, rgba=(0.1, 0.3, 0.8, 1.0))
        cube = box(CUBE, (SIZE,) * 3, mass=MASS, pose=Pose((0.5, 0.0, SIZE / 2)), material=paint)
        arm = SceneRobot(ARM, self.model, q=START, material=material)
        passive = [f"{ARM}/{link.name}" for link in self.model.links if link.name not in HAND]
        groups = {"passive": passive, "others": [CUBE, TABLE]}
        bodies = (cube, ground(TABLE, material=material))
        return Scene("push", (arm,), bodies, ignored=[("passive", "others")], groups=groups)

    def start(self, episode: Episode, cube: ArrayLike | None = None, goal: ArrayLike | None = None) -> None:
        """Draw the places of the cube and of the goal, unless they are given as x and y [m]."""
        rng, memory = episode.rng, episode.memory
        place = rng.uniform(*CUBE_AREA)
        aim = rng.uniform(*GOAL_AREA)
        while np.hypot(*(aim - place)) < LEAST_DISTANCE:
            aim = rng.uniform(*GOAL_AREA)
        if cube is not None:
            place = checked_place("cube", cube)
            if np.hypot(*(place - TIP_START[:2])) < SIZE:
                raise ArgumentError(f"cube is {shown(cube)}, where the fingers are: {TIP_START[:2]}")
        aim = aim if goal is None else checked_place("goal", goal)
        memory.goal = np.array([*aim, SIZE / 2])
        memory.tip = np.array(TIP_START)
        T = np.eye(4)
        T[:3, 3] = *place, SIZE / 2
        episode.world.set_state(bodies={CUBE: (T, np.zeros(6))})

    def loads(self, episode: Episode, action: Any) -> Mapping[str, Any]:
        """Return the motors that move the finger tips with a velocity, and the torque of gravity."""
        memory = episode.memory
        q = episode.world.state.robots[ARM].q
        target = memory.tip + self.control_dt * SPEED * np.asarray(action, dtype=np.float64)
        before, memory.tip = memory.tip, np.clip(target, *WORKSPACE)
        T = self.kinematics.forward_kinematics(q, TIP)
        turn = 0.5 * sum((cross(T[:3, k], DOWN[:, k]) for k in range(3)), start=np.zeros(3))
        linear = (memory.tip - before) / self.control_dt + POSE_GAIN * (before - T[:3, 3])
        J = self.kinematics.jacobian(q, TIP, reference="local_world_aligned")
        twist = np.concatenate([linear, POSE_GAIN * turn])
        rates = J.T @ np.linalg.solve(J @ J.T + DAMPING**2 * np.eye(6), twist)
        motor = VelocityMotor(rates, kd=MOTOR_KD, max_force=EFFORT)
        return {"torques": {ARM: self.kinematics.gravity_torque(q)}, "motors": {ARM: motor}}

    def observation(self, episode: Episode) -> NDArray[np.float32]:
        """Return finger tips, cube and goal."""
        state = episode.world.state
        q, v = state.robots[ARM]
        T, twist = state.bodies[CUBE]
        tip = self.kinematics.forward_kinematics(q, TIP)[:3, 3]
        velocity = (self.kinematics.jacobian(q, TIP, reference="local_world_aligned") @ v)[:3]
        parts = [tip, velocity, T[:3, 3], T[0, :3], T[1, :3], twist, episode.memory.goal]
        return np.concatenate(parts).clip(-LARGEST, LARGEST).astype(np.float32)

    def distance(self, episode: Episode) -> float:
        """Return the distance of the cube from the goal [m]."""
        cube = episode.world.state.bodies[CUBE].position
        return float(np.linalg.norm(cube - episode.memory.goal))

    def reward(self, episode: Episode, action: Any) -> float:
        """Return minus the distances, or -1 where that of the cube is too large."""
        distance = self.distance(episode)
        if self.reward_kind == "sparse":
            return -float(distance > NEAR)
        if self.reward_kind == "dense":
            return -distance
        tip = self.kinematics.forward_kinematics(episode.world.state.robots[ARM].q, TIP)[:3, 3]
        return -distance - FINGER_WEIGHT * float(np.linalg.norm(tip - self.pushing_place(episode)))

    def reward_terms(self, episode: Episode, action: Any) -> Mapping[str, float]:
        """Return the terms of the cube and, for the shaped reward, of the finger tips."""
        total = self.reward(episode, action)
        cube = -self.distance(episode) if self.reward_kind != "sparse" else total
        return {"cube": cube, "finger tips": total - cube}

    def pushing_place(self, episode: Episode) -> Floats:
        """Return the place (3,) [m] of the finger tips from which they push the cube to the goal: an edge's
        length from its center, less where the cube is almost at the goal."""
        cube = episode.world.state.bodies[CUBE].position
        away: Floats = np.asarray(cube - episode.memory.goal)
        return np.asarray(cube + SIZE * away / max(self.distance(episode), NEAR))

    def info(self, episode: Episode) -> dict[str, Any]:
        """Return whether the cube is at the goal."""
        return {"is_success": self.distance(episode) <= NEAR}

    @cached_property
    def camera(self) -> Camera:
        """A camera in front of the table."""
        return camera_at((1.1, -0.7, 0.6), (0.4, 0.0, 0.15))


def checked_place(name: str, place: ArrayLike) -> Floats:
    """Return a place (2,) on the table; ArgumentError (and its subclasses) for one beyond the workspace."""
    xy = checked_array(name, place, 2)
    low, high = (np.array(corner[:2]) for corner in WORKSPACE)
    if xy.ndim != 1 or (xy < low).any() or (xy > high).any():
        raise ArgumentError(f"{name} is {shown(place)}; wanted x and y between {low} and {high} [m]")
    return xy
