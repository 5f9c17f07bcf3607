"""Published hyperparameters of tasks, for stable-baselines3.

Source: Raffin, RL Baselines3 Zoo, hyperparams/ppo.yml (github.com/DLR-RM/rl-baselines3-zoo), under the names
of Gymnasium's tasks. Tasks that it does not have take the defaults of the algorithm, or what is named here as
dynx's own.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any

from dynx.argument_types import checks_types
from dynx.envs.ground_task import KERNEL_ENGINE
from dynx.envs.registration import bare_name
from dynx.training.specification import TaskSpec

NO_VALUES: Mapping[str, Any] = MappingProxyType({})


@dataclass(frozen=True)
class Recipe:
    """How to train on a task: the number of environments and of steps, and hyperparameters.

    With `normalize`, observations and rewards are scaled by their running mean and deviation.
    """

    envs: int = 1
    steps: int | None = None
    normalize: bool = False
    hyperparameters: Mapping[str, Any] = field(default_factory=lambda: NO_VALUES)


def _recipe(envs: int, steps: int, normalize: bool = False, **hyperparameters: Any) -> Recipe:
    return Recipe(envs, steps, normalize, MappingProxyType(hyperparameters))


_LUNAR_LANDER = _recipe(
    16, 1_000_000, n_steps=1024, batch_size=64, gae_lambda=0.98, gamma=0.999, n_epochs=4, ent_coef=0.01
)

PPO: Mapping[str, Recipe] = {
    "CartPole": _recipe(
        8,
        100_000,
        n_steps=32,
        batch_size=256,
        gae_lambda=0.8,
        gamma=0.98,
        n_epochs=20,
        ent_coef=0.0,
        learning_rate="lin_0.001",
        clip_range="lin_0.2",
    ),
    "Pendulum": _recipe(
        4,
        100_000,
        n_steps=1024,
        gae_lambda=0.95,
        gamma=0.9,
        n_epochs=10,
        ent_coef=0.0,
        learning_rate=1e-3,
        clip_range=0.2,
        use_sde=True,
        sde_sample_freq=4,
    ),
    "Acrobot": _recipe(
        16, 1_000_000, normalize=True, n_steps=256, gae_lambda=0.94, gamma=0.99, n_epochs=4, ent_coef=0.0
    ),
    "LunarLander": _LUNAR_LANDER,
    "LunarLanderContinuous": _LUNAR_LANDER,
}
"""Recipes of PPO by the name of the task, without its namespace and version."""

PUBLISHED: Mapping[str, Mapping[str, Recipe]] = {"ppo": PPO}
"""Recipes by algorithm and task."""


ON_FEET: Mapping[str, Mapping[str, Recipe]] = {
    "ppo": {
        "Walk": _recipe(
            1024,
            12_000_000,
            normalize=True,
            n_steps=24,
            batch_size=6144,
            n_epochs=5,
            learning_rate="kl_0.01",
            policy_kwargs={"net_arch": [128, 64], "activation_fn": "relu", "log_std_init": -1.2},
        )
    }
}
"""Recipes of dynx by algorithm and task, for a thousand environments in kernels with contacts: engine
``dynx``, option ``contacts="feet"``. Rollouts, epochs and learning rate: Rudin and others, Learning to walk
in minutes using massively parallel deep reinforcement learning (2022)."""


@checks_types
def recipe_of(algorithm: str, task: str | TaskSpec) -> Recipe:
    """Return the published hyperparameters for a task such as ``dynx/CartPole-v0``, or the defaults if there
    are none.

    A `TaskSpec` may have others on its engine than the name alone: those of `ON_FEET`.
    """
    name = bare_name(task if isinstance(task, str) else task.id)
    published = PUBLISHED.get(algorithm, {}).get(name, Recipe())
    if isinstance(task, str) or task.engine != KERNEL_ENGINE or task.options.get("contacts") != "feet":
        return published
    return ON_FEET.get(algorithm, {}).get(name, published)
