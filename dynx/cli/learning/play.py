"""Run of ``dynx play``: episodes of a policy, judged, shown or filmed."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import ExitStack, closing, suppress
from functools import partial
from itertools import count
from typing import Any

import numpy as np
from rich.console import Console

from dynx.cli.learning.documents import play_document
from dynx.cli.shell.exits import DONE, exit_code, interruptible, one_line
from dynx.cli.shell.options import json_value
from dynx.cli.shell.output import (
    Entry,
    check_json,
    check_writable,
    console,
    counted,
    log,
    present,
    progress_bar,
)
from dynx.cli.shell.tables import Table
from dynx.envs.registration import is_of_dynx, task_id
from dynx.errors import ArgumentError
from dynx.files.films import film_suffix, write_pictures
from dynx.training import Evaluation, Policy, TaskSpec, judge, load_policy, make
from dynx.training.file_tasks import task_of_file
from dynx.training.policy import read_policy_document

DEFAULT_EPISODES = 10

PICTURES_PER_SECOND = 25.0
"""Largest rate of the pictures of a film."""


def play(
    policy: str,
    own_task: str | None,
    engines: tuple[str, ...] | None,
    options: Sequence[tuple[str, str]],
    episodes: int | None,
    seed: int,
    stochastic: bool,
    unpickle: bool,
    algorithm: str | None,
    statistics: str | None,
    view: bool,
    export_path: str | None,
    json_path: str | None,
    quiet: bool,
) -> int:
    """Judge, show or film a policy; return the exit code."""
    check_json(json_path)
    if view and export_path is not None:
        raise ArgumentError("--view and --export are given together; wanted one of them")
    most = 2 if view else 1
    if (view or export_path is not None) and (json_path is not None or len(engines or ()) > most):
        shown_only = "--view shows episodes of one or two engines" if view else "--export films one engine"
        raise ArgumentError(f"{shown_only}; --json and more engines judge them")
    load: Callable[[TaskSpec], Policy]
    if unpickle:
        task = _given_task(options, own_task)
        load = partial(_load_unpickled, policy, algorithm, statistics)
    else:
        for name, value in (("--algo", algorithm), ("--statistics", statistics)):
            if value is not None:
                raise ArgumentError(
                    f"{name} has an effect on a file of stable-baselines3 alone; wanted --unpickle"
                )
        task = _task_of(policy, options, own_task)
        load = partial(load_policy, policy)
    if engines is not None and not is_of_dynx(task.id):
        raise ArgumentError(f"--engine chooses the engine of a task of dynx; {task.id} has its own")
    tasks = [task.on(engine) for engine in engines or (None,)]
    first = tasks[0]
    if view or export_path is not None:
        trained = load(first)
        if export_path is not None:
            return _film(trained, first, episodes or 1, seed, not stochastic, export_path, quiet)
        return _show(trained, tasks, episodes, seed, not stochastic)
    found: list[tuple[TaskSpec, Evaluation]] = []
    with interruptible() as interruption:
        per_engine = episodes or DEFAULT_EPISODES
        with progress_bar(per_engine * len(tasks), words="episodes", enabled=not quiet) as advance:
            for each in tasks:
                trained = load(each)

                def progress(done: int) -> None:
                    advance(len(found) * per_engine + done, "episodes")

                judged = judge(
                    trained, each, per_engine, seed, deterministic=not stochastic, progress=progress
                )
                found.append((each, judged))
        interruption.finishing = True
        made = play_document(policy, trained, None if unpickle else task.engine, found)
        error = present(made, show, json_path, quiet=quiet)
    return exit_code(error)


def _task_of(policy: str, options: Sequence[tuple[str, str]], own_task: str | None) -> TaskSpec:
    """Return the task of a policy with the options and the name that the command gives."""
    # First, because it registers the task that the file may name.
    env_id = None if own_task is None else task_id(own_task)
    task = read_policy_document(policy).spec.task
    given = {name: json_value(word) for name, word in options}
    return task_of_file(task, policy, given, env_id)


def _given_task(options: Sequence[tuple[str, str]], own_task: str | None) -> TaskSpec:
    """Return the task of a file that names none."""
    if own_task is None:
        raise ArgumentError(
            "a file of stable-baselines3 names no task; wanted --task, such as --task CartPole-v1"
        )
    return TaskSpec(task_id(own_task), None, {name: json_value(word) for name, word in options})


def _load_unpickled(path: str, algorithm: str | None, statistics: str | None, task: TaskSpec) -> Policy:
    from dynx.training import load_stable_baselines  # needs stable-baselines3, unlike files of dynx

    return load_stable_baselines(path, task, algorithm, statistics)


def _show(
    policy: Policy, tasks: Sequence[TaskSpec], episodes: int | None, seed: int, deterministic: bool
) -> int:
    # Imported here, because judging and filming need no page.
    from dynx.envs.watching import Ended, EpisodePage

    out = console()

    def ended(episode: Ended) -> None:
        numbers = zip(tasks, episode.totals, episode.steps, strict=True)
        found = [f"return {total:.5g} in {steps} steps" for _, total, steps in numbers]
        if len(tasks) > 1:
            found = [f"{task.engine}: {text}" for task, text in zip(tasks, found, strict=True)]
        out.print(f"seed {episode.seed}: {'; '.join(found)}")

    with suppress(KeyboardInterrupt), interruptible(), ExitStack() as opened:
        envs = [opened.enter_context(closing(make(task, "rgb_array"))) for task in tasks]
        names = [one_line(task.engine or "") for task in tasks]
        page = opened.enter_context(
            EpisodePage(
                lambda seen: policy(seen, deterministic), envs, names, title=one_line(tasks[0].id), seed=seed
            )
        )
        out.print(f"{one_line(repr(policy)[1:-1])} is shown at {page.url}; Ctrl-C ends it", soft_wrap=True)
        page.run(episodes, ended)
    return DONE


def _episode(
    policy: Policy, env: Any, seed: int, deterministic: bool, each: Any = lambda: None
) -> tuple[float, int]:
    """Run one episode; `each` is called at its start and after each step. Return its return and length."""
    observation, _ = env.reset(seed=seed)
    each()
    total, length, ended = 0.0, 0, False
    while not ended:
        action = policy(np.asarray(observation)[None], deterministic)[0]
        observation, reward, terminated, truncated, _ = env.step(action)
        each()
        total, length, ended = total + float(reward), length + 1, terminated or truncated
    return total, length


def _film(
    policy: Policy, task: TaskSpec, episodes: int, seed: int, deterministic: bool, path: str, quiet: bool
) -> int:
    check_writable(path)
    film_suffix(path)
    pictures: list[Any] = []
    with (
        interruptible(),
        closing(make(task, "rgb_array")) as env,
        progress_bar(episodes, words="episodes", enabled=not quiet) as advance,
    ):
        rate = float(env.metadata.get("render_fps") or PICTURES_PER_SECOND)
        skip = max(1, int(np.ceil(rate / PICTURES_PER_SECOND)))
        steps = count()

        def draw() -> None:
            if next(steps) % skip == 0:
                pictures.append(env.render())
                advance(done, f"episodes, {counted(len(pictures), 'picture')}")

        for done in range(episodes):
            total, length = _episode(policy, env, seed + done, deterministic, draw)
            advance(done + 1, f"episodes, {counted(len(pictures), 'picture')}")
            if not quiet:
                log(f"episode {done + 1} of {episodes}: return {total:.5g} in {counted(length, 'step')}")
    write_pictures(path, pictures, skip / rate)
    if not quiet:
        console().print(f"wrote {one_line(path)}")
    return DONE


def show(out: Console, report: Entry) -> None:
    """Print what the policy is worth on each engine."""
    engine = f" on {one_line(report['trained_on'])}" if report["trained_on"] else ""
    out.print(
        f"{one_line(report['task'])}: {report['algorithm']}, {report['steps']:,} steps{engine}", style="bold"
    )
    right = ("return", "deviation", "mean between", "least", "mean length")
    table = Table("engine", *right, right=right)
    for each in report["engines"]:
        table.add_row(
            one_line(each["engine"] or "its own"),
            f"{each['mean']:.5g}",
            f"{each['deviation']:.3g}",
            f"{each['low']:.5g} and {each['high']:.5g}",
            f"{min(each['returns']):.5g}",
            f"{each['mean_length']:.4g}",
        )
    out.print(table)
    for each in report["engines"]:
        if each["diverged"]:
            lost = counted(each["diverged"], "episode")
            out.print(f"{one_line(each['engine'] or 'its own')}: {lost} diverged and counted up to there")
    episodes = counted(len(report["engines"][0]["returns"]), "episode")
    out.print(
        f"{episodes}, the first with seed {report['seed']}; the true mean lies between the two with 95 %"
    )
