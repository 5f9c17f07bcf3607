"""Swing a pendulum up and hold it there: the task of Gymnasium's ``Pendulum-v1``.

A uniform rod of length 1 m and mass 1 kg on a motor. The angle is measured from the upright. The step is that
of Gymnasium: semi-implicit, with the velocity clamped before the angle follows it.
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
from dynx.envs.task import RobotTask, State, camera_at, painted, refuse_unknown_choice, refuse_unphysical
from dynx.model import Model
from dynx.model.loading import load
from dynx.rbd.integration import Accelerate
from dynx.spatial.scalar import Array

if TYPE_CHECKING:
    from dynx.steppers.camera import Camera

MAX_SPEED = 8.0
"""Bound to which the velocity is clamped [rad/s]."""

MAX_TORQUE = 2.0
"""Largest torque of the motor [N m]."""

ACTIONS = ("relative", "torque")

URDF = """<robot name="pendulum">
  <link name="stand">
    <visual><geometry><box size="0.1 0.02 0.1"/></geometry>{stand_colour}</visual>
  </link>
  <link name="rod">
    <inertial>
      <origin xyz="0 0 {half!r}"/>
      <mass value="{mass!r}"/>
      <inertia ixx="{inertia!r}" ixy="0" ixz="0" iyy="{inertia!r}" iyz="0" izz="{axial!r}"/>
    </inertial>
    <visual>
      <origin xyz="0 -0.1 {half!r}"/><geometry><box size="0.08 0.04 {length!r}"/></geometry>{rod_colour}
    </visual>
  </link>
  <joint name="hinge" type="continuous">
    <parent link="stand"/><child link="rod"/><axis xyz="0 1 0"/>
  </joint>
</robot>"""


@dataclass(frozen=True)
class Pendulum(RobotTask):
    """Swing a pendulum up and hold it there.

    Action (1,): torque as a share of 2 N m, from -1 to 1; with ``actions="torque"`` the torque itself [N m],
    from -2 to 2, as in Gymnasium. Observation (3,): cosine and sine of the angle from the upright, and its
    velocity [rad/s]. Reward: -(angle^2 + velocity^2 / 10 + torque^2 / 1000) before the step, with the angle
    in [-pi, pi). An episode never terminates. ``reset(options={"x_init": 3.1, "y_init": 1.0})`` bounds the
    initial angle and velocity.
    """

    actions: str = "relative"
    g: float = 10.0
    """Gravity [m/s^2]."""
    mass: float = 1.0
    """Mass of the rod [kg]."""
    length: float = 1.0
    """Length of the rod [m]."""

    control_dt = 0.05
    random_size = 2
    max_episode_steps = 200

    def __post_init__(self) -> None:
        refuse_unknown_choice("actions", self.actions, ACTIONS)
        refuse_unphysical("g", self.g, "m/s^2", zero=True)
        refuse_unphysical("mass", self.mass, "kg")
        refuse_unphysical("length", self.length, "m")

    @cached_property
    def model(self) -> Model:
        """The rod; at q = 0 it stands upright."""
        m, length = float(self.mass), float(self.length)
        inertia = m * length**2 / 12.0
        text = URDF.format(
            mass=m,
            length=length,
            half=0.5 * length,
            inertia=inertia,
            axial=1e-3 * inertia,
            stand_colour=painted("dark"),
            rod_colour=painted("orange"),
        )
        return load(text, gravity=(0.0, 0.0, -float(self.g)))

    @cached_property
    def observation_space(self) -> spaces.Box:
        """Bounds of cosine, sine and velocity."""
        high = np.array([1.0, 1.0, MAX_SPEED], dtype=np.float32)
        return spaces.Box(-high, high, dtype=np.float32)

    @property
    def observation_names(self) -> tuple[str, ...]:
        """Names of the entries of the observation."""
        return "cosine of the angle", "sine of the angle", "velocity"

    @cached_property
    def action_space(self) -> spaces.Box:
        """Torque, relative or in N m."""
        high = MAX_TORQUE if self.actions == "torque" else 1.0
        return spaces.Box(-high, high, (1,), np.float32)

    def start(self, random: Array, x_init: float = math.pi, y_init: float = 1.0) -> State:
        """Return an angle uniform in [-x_init, x_init) and a velocity uniform in [-y_init, y_init)."""
        high = np.array([x_init, y_init])
        angle, velocity = -high + 2.0 * high * random
        return State(np.stack([angle]), np.stack([velocity]))

    def torque(self, robot: Dynamics, state: State, action: Array) -> Array:
        """Return the torque of the motor."""
        return action if self.actions == "torque" else MAX_TORQUE * action

    def advance(self, accelerate: Accelerate, q: Array, v: Array) -> tuple[Array, Array]:
        """Take a semi-implicit step, with the velocity clamped."""
        v = np.clip(v + self.step_dt * accelerate(q, v), -MAX_SPEED, MAX_SPEED)
        return q + self.step_dt * v, v

    def observation(self, robot: Dynamics, state: State) -> Array:
        """Return cosine, sine and velocity."""
        return np.concatenate([np.cos(state.q), np.sin(state.q), state.v])

    def reward(self, robot: Dynamics, before: State, action: Array, after: State) -> Any:
        """Return the negative cost of the state before the step and of the torque."""
        (angle,), (velocity,) = before.q, before.v
        (torque,) = self.torque(robot, before, action)
        # The angle in [-pi, pi) without a remainder: by its sine and cosine.
        wrapped = np.arctan2(np.sin(angle), np.cos(angle))
        return -(wrapped**2 + 0.1 * velocity**2 + 0.001 * torque**2)

    def reward_terms(
        self, robot: Dynamics, before: State, action: Array, after: State
    ) -> Mapping[str, float]:
        """Return the terms of the angle, the velocity and the torque."""
        (angle,), (velocity,) = before.q, before.v
        (torque,) = self.torque(robot, before, action)
        wrapped = math.remainder(float(angle), 2.0 * math.pi)
        return {
            "angle": -(wrapped**2),
            "velocity": -0.1 * float(velocity**2),
            "torque": -0.001 * float(torque**2),
        }

    @cached_property
    def camera(self) -> Camera:
        """A camera in front of the hinge."""
        return camera_at((0.0, -4.0, 0.0), (0.0, 0.0, 0.0))
