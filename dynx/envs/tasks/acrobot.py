"""Swing a two-link pendulum above a line by a motor in its elbow: the task of Gymnasium's ``Acrobot-v1``.

Sutton and Barto, Reinforcement Learning, 2018, section 10: links of 1 m and 1 kg with a moment of inertia of
1 kg m^2 about their centres of mass. Gymnasium's default dynamics ("book") are those of this robot. The step
is Runge-Kutta 4 of 0.2 s, after which angles are wrapped and velocities clamped.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from dynx.backends.dynamics import Dynamics
from dynx.envs.library import spaces
from dynx.envs.task import RobotTask, State, camera_at, painted, refuse_unphysical
from dynx.model import Model
from dynx.model.loading import load
from dynx.spatial.scalar import Array

if TYPE_CHECKING:
    from dynx.steppers.camera import Camera

MAX_SPEEDS = np.array([4.0 * math.pi, 9.0 * math.pi])
"""Bounds to which the velocities are clamped [rad/s]."""

LINK = """<link name="{name}">
    <inertial>
      <origin xyz="0 0 -0.5"/>
      <mass value="{mass!r}"/>
      <inertia ixx="{inertia!r}" ixy="0" ixz="0" iyy="{inertia!r}" iyz="0" izz="{inertia!r}"/>
    </inertial>
    <visual>
      <origin xyz="0 {side} -0.5"/><geometry><box size="0.12 0.04 1"/></geometry>{colour}
    </visual>
  </link>"""

URDF = """<robot name="acrobot">
  <link name="bar"><visual><geometry><box size="0.2 0.02 0.2"/></geometry>{colour}</visual></link>
  {upper}
  {lower}
  <link name="tip"/>
  <joint name="shoulder" type="continuous">
    <parent link="bar"/><child link="upper"/><axis xyz="0 1 0"/>
  </joint>
  <joint name="elbow" type="continuous">
    <origin xyz="0 0 -1"/><parent link="upper"/><child link="lower"/><axis xyz="0 1 0"/>
  </joint>
  <joint name="lower_to_tip" type="fixed">
    <origin xyz="0 0 -1"/><parent link="lower"/><child link="tip"/>
  </joint>
</robot>"""


@dataclass(frozen=True)
class Acrobot(RobotTask):
    """Swing the tip of a two-link pendulum 1 m above its bar.

    Actions: 0, 1 and 2 for a torque in the elbow of -1, 0 and 1 N m. Observation (6,): cosine and sine of the
    angle of the upper link from hanging down, of the angle of the elbow, and their velocities [rad/s].
    Reward: -1 in each step, and 0 in the one that reaches the height, which terminates the episode.
    ``reset(options={"low": -0.2, "high": 0.2})`` changes the bounds of the initial state.
    """

    mass: float = 1.0
    """Mass of each link [kg]."""
    inertia: float = 1.0
    """Moment of inertia of each link about its centre of mass [kg m^2]."""

    control_dt = 0.2
    integrator = "rk4"
    random_size = 4
    max_episode_steps = 500
    reward_threshold = -100.0

    def __post_init__(self) -> None:
        refuse_unphysical("mass", self.mass, "kg")
        refuse_unphysical("inertia", self.inertia, "kg m^2")

    @cached_property
    def model(self) -> Model:
        """Two links of 1 m; at q = 0 they hang down."""
        links = {
            name: LINK.format(
                name=name,
                mass=float(self.mass),
                inertia=float(self.inertia),
                side=side,
                colour=painted(paint),
            )
            for name, side, paint in (("upper", -0.05, "blue"), ("lower", -0.1, "orange"))
        }
        return load(URDF.format(**links, colour=painted("dark")), gravity=(0.0, 0.0, -9.8))

    @cached_property
    def observation_space(self) -> spaces.Box:
        """Bounds of cosines, sines and velocities."""
        high = np.array([1.0, 1.0, 1.0, 1.0, *MAX_SPEEDS], dtype=np.float32)
        return spaces.Box(-high, high, dtype=np.float32)

    @property
    def observation_names(self) -> tuple[str, ...]:
        """Names of the entries of the observation."""
        joints = self.model.joint_names
        angles = [f"{function} of the {joint} angle" for joint in joints for function in ("cosine", "sine")]
        return (*angles, *(f"{joint} velocity" for joint in joints))

    @cached_property
    def action_space(self) -> spaces.Discrete:
        """Torques of -1, 0 and 1 N m."""
        return spaces.Discrete(3)

    def start(self, random: Array, low: float = -0.1, high: float = 0.1) -> State:
        """Return a state with all four numbers uniform in [low, high)."""
        numbers = low + (high - low) * random
        return State(numbers[:2], numbers[2:])

    def torque(self, robot: Dynamics, state: State, action: Array) -> Array:
        """Return the torque in the elbow; the shoulder has no motor."""
        return np.stack([0.0 * action, action - 1.0])

    def settle(self, state: State) -> State:
        """Wrap the angles to [-pi, pi] and clamp the velocities."""
        q = state.q
        # In a step of 0.2 s the fastest joint turns by less than two turns.
        for _ in range(2):
            q = np.where(q > math.pi, q - 2.0 * math.pi, np.where(q < -math.pi, q + 2.0 * math.pi, q))
        return State(q, np.clip(state.v, -MAX_SPEEDS, MAX_SPEEDS))

    def observation(self, robot: Dynamics, state: State) -> Array:
        """Return cosines and sines of the angles, and the velocities."""
        (first, second), v = state.q, state.v
        return np.stack([np.cos(first), np.sin(first), np.cos(second), np.sin(second), v[0], v[1]])

    def reward(self, robot: Dynamics, before: State, action: Array, after: State) -> Any:
        """Return 0 at the height, otherwise -1."""
        return np.where(self.terminated(robot, after), 0.0, -1.0)

    def terminated(self, robot: Dynamics, state: State) -> Any:
        """Check whether the tip is more than 1 m above the bar."""
        first, second = state.q
        return -np.cos(first) - np.cos(second + first) > 1.0

    @cached_property
    def camera(self) -> Camera:
        """A camera in front of the bar."""
        return camera_at((0.0, -5.0, 0.0), (0.0, 0.0, 0.0))
