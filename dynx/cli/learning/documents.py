"""JSON documents of ``dynx env``, ``dynx train`` and ``dynx play``."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations
from typing import TYPE_CHECKING, Any, Literal, TypedDict

import numpy as np

from dynx.cli.shell.output import entry_of
from dynx.envs.distance import EngineDistance, EpisodeDifference

if TYPE_CHECKING:
    from dynx.training import Evaluation, Policy, TaskSpec, Trained, TrainingSpec


DISTANCE_SCHEMA: Literal["dynx.env-distance/1"] = "dynx.env-distance/1"


class TaskEntry(TypedDict):
    """A task of dynx: its Gymnasium id, what is learned, and the engines on which it runs, the default first.

    `max_episode_steps` is null without a time limit, `reward_threshold` where no return counts as solved.
    """

    id: str
    summary: str
    max_episode_steps: int | None
    reward_threshold: float | None
    engines: list[str]


class TasksDocument(TypedDict):
    """The tasks of dynx."""

    schema: Literal["dynx.tasks/1"]
    tasks: list[TaskEntry]


class EpisodeEntry(TypedDict):
    """One episode on two engines: the step at which they part (null: never), and the entry of the observation
    that differs most there, with its name (null where an engine only ends the episode earlier).

    `largest` is the largest difference of an entry over the steps that both have. `returns` and `lengths` are
    those of the two engines.
    """

    seed: int
    step: int | None
    entry: int | None
    entry_name: str | None
    largest: float
    returns: list[float]
    lengths: list[int]


class PairEntry(TypedDict):
    """Two engines: how many episodes part, the first and the median step of those, and each episode.

    `first_entry` names the entry of the observation that differs most at the first step; it is null if no
    episode parts, or if an engine only ends the episode earlier.
    """

    engines: list[str]
    parted: int
    first_step: int | None
    first_entry: str | None
    median_step: float | None
    largest: float
    mean_returns: list[float]
    episodes: list[EpisodeEntry]


class ReturnEntry(TypedDict):
    """Returns of a policy on one engine; the mean lies between `low` and `high` with 95 % confidence, and
    `diverged` episodes were truncated because a step diverged."""

    engine: str
    mean: float
    deviation: float
    low: float
    high: float
    diverged: int


class PolicyEntry(TypedDict):
    """A policy, the engine on which it was trained, and what it is worth on each engine."""

    file: str
    trained_on: str | None
    episodes: int
    engines: list[ReturnEntry]


class EnvDistanceDocument(TypedDict):
    """How far apart engines are on one task, with the same seeds and the same actions."""

    schema: Literal["dynx.env-distance/1"]
    task: str
    options: dict[str, Any]
    engines: list[str]
    tolerance: float
    pairs: list[PairEntry]
    policies: list[PolicyEntry]


def distance_document(
    task: str, options: dict[str, Any], measurement: EngineDistance, policies: list[PolicyEntry]
) -> EnvDistanceDocument:
    """Return the JSON document of ``dynx env``: for each two engines how many episodes part, when, and by how
    much. The measurement has at least one episode."""
    return {
        "schema": DISTANCE_SCHEMA,
        "task": task,
        "options": options,
        "engines": list(measurement.engines),
        "tolerance": measurement.tolerance,
        "pairs": [_pair(measurement, measurement.of(a, b)) for a, b in combinations(measurement.engines, 2)],
        "policies": policies,
    }


def _pair(measurement: EngineDistance, episodes: Sequence[EpisodeDifference]) -> PairEntry:
    steps = [each.step for each in episodes if each.step is not None]
    first = min((each.step, k) for k, each in enumerate(episodes) if each.step is not None)[1] if steps else 0
    returns = np.array([each.returns for each in episodes])
    return {
        "engines": list(episodes[0].engines),
        "parted": len(steps),
        "first_step": min(steps, default=None),
        "first_entry": measurement.entry_name(episodes[first].entry),
        "median_step": float(np.median(steps)) if steps else None,
        "largest": max(each.largest for each in episodes),
        "mean_returns": returns.mean(axis=0).tolist(),
        "episodes": [
            entry_of(EpisodeEntry, each, entry_name=measurement.entry_name(each.entry)) for each in episodes
        ],
    }


def policy_entry(
    path: str, env_id: str, engines: Sequence[str], options: dict[str, Any], episodes: int
) -> PolicyEntry:
    """Load a policy, run `episodes` of its task, which is `env_id`, on each engine, and return its returns as
    an entry of the document of ``dynx env``."""
    # Imports PyTorch.
    from dynx.training import TaskSpec, load_policy
    from dynx.training.file_tasks import task_of_file
    from dynx.training.judging import judge
    from dynx.training.policy import read_policy_document

    rows: list[ReturnEntry] = []
    trained_on = None
    for engine in engines:
        task = task_of_file(read_policy_document(path).spec.task, path, options, env_id)
        trained_on = task.engine
        task = TaskSpec(task.id, engine, task.options)
        policy = load_policy(path, task)
        evaluation = judge(policy, task, episodes)
        low, high = evaluation.interval
        rows.append(entry_of(ReturnEntry, evaluation, engine=engine, low=low, high=high))
    return {"file": path, "trained_on": trained_on, "episodes": episodes, "engines": rows}


class RunEntry(TypedDict):
    """One run: its seed and folder, and the returns of its policy at the end.

    `mean` and `deviation` are over the episodes; the mean lies between `low` and `high` with 95 % confidence.
    `diverged` episodes were truncated because a step diverged.
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
    diverged: int
    seconds: float


