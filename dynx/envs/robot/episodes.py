"""Episodes of a task of one robot on a backend, in plain Python."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dynx.backends import backend
from dynx.control.dynamics import EngineDynamics
from dynx.envs.library import spaces
from dynx.envs.randomization import Parameter, Randomization
from dynx.envs.robot.array_task import ArrayTask
from dynx.envs.robot.pictures import draw_robot
from dynx.envs.robot.state import State
from dynx.envs.robot.step import ForwardDynamics, control_step
from dynx.envs.robot.varied_robot import RobotVariation, VariedRobot
from dynx.envs.task import Episodes, Outcome
from dynx.errors import DivergedError, ShapeError
from dynx.model.numbers import DIVERGENCE_SPEED
from dynx.spatial.scalar import Array, Floats


class RobotEpisodes(Episodes):
    """Episodes of a task of one robot, whose dynamics a backend evaluates."""

    def __init__(self, task: ArrayTask, engine: str) -> None:
        self._task = task
        self._backend = backend(engine, task.model, validate=False)
        self._robot = EngineDynamics(self._backend)
        self._forward: ForwardDynamics = self._robot.forward_dynamics
        self._variation: RobotVariation | None = None
        self._discrete = isinstance(task.action_space, spaces.Discrete)
        self._dtype, self._shape = task.observation_space.dtype, task.observation_space.shape
        self._viewer: Any = None
        self._steps = 0

    def vary(self, randomization: Randomization) -> tuple[Parameter, ...]:
        """Return the parameters of this robot that episodes draw."""
        self._variation = RobotVariation(VariedRobot(self._task, randomization), self._backend)
        return self._variation.robot.parameters

    def set_parameters(self, values: Floats) -> None:
        """Give the robot of the next episode the values (k,) of the parameters that `vary` returned."""
        assert self._variation is not None, "vary was not called"
        self._forward = self._variation.forward_dynamics(values)

    @property
    def state(self) -> State:
        """The present state."""
        return self._state

    @state.setter
    def state(self, state: State) -> None:
        self._state = State(*(np.array(each, dtype=np.float64) for each in state))

    def start(self, rng: np.random.Generator, options: Mapping[str, Any]) -> tuple[Any, dict[str, Any]]:
        self._task.require_start_options(options)
        self.state = self._task.start(rng.random(self._task.random_size), **options)
        self._steps = 0
        return self._observation(), self._task.info(self._robot, self._state)

    def step(self, action: Any) -> Outcome:
        task, robot, before = self._task, self._robot, self._state
        given = np.asarray(float(action) if self._discrete else action, dtype=np.float64)
        if self._variation is None:
            actions: Sequence[Array] = [given] * task.substeps
        else:
            actions = self._variation.acting_actions(given, first=self._steps == 0)
        moved = control_step(task, robot, self._forward, before, actions)
        self._steps += 1
        self._refuse_divergence(moved.q, moved.v)
        after = self._state = task.settle(moved)
        reward = float(task.reward(robot, before, given, after))
        terminated = bool(task.terminated(robot, after))
        return Outcome(self._observation(), reward, terminated, task.info(robot, after))

    def _observation(self) -> Array:
        observation = np.array(self._task.observation(self._robot, self._state), dtype=self._dtype)
        if observation.shape != self._shape:
            raise ShapeError(
                f"the observation of {type(self._task).__name__} has shape {observation.shape}; "
                f"its observation space has {self._shape}"
            )
        return observation

    def _refuse_divergence(self, q: Floats, v: Floats) -> None:
        if not v @ v < DIVERGENCE_SPEED**2:
            dt = self._task.control_dt
            raise DivergedError(
                f"the velocity after step {self._steps} ({self._steps * dt:.6g} s) is not finite or beyond "
                f"{DIVERGENCE_SPEED:g}; smaller steps (substeps) or actions may help",
                time=self._steps * dt,
                step=self._steps,
                state=(q, v),
            )

    def picture(self, width: int, height: int) -> NDArray[np.uint8]:
        """Draw the robot by rays through the shapes of its description."""
        return draw_robot(self._task, self._state, width, height)

    def view(self) -> None:
        """Show the robot in the browser."""
        if self._viewer is None:
            self._viewer = self._task.model.view(q=self._state.q)
            print(f"{type(self._task).__name__} is shown at {self._viewer.url}", flush=True)
        self._viewer.view.put(self._state.q)

    def close(self) -> None:
        if self._variation is not None:
            self._variation.close()
        self._backend.close()
        if self._viewer is not None:
            self._viewer.close()
            self._viewer = None
