"""Run of ``dynx train``: a run for each seed, with progress, a table, a plot and the exit code."""

from __future__ import annotations

import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from rich.console import Console

from dynx.cli.learning.documents import train_document
from dynx.cli.shell.exits import exit_code, failure_of, interruptible, one_line
from dynx.cli.shell.options import json_value, one_task
from dynx.cli.shell.output import Advance, Entry, check_json, check_writable, log, present, progress_bar
from dynx.cli.shell.tables import Table
from dynx.envs.registration import bare_name, task_id
from dynx.errors import ArgumentError, shown
from dynx.files.figures import line_style, literal, new_figure, picture_format, save_figure
from dynx.training import Progress, Schedule, TaskSpec, Trained, TrainingSpec, recipe_of
from dynx.training import train as train_run
from dynx.training.file_tasks import task_of_file
from dynx.training.learning import CURVE, EVALUATIONS
from dynx.training.records import read_lines
from dynx.training.run import RUN, read_run

DEFAULT_STEPS = 100_000
"""Steps of a task without a published number."""

ALGORITHM = "ppo"
"""Algorithm of a run for which none is given."""

MAX_ENVS_OF_FILE = 1024
"""Largest number of environments that the file of a run starts; more are given by the caller."""

SECONDS_BETWEEN_LINES = 30.0
"""Shortest time between two lines of progress where standard error is no terminal."""


