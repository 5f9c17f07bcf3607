"""Balance a pole on a cart that is pushed left or right: the task of Gymnasium's ``CartPole-v1``.

Barto, Sutton and Anderson 1983: a uniform rod of half length 0.5 m on a cart without friction. The robot is a
model whose dynamics an engine evaluates; its explicit Euler step of 0.02 s is that of Gymnasium.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
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

MAX_POSITION = 2.4
"""Distance of the cart from the middle beyond which an episode ends [m]."""

MAX_ANGLE = 12.0 * 2.0 * math.pi / 360.0
"""Angle of the pole from the vertical beyond which an episode ends [rad]."""

FORCE = 10.0
"""Force on the cart [N]."""

LARGEST = float(np.finfo(np.float32).max)

URDF = """<robot name="cart_pole">
  <link name="rail">
    <visual><geometry><box size="5.2 0.04 0.04"/></geometry>{rail_colour}</visual>
  </link>
  <link name="cart">
    <inertial>
      <mass value="{cart_mass!r}"/>
      <inertia ixx="0.01" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.01"/>
    </inertial>
    <visual><geometry><box size="0.4 0.25 0.2"/></geometry>{cart_colour}</visual>
  </link>
  <link name="pole">
    <inertial>
      <origin xyz="0 0 {half!r}"/>
      <mass value="{pole_mass!r}"/>
      <inertia ixx="{inertia!r}" ixy="0" ixz="0" iyy="{inertia!r}" iyz="0" izz="{axial!r}"/>
    </inertial>
    <visual>
      <origin xyz="0 -0.15 {half!r}"/><geometry><cylinder radius="0.04" length="{length!r}"/></geometry>
      {pole_colour}
    </visual>
  </link>
  <joint name="slide" type="prismatic">
    <parent link="rail"/><child link="cart"/><axis xyz="1 0 0"/>
    <limit lower="-4.8" upper="4.8" velocity="100" effort="10"/>
  </joint>
  <joint name="pivot" type="continuous">
    <parent link="cart"/><child link="pole"/><axis xyz="0 1 0"/>
  </joint>
</robot>"""


@dataclass(frozen=True)
class CartPole(RobotTask):
    """Balance a pole on a cart.

    Actions: 0 pushes to the left, 1 to the right. Observation (4,): position [m] and velocity of the cart,
    angle of the pole from the vertical [rad] and its velocity. Reward: 1 in each step; with
    `sutton_barto_reward` -1 in the step that ends the episode and 0 before. An episode terminates where the
    cart is more than 2.4 m from the middle or the pole leans by more than 12 degrees. ``reset(options={"low":
    -0.1, "high": 0.1})`` changes the bounds of the initial state.
    """

    sutton_barto_reward: bool = False
    cart_mass: float = 1.0
    """Mass of the cart [kg]."""
    pole_mass: float = 0.1
    """Mass of the pole [kg]."""
    half_length: float = 0.5
    """Half of the length of the pole [m]."""

    control_dt = 0.02
    integrator = "euler"
    random_size = 4
    max_episode_steps = 500
    reward_threshold = 475.0

    def __post_init__(self) -> None:
        for name, unit in (("cart_mass", "kg"), ("pole_mass", "kg"), ("half_length", "m")):
            refuse_unphysical(name, getattr(self, name), unit)

    @cached_property
    def model(self) -> Model:
        """Cart and pole; at q = 0 the pole stands upright in the middle of the rail."""
        m, half = float(self.pole_mass), float(self.half_length)
        inertia = m * half**2 / 3.0
        text = URDF.format(
            cart_mass=float(self.cart_mass),
            pole_mass=m,
            half=half,
            length=2.0 * half,
            inertia=inertia,
            axial=1e-3 * inertia,
            rail_colour=painted("dark"),
            cart_colour=painted("blue"),
            pole_colour=painted("orange"),
        )
        model = load(text, gravity=(0.0, 0.0, -9.8))
        slide, pivot = model.joints
        # The rail has no ends, as in Gymnasium; a URDF cannot say that.
        return replace(model, joints=(replace(slide, limits=pivot.limits), pivot))

    @cached_property
    def observation_space(self) -> spaces.Box:
        """Twice the bounds of an episode, as in Gymnasium; velocities are bounded by the largest float32."""
        high = np.array([2.0 * MAX_POSITION, LARGEST, 2.0 * MAX_ANGLE, LARGEST], dtype=np.float32)
        return spaces.Box(-high, high, dtype=np.float32)

    @property
    def observation_names(self) -> tuple[str, ...]:
        """Names of the entries of the observation."""
        return "cart position", "cart velocity", "pole angle", "pole velocity"

    @cached_property
    def action_space(self) -> spaces.Discrete:
        """Left and right."""
        return spaces.Discrete(2)

    def start(self, random: Array, low: float = -0.05, high: float = 0.05) -> State:
        """Return a state with all four numbers uniform in [low, high)."""
        x, x_dot, theta, theta_dot = low + (high - low) * random
        return State(np.stack([x, theta]), np.stack([x_dot, theta_dot]))

    def torque(self, robot: Dynamics, state: State, action: Array) -> Array:
        """Return the force on the cart; the pole has no motor."""
        force = np.where(action == 1.0, FORCE, -FORCE)
        return np.stack([force, 0.0 * force])

    def observation(self, robot: Dynamics, state: State) -> Array:
        """Return position, velocity, angle and angular velocity."""
        (x, theta), (x_dot, theta_dot) = state.q, state.v
        return np.stack([x, x_dot, theta, theta_dot])

    def reward(self, robot: Dynamics, before: State, action: Array, after: State) -> Any:
        """Return 1, or the reward of Sutton and Barto."""
        return np.where(self.terminated(robot, after), -1.0, 0.0) if self.sutton_barto_reward else 1.0

    def terminated(self, robot: Dynamics, state: State) -> Any:
        """Check the bounds of position and angle."""
        x, theta = state.q
        return (np.abs(x) > MAX_POSITION) | (np.abs(theta) > MAX_ANGLE)

    @cached_property
    def camera(self) -> Camera:
        """A camera in front of the rail."""
        return camera_at((0.0, -5.0, 0.8), (0.0, 0.0, 0.3))
