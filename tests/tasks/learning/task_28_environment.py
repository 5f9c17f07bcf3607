"""A Gymnasium environment of one's own robot."""

import warnings
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
from gymnasium.utils.env_checker import check_env

from tests.tasks.motion import advance, arm_derivative
from tests.tasks.robots import damping, pinocchio_model, two_link_arm
from tests.tasks.student.task_06_picture import tip
from tests.tasks.task import Array, Task, Wrong, numbers, require, require_close, users_module

VISCOUS = 0.5
STEPS = 100
LIMITS = (10.0, 3.0)


def description() -> str:
    """Return an arm with damped joints."""
    return two_link_arm(shoulder=damping(VISCOUS), elbow=damping(VISCOUS))


def users_environment(folder: Path) -> Any:
    """Return what `make_env` of `env.py` returns."""
    module = users_module(folder, "env.py")
    try:
        environment = module.make_env()
    except Exception as error:
        raise Wrong(f"env.py fails: {error!r}") from None
    require(isinstance(environment, gymnasium.Env), "make_env() does not return a gymnasium.Env")
    return environment


def angles(observation: Array) -> Array:
    """Return angles and velocities of an observation."""
    return np.concatenate(
        [np.arctan2(observation[[2, 3]], observation[[0, 1]]), observation[[4, 5]].astype(float)]
    )


def check_steps(environment: Any) -> None:
    """Compare each step of an episode with the equations of motion and with the reward."""
    model = pinocchio_model(description())
    random = np.random.default_rng(28)
    observation = numbers("observation", environment.reset(seed=1)[0], 8)
    for index in range(STEPS):
        action = random.uniform(-1, 1, 2).astype(environment.action_space.dtype)
        torque = np.array(LIMITS) * action.astype(float)
        state = advance(arm_derivative(model, torque, VISCOUS), angles(observation), 0.02, 10)
        before = observation
        observation, reward, terminated, truncated, _ = environment.step(action)
        observation = numbers("observation", observation, 8)
        found = angles(observation)
        error = np.abs(np.angle(np.exp(1j * (found[:2] - state[:2]))))
        require(error.max() < 0.01, f"after step {index + 1} an angle is off by {error.max():.2g} rad")
        require_close(
            f"velocity after step {index + 1}",
            found[2:],
            state[2:],
            0.05 + 0.03 * np.abs(state[2:]).max() + 0 * found[2:],
        )
        require_close("target", observation[6:], before[6:], 1e-6)
        place = tip(found[:2])
        want = -np.hypot(place[0] - observation[6], place[2] - observation[7]) - 0.01 * action @ action
        require_close(f"reward of step {index + 1}", numbers("reward", reward), np.array(want), 2e-3)
        require(not terminated, f"the episode is terminated after step {index + 1}")
        require(bool(truncated) == (index == STEPS - 1), f"truncated is wrong after step {index + 1}")


def check(folder: Path) -> None:
    """Run Gymnasium's checker, then steps against the equations of motion."""
    environment = users_environment(folder)
    space = environment.action_space
    require(
        isinstance(space, gymnasium.spaces.Box) and space.shape == (2,),
        "the action space is not a box of two",
    )
    require(np.all(space.low == -1) and np.all(space.high == 1), "the action space is not [-1, 1]")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            check_env(environment.unwrapped, skip_render_check=True)
    except Exception as error:
        raise Wrong(f"Gymnasium's check_env fails: {error}") from None
    environment = users_environment(folder)
    resets = [numbers("observation", environment.reset(seed=seed)[0], 8) for seed in (3, 3, 4)]
    require(np.array_equal(resets[0], resets[1]), "reset(seed=3) differs from reset(seed=3)")
    require(not np.array_equal(resets[0][6:], resets[2][6:]), "the target does not depend on the seed")
    targets = np.array([environment.reset(seed=seed)[0][6:] for seed in range(20)])
    inside = (targets > [0.2, -0.2]) & (targets < [0.5, 0.4])
    require(bool(inside.all()), "a target lies outside the region")
    check_steps(environment)


TASK = Task(
    "An environment of my own robot",
    f"""
Make a Gymnasium environment of the arm of arm.urdf, for use with any RL library.
- Start: at rest, both angles uniform in +-0.5 rad. Target: (x, z) uniform in x 0.2 to 0.5 m, z -0.2 to 0.4 m.
- Action: two numbers in [-1, 1]; times {LIMITS} N m they are the torques of shoulder and elbow, held
  for 20 ms. Gravity is -9.81 m/s2; the joints have the damping of the file.
- Observation, eight numbers: cosine of both angles, sine of both angles, both velocities [rad/s],
  target x, z.
- Reward after each step: minus the distance in m between the tip (link tip) and the target,
  minus 0.01 times the sum of the squares of the action's two numbers (in [-1, 1]).
- The episode is truncated after {STEPS} steps and never terminated.
The same seed of reset gives the same start and target.

Write env.py with a function make_env() that returns the environment. It finds arm.urdf beside itself,
whatever the working directory. Gymnasium's check_env must accept it.
Angles after a step must be right to 0.01 rad.
""",
    check,
    {"arm.urdf": description},
)
