"""Environments side by side, as stable-baselines3 steps them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dynx.argument_types import checks_types
from dynx.envs.environment import DIVERGED
from dynx.envs.ground_task import KERNEL_ENGINE
from dynx.envs.library import AutoresetMode, Env, GymnasiumError, VectorEnv, make_vec_env
from dynx.envs.registration import is_of_dynx, kernel_engine, task_class
from dynx.errors import ArgumentError, DynxError, UnsupportedFeatureError, shown
from dynx.model.numbers import whole_number
from dynx.training.environments import first_line, make
from dynx.training.library import (
    DummyVecEnv,
    Monitor,
    SubprocVecEnv,
    VecEnv,
    VecMonitor,
    VecNormalize,
)
from dynx.training.networks import CLIPPED_AT
from dynx.training.specification import TaskSpec, TrainingSpec

MAX_ENVIRONMENTS = 10**6
"""Largest number of environments side by side."""


@checks_types
def make_vector(task: TaskSpec, envs: int, *, processes: bool = False, threads: int = 1) -> VecEnv:
    """Make `envs` environments of a task for an algorithm of stable-baselines3, ``PPO("MlpPolicy", vector)``.

    On engine ``compiled``, and on ``dynx`` where its kernels have all that the task needs, all step in
    compiled kernels (those with contacts on at most `threads` threads), else one by one, or each in a process
    of its own with `processes`. The return and length of each episode are in ``info["episode"]``. Raises
    ArgumentError for a task that Gymnasium cannot make, and the errors of the task itself.
    """
    count = whole_number("envs", envs, 1, MAX_ENVIRONMENTS)
    if processes:
        return VecMonitor(SubprocVecEnv([partial(_monitored, task) for _ in range(count)]))
    if _steps_in_a_kernel(task):
        try:
            return VecMonitor(BatchedEnvironments(_make_batched(task, count, threads)))
        except UnsupportedFeatureError:
            if task.engine != KERNEL_ENGINE:
                raise
    return DummyVecEnv([partial(_monitored, task) for _ in range(count)])


def make_training_vector(spec: TrainingSpec, threads: int = 1) -> VecEnv:
    """Make the environments of a run; with `normalize` they are wrapped in a `VecNormalize`."""
    vector = make_vector(spec.task, spec.envs, processes=spec.processes, threads=threads)
    if not spec.normalize:
        return vector
    gamma = float(spec.hyperparameters.get("gamma", 0.99))
    return VecNormalize(vector, gamma=gamma, clip_obs=CLIPPED_AT, clip_reward=CLIPPED_AT)


def _steps_in_a_kernel(task: TaskSpec) -> bool:
    return is_of_dynx(task.id) and task.engine == kernel_engine(task_class(task.id))


def _make_batched(task: TaskSpec, count: int, threads: int) -> Any:
    try:
        return make_vec_env(
            task.id,
            num_envs=count,
            vectorization_mode="vector_entry_point",
            autoreset_mode=AutoresetMode.SAME_STEP,
            **{"threads": threads, **task.arguments()},
        )
    except DynxError:
        raise
    except (GymnasiumError, TypeError, ImportError) as error:
        raise ArgumentError(f"{task.name} cannot be made: {first_line(error)}") from error


def _monitored(task: TaskSpec) -> Env[Any, Any]:
    monitored: Env[Any, Any] = Monitor(make(task))
    return monitored


class BatchedEnvironments(VecEnv):  # type: ignore[misc]  # stable-baselines3 is not followed
    """A `gymnasium.vector.VectorEnv`, such as a `dynx.envs.RobotVectorEnvironment`, as a `VecEnv` of
    stable-baselines3.

    Both start the next episode in the step in which one ends (``autoreset_mode="SameStep"``). The info of
    that step has ``terminal_observation`` and ``TimeLimit.truncated``; `reset_infos` has the info of the
    episode that began. After ``seed(s)`` the next `reset` starts environment k with the seed s + k. Options
    of `set_options` are those of all environments.
    """

    def __init__(self, vector: VectorEnv[Any, Any, Any]) -> None:
        """Raises ArgumentError for environments that start their next episode at another time."""
        if not isinstance(vector, VectorEnv):
            raise ArgumentError(
                f"vector is of type {type(vector).__name__}; wanted a gymnasium.vector.VectorEnv, as "
                "gymnasium.make_vec returns it"
            )
        mode = vector.metadata.get("autoreset_mode")
        if mode is not AutoresetMode.SAME_STEP:
            given = mode.value if isinstance(mode, AutoresetMode) else shown(mode)
            raise ArgumentError(
                f"the environments have the autoreset mode {given}; stable-baselines3 needs "
                "gymnasium.make_vec(..., autoreset_mode='SameStep')"
            )
        self._vector = vector
        super().__init__(vector.num_envs, vector.single_observation_space, vector.single_action_space)
        self._actions: NDArray[Any] | None = None

    def reset(self) -> NDArray[Any]:
        """Begin an episode in each environment, and return the observations (envs, ...).

        Raises ArgumentError for options that differ between the environments.
        """
        options = self._options[0]
        if any(each != options for each in self._options):
            raise ArgumentError(
                "set_options has different options; environments in one kernel begin with the same"
            )
        seeds = None if None in self._seeds else self._seeds
        observations, info = self._vector.reset(seed=seeds, options=options or None)
        self._reset_seeds()
        self._reset_options()
        self.reset_infos = [_info_of(info, k) for k in range(self.num_envs)]
        return np.array(observations)

    def step_async(self, actions: NDArray[Any]) -> None:
        """Take the actions of the next step."""
        self._actions = actions

    def step_wait(self) -> tuple[NDArray[Any], NDArray[Any], NDArray[Any], list[dict[str, Any]]]:
        """Step, and return copies of observations, rewards, ends of episodes, and an info of each
        environment."""
        observations, rewards, terminated, truncated, info = self._vector.step(self._actions)
        done = np.logical_or(terminated, truncated)
        begun = {name: value for name, value in info.items() if not name.lstrip("_").startswith("final_")}
        infos: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        for k in np.flatnonzero(_told(begun, self.num_envs) & ~done).tolist():
            infos[k] = _info_of(begun, k)
        for k in np.flatnonzero(done).tolist():
            infos[k] = {
                **_info_of(info["final_info"], k),
                "terminal_observation": np.array(info["final_obs"][k]),
                "TimeLimit.truncated": bool(truncated[k] and not terminated[k]),
            }
            self.reset_infos[k] = _info_of(begun, k)
        return np.array(observations), np.array(rewards, dtype=np.float32), done, infos

    def close(self) -> None:
        """Close the environments."""
        self._vector.close()

    def get_images(self) -> list[NDArray[np.uint8]]:
        """Return the picture of each environment (height, width, 3)."""
        pictures: Any = self._vector.render()
        return list(pictures or ())

    def get_attr(self, attr_name: str, indices: int | Iterable[int] | None = None) -> list[Any]:
        """Return an attribute of each of the environments, or of all together where they share it.

        ``states`` and ``parameters`` are those of each, and its spaces those of one environment.
        """
        value = getattr(self._vector, _OF_ONE.get(attr_name, attr_name))
        if attr_name in _ROWS:
            return [_row(value, k) for k in self._chosen(indices)]
        return [value] * len(self._chosen(indices))

    def set_attr(self, attr_name: str, value: Any, indices: int | Iterable[int] | None = None) -> None:
        """Refuse: the environments share one kernel."""
        raise NotImplementedError(
            f"environments in one kernel have no {attr_name} of their own to set; options of the task are "
            "given as it is made, or drawn for each episode by randomize"
        )

    def env_method(
        self,
        method_name: str,
        *method_args: Any,
        indices: int | Iterable[int] | None = None,
        **method_kwargs: Any,
    ) -> list[Any]:
        """Return what ``render()`` and ``get_wrapper_attr(name)`` of each environment return; refuse other
        methods, since the environments share one kernel."""
        chosen = self._chosen(indices)
        if method_name == "render" and not method_args and not method_kwargs:
            pictures = self.get_images()
            return [pictures[k] for k in chosen]
        if method_name == "get_wrapper_attr" and len(method_args) == 1 and not method_kwargs:
            return self.get_attr(method_args[0], chosen)
        raise NotImplementedError(
            f"environments in one kernel have no method {method_name} of their own; they have render() and "
            "get_wrapper_attr(name)"
        )

    def env_is_wrapped(
        self, wrapper_class: type[Any], indices: int | Iterable[int] | None = None
    ) -> list[bool]:
        """Return False for each: nothing wraps an environment in a kernel."""
        return [False] * len(self._chosen(indices))

    def _chosen(self, indices: int | Iterable[int] | None) -> list[int]:
        return list(self._get_indices(indices))


_ROWS = ("states", "parameters")
"""Attributes of environments in a kernel with a row for each."""

_OF_ONE = {"observation_space": "single_observation_space", "action_space": "single_action_space"}


def _told(info: Mapping[str, Any], count: int) -> NDArray[np.bool_]:
    """Return which environments (count,) have an entry in an info."""
    found = np.zeros(count, dtype=np.bool_)
    for name in info:
        found |= info.get(f"_{name}", False)
    return found


def _info_of(info: Mapping[str, Any], k: int) -> dict[str, Any]:
    """Return the info of one environment: the entries whose mask has it."""
    found = {}
    for name, value in info.items():
        mask = info.get(f"_{name}")
        if mask is not None and mask[k] and (name != DIVERGED or value[k] is not None):
            found[name] = _row(value, k)
    return found


def _row(value: Any, k: int) -> Any:
    """Return the value of one environment, of an array or of a mapping of arrays."""
    if isinstance(value, Mapping):
        return {name: each[k] for name, each in value.items() if not name.startswith("_")}
    return value[k]
