"""Training of policies by reinforcement learning, with stable-baselines3 (extra ``train``).

`train` runs an algorithm on a task of Gymnasium, such as those of `dynx.envs`, with checkpoints that survive
the end of the process; `load_policy` reads a policy, and `judge` evaluates it, which need NumPy and Gymnasium
alone (extra ``envs``).

    from dynx.training import TaskSpec, TrainingSpec, train
    trained = train(TrainingSpec(TaskSpec("dynx/CartPole-v0", "compiled"), "ppo", 100_000, 8, 0), "run")
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from dynx.registry import moved_names
from dynx.training.environments import make
from dynx.training.evaluation import Evaluation, evaluate
from dynx.training.hyperparameters import recipe_of
from dynx.training.judging import judge
from dynx.training.policy import Policy, load_policy
from dynx.training.specification import TaskSpec, TrainingSpec

if TYPE_CHECKING:
    from dynx.training.learning import Progress, Schedule
    from dynx.training.run import Trained, train
    from dynx.training.unpickling import load_stable_baselines
    from dynx.training.vectors import BatchedEnvironments, make_vector

__all__ = [
    "BatchedEnvironments",
    "Evaluation",
    "Policy",
    "Progress",
    "Schedule",
    "TaskSpec",
    "Trained",
    "TrainingSpec",
    "evaluate",
    "judge",
    "load_policy",
    "load_stable_baselines",
    "make",
    "make_vector",
    "recipe_of",
    "train",
]

_HOME = {
    "BatchedEnvironments": "dynx.training.vectors",
    "Progress": "dynx.training.learning",
    "Schedule": "dynx.training.learning",
    "Trained": "dynx.training.run",
    "load_stable_baselines": "dynx.training.unpickling",
    "make_vector": "dynx.training.vectors",
    "train": "dynx.training.run",
}
"""Modules of names that need stable-baselines3."""

# Hidden from type checkers, which would take any name for an attribute.
if not TYPE_CHECKING:
    __getattr__ = moved_names(__name__, {}, _HOME)
