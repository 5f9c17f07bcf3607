"""`TaskEnvironment`: the Gymnasium environment made of a task and an engine."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dynx.argument_types import checks_types
from dynx.envs.hooks import require_settings
from dynx.envs.library import Env, Space, spaces
from dynx.envs.randomization import Randomization, Variation, first_seed
from dynx.envs.task import Episodes, JointOptions, Outcome, Task, checked_engine
from dynx.errors import (
    ArgumentError,
    ClosedError,
    DivergedError,
    DTypeError,
    EngineError,
    EpisodeError,
    NotFiniteError,
    ShapeError,
    nearest,
    shown,
)
from dynx.model.numbers import checked_seed, whole_number

Act = Callable[[NDArray[Any]], NDArray[Any]]
"""A policy: observations (n, ...) in, actions (n, ...) out."""

RENDER_MODES = ("human", "rgb_array")

DIVERGED = "diverged"
"""Key in `info` of the reason why a step diverged, which truncates its episode."""

MAX_SIDE = 8192
"""Largest width and height of a picture [pixels]."""


class TaskEnvironment(Env[Any, Any]):
    """A task on one engine, with the interface of `gymnasium.Env`.

    ``terminated`` is True if the task ended the episode. ``truncated`` is True if a step diverged, and at the
    time limit that `gymnasium.make` adds (`Task.max_episode_steps`). `render` returns the picture of the
    task's camera (``"rgb_array"``); with ``"human"`` each step is shown in the browser, at most as fast as in
    reality. Not safe for several threads.
    """

    metadata: dict[str, Any] = {"render_modes": list(RENDER_MODES)}  # noqa: RUF012  (declared by `Env`)

    def __init__(
        self,
        task: Task,
        engine: str | None = None,
        render_mode: str | None = None,
        *,
        randomize: Randomization | Mapping[str, Any] | None = None,
        width: int = 480,
        height: int = 360,
        joint_damping: bool = True,
        joint_friction: bool = True,
        joint_armature: bool = True,
        joint_springs: bool = True,
        joint_limits: bool = True,
    ) -> None:
        """`engine` is by default the first of ``task.engines()``; pictures have `width` x `height` pixels.

        Each episode draws the parameters that `randomize` names; ``info["parameters"]`` of `reset` has their
        values. Joints have the joint dynamics and limits of their description, unless one of these options is
        False. Raises ArgumentError for an option that is not valid, NotInstalledError for an engine that is
        not installed, and the errors of `Randomization` and of its parameters.
        """
        if not isinstance(task, Task):
            raise ArgumentError(f"task is of type {type(task).__name__}; wanted a dynx.envs.Task")
        if render_mode is not None and render_mode not in RENDER_MODES:
            raise ArgumentError(f"render_mode is {shown(render_mode)}{nearest(render_mode, RENDER_MODES)}")
        require_settings(task)
        self.task = task
        """The task."""
        self.engine = checked_engine(type(task), engine)
        """Name of the engine."""
        self.render_mode = render_mode
        self.metadata = {**self.metadata, "render_fps": round(1.0 / task.control_dt)}
        self.observation_space = task.observation_space
        self.observation_names = task.observation_names
        """Names of the entries of the observation; empty where the task does not name them."""
        self.action_space = task.action_space
        self._size = (whole_number("width", width, 1, MAX_SIDE), whole_number("height", height, 1, MAX_SIDE))
        self._phase = "before reset"
        self._shown_at = -np.inf
        drawn = None if randomize is None else Randomization.read(randomize)
        joints = JointOptions(joint_damping, joint_friction, joint_armature, joint_springs, joint_limits)
        self._episodes: Episodes | None = task.open(self.engine, joints)
        self._variation: Variation | None = None
        if drawn is not None:
            try:
                motion = self._episodes.vary(drawn)
                self._variation = Variation(
                    drawn, motion, task.observation_space, task.action_space, task.control_dt
                )
            except BaseException:
                self.close()
                raise
        self._seeded_by: np.random.Generator | None = None
        self._last: Any = None

    @property
    def episodes(self) -> Episodes:
        """The episodes of the task on the engine. Raises ClosedError after `close`."""
        if self._episodes is None:
            raise ClosedError("this environment was closed")
        return self._episodes

    @property
    def reward_terms(self) -> Mapping[str, float]:
        """Terms of the reward of the last step by name; empty before it, and where the task names none.

        Raises ClosedError after `close`.
        """
        return self.episodes.reward_terms()

    @checks_types
    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Start an episode; return its first observation, and info.

        Episodes after a `seed` are the same in each run. `options` are the options of the task's method
        `start`, by name. Raises UnknownNameError for an option that the task does not have.
        """
        episodes = self.episodes
        super().reset(seed=None if seed is None else checked_seed("seed", seed))
        if not isinstance(options, Mapping | None):
            raise ArgumentError(f"options is {shown(options)}; wanted a dict of options by name")
        if self._variation is not None:
            if self.np_random is not self._seeded_by:
                self._variation.seed([first_seed(self.np_random_seed, self.np_random)])
                self._seeded_by = self.np_random
            self._variation.start()
            episodes.set_parameters(self._variation.values[0, : self._variation.motion_size].copy())
        observation, info = episodes.start(self.np_random, options or {})
        self._last = observation
        self._phase = "running"
        self._show()
        if self._variation is not None:
            values = {name: float(numbers[0]) for name, numbers in self._variation.by_name().items()}
            observation, info = self._observed(observation), {**info, "parameters": values}
        return observation, info

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        """Act for one control step; return observation, reward, terminated, truncated and info.

        A step that diverges, or that the engine fails to take, truncates the episode: the observation is the
        one before the step, the reward is 0, and ``info["diverged"]`` states the cause. Raises EpisodeError
        before the first `reset` and after the end of an episode, and ArgumentError (and its subclasses) for
        an action that is not in the action space. The episode is unchanged then. Raises ShapeError,
        DTypeError or NotFiniteError for an invalid result of a method of a `RobotTask`; the error names the
        task and the method.
        """
        episodes = self.episodes
        if self._phase != "running":
            raise EpisodeError(
                "step was called before the first reset"
                if self._phase == "before reset"
                else "step was called after the episode ended: call reset"
            )
        given = checked_action(self.action_space, action)
        if self._variation is not None:
            given = self._acting(given)
            if self._variation.pushes is not None:
                episodes.push(self._variation.accelerations()[0])
        truncated = False
        try:
            outcome = episodes.step(given)
        except (DivergedError, EngineError) as error:  # Drake's solver fails where others diverge
            outcome, truncated = Outcome(self._last, 0.0, False, {DIVERGED: str(error)}), True
        else:
            self._last = outcome.observation
        if outcome.terminated or truncated:
            self._phase = "ended"
        self._show()
        observation = outcome.observation
        if self._variation is not None:
            self._variation.count_step()
            observation = self._observed(observation)
        return observation, outcome.reward, outcome.terminated, truncated, outcome.info

    def _acting(self, action: Any) -> Any:
        """Return an action with noise."""
        variation = self._variation
        if variation is None or variation.action_noise is None:
            return action
        noisy = variation.action_noise.added(action.reshape(1, -1), variation.noise_on_actions())
        return noisy.reshape(action.shape)

    def _observed(self, observation: Any) -> Any:
        """Return an observation with noise."""
        variation = self._variation
        if variation is None or variation.observation_noise is None:
            return observation
        noisy = variation.noisy_observations(observation.reshape(1, -1))
        return noisy.reshape(observation.shape).astype(observation.dtype)

    def render(self) -> NDArray[np.uint8] | None:
        """Return the picture of the present state (height, width, 3) in mode ``"rgb_array"``, otherwise None.

        Raises EpisodeError before the first `reset`, ArgumentError for an environment without a render mode.
        """
        episodes = self.episodes
        if self._phase == "before reset":
            raise EpisodeError("render was called before the first reset")
        if self.render_mode is None:
            raise ArgumentError("this environment has no render mode; make it with render_mode='rgb_array'")
        return episodes.picture(*self._size) if self.render_mode == "rgb_array" else None

    def close(self) -> None:
        """Release engine and viewer; further calls raise ClosedError. Closing twice is harmless."""
        if self._episodes is not None:
            self._episodes.close()
            self._episodes = None

    def _show(self) -> None:
        if self.render_mode != "human":
            return
        ahead = self._shown_at + self.task.control_dt - time.perf_counter()
        if ahead > 0.0:
            time.sleep(ahead)
        self.episodes.view()
        self._shown_at = time.perf_counter()


