"""Runs of ``dynx env list`` and ``dynx env distance``, with their tables."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from rich.console import Console

from dynx.cli.learning.documents import PolicyEntry, TaskEntry, TasksDocument, distance_document, policy_entry
from dynx.cli.shell.exits import DONE, exit_code, interruptible, one_line
from dynx.cli.shell.options import json_value, one_task
from dynx.cli.shell.output import Entry, check_json, console, entry_of, present, progress_bar, write_json
from dynx.cli.shell.tables import Table
from dynx.envs.distance import engine_distance
from dynx.envs.environment import Act
from dynx.envs.library import make_env, registry
from dynx.envs.registration import bare_id, import_tasks, is_of_dynx, task_class, task_id
from dynx.errors import ArgumentError, shown


def distance(
    task: str | None,
    named_task: str | None,
    engines: tuple[str, ...] | None,
    options: Sequence[tuple[str, str]],
    seeds: tuple[int, ...] | None,
    steps: int,
    tolerance: float,
    policies: tuple[str, ...],
    episodes: int,
    json_path: str | None,
    quiet: bool,
) -> int:
    """Measure how far apart the engines are on a task; return the exit code."""
    check_json(json_path)
    env_id = task_id(one_task(task, named_task))
    if not is_of_dynx(env_id):
        raise ArgumentError(f"{env_id} runs on one engine, its own; wanted a task of dynx (dynx env list)")
    chosen = engines or task_class(env_id).engines()
    given = {name: json_value(word) for name, word in options}
    numbers = seeds or tuple(range(10))
    act = _first_policy(policies, env_id, chosen[0])
    judged: list[PolicyEntry] = []
    with interruptible() as interruption:
        total = len(chosen) * len(numbers)
        with progress_bar(total, words="episodes", enabled=not quiet) as advance:
            found = engine_distance(
                lambda engine: make_env(env_id, engine=engine, **given),
                chosen,
                seeds=numbers,
                steps=steps,
                tolerance=tolerance,
                policy=act,
                progress=lambda done: advance(done, "episodes"),
            )
        with progress_bar(len(policies) * len(chosen), words="judged", enabled=not quiet) as advance:
            for path in policies:
                judged.append(policy_entry(path, env_id, chosen, given, episodes))
                advance(len(judged) * len(chosen), "judged")
        interruption.finishing = True
        made = distance_document(env_id, given, found, judged)
        error = present(made, show, json_path, quiet=quiet)
    return exit_code(error)


def _first_policy(policies: tuple[str, ...], env_id: str, engine: str) -> Act | None:
    """Return the first policy, whose actions all engines get; None without one."""
    if not policies:
        return None
    # Imports PyTorch.
    from dynx.training import TaskSpec, load_policy
    from dynx.training.policy import read_policy_document

    found = []
    for path in policies:
        trained_on = read_policy_document(path).spec.task.id
        if bare_id(trained_on) != bare_id(env_id):
            raise ArgumentError(f"{path} is a policy for {shown(trained_on)}, not for {env_id}")
        found.append(load_policy(path, TaskSpec(env_id, engine)))
    return found[0]


def show(out: Console, report: Entry) -> None:
    """Print where every two engines part, and what each policy is worth on each engine."""
    seeds = len(report["pairs"][0]["episodes"])
    out.print(
        f"{one_line(report['task'])}: {seeds} episode{'s' * (seeds != 1)} with the same actions, on "
        f"{', '.join(report['engines'])}",
        style="bold",
    )
    right = ("parted", "first step", "median step", "largest difference", "returns")
    columns = (*right[:2], "parts first", *right[2:])
    table = Table("engines", *columns, right=right)
    for pair in report["pairs"]:
        table.add_row(
            ", ".join(pair["engines"]),
            f"{pair['parted']} of {len(pair['episodes'])}",
            "never" if pair["first_step"] is None else str(pair["first_step"]),
            _first_entry(pair),
            "never" if pair["median_step"] is None else f"{pair['median_step']:g}",
            f"{pair['largest']:.2e}",
            ", ".join(f"{each:.5g}" for each in pair["mean_returns"]),
        )
    out.print(table)
    out.print(
        f"two engines part where an entry of the observation differs by more than {report['tolerance']:g}; "
        "the one that differs most at the first step is named"
    )
    if report["policies"]:
        _show_policies(out, report)


def _first_entry(pair: Entry) -> str:
    if pair["first_step"] is None:
        return ""
    return "end of the episode" if pair["first_entry"] is None else one_line(pair["first_entry"])


def _show_policies(out: Console, report: Entry) -> None:
    columns = [f"on {engine}" for engine in report["engines"]]
    table = Table("policy", "trained on", *columns, right=tuple(columns))
    for each in report["policies"]:
        cells = (f"{row['mean']:.4g} +- {row['deviation']:.2g}" for row in each["engines"])
        table.add_row(one_line(each["file"]), each["trained_on"] or "", *cells)
    episodes = report["policies"][0]["episodes"]
    out.print(f"\nreturn of each policy, mean and deviation of {episodes} episodes")
    out.print(table)


def list_tasks(modules: tuple[str, ...], json_path: str | None) -> int:
    """List the registered tasks, those of some modules included; return the exit code."""
    for module in modules:
        import_tasks(module)
    entries: list[TaskEntry] = [
        _task_entry(each) for name, each in sorted(registry.items()) if is_of_dynx(name)
    ]
    document: TasksDocument = {"schema": "dynx.tasks/1", "tasks": entries}
    if write_json(document, json_path):
        return DONE
    table = Table("task", "what is learned", "time limit", "engines", right=("time limit",))
    for each in entries:
        table.add_row(
            each["id"], each["summary"], str(each["max_episode_steps"] or "none"), ", ".join(each["engines"])
        )
    console().print(table)
    return DONE


def _task_entry(spec: Any) -> TaskEntry:
    kind = task_class(spec.kwargs["task"])
    summary = (kind.__doc__ or "").strip().splitlines()[0].rstrip(".")
    return entry_of(TaskEntry, spec, summary=summary, engines=kind.engines())
