"""Run of ``dynx env distance``."""

from __future__ import annotations

from collections.abc import Sequence

from dynx.cli.env.document import PolicyEntry, document, policy_entry
from dynx.cli.env.tables import show
from dynx.cli.shell.exits import BAD_INPUT, DONE, complain
from dynx.cli.shell.interruption import interruptible
from dynx.cli.shell.options import json_value
from dynx.cli.shell.output_file import check_json
from dynx.cli.shell.progress import progress_bar
from dynx.cli.shell.terminal import present
from dynx.envs.distance import Act, engine_distance
from dynx.envs.library import make_env, registry
from dynx.envs.registration import is_of_dynx, task_class, task_id
from dynx.errors import ArgumentError, shown


def distance(
    task: str,
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
    env_id = task_id(task)
    if not is_of_dynx(env_id):
        raise ArgumentError(f"{env_id} runs on one engine, its own; wanted a task of dynx (dynx env list)")
    chosen = engines or task_class(registry[env_id].kwargs["task"]).engines()
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
                judged.append(policy_entry(path, chosen, given, episodes))
                advance(len(judged) * len(chosen), "judged")
        interruption.finishing = True
        made = document(env_id, given, found, judged)
        error = present(made, _nothing if quiet else show, json_path)
    if error is not None:
        complain(str(error))
        return BAD_INPUT
    return DONE


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
        if trained_on != env_id:
            raise ArgumentError(f"{path} is a policy for {shown(trained_on)}, not for {env_id}")
        found.append(load_policy(path, TaskSpec(env_id, engine)))
    return found[0]


def _nothing(*_: object) -> None:
    """Show nothing."""
