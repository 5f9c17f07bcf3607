"""`WorldTask`: a task in a scene with contacts, on any engine that runs worlds."""

from __future__ import annotations

from dynx.envs.task import Episodes
from dynx.envs.world.episodes import WorldEpisodes
from dynx.envs.world.scene_task import SceneTask
from dynx.steppers.registry import world_names

DEFAULT_ENGINE = "pybullet"
"""Engine that runs a task unless another is named."""


class WorldTask(SceneTask):
    """A task in a scene with contacts, which an engine steps as a `dynx.world.World`.

    `SceneTask` documents what a task defines.
    """

    @classmethod
    def engines(cls) -> tuple[str, ...]:
        """Return the names of the engines that run worlds, the default first."""
        return tuple(dict.fromkeys((DEFAULT_ENGINE, *world_names())))

    def open(self, engine: str) -> Episodes:
        """Return the episodes of this task in a world of an engine."""
        return WorldEpisodes(self, engine)
