"""Declarations of ``dynx env list`` and ``dynx env distance``."""

from __future__ import annotations

import click

from dynx.cli.shell.lazy import runs
from dynx.cli.shell.options import (
    FiniteRange,
    GroupedCommand,
    engines_option,
    group,
    json_option,
    quiet_option,
    task_options,
    whole_numbers,
)


@click.group()
def env() -> None:
    """List the tasks of reinforcement learning, and measure how far apart the engines are on one.

    \b
    Examples:
      dynx env list
      dynx env distance CartPole
      dynx env distance LunarLander --engine pybullet,mujoco --tolerance 1e-3
    """


@env.command("list")
@json_option
@runs("dynx.cli.env.listing:list_tasks")
def list_tasks() -> None:
    """List the tasks of dynx: id, engines, spaces, time limit.

    \b
    Examples:
      dynx env list
      dynx env list --json
    """


@env.command(cls=GroupedCommand)
@click.argument("task", metavar="TASK")
@group(
    "Measurement",
    engines_option("Engines to compare"),
    task_options,
    click.option(
        "--seed",
        "seeds",
        type=whole_numbers,
        metavar="A,B,C",
        help="Seeds of the episodes (default: 0 to 9).",
    ),
    click.option(
        "--steps",
        type=click.IntRange(min=1),
        default=200,
        show_default=True,
        help="Largest number of steps of an episode.",
    ),
    click.option(
        "--tolerance",
        type=FiniteRange(min=0.0, min_open=True),
        default=1e-6,
        show_default=True,
        help="Difference of an entry of the observation beyond which two engines part.",
    ),
    click.option(
        "--policy",
        "policies",
        multiple=True,
        metavar="FILE",
        help="Policy of `dynx train`: its actions on the first engine are those of all, and it is judged on "
        "every engine; may be given several times, such as one trained on each engine.",
    ),
    click.option(
        "--episodes",
        type=click.IntRange(min=1),
        default=100,
        show_default=True,
        help="Episodes by which each policy is judged on each engine.",
    ),
)
@group("Output", json_option, quiet_option)
@runs("dynx.cli.env.run:distance")
def distance() -> None:
    """Run a task with the same seeds and the same actions on several engines, and tell where they part.

    For every two engines: in how many episodes the observations part by more than the tolerance, after how
    many steps, by how much at most, and the returns. With --policy also a table: each policy, trained on one
    engine, judged on all of them.

    Exit code 0; 2 for input that cannot be used. After Ctrl-C the exit code is 130.

    \b
    Examples:
      dynx env distance CartPole
      dynx env distance LunarLander --engine pybullet,mujoco --tolerance 1e-3
      dynx env distance LunarLander --policy on_mujoco.zip --policy on_pybullet.zip --json table.json
    """