def checked_action(space: Space[Any], action: Any) -> Any:
    """Return an action of one environment: an int for a `Discrete` space, an array of float64 in the space's
    shape for a `Box`.

    A number of a Box beyond the bounds is refused, not clipped. Raises ShapeError, DTypeError, NotFiniteError
    or ArgumentError, each with what was got and what is wanted.
    """
    if isinstance(space, spaces.Discrete):
        return _checked_choice(space, action)
    if isinstance(space, spaces.Box):
        return _checked_numbers(space, action)
    if not space.contains(action):
        raise ArgumentError(f"action is {shown(action)}; wanted an element of {space}")
    return action


def _array_of(action: object) -> Any:
    try:
        return np.asarray(action)
    except ValueError as error:
        raise ShapeError(f"action is ragged, {shown(action)}; wanted rows of one length: {error}") from None


def _checked_choice(space: spaces.Discrete, action: Any) -> int:
    first, last = int(space.start), int(space.start + space.n - 1)
    if type(action) is not int:
        array = _array_of(action)
        if array.dtype.kind not in "iu":
            raise DTypeError(f"action is {shown(action)}; wanted a whole number from {first} to {last}")
        if array.size != 1 or array.ndim > 1:
            raise ShapeError(f"action has shape {array.shape}; wanted one whole number")
        action = int(array.item())
    if not first <= action <= last:
        raise ArgumentError(f"action is {action}; wanted a whole number from {first} to {last}")
    return int(action)


def _checked_numbers(space: spaces.Box, action: Any) -> Any:
    array = _array_of(action)
    if array.dtype.kind not in "fiu":
        raise DTypeError(f"action is {shown(action)}; wanted numbers of shape {space.shape}")
    if array.shape != space.shape:
        raise ShapeError(f"action has shape {array.shape}; wanted {space.shape}")
    # Bounds are of the space's dtype: 0.7 of float64 is within a bound of 0.7 of float32.
    rounded = array.astype(space.dtype)
    inside = (rounded >= space.low) & (rounded <= space.high)
    if not inside.all():
        place = tuple(int(k) for k in np.argwhere(~inside)[0])
        name = f"action[{', '.join(map(str, place))}]"
        value, low, high = (float(each[place]) for each in (array, space.low, space.high))
        if not np.isfinite(value):
            raise NotFiniteError(f"{name} is {value}; wanted numbers from {low:g} to {high:g}")
        raise ArgumentError(f"{name} is {value:g}; wanted numbers from {low:g} to {high:g}")
    return array.astype(np.float64, copy=False)
