"""A training run in a folder: checkpoints, evaluations and curves, and resuming after it was ended."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from contextlib import ExitStack, closing
from dataclasses import dataclass
from pathlib import Path

from dynx._version import __version__
from dynx.argument_types import checks_types
from dynx.errors import ArgumentError, DescriptionError, RobotNotFoundError, shown
from dynx.files.documents import json_text, parse_json
from dynx.files.links import refuse_links
from dynx.files.reading import checked_path, read_file
from dynx.files.writing import write_text
from dynx.model.numbers import whole_number
from dynx.training.algorithms import new_algorithm
from dynx.training.checkpoints import Checkpoints
from dynx.training.environments import make
from dynx.training.evaluation import AT_ONCE, MAX_EPISODES, Evaluation
from dynx.training.file_tasks import of_earlier_version
from dynx.training.learning import BEST, CURVE, EVALUATIONS, FINAL, TENSORBOARD, Learning, Progress, Schedule
from dynx.training.library import set_threads
from dynx.training.policy import Policy
from dynx.training.ppo import ThreadedPPO
from dynx.training.specification import TrainingSpec, read_spec, spec_document
from dynx.training.vectors import make_training_vector

RUN = "run.json"

SCHEMA = "dynx.training/3"
"""Name and version of the layout of `RUN`."""

EARLIER_SCHEMAS = ("dynx.training/1", "dynx.training/2")
"""Versions whose `RobotTask` moves robots without limits, and in the first rigid bodies."""


@dataclass(frozen=True)
class Trained:
    """A finished run: its policy at the end, and the evaluation of that policy."""

    folder: Path
    policy: Policy
    evaluation: Evaluation
    resumed_at: int
    """Steps that were done before; 0 for a run from its beginning."""


@checks_types
def train(
    spec: TrainingSpec,
    folder: str | os.PathLike[str],
    *,
    resume: bool = False,
    schedule: Schedule | None = None,
    final_episodes: int = 100,
    progress: Callable[[Progress], object] = lambda _: None,
) -> Trained:
    """Train a policy, and evaluate it over `final_episodes` whole episodes.

    The folder gets `RUN`, checkpoints, `EVALUATIONS` and `CURVE` (a JSON document in each line), `BEST` (the
    policy of the best evaluation) and `FINAL`. ``Schedule(target_return=...)`` ends the training at the first
    evaluation with this mean return. With `resume` a run that was ended, even by a power failure, continues
    from its last checkpoint: weights, state of the optimizer, schedules, scaling and replay buffer are those
    of the checkpoint; the environments begin new episodes. A run of an earlier dynx keeps the joint dynamics
    that its environments had (`of_earlier_version`). A finished run is only evaluated. If the number of steps
    is greater now, it continues, with schedules that end at the new number.

    Raises ArgumentError for a folder that has another run, or one that is not to be resumed, and the errors
    of the task and the algorithm.
    """
    whole_number("final_episodes", final_episodes, 1, MAX_EPISODES)  # Before the training, which takes hours.
    schedule = schedule or Schedule()
    place = Path(checked_path(folder))
    schema, given = _checked_schema(place, spec, resume), spec
    spec = of_earlier_version(spec, schema)
    with ExitStack() as stack:
        stack.callback(set_threads(schedule.threads))
        vector = make_training_vector(spec, schedule.threads)
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
        if isinstance(algorithm, ThreadedPPO):
            algorithm.threads = schedule.threads
        if found is not None:
            found.restore(algorithm, vector)
        _write_run(place, given, schema)
        learning = Learning(spec, place, schedule, algorithm, vector, judged, checkpoints, progress)
        if done < spec.steps:
            learning.learn(spec.steps - done)
        policy, final = learning.finish(final_episodes)
        return Trained(place, policy, final, done)


def read_run(folder: str | os.PathLike[str]) -> TrainingSpec:
    """Read what a folder was trained with, which may be anything: it is compared, and nothing is made of it.

    Raises ArgumentError for a folder without a run.
    """
    return _read_run(Path(checked_path(folder)))[0]


def _read_run(folder: Path) -> tuple[TrainingSpec, str]:
    """Read what a folder was trained with, and the schema of its `RUN`."""
    path = folder / RUN
    try:
        document = parse_json(read_file(str(path)))
        spec: object = document["spec"]
        schema = document.get("schema")
        schema = schema if schema in EARLIER_SCHEMAS else SCHEMA
    except RobotNotFoundError:
        raise ArgumentError(f"{shown(folder, 300)} has no training run: there is no {RUN} in it") from None
    except (DescriptionError, ValueError, KeyError, TypeError) as error:
        raise ArgumentError(f"{shown(path, 300)} cannot be read: {error}") from error
    return read_spec(spec, str(path)), schema


def _checked_schema(place: Path, spec: TrainingSpec, resume: bool) -> str:
    """Return the schema of the run that a folder has, where it is to be resumed, otherwise that of a new one.

    Raises ArgumentError for a folder that is not free for a run, or has another one.
    """
    if not os.path.exists(place / RUN):
        if resume:
            raise ArgumentError(f"{shown(place, 300)} has no training run that could be resumed")
        written = (RUN, EVALUATIONS, CURVE, BEST, FINAL, TENSORBOARD, "checkpoints")
        refuse_links(place, written)
        refuse_links(place, _names(place, "checkpoints/*"))
        return SCHEMA
    if not resume:
        raise ArgumentError(
            f"{shown(place, 300)} has a training run already; resume it (--resume) or name another folder"
        )
    # One after the other: a link is found before what is behind it is read.
    refuse_links(place, _names(place, "*", "checkpoints/*"))
    known, schema = _read_run(place)
    difference = spec.obstacle_to_continuing(known)
    if difference is not None:
        raise ArgumentError(f"{shown(place, 300)} has another run: {difference}")
    return schema


def _names(place: Path, *patterns: str) -> Iterator[str]:
    """Yield the relative paths of what matches patterns in a folder."""
    for pattern in patterns:
        yield from (str(each.relative_to(place)) for each in place.glob(pattern))


def _write_run(place: Path, spec: TrainingSpec, schema: str) -> None:
    """Make the folder of a run that can begin, or go on, perhaps with more steps."""
    try:
        place.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ArgumentError(f"{shown(place, 300)} cannot be made: {error.strerror}") from error
    document = {"schema": schema, "dynx": __version__, "spec": spec_document(spec)}
    write_text(place / RUN, json_text(document))
