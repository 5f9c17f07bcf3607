"""Small runs for the tests of training."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from dynx.training import TaskSpec, TrainingSpec

SMALL: dict[str, Any] = {"n_steps": 16, "batch_size": 32, "n_epochs": 2}


def small_run(steps: int = 256, **changes: Any) -> TrainingSpec:
    """Return a run of PPO on Gymnasium's cart-pole with updates after every 32 steps."""
    spec = TrainingSpec(TaskSpec("CartPole-v1"), "ppo", steps, 2, 0, hyperparameters=SMALL)
    return replace(spec, **changes)
