"""Environments for reinforcement learning: one task on every engine, with Gymnasium's interface.

    import gymnasium
    import dynx.envs                                      # registers dynx/CartPole-v0, ...

    env = gymnasium.make("dynx/CartPole-v0", engine="pinocchio")

A task says what is observed, done and rewarded; the engine moves the robot. The page "Environments" of the
documentation shows a task of your own. Needs the extra ``envs``.
"""

from typing import TYPE_CHECKING

from dynx.envs.environment import TaskEnvironment
from dynx.envs.ground_task import GroundState, GroundTask
from dynx.envs.randomization import Randomization
from dynx.envs.registration import make_environment, register_task, register_tasks
from dynx.envs.task import Episode, Episodes, Outcome, RobotTask, State, Task, WorldTask
from dynx.registry import moved_names

__all__ = [
    "Episode",
    "Episodes",
    "GroundState",
    "GroundTask",
    "Outcome",
    "Randomization",
    "RobotTask",
    "State",
    "Task",
    "TaskEnvironment",
    "WorldTask",
    "make_environment",
    "register_task",
]

register_tasks()

# Hidden from type checkers, which would take any name for an attribute.
if not TYPE_CHECKING:
    __getattr__ = moved_names(__name__, {})
