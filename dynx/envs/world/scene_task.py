"""`SceneTask`: what a task in a scene with contacts defines; `Episode`: what its methods are given."""

from __future__ import annotations

import inspect
from abc import abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from types import SimpleNamespace
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from dynx.envs.task import Task
from dynx.errors import UnknownNameError, nearest, shown
from dynx.world import Camera, Scene, World


@dataclass
class Episode:
    """One episode: a world, its random numbers, and what else the task keeps between two steps."""

    world: World
    rng: np.random.Generator
    memory: SimpleNamespace
    """Values of the task's own, as attributes, such as the goal of the episode."""


class SceneTask(Task):
    """A task in a scene with contacts, which an engine steps through `dynx.world.World`.

    The order of calls: `start` sets the state of an episode and its memory. Then for each action `loads`
    says what acts, the world takes a step of `control_dt`, `settle` updates the memory, and `observation`,
    `reward`, `terminated` and `info` read the world and the memory.
    """

    substeps: ClassVar[int] = 1
    """Steps of the engine in a control step."""
    settings: ClassVar[Mapping[str, Mapping[str, Any]]] = {}
    """Options of `World` by engine, such as ``{"pybullet": {"solver_iterations": 50}}``."""

    @abstractmethod
    def scene(self) -> Scene:
        """Return the scene in which episodes start."""

    def scene_of_episode(self, rng: np.random.Generator, memory: SimpleNamespace) -> Scene | None:
        """Return the scene of an episode that differs from the others in more than the state, or None.

        `memory` is that of the episode. A scene is opened in the engine anew, which takes milliseconds;
        without one the world returns to its start.
        """
        return None

    @abstractmethod
    def start(self, episode: Episode) -> None:
        """Set the state of the world, which is at the start of the scene, and the memory.

        Keyword arguments after `episode` are the options of `reset`; they need defaults.
        """

    @abstractmethod
    def loads(self, episode: Episode, action: Any) -> Mapping[str, Any]:
        """Return what acts during a control step, as arguments of `World.step`: ``torques``, ``motors``,
        ``forces``."""

    def settle(self, episode: Episode, action: Any) -> None:
        """Update the memory after a control step; by default it is unchanged."""
        return

    @abstractmethod
    def observation(self, episode: Episode) -> NDArray[Any]:
        """Return the observation, of the observation space's shape and dtype."""

    @abstractmethod
    def reward(self, episode: Episode, action: Any) -> float:
        """Return the reward of a control step."""

    def terminated(self, episode: Episode) -> bool:
        """Check whether the task ended the episode; by default it never does."""
        return False

    def info(self, episode: Episode) -> dict[str, Any]:
        """Return the info of a step; by default it is empty."""
        return {}

    @cached_property
    def camera(self) -> Camera:
        """Camera of the pictures; its size is replaced by that of the environment."""
        return Camera.look_at((1.5, -1.5, 1.0), (0.0, 0.0, 0.2))

    def require_start_options(self, options: Mapping[str, Any]) -> None:
        """Raise UnknownNameError for an option of `reset` that `start` does not take."""
        known = list(inspect.signature(self.start).parameters)[1:]
        for name in options:
            if name not in known:
                kind = type(self).__name__
                raise UnknownNameError(
                    f"{kind} has no option {shown(name)} of reset{nearest(str(name), known)}"
                )
