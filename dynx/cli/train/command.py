"""Declaration of ``dynx train``."""

from __future__ import annotations

import click

from dynx.cli.shell.lazy import runs
from dynx.cli.shell.options import (
    GroupedCommand,
    group,
    json_option,
    name_value,
    quiet_option,
    task_options,
    whole_numbers,
)


@click.command(cls=GroupedCommand)
@click.argument("task", metavar="TASK")
@group(
    "Training",
    click.option("--engine", metavar="NAME", help="Engine of a task of dynx (default: that of the task)."),
    task_options,
    click.option(
        "--randomize",
        type=name_value,
        multiple=True,
        metavar="NAME=VALUE",
        help="Parameter of a task of dynx that each episode draws, such as mass_scale=[0.8,1.2] (uniform) or "
        "delay=0.02 [s]; may be given several times (docs/environments.md).",
    ),
    click.option(
        "--algo",
        "algorithm",
        default="ppo",
        show_default=True,
        metavar="NAME",
        help="Algorithm of stable-baselines3: ppo, a2c, dqn, sac or td3.",
    ),
    click.option("--steps", type=click.IntRange(min=1), help="Number of steps (default: the published one)."),
    click.option(
        "--seed",
        "seeds",
        type=whole_numbers,
        default="0",
        show_default=True,
        metavar="A,B,C",
        help="Seeds, each with a run of its own.",
    ),
    click.option(
        "--envs",
        type=click.IntRange(min=1),
        help="Number of environments stepped together (default: the published one).",
    ),
    click.option("--processes", is_flag=True, help="Step each environment in a process of its own."),
    click.option(
        "--normalize/--no-normalize",
        default=None,
        help="Scale observations and rewards by their running mean and deviation (default: as published).",
    ),
    click.option(
        "--set",
        "values",
        type=name_value,
        multiple=True,
        metavar="NAME=VALUE",
        help="Hyperparameter of the algorithm, such as gamma=0.98 or learning_rate=lin_0.001 (falls to zero "
        "until the end); may be given several times (default: those of rl-baselines3-zoo).",
    ),
)
@group(
    "Run",
    click.option(
        "--out",
        metavar="FOLDER",
        help="Folder of the run, with a folder for each seed (default: runs/TASK-ENGINE-ALGO).",
    ),
    click.option("--resume", is_flag=True, help="Go on from the last checkpoint in the folder."),
    click.option(
        "--checkpoint-every",
        type=click.IntRange(min=1),
        metavar="STEPS",
        help="Steps between checkpoints (default: a twentieth of all).",
    ),
    click.option(
        "--evaluate-every",
        type=click.IntRange(min=1),
        metavar="STEPS",
        help="Steps between evaluations (default: a tenth of all).",
    ),
    click.option(
        "--episodes",
        type=click.IntRange(min=1),
        default=100,
        show_default=True,
        help="Episodes of the last evaluation.",
    ),
    click.option(
        "--threads",
        type=click.IntRange(min=1),
        default=1,
        show_default=True,
        help="Threads of PyTorch; small networks are no faster with more.",
    ),
    click.option("--tensorboard", is_flag=True, help="Write curves for TensorBoard into the folder."),
)
@group(
    "Output",
    json_option,
    click.option("--plot", "plot_path", metavar="FILE", help="File for a plot of the learning curves."),
    quiet_option,
)
@runs("dynx.cli.train.run:train")
def train() -> None:
    """Train a policy on a task by reinforcement learning, and judge it.

    TASK is a task of dynx (`dynx env list`), such as CartPole, or the id of any registered task of Gymnasium,
    such as LunarLander-v3, or a task of your own as module:Env-v0, whose module is imported. Training needs
    the extra train.

    The folder of a run gets checkpoints, evaluations (evaluations.jsonl), the mean return of the last hundred
    episodes (curve.jsonl), and the policies best.zip and final.zip, which `dynx play` shows and
    stable-baselines3 loads. A run that was ended in any way goes on with --resume, and loses at most the
    steps since its last checkpoint.

    Exit code 0; 2 for input that cannot be used. After Ctrl-C the exit code is 130.

    \b
    Examples:
      dynx train CartPole
      dynx train CartPole --engine compiled --seed 0,1,2 --plot curve.png
      dynx train LunarLander --engine mujoco --out lander
      dynx train LunarLander --engine mujoco --out lander --resume
      dynx train CartPole --engine compiled --randomize mass_scale=[0.5,2]
      dynx train Pendulum --algo sac --steps 20000 --set learning_rate=0.001
    """
