"""A training run in a folder: checkpoints, evaluations and curves, and resuming after it was ended."""

from __future__ import annotations

import json
import os
from collections.abc import Callable
from contextlib import ExitStack, closing
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from dynx._version import __version__
from dynx.errors import ArgumentError, shown
from dynx.files.documents import json_text
from dynx.files.writing import write_text
from dynx.training.checkpoints import Checkpoints
from dynx.training.environments import make, make_vector
from dynx.training.evaluation import AT_ONCE, Evaluation, evaluate
from dynx.training.library import log_to, new_algorithm, set_threads
from dynx.training.observer import Observer
from dynx.training.policy import Policy, Scaling
from dynx.training.records import Lines, read_lines
from dynx.training.specification import TrainingSpec, read_spec, spec_document

RUN, BEST, FINAL = "run.json", "best.zip", "final.zip"
EVALUATIONS, CURVE = "evaluations.jsonl", "curve.jsonl"
TENSORBOARD = "tensorboard"

CHECKPOINTS_PER_RUN, EVALUATIONS_PER_RUN = 20, 10
"""Numbers of checkpoints and of evaluations of a run, unless their distance is given."""

EVALUATION_SEED = 1_000_000_000
"""Seed of the first episode of every evaluation: far from those of training."""


@dataclass(frozen=True)
class Progress:
    """Where a run is: steps done and wanted, and the mean return of the last hundred episodes, if any
    ended."""

    steps: int
    total: int
    mean_return: float | None
    last_evaluation: Evaluation | None


