"""A task in a world whose scene is another in each episode."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
from numpy.typing import NDArray

import dynx
from dynx.envs import Episode, WorldTask
from dynx.envs.library import spaces
from dynx.world import ExternalForce, Scene, box, ground

SIDE = 0.5
"""Distance of the stones [m]."""


class Hail(WorldTask):
    """One to three boxes of drawn sizes fall on the ground; the action pushes the first [10 N]."""

    control_dt = 0.02
    max_episode_steps = 50
    action_space = spaces.Box(-1.0, 1.0, (3,), np.float32)
    observation_space = spaces.Box(-np.inf, np.inf, (4,), np.float32)

    def scene(self) -> Scene:
        """Return one stone."""
        return _scene(np.full((1, 3), 0.1))

    def scene_of_episode(self, rng: np.random.Generator, memory: SimpleNamespace) -> Scene:
        """Return the stones of an episode."""
        sizes = rng.uniform(0.05, 0.2, (int(rng.integers(1, 4)), 3))
        memory.stones = len(sizes)
        return _scene(sizes)

    def start(self, episode: Episode) -> None:
        """Turn the first stone."""
        roll = float(episode.rng.uniform(-0.3, 0.3))
        pose = dynx.Pose((0.0, 0.0, 0.3), (roll, 0.0, 0.0))
        episode.world.set_state(bodies={"stone 0": (pose, np.zeros(6))})

    def loads(self, episode: Episode, action: Any) -> dict[str, Any]:
        """Return the push."""
        return {"forces": [ExternalForce("stone 0", (*(10.0 * np.asarray(action, float)), 0.0, 0.0, 0.0))]}

    def observation(self, episode: Episode) -> NDArray[np.float32]:
        """Return the position of the first stone, and how many there are."""
        position = episode.world.state.bodies["stone 0"].position
        return np.array([*position, episode.memory.stones], dtype=np.float32)

    def reward(self, episode: Episode, action: Any) -> float:
        """Return the height of the first stone."""
        return float(episode.world.state.bodies["stone 0"].position[2])


def _scene(sizes: NDArray[np.float64]) -> Scene:
    stones = [
        box(f"stone {k}", tuple(size), mass=1.0, pose=dynx.Pose((SIDE * k, 0.0, 0.5)))
        for k, size in enumerate(sizes.tolist())
    ]
    return Scene("hail", bodies=(ground(), *stones))