class TrainDocument(TypedDict):
    """Runs of one task with several seeds.

    `mean` is that of the runs, each counted once; it lies between `low` and `high` with 95 % confidence.
    These are infinite for a single run, which JSON writes as null.
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
    evaluation = trained.evaluation
    low, high = evaluation.interval
    return entry_of(
        RunEntry,
        evaluation,
        seed=trained.policy.spec.seed,
        folder=str(trained.folder),
        steps=trained.policy.steps_done,
        resumed_at=trained.resumed_at,
        episodes=len(evaluation.returns),
        low=low,
        high=high,
        least=evaluation.returns.min(),
        seconds=seconds,
    )


def train_document(spec: TrainingSpec, trained: list[Trained], seconds: list[float]) -> TrainDocument:
    """Return the JSON document of ``dynx train``: one entry for each run, and the mean over the runs with its
    95 % interval. The runs differ in the seed; `trained` and `seconds` have one item for each."""
    # Imported here, because schemas are written without the extra ``train``.
    from dynx.training.evaluation import mean_of_runs

    mean, (low, high) = mean_of_runs([each.evaluation.mean for each in trained])
    return entry_of(
        TrainDocument,
        spec,
        schema="dynx.train/1",
        task=spec.task.id,
        engine=spec.task.engine,
        options=spec.task.options,
        runs=[run_entry(each, time) for each, time in zip(trained, seconds, strict=True)],
        mean=mean,
        low=low,
        high=high,
    )


class JudgementEntry(TypedDict):
    """Returns of a policy on one engine.

    `mean` and `deviation` are over the episodes; the mean lies between `low` and `high` with 95 % confidence.
    `diverged` episodes were truncated because a step diverged.
    """

    engine: str | None
    mean: float
    deviation: float
    low: float
    high: float
    diverged: int
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


def play_document(
    path: str, policy: Policy, trained_on: str | None, judgements: Sequence[tuple[TaskSpec, Evaluation]]
) -> PlayDocument:
    """Return the JSON document of ``dynx play``: one entry for each task and its evaluation in `judgements`,
    of which there is at least one."""
    return {
        "schema": "dynx.play/1",
        "file": path,
        "task": policy.spec.task.id,
        "trained_on": trained_on,
        "algorithm": policy.spec.algorithm,
        "steps": policy.steps_done,
        "seed": judgements[0][1].seed,
        "engines": [_judgement_entry(task, each) for task, each in judgements],
    }


def _judgement_entry(task: TaskSpec, evaluation: Evaluation) -> JudgementEntry:
    low, high = evaluation.interval
    return entry_of(
        JudgementEntry,
        evaluation,
        engine=task.engine,
        low=low,
        high=high,
        mean_length=evaluation.lengths.mean(),
    )
