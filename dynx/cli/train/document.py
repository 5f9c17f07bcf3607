"""The JSON document of ``dynx train``."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Literal, TypedDict

from dynx.training.evaluation import mean_of_runs

if TYPE_CHECKING:
    from dynx.training import Trained, TrainingSpec


class RunEntry(TypedDict):
    """One run: its seed and folder, and the returns of its policy at the end.

    `mean` and `deviation` are over the episodes; the mean lies between `low` and `high` with 95 % confidence.
    `resumed_at` is the number of steps that were done before this call.
    """

    seed: int
    folder: str
    steps: int
    resumed_at: int
    episodes: int
    mean: float
    deviation: float
    low: float
    high: float
    least: float
    seconds: float


class TrainDocument(TypedDict):
    """Runs of one task with several seeds.

    `mean` is that of the runs, each counted once; it lies between `low` and `high` with 95 % confidence,
    which are null for a single run.
    """

    schema: Literal["dynx.train/1"]
    task: str
    engine: str | None
    options: dict[str, Any]
    algorithm: str
    envs: int
    normalize: bool
    hyperparameters: dict[str, Any]
    runs: list[RunEntry]
    mean: float
    low: float
    high: float


def run_entry(trained: Trained, seconds: float) -> RunEntry:
    """Return the entry of a finished run."""
    found = trained.evaluation
    low, high = found.interval
    return {
        "seed": trained.policy.spec.seed,
        "folder": str(trained.folder),
        "steps": trained.policy.steps_done,
        "resumed_at": trained.resumed_at,
        "episodes": len(found.returns),
        "mean": found.mean,
        "deviation": found.deviation,
        "low": low,
        "high": high,
        "least": float(found.returns.min()),
        "seconds": seconds,
    }


def document(spec: TrainingSpec, trained: list[Trained], seconds: list[float]) -> TrainDocument:
    """Return the document of the runs of a specification, which differ in the seed."""
    mean, (low, high) = mean_of_runs([each.evaluation.mean for each in trained])
    return {
        "schema": "dynx.train/1",
        "task": spec.task.id,
        "engine": spec.task.engine,
        "options": spec.task.options,
        "algorithm": spec.algorithm,
        "envs": spec.envs,
        "normalize": spec.normalize,
        "hyperparameters": spec.hyperparameters,
        "runs": [run_entry(each, time) for each, time in zip(trained, seconds, strict=True)],
        "mean": mean,
        "low": low,
        "high": high,
    }
