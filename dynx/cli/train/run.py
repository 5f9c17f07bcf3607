"""Run of ``dynx train``: a run for each seed, with progress, a table, files and the exit code."""

from __future__ import annotations

import time
from collections.abc import Sequence
from pathlib import Path

from dynx.cli.shell.exits import BAD_INPUT, DONE, complain, failure_of
from dynx.cli.shell.interruption import interruptible
from dynx.cli.shell.options import json_value
from dynx.cli.shell.output_file import check_json, check_writable
from dynx.cli.shell.progress import Advance, log, progress_bar
from dynx.cli.shell.terminal import present
from dynx.cli.train.document import document
from dynx.cli.train.plot import plot
from dynx.cli.train.tables import show
from dynx.envs.registration import bare_name, task_id
from dynx.errors import DynxError
from dynx.files.figures import picture_format
from dynx.training import Progress, Schedule, TaskSpec, Trained, TrainingSpec, recipe_of
from dynx.training import train as train_run
from dynx.training.hyperparameters import Recipe

DEFAULT_STEPS = 100_000
"""Steps of a task without a published number."""

SECONDS_BETWEEN_LINES = 30.0
"""Shortest time between two lines of progress where standard error is no terminal."""


def train(
    task: str,
    engine: str | None,
    options: Sequence[tuple[str, str]],
    randomize: Sequence[tuple[str, str]],
    algorithm: str,
    steps: int | None,
    seeds: tuple[int, ...],
    envs: int | None,
    processes: bool,
    normalize: bool | None,
    values: Sequence[tuple[str, str]],
    out: str | None,
    resume: bool,
    checkpoint_every: int | None,
    evaluate_every: int | None,
    episodes: int,
    threads: int,
    tensorboard: bool,
    json_path: str | None,
    plot_path: str | None,
    quiet: bool,
) -> int:
    """Train with each seed; return the exit code."""
    check_json(json_path)
    if plot_path is not None:
        check_writable(plot_path)
        picture_format(plot_path)
    chosen = {name: json_value(word) for name, word in options}
    if randomize:
        chosen["randomize"] = {name: json_value(word) for name, word in randomize}
    spec = TaskSpec(task_id(task), engine, chosen)
    recipe = recipe_of(algorithm, spec.id)
    given = {name: json_value(word) for name, word in values}
    schedule = Schedule(checkpoint_every, evaluate_every, threads=threads, tensorboard=tensorboard)
    base = Path(out if out is not None else _folder_of(spec, algorithm))
    runs: list[Trained] = []
    times: list[float] = []
    with interruptible() as interruption:
        for seed in seeds:
            run = _specification(spec, algorithm, recipe, steps, envs, seed, normalize, processes, given)
            folder = base / f"seed-{seed}" if len(seeds) > 1 else base
            started = time.perf_counter()
            with progress_bar(run.steps, words="steps", enabled=not quiet) as advance:
                reporter = _Reporter(advance, seed if len(seeds) > 1 else None, quiet)
                try:
                    trained = train_run(
                        run,
                        folder,
                        # A seed that has not begun is begun: the run was ended in an earlier one.
                        resume=resume and (len(seeds) == 1 or (folder / "run.json").exists()),
                        schedule=schedule,
                        final_episodes=episodes,
                        progress=reporter,
                    )
                except KeyboardInterrupt:
                    if any((folder / "checkpoints").glob("*.zip")):
                        log(f"{folder} has a checkpoint; the same command with --resume goes on from there")
                    raise
            runs.append(trained)
            times.append(time.perf_counter() - started)
        interruption.finishing = True
        made = document(run, runs, times)
        errors = [present(made, _nothing if quiet else show, json_path)]
        if plot_path is not None:
            errors.append(failure_of(plot, runs, plot_path))
    failed: list[DynxError] = [each for each in errors if each is not None]
    for each in failed:
        complain(str(each))
    return BAD_INPUT if failed else DONE


class _Reporter:
    """Shows progress: in the bar, or as a line from time to time."""

    def __init__(self, advance: Advance, seed: int | None, quiet: bool) -> None:
        self._advance = advance
        self._prefix = "" if seed is None else f"seed {seed}: "
        self._quiet = quiet
        self._last = time.perf_counter()

    def __call__(self, progress: Progress) -> None:
        now = time.perf_counter()
        words = f"{self._prefix}steps"
        if progress.mean_return is not None:
            words = f"{words}, mean return {progress.mean_return:.4g}"
        self._advance(progress.steps, words)
        if not self._quiet and now - self._last >= SECONDS_BETWEEN_LINES:
            self._last = now
            log(f"{self._prefix}{progress.steps:,} of {progress.total:,} {words[len(self._prefix) :]}")


def _specification(
    task: TaskSpec,
    algorithm: str,
    recipe: Recipe,
    steps: int | None,
    envs: int | None,
    seed: int,
    normalize: bool | None,
    processes: bool,
    given: dict[str, object],
) -> TrainingSpec:
    return TrainingSpec(
        task,
        algorithm,
        steps or recipe.steps or DEFAULT_STEPS,
        envs or recipe.envs,
        seed,
        recipe.normalize if normalize is None else normalize,
        processes,
        {**recipe.hyperparameters, **given},
    )


def _folder_of(task: TaskSpec, algorithm: str) -> Path:
    return Path("runs") / "-".join(each for each in (bare_name(task.id), task.engine, algorithm) if each)


def _nothing(*_: object) -> None:
    """Show nothing."""
