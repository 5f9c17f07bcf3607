"""Declaration of ``dynx play``."""

from __future__ import annotations

import click

from dynx.cli.shell.lazy import runs
from dynx.cli.shell.options import GroupedCommand, group, json_option, name_list, quiet_option, task_options


@click.command(cls=GroupedCommand)
@click.argument("policy", metavar="FILE")
@group(
    "Episodes",
    click.option(
        "--engine",
        "engines",
        type=name_list,
        metavar="A,B,C",
        help="Engines on which the policy is judged (default: that of its training).",
    ),
    click.option(
        "--task",
        "own_task",
        metavar="ID",
        help="Task instead of the one that the file names, such as one of your own: module:Env-v0, whose "
        "module is imported.",
    ),
    task_options,
    click.option(
        "--episodes",
        type=click.IntRange(min=1),
        help="Number of episodes (default: 10; 1 with --export; with --view until Ctrl-C).",
    ),
    click.option(
        "--seed",
        type=click.IntRange(min=0),
        default=0,
        show_default=True,
        help="Seed of the first episode; the next have the numbers after it.",
    ),
    click.option(
        "--random", "stochastic", is_flag=True, help="Draw actions instead of taking the likeliest."
    ),
)
@group(
    "Output",
    click.option("--view", is_flag=True, help="Show the episodes in the browser, in real time."),
    click.option("--export", "export_path", metavar="FILE", help="Film of an episode, as .gif."),
    json_option,
    quiet_option,
)
@runs("dynx.cli.play.run:play")
def play() -> None:
    """Judge a policy that `dynx train` wrote, show it in the browser, or film it.

    FILE is final.zip or best.zip of a run. Only numbers are read from it, so that it runs no code: it names a
    registered task. A task of your own, and options that name a file, are given by you.
    On several engines, each episode begins alike: the table tells what the policy is worth where it was not
    trained.

    Exit code 0; 2 for input that cannot be used. After Ctrl-C the exit code is 130, or 0 with --view.

    \b
    Examples:
      dynx play runs/CartPole-compiled-ppo/final.zip
      dynx play lander/final.zip --engine mujoco,pybullet --episodes 100
      dynx play lander/final.zip --view
      dynx play lander/final.zip --export lander.gif
    """