@dataclass(frozen=True)
class Schedule:
    """What a run does beside training, which does not change what is learned.

    Steps between checkpoints and between evaluations (None: `CHECKPOINTS_PER_RUN` and `EVALUATIONS_PER_RUN`
    in all), episodes of an evaluation, threads of PyTorch, and whether curves are written for TensorBoard.
    """

    checkpoint_every: int | None = None
    evaluate_every: int | None = None
    episodes: int = 10
    threads: int = 1
    tensorboard: bool = False

    def distances(self, steps: int) -> tuple[int, int]:
        """Return the steps between checkpoints and between evaluations of a run of `steps`."""
        return (
            self.checkpoint_every or max(1, steps // CHECKPOINTS_PER_RUN),
            self.evaluate_every or max(1, steps // EVALUATIONS_PER_RUN),
        )


@dataclass(frozen=True)
class Trained:
    """A finished run: its policy at the end, and the evaluation of that policy."""

    folder: Path
    policy: Policy
    evaluation: Evaluation
    resumed_at: int
    """Steps that were done before; 0 for a run from its beginning."""


def train(
    spec: TrainingSpec,
    folder: str | os.PathLike[str],
    *,
    resume: bool = False,
    schedule: Schedule | None = None,
    final_episodes: int = 100,
    progress: Callable[[Progress], object] = lambda _: None,
) -> Trained:
    """Train a policy, and judge it over `final_episodes` whole episodes.

    The folder gets `RUN`, checkpoints, `EVALUATIONS` and `CURVE` (a JSON document in each line), `BEST` (the
    policy of the best evaluation) and `FINAL`. A run that was ended, even by a power failure, goes on with
    `resume` from its last checkpoint: weights, state of the optimizer, schedules, scaling and replay buffer
    are those of the checkpoint; the environments begin new episodes. A finished run is only judged.

    Raises ArgumentError for a folder that has another run, or one that is not to be resumed, and the errors
    of the task and the algorithm.
    """
    schedule = schedule or Schedule()
    place = Path(folder)
    _check_folder(place, spec, resume)
    reset_threads = set_threads(schedule.threads)
    with ExitStack() as stack:
        stack.callback(reset_threads)
        vector = make_vector(spec)
        stack.callback(vector.close)
        judged = [
            stack.enter_context(closing(make(spec.task)))
            for _ in range(min(AT_ONCE, max(final_episodes, schedule.episodes)))
        ]
        checkpoints = Checkpoints(place / "checkpoints")
        found = checkpoints.newest(spec) if resume else None
        done = 0 if found is None else found.steps_done
        # Another seed after a checkpoint, or the same episodes would be learned again.
        algorithm = new_algorithm(spec.algorithm, vector, spec.hyperparameters, spec.seed + done)
        if found is not None:
            found.restore(algorithm, vector)
        if not resume:
            _begin(place, spec)
        evaluations, curve = Lines(place / EVALUATIONS, done), Lines(place / CURVE, done)
        if schedule.tensorboard:
            log_to(algorithm, str(place / TENSORBOARD))
        best = max((float(line["mean"]) for line in read_lines(place / EVALUATIONS)), default=-float("inf"))
        last: Evaluation | None = None

        def policy_now() -> Policy:
            return Policy(algorithm, spec, int(algorithm.num_timesteps), Scaling.of(vector))

        def judge() -> None:
            nonlocal best, last
            policy = policy_now()
            last = evaluate(policy, judged, schedule.episodes, EVALUATION_SEED)
            evaluations.add(evaluation_line(policy.steps_done, last))
            if last.mean > best:
                best = last.mean
                policy.save(place / BEST)

        def report(mean_return: float | None) -> None:
            steps = int(algorithm.num_timesteps)
            if mean_return is not None:
                curve.add({"steps": steps, "mean_return": mean_return})
            progress(Progress(min(steps, spec.steps), spec.steps, mean_return, last))

        every, judge_every = schedule.distances(spec.steps)
        observer = Observer(
            {"checkpoint": every, "judge": judge_every, "report": max(1, spec.steps // 200)},
            {"checkpoint": lambda: checkpoints.add(policy_now()), "judge": judge},
            report,
        )
        if done < spec.steps:
            algorithm.learn(spec.steps - done, callback=observer, reset_num_timesteps=False)
            checkpoints.add(policy_now())
        policy = policy_now()
        policy.save(place / FINAL)
        final = evaluate(policy, judged, final_episodes, EVALUATION_SEED)
        if not (place / BEST).exists():
            policy.save(place / BEST)
        return Trained(place, policy, final, done)


def evaluation_line(steps: int, found: Evaluation) -> dict[str, Any]:
    """Return an evaluation as a line of `EVALUATIONS`."""
    low, high = found.interval
    return {
        "steps": steps,
        "mean": found.mean,
        "deviation": found.deviation,
        "low": low,
        "high": high,
        "episodes": len(found.returns),
        "mean_length": float(found.lengths.mean()),
    }


def read_run(folder: str | os.PathLike[str]) -> TrainingSpec:
    """Read what a folder was trained with. Raises ArgumentError for a folder without a run."""
    path = Path(folder) / RUN
    try:
        document = json.loads(path.read_text("ascii"))
        spec: object = document["spec"]
    except FileNotFoundError:
        raise ArgumentError(f"{shown(folder, 300)} has no training run: there is no {RUN} in it") from None
    except (OSError, ValueError, KeyError, TypeError, RecursionError) as error:
        raise ArgumentError(f"{shown(path, 300)} cannot be read: {error}") from error
    return read_spec(spec, str(path))


def _check_folder(place: Path, spec: TrainingSpec, resume: bool) -> None:
    """Check that the folder is free for a run, or has this one where it is to be resumed."""
    if not (place / RUN).exists():
        if resume:
            raise ArgumentError(f"{shown(place, 300)} has no training run that could be resumed")
        return
    if not resume:
        raise ArgumentError(
            f"{shown(place, 300)} has a training run already; resume it (--resume) or name another folder"
        )
    difference = spec.first_difference(read_run(place))
    if difference is not None:
        raise ArgumentError(f"{shown(place, 300)} has another run: {difference}")


def _begin(place: Path, spec: TrainingSpec) -> None:
    """Make the folder of a run that can begin."""
    try:
        place.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ArgumentError(f"{shown(place, 300)} cannot be made: {error.strerror}") from error
    document = {"schema": "dynx.training/1", "dynx": __version__, "spec": spec_document(spec)}
    write_text(place / RUN, json_text(document))
