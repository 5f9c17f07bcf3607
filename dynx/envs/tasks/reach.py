"""Reach: bring a frame of an arm to a random pose, by torque or velocity.

The arm is any robot that `dynx.load` takes. Goals are poses of the frame at configurations drawn within the
limits of the joints, so each can be reached.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from dynx.backends.dynamics import Dynamics
from dynx.envs.library import spaces
from dynx.envs.task import RobotTask, State, camera_at, component_names, refuse_unknown_choice
from dynx.errors import UnsupportedFeatureError
from dynx.model import Model
from dynx.model.configuration import sampling_range
from dynx.model.loading import load
from dynx.rbd.kinematics import ancestry
from dynx.spatial.scalar import Array, Floats
from dynx.spatial.se3 import homogeneous, pose_error

if TYPE_CHECKING:
    from dynx.steppers.camera import Camera

ACTIONS = ("torque", "velocity")

MAX_ACCELERATION = 20.0
"""Acceleration that the largest torque gives a joint alone, without gravity [rad/s^2 or m/s^2]."""

DAMPING_RATE = 2.0
"""Viscous damping of a joint over its inertia [1/s]."""

MAX_SPEED = 1.0
"""Largest velocity that an action asks for [rad/s or m/s]."""

SERVO_RATE = 20.0
"""Rate at which a velocity approaches the one that an action asks for [1/s]."""

START_SPREAD = 0.1
"""Largest distance of a joint from the middle of its range at the start [rad or m]."""

ROTATION_WEIGHT = 0.2
"""Reward for an error of one radian over that for an error of one metre [m/rad]."""

ACTION_WEIGHT = 1e-3
"""Reward for the square of an action."""

LARGEST = float(np.finfo(np.float32).max)


@dataclass(frozen=True)
class Reach(RobotTask):
    """Bring a frame of an arm to a random pose and hold it there.

    Action (nv,) from -1 to 1. With ``actions="torque"``: the torque beyond that of gravity, 1 being the one
    that accelerates the joint alone by 20 rad/s^2 at the neutral configuration, with its armature and against
    its dry friction; joints are damped by 2 /s beside their own damping, and springs are held. With
    ``actions="velocity"``: the velocity, 1 being 1 rad/s or m/s, which the torque of the inverse dynamics
    approaches at a rate of 20 /s; it includes armature, damping, springs and the friction of a joint that
    moves at that velocity.

    Observation (2 nv + 9,): q, v, position of the frame [m], the vector from it to the goal [m], and the
    rotation vector from it to the goal [rad], in world axes. Reward: -(distance [m] + 0.2 angle [rad] + 0.001
    action^2). An episode never terminates. `info` has the ``distance`` [m] and the ``angle`` [rad].
    """

    robot: str = "ur5"
    """What `dynx.load` takes: the name of a robot, or a path."""
    frame: str | None = None
    """Frame that reaches; by default the first that most joints move."""
    actions: str = "torque"

    control_dt = 0.02
    substeps = 5
    max_episode_steps = 200

    def __post_init__(self) -> None:
        refuse_unknown_choice("actions", self.actions, ACTIONS)
        self.model.frame_index(self.tool)

    @cached_property
    def model(self) -> Model:
        """The arm. Raises UnsupportedFeatureError for a robot without joints."""
        model = load(self.robot)
        if not model.nv:
            raise UnsupportedFeatureError(f"{model.name} has no joints, so no frame of it can reach a pose")
        return model

    @cached_property
    def tool(self) -> str:
        """Name of the frame that reaches."""
        if self.frame is not None:
            return self.frame
        mechanism = self.model.mechanism
        joints = [len(ancestry(mechanism, frame.body)) for frame in mechanism.frames]
        return self.model.frame_names[joints.index(max(joints))]

    @property
    def random_size(self) -> int:  # type: ignore[override]  # a property in place of the class's number
        """Two numbers for each coordinate: the start and the goal."""
        return 2 * self.model.nq

    @cached_property
    def observation_space(self) -> spaces.Box:
        """Positions and velocities, bounded by the largest float32."""
        return spaces.Box(-LARGEST, LARGEST, (2 * self.model.nv + 9,), np.float32)

    @property
    def observation_names(self) -> tuple[str, ...]:
        """Names of the entries of the observation."""
        joints = self.model.joint_names
        return (
            *(f"{joint} position" for joint in joints),
            *(f"{joint} velocity" for joint in joints),
            *component_names(f"{self.tool} position"),
            *component_names("vector to the goal"),
            *component_names("rotation error"),
        )

    @cached_property
    def action_space(self) -> spaces.Box:
        """Torques or velocities, relative."""
        return spaces.Box(-1.0, 1.0, (self.model.nv,), np.float32)

    @cached_property
    def _range(self) -> tuple[Floats, Floats]:
        """Range of each coordinate in which goals are drawn."""
        model = self.model
        ranges = [
            sampling_range(float(low), float(high), 1.0 if joint.type == "prismatic" else math.pi)
            for joint, low, high in zip(model.coordinate_joints, model.lower, model.upper, strict=True)
        ]
        low, high = np.array(ranges).T
        return low, high

    @cached_property
    def _arrays(self) -> Dynamics:
        # The other tasks, which are registered with this one, need no compiler.
        from dynx.compiled.array_dynamics import ArrayDynamics

        return ArrayDynamics(self.model)

    @cached_property
    def inertia(self) -> Floats:
        """Inertia of each joint at the neutral configuration."""
        M = np.asarray(self._arrays.mass_matrix(self.model.neutral()), dtype=np.float64)
        return np.array(np.diag(M))

    def start(self, random: Array) -> State:
        """Return a state at rest near the middle of the joints' ranges, and a goal as memory (12,)."""
        (low, high), n = self._range, self.model.nq
        spread = np.minimum(START_SPREAD, 0.5 * (high - low))
        q = 0.5 * (low + high) + spread * (2.0 * random[:n] - 1.0)
        T_world_goal = self._arrays.forward_kinematics(low + (high - low) * random[n:], self.tool)
        return State(q, 0.0 * q, np.concatenate([T_world_goal[:3, 3], T_world_goal[:3, :3].reshape(9)]))

    def torque(self, robot: Dynamics, state: State, action: Array) -> Array:
        """Return the torque of an action."""
        (q, v, _), joints = state, robot.joints
        if self.actions == "torque":
            inertia = self.inertia if joints is None else self.inertia + joints.armature
            push = inertia * (MAX_ACCELERATION * action - DAMPING_RATE * v)
            if joints is not None:
                push = push + joints.friction * action
            tau: Array = robot.gravity_torque(q) + push
        else:
            wanted = MAX_SPEED * action
            a = SERVO_RATE * (wanted - v)
            tau = robot.inverse_dynamics(q, v, a)
            if joints is not None:
                # Damping acts on the velocity at the end of the step.
                damping = joints.damping * (v + self.step_dt * a)
                tau = tau + joints.armature * a + damping + joints.friction * np.sign(wanted)
        return tau if joints is None or joints.springs is None else tau - joints.springs.torque(q)

    def errors(self, robot: Dynamics, state: State) -> tuple[Array, Array, Array]:
        """Return the position of the frame, and the vector and rotation vector to the goal, (3,) each."""
        T = robot.forward_kinematics(state.q, self.tool)
        T_goal = homogeneous(state.memory[3:].reshape(3, 3), state.memory[:3])
        return T[:3, 3], *pose_error(T_goal, T)

    def observation(self, robot: Dynamics, state: State) -> Array:
        """Return q, v, position and errors of the frame."""
        return np.concatenate([state.q, state.v, *self.errors(robot, state)])

    def reward(self, robot: Dynamics, before: State, action: Array, after: State) -> Any:
        """Return the negative sum of errors and effort."""
        _, distance, rotation = self.errors(robot, after)
        lengths = [np.sqrt(np.sum(each * each)) for each in (distance, rotation)]
        return -(lengths[0] + ROTATION_WEIGHT * lengths[1] + ACTION_WEIGHT * np.sum(action * action))

    def reward_terms(
        self, robot: Dynamics, before: State, action: Array, after: State
    ) -> Mapping[str, float]:
        """Return the terms of the distance, the angle and the effort."""
        _, distance, rotation = self.errors(robot, after)
        return {
            "distance": -float(np.linalg.norm(distance)),
            "angle": -ROTATION_WEIGHT * float(np.linalg.norm(rotation)),
            "effort": -ACTION_WEIGHT * float(action @ action),
        }

    def info(self, robot: Dynamics, state: State) -> dict[str, Any]:
        """Return the ``distance`` [m] and the ``angle`` [rad] to the goal."""
        _, distance, rotation = self.errors(robot, state)
        return {"distance": float(np.linalg.norm(distance)), "angle": float(np.linalg.norm(rotation))}

    @cached_property
    def camera(self) -> Camera:
        """A camera that sees the reach of the arm."""
        T = np.asarray(self._arrays.forward_kinematics(0.5 * sum(self._range), self.tool), dtype=np.float64)
        far = 1.0 + float(np.linalg.norm(T[:3, 3]))
        return camera_at((far, -1.6 * far, far), 0.5 * T[:3, 3])
