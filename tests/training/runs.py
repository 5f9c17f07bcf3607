"""Small runs for the tests of training."""

from __future__ import annotations

import zipfile
from dataclasses import replace
from pathlib import Path
from typing import Any

from dynx.training import TaskSpec, TrainingSpec

SMALL: dict[str, Any] = {"n_steps": 16, "batch_size": 32, "n_epochs": 2}


def small_run(steps: int = 256, **changes: Any) -> TrainingSpec:
    """Return a run of PPO on Gymnasium's cart-pole with updates after every 32 steps."""
    spec = TrainingSpec(TaskSpec("CartPole-v1"), "ppo", steps, 2, 0, hyperparameters=SMALL)
    return replace(spec, **changes)


def members(path: Any) -> dict[str, bytes]:
    with zipfile.ZipFile(path) as archive:
        return {name: archive.read(name) for name in archive.namelist()}


def written(path: Path, parts: dict[str, bytes]) -> Path:
    with zipfile.ZipFile(path, "w") as archive:
        for name, content in parts.items():
            archive.writestr(name, content)
    return path
