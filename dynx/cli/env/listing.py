"""Run of ``dynx env list``."""

from __future__ import annotations

from typing import Any

from dynx.cli.env.document import TaskEntry, TasksDocument
from dynx.cli.shell.exits import DONE
from dynx.cli.shell.tables import Table
from dynx.cli.shell.terminal import console, write_json
from dynx.envs.library import registry
from dynx.envs.registration import NAMESPACE, task_class


def list_tasks(json_path: str | None) -> int:
    """List the registered tasks of dynx; return the exit code."""
    entries: list[TaskEntry] = [
        _entry(each)
        for name, each in sorted(registry.items())
        if name.startswith(f"{NAMESPACE}/") and "task" in each.kwargs
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


def _entry(spec: Any) -> TaskEntry:
    kind = task_class(spec.kwargs["task"])
    return {
        "id": spec.id,
        "summary": (kind.__doc__ or "").strip().splitlines()[0].rstrip("."),
        "max_episode_steps": spec.max_episode_steps,
        "reward_threshold": spec.reward_threshold,
        "engines": list(kind.engines()),
    }
