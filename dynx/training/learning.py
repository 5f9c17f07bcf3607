"""Learning of a run: checkpoints, evaluations and curves beside the updates of the algorithm."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from dynx.argument_types import checks_types
from dynx.errors import ArgumentError, shown
from dynx.model.numbers import is_real, whole_number
from dynx.training.checkpoints import Checkpoints
from dynx.training.evaluation import MAX_EPISODES, Evaluation, evaluate
from dynx.training.library import log_to
from dynx.training.observer import Observer
from dynx.training.policy import Policy, Scaling
from dynx.training.records import JsonLines, read_lines
from dynx.training.specification import TrainingSpec

BEST, FINAL = "best.zip", "final.zip"
EVALUATIONS, CURVE = "evaluations.jsonl", "curve.jsonl"
TENSORBOARD = "tensorboard"

CHECKPOINTS_PER_RUN, EVALUATIONS_PER_RUN = 20, 10
"""Numbers of checkpoints and of evaluations of a run, unless their distance is given."""

MAX_THREADS = 1024
"""Largest number of threads that PyTorch is asked for: it makes all of them at once."""

REPORTS_PER_RUN = 200
"""Number of points of the curve of a run."""

EVALUATION_SEED = 1_000_000_000
"""Seed of the first episode of every evaluation: far from those of training."""


@dataclass(frozen=True)
class Progress:
    """Progress of a run: steps done and wanted, and the mean return of the last hundred episodes, if any
    ended."""

    steps: int
    total: int
    mean_return: float | None
    last_evaluation: Evaluation | None

    def __str__(self) -> str:
        """Return the line that ``progress=print`` prints."""
        earned = "" if self.mean_return is None else f", mean return {self.mean_return:.4g}"
        return f"{self.steps} of {self.total} steps{earned}"


@checks_types
@dataclass(frozen=True)
class Schedule:
    """Schedule of checkpoints and evaluations of a training run, and the return at which the run ends early.

    The fields are the number of steps between checkpoints and between evaluations (None:
    `CHECKPOINTS_PER_RUN` checkpoints and `EVALUATIONS_PER_RUN` evaluations in the whole run), episodes of an
    evaluation, threads (of environments with contacts in kernels, of mini-batches of PPO with more than 4096
    samples, and of PyTorch), and whether curves are written for TensorBoard. The first evaluation with a mean
    return of at least `target_return` ends the training; with None no evaluation ends it.
    """

    checkpoint_every: int | None = None
    evaluate_every: int | None = None
    episodes: int = 10
    threads: int = 1
    tensorboard: bool = False
    target_return: float | None = None

    def __post_init__(self) -> None:
        for name in ("checkpoint_every", "evaluate_every"):
            steps = getattr(self, name)
            if steps is not None:
                whole_number(name, steps, 1)
        whole_number("episodes", self.episodes, 1, MAX_EPISODES)
        whole_number("threads", self.threads, 1, MAX_THREADS)
        target = self.target_return
        if target is not None and not (is_real(target) and math.isfinite(target)):
            raise ArgumentError(f"target_return is {shown(target)}; wanted a finite number, or None")

    def distances(self, steps: int) -> tuple[int, int]:
        """Return the steps between checkpoints and between evaluations of a run of `steps`."""
        whole_number("steps", steps, 1)
        return (
            self.checkpoint_every or max(1, steps // CHECKPOINTS_PER_RUN),
            self.evaluate_every or max(1, steps // EVALUATIONS_PER_RUN),
        )


class Learning:
    """An algorithm that learns in the folder of its run."""

    def __init__(
        self,
        spec: TrainingSpec,
        place: Path,
        schedule: Schedule,
        algorithm: Any,
        vector: Any,
        judged: Sequence[Any],
        checkpoints: Checkpoints,
        progress: Callable[[Progress], object],
    ) -> None:
        """`vector` are the environments to learn on, `judged` those of evaluations."""
        self._spec, self._place, self._schedule = spec, place, schedule
        self._algorithm, self._vector, self._judged = algorithm, vector, judged
        self._checkpoints, self._progress = checkpoints, progress
        done = int(algorithm.num_timesteps)
        self._evaluations, self._curve = JsonLines(place / EVALUATIONS, done), JsonLines(place / CURVE, done)
        means = (line.get("mean") for line in read_lines(place / EVALUATIONS))
        self._best = max((float(each) for each in means if is_real(each)), default=-float("inf"))
        self._last: Evaluation | None = None
        if schedule.tensorboard:
            log_to(algorithm, str(place / TENSORBOARD))

    def learn(self, steps: int) -> None:
        """Take at least this number of further steps, or fewer if an evaluation reaches the target return.

        The last policy is a checkpoint.
        """
        total = self._spec.steps
        every, judge_every = self._schedule.distances(total)
        observer = Observer(
            {"checkpoint": every, "judge": judge_every, "report": max(1, total // REPORTS_PER_RUN)},
            {"checkpoint": self._add_checkpoint, "judge": self._judge},
            self._report,
        )
        self._algorithm.learn(steps, callback=observer, reset_num_timesteps=False)
        self._add_checkpoint()

    def finish(self, episodes: int) -> tuple[Policy, Evaluation]:
        """Write the policy as `FINAL`, and as `BEST` if there was no evaluation; judge it."""
        policy = self._policy()
        policy.save(self._place / FINAL)
        final = evaluate(policy, self._judged, episodes, EVALUATION_SEED)
        if not (self._place / BEST).exists():
            policy.save(self._place / BEST)
        return policy, final

    def _policy(self) -> Policy:
        """Return the policy of the present weights."""
        steps = int(self._algorithm.num_timesteps)
        return Policy(self._algorithm, self._spec, steps, Scaling.of(self._vector))

    def _add_checkpoint(self) -> None:
        self._checkpoints.add(self._policy())

    def _judge(self) -> bool:
        """Evaluate the policy; keep it if it is the best so far. Return whether it has the target return."""
        policy = self._policy()
        self._last = found = evaluate(policy, self._judged, self._schedule.episodes, EVALUATION_SEED)
        self._evaluations.add(evaluation_line(policy.steps_done, found))
        if found.mean > self._best:
            self._best = found.mean
            policy.save(self._place / BEST)
        target = self._schedule.target_return
        return target is not None and found.mean >= target

    def _report(self, mean_return: float | None) -> None:
        """Add a point to the curve, and tell the caller of the run."""
        steps, total = int(self._algorithm.num_timesteps), self._spec.steps
        if mean_return is not None:
            self._curve.add({"steps": steps, "mean_return": mean_return})
        self._progress(Progress(min(steps, total), total, mean_return, self._last))


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
        "diverged": found.diverged,
    }
