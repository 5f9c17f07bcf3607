"""Recipes by the name of a task, and by its engine and options."""

from __future__ import annotations

from pathlib import Path

import pytest

from dynx.training import Schedule, TaskSpec, TrainingSpec, recipe_of, train
from dynx.training.hyperparameters import ON_FEET, PPO, Recipe
from tests.training.runs import small_run

FEET = {"contacts": "feet"}


def test_environments_on_their_feet_have_a_recipe_of_their_own() -> None:
    walk = "dynx/Walk-v0"
    assert recipe_of("ppo", TaskSpec(walk, "dynx", FEET)) is ON_FEET["ppo"]["Walk"]
    for other in (
        TaskSpec(walk, "dynx"),
        TaskSpec(walk, "mujoco", FEET),
        TaskSpec("dynx/Stand-v0", "dynx", FEET),
    ):
        assert recipe_of("ppo", other) == Recipe()
    assert recipe_of("ppo", walk) == Recipe()
    assert recipe_of("sac", TaskSpec(walk, "dynx", FEET)) == Recipe()
    assert recipe_of("ppo", TaskSpec("dynx/CartPole-v0", "compiled")) is PPO["CartPole"]


@pytest.mark.parametrize("name", sorted(ON_FEET["ppo"]))
def test_recipes_of_environments_on_their_feet_train(name: str, tmp_path: Path) -> None:
    """With few environments: the mini-batches are then smaller."""
    task = TaskSpec(f"dynx/{name}-v0", "dynx", FEET)
    settings = {**recipe_of("ppo", task).hyperparameters, "batch_size": 48}
    spec: TrainingSpec = small_run(192, task=task, envs=8, normalize=True, hyperparameters=settings)
    trained = train(spec, tmp_path, schedule=Schedule(episodes=1, threads=2), final_episodes=1)
    assert trained.policy.steps_done == 192
    assert trained.evaluation.lengths[0] > 0
