"""`RobotTask`: a task of one robot without contacts, on any backend and compiled."""

from __future__ import annotations

from dynx.backends import backend_names
from dynx.envs.robot.array_task import ArrayTask
from dynx.envs.robot.episodes import RobotEpisodes
from dynx.envs.task import Episodes
from dynx.registry import DEFAULT_ENGINE


class RobotTask(ArrayTask):
    """A task of one robot without contacts, whose dynamics a backend of dynx evaluates.

    `ArrayTask` documents what a task defines.
    """

    @classmethod
    def engines(cls) -> tuple[str, ...]:
        """Return the names of all backends, the default first."""
        return tuple(dict.fromkeys((DEFAULT_ENGINE, *backend_names())))

    def open(self, engine: str) -> Episodes:
        """Return the episodes of this task on a backend."""
        return RobotEpisodes(self, engine)