def train(
    task: str | None,
    named_task: str | None,
    engine: str | None,
    options: Sequence[tuple[str, str]],
    randomize: Sequence[tuple[str, str]],
    algorithm: str | None,
    steps: int | None,
    seeds: tuple[int, ...] | None,
    envs: int | None,
    processes: bool,
    normalize: bool | None,
    values: Sequence[tuple[str, str]],
    out: str | None,
    resume: bool,
    checkpoint_every: int | None,
    evaluate_every: int | None,
    target_return: float | None,
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
    resumes_folder = resume and out is not None and task is None and named_task is None
    name = None if resumes_folder else task_id(one_task(task, named_task))
    given = {name: json_value(word) for name, word in values}
    schedule = Schedule(
        checkpoint_every,
        evaluate_every,
        threads=threads,
        tensorboard=tensorboard,
        target_return=target_return,
    )
    base = Path(out if out is not None else _folder_of(str(name), engine, algorithm or ALGORITHM))
    known = _known_runs(base) if resume else {}
    if name is None and not known:
        raise ArgumentError(f"{shown(base, 300)} has no training run that could be resumed")
    seeds = seeds or tuple(known) or (0,)
    in_folders = len(seeds) > 1 or (bool(known) and not (base / RUN).exists())
    runs: list[Trained] = []
    times: list[float] = []
    with interruptible() as interruption:
        for seed in seeds:
            earlier = known.get(seed) or next(iter(known.values()), None)
            spec = _task(name, engine, chosen, earlier, base)
            run = _specification(
                spec, algorithm, steps, envs, seed, normalize, processes, given, earlier, base
            )
            folder = base / f"seed-{seed}" if in_folders else base
            started = time.perf_counter()
            with progress_bar(run.steps, words="steps", enabled=not quiet) as advance:
                reporter = _Reporter(advance, seed if len(seeds) > 1 else None, quiet)
                try:
                    trained = train_run(
                        run,
                        folder,
                        # A seed that has not begun is begun: the run was ended in an earlier one.
                        resume=resume and (not in_folders or (folder / RUN).exists()),
                        schedule=schedule,
                        final_episodes=episodes,
                        progress=reporter,
                    )
                except KeyboardInterrupt:
                    if any((folder / "checkpoints").glob("*.zip")):
                        own = _own_task(spec.id)
                        again = f"dynx train --resume --out {one_line(base)}{own}"
                        log(f"{folder} has a checkpoint; {again} goes on from there")
                    raise
            runs.append(trained)
            times.append(time.perf_counter() - started)
        interruption.finishing = True
        made = train_document(run, runs, times)
        unwritten = present(made, show, json_path, quiet=quiet)
        unplotted = None if plot_path is None else failure_of(plot, runs, plot_path)
    return exit_code(unwritten, unplotted)


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


def _known_runs(base: Path) -> dict[int, TrainingSpec]:
    """Read the runs in a folder, by seed: its own, or those of its folders ``seed-N``."""
    folders = [base] if (base / RUN).exists() else sorted(base.glob("seed-*"))
    found = [read_run(folder) for folder in folders if (folder / RUN).exists()]
    return {spec.seed: spec for spec in sorted(found, key=lambda spec: spec.seed)}


def _task(
    name: str | None, engine: str | None, chosen: dict[str, Any], earlier: TrainingSpec | None, base: Path
) -> TaskSpec:
    """Return the task with the options given, and those of the run that is resumed."""
    if earlier is None:
        return TaskSpec(str(name), engine, chosen)
    return task_of_file(earlier.task, str(base / RUN), chosen, name).on(engine)


def _specification(
    task: TaskSpec,
    algorithm: str | None,
    steps: int | None,
    envs: int | None,
    seed: int,
    normalize: bool | None,
    processes: bool,
    given: dict[str, object],
    earlier: TrainingSpec | None,
    base: Path,
) -> TrainingSpec:
    """Return what is trained: what is given, or else what the run that is resumed has, or what is published.

    Raises ArgumentError for a file that would start more than `MAX_ENVS_OF_FILE` environments.
    """
    if earlier is not None:
        if envs is None and earlier.envs > MAX_ENVS_OF_FILE:
            raise ArgumentError(
                f"{shown(base / RUN, 300)} wants {earlier.envs} environments; give so many yourself: --envs"
            )
        return TrainingSpec(
            task,
            algorithm or earlier.algorithm,
            steps or earlier.steps,
            envs or earlier.envs,
            seed,
            earlier.normalize if normalize is None else normalize,
            processes or earlier.processes,
            {**earlier.hyperparameters, **given},
        )
    algorithm = algorithm or ALGORITHM
    recipe = recipe_of(algorithm, task)
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


def _folder_of(task: str, engine: str | None, algorithm: str) -> Path:
    return Path("runs") / "-".join(each for each in (bare_name(task), engine, algorithm) if each)


def _own_task(task: str) -> str:
    """Return the option for a task of the user: files of runs and policies import no module."""
    return f" --task {one_line(task)}" if ":" in task else ""


def show(out: Console, report: Entry) -> None:
    """Print the return of each run, their mean, and where the policies are."""
    engine = f" on {one_line(report['engine'])}" if report["engine"] else ""
    out.print(f"{one_line(report['task'])}{engine}, {report['algorithm']}", style="bold")
    right = ("seed", "steps", "episodes", "return", "deviation", "least", "time [s]")
    table = Table(
        "seed", "steps", "episodes", "return", "deviation", "least", "time [s]", "policy", right=right
    )
    for run in report["runs"]:
        table.add_row(
            str(run["seed"]),
            f"{run['steps']:,}",
            str(run["episodes"]),
            f"{run['mean']:.5g}",
            f"{run['deviation']:.3g}",
            f"{run['least']:.5g}",
            f"{run['seconds']:.0f}",
            f"{one_line(run['folder'])}/final.zip",
        )
    out.print(table)
    if len(report["runs"]) > 1:
        out.print(
            f"mean of the runs {report['mean']:.5g}, with 95 % confidence between {report['low']:.5g} and "
            f"{report['high']:.5g}"
        )
    own = _own_task(report["task"])
    out.print(f"to see it: dynx play {one_line(report['runs'][0]['folder'])}/final.zip --view{own}")


_MARKS = "os^v"


def plot(runs: Sequence[Trained], path: str) -> None:
    """Plot the mean return of the last episodes, and each evaluation with its interval, over the steps."""
    figure = new_figure(7.0, 4.0)
    axes = figure.subplots()
    for k, run in enumerate(runs):
        style = line_style(k)
        curve = read_lines(run.folder / CURVE)
        axes.plot(
            [each["steps"] for each in curve],
            [each["mean_return"] for each in curve],
            label=f"seed {run.policy.spec.seed}",
            **style,
        )
        judged = read_lines(run.folder / EVALUATIONS)
        axes.plot(
            [each["steps"] for each in judged],
            [each["mean"] for each in judged],
            _MARKS[k % len(_MARKS)],
            color=style["color"],
            ms=5,
            mfc="none",
        )
    spec = runs[0].policy.spec
    axes.set_xlabel("steps")
    axes.set_ylabel("return: last 100 episodes (line), evaluation (mark)")
    axes.set_title(literal(f"{spec.task.name}, {spec.algorithm}"))
    axes.grid(True, alpha=0.3)
    axes.legend()
    save_figure(figure, path)
