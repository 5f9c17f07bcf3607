"""The JSON document of ``dynx play``."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Literal, TypedDict

if TYPE_CHECKING:
    from dynx.training import Evaluation, Policy, TaskSpec


class JudgementEntry(TypedDict):
    """Returns of a policy on one engine.

    `mean` and `deviation` are over the episodes; the mean lies between `low` and `high` with 95 % confidence.
    """

    engine: str | None
    mean: float
    deviation: float
    low: float
    high: float
    mean_length: float
    returns: list[float]
    lengths: list[int]


class PlayDocument(TypedDict):
    """A policy, what it was trained on, and what it is worth on each engine; episode k has seed ``seed +
    k``."""

    schema: Literal["dynx.play/1"]
    file: str
    task: str
    trained_on: str | None
    algorithm: str
    steps: int
    seed: int
    engines: list[JudgementEntry]


def document(path: str, policy: Policy, found: Sequence[tuple[TaskSpec, Evaluation]]) -> PlayDocument:
    """Return the document of the judgements of a policy."""
    return {
        "schema": "dynx.play/1",
        "file": path,
        "task": policy.spec.task.id,
        "trained_on": policy.spec.task.engine,
        "algorithm": policy.spec.algorithm,
        "steps": policy.steps_done,
        "seed": found[0][1].seed,
        "engines": [_entry(task, each) for task, each in found],
    }


def _entry(task: TaskSpec, found: Evaluation) -> JudgementEntry:
    low, high = found.interval
    return {
        "engine": task.engine,
        "mean": found.mean,
        "deviation": found.deviation,
        "low": low,
        "high": high,
        "mean_length": float(found.lengths.mean()),
        "returns": found.returns.tolist(),
        "lengths": found.lengths.tolist(),
    }
