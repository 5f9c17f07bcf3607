"""Vector environments of Gymnasium as stable-baselines3 steps them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dynx.envs.environment import DIVERGED
from dynx.envs.library import VectorEnv
from dynx.training.library import VecEnv


class BatchedEnvironments(VecEnv):  # type: ignore[misc]  # stable-baselines3 is not followed
    """A `gymnasium.vector.VectorEnv` with autoreset in the same step, as a `VecEnv`.

    Both reset an environment in the step in which its episode ends and keep the last observation in `info`;
    only the form of `info` differs.
    """

    def __init__(self, vector: VectorEnv[Any, Any, Any]) -> None:
        self._vector = vector
        self.render_mode = vector.render_mode  # asked for by the constructor
        super().__init__(vector.num_envs, vector.single_observation_space, vector.single_action_space)
        self._actions: NDArray[Any] | None = None
        self._first_seed: int | None = None

    def seed(self, seed: int | None = None) -> Sequence[int | None]:
        """Seed the next reset: environment k begins with ``seed + k``."""
        self._first_seed = seed
        return [None if seed is None else seed + k for k in range(self.num_envs)]

    def reset(self) -> NDArray[Any]:
        """Begin an episode in each environment, and return the observations (envs, ...)."""
        observations, _ = self._vector.reset(seed=self._first_seed)
        self._first_seed = None
        self.reset_infos: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        return np.array(observations)

    def step_async(self, actions: NDArray[Any]) -> None:
        """Take the actions of the next step."""
        self._actions = actions

    def step_wait(self) -> tuple[NDArray[Any], NDArray[Any], NDArray[Any], list[dict[str, Any]]]:
        """Step, and return copies of observations, rewards, ends of episodes, and an info of each
        environment."""
        observations, rewards, terminated, truncated, info = self._vector.step(self._actions)
        done = np.logical_or(terminated, truncated)
        infos: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        for k in np.flatnonzero(done):
            infos[k] = {
                "terminal_observation": np.array(info["final_obs"][k]),
                "TimeLimit.truncated": bool(truncated[k] and not terminated[k]),
            }
            why = info["final_info"].get(DIVERGED)
            if why is not None and why[k] is not None:
                infos[k][DIVERGED] = why[k]
        return np.array(observations), np.array(rewards, dtype=np.float32), done, infos

    def close(self) -> None:
        """Close the environments."""
        self._vector.close()

    def get_attr(self, attr_name: str, indices: int | Iterable[int] | None = None) -> list[Any]:
        """Return an attribute of the vector, once for each of the environments."""
        return [getattr(self._vector, attr_name)] * len(self._chosen(indices))

    def set_attr(self, attr_name: str, value: Any, indices: int | Iterable[int] | None = None) -> None:
        """Refuse: the environments share one kernel."""
        raise NotImplementedError("environments in one kernel have no attributes of their own")

    def env_method(
        self,
        method_name: str,
        *method_args: Any,
        indices: int | Iterable[int] | None = None,
        **method_kwargs: Any,
    ) -> list[Any]:
        """Refuse: the environments share one kernel."""
        raise NotImplementedError("environments in one kernel have no methods of their own")

    def env_is_wrapped(
        self, wrapper_class: type[Any], indices: int | Iterable[int] | None = None
    ) -> list[bool]:
        """Return False for each: nothing wraps an environment in a kernel."""
        return [False] * len(self._chosen(indices))

    def _chosen(self, indices: int | Iterable[int] | None) -> list[int]:
        return list(self._get_indices(indices))
