"""Declarations of ``dynx env``, ``train`` and ``play``: reinforcement learning."""

from __future__ import annotations

import click

from dynx.cli.shell.lazy import LazyGroup, runs
from dynx.cli.shell.options import (
    FiniteRange,
    GroupedCommand,
    engine_option,
    engines_option,
    group,
    json_option,
    name_list,
    name_value,
    named_task_option,
    quiet_option,
    silent_option,
    task_options,
    whole_numbers,
)


@click.group(cls=LazyGroup)
def env() -> None:
    """List the tasks of reinforcement learning, and measure how far apart the engines are on one.

    \b
    Examples:
      dynx env list
      dynx env distance CartPole
      dynx env distance Stand --engine pybullet,mujoco --tolerance 1e-3
    """


@env.command("list")
@click.argument("modules", nargs=-1, metavar="[MODULE...]")
@json_option
@silent_option
@runs("dynx.cli.learning.env:list_tasks")
def list_tasks() -> None:
    """List the tasks of dynx, and those that each MODULE of yours registers: id, engines, time limit.

    \b
    Examples:
      dynx env list
      dynx env list my_tasks
      dynx env list --json
    """


@env.command(cls=GroupedCommand)
@click.argument("task", required=False, metavar="TASK")
@group(
    "Measurement",
    engines_option("Engines to compare"),
    named_task_option,
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
@runs("dynx.cli.learning.env:distance")
def distance() -> None:
    """Run a task with the same seeds and the same actions on several engines, and tell where they part.

    TASK is a task of dynx (`dynx env list`), or one of your own as module:Env-v0, whose module is imported.

    For every two engines: in how many episodes the observations part by more than the tolerance, after how
    many steps, by how much at most, and the returns. With --policy also a table: each policy, trained on one
    engine, judged on all of them.

    Exit code 0; 2 for input that cannot be used. After Ctrl-C the exit code is 130.

    \b
    Examples:
      dynx env distance CartPole
      dynx env distance --task my_module:mine/Lift-v0
      dynx env distance Stand --engine pybullet,mujoco --tolerance 1e-3
      dynx env distance Stand --policy on_mujoco.zip --policy on_pybullet.zip --json table.json
    """


@click.command(cls=GroupedCommand)
@click.argument("task", required=False, metavar="TASK")
@group(
    "Training",
    engine_option("engine", "Engine of a task of dynx (default: that of the task).", metavar="NAME"),
    named_task_option,
    task_options,
    click.option(
        "--randomize",
        type=name_value,
        multiple=True,
        metavar="NAME=VALUE",
        help="Parameter of a task of dynx that each episode draws, such as mass_scale=[0.8,1.2] (uniform) or "
        "delay=0.02 [s]; may be given several times.",
    ),
    click.option(
        "--algo",
        "algorithm",
        metavar="NAME",
        help="Algorithm of stable-baselines3: ppo, a2c, dqn, sac or td3 (default: ppo).",
    ),
    click.option("--steps", type=click.IntRange(min=1), help="Number of steps (default: the published one)."),
    click.option(
        "--seed",
        "seeds",
        type=whole_numbers,
        metavar="A,B,C",
        help="Seeds, each with a run of its own (default: 0).",
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
        help="Hyperparameter of the algorithm, such as gamma=0.98, learning_rate=lin_0.001 (falls to zero "
        "until the end) or learning_rate=kl_0.01 (PPO: keeps the divergence of updates near 0.01); may be "
        "given several times (default: those of rl-baselines3-zoo).",
    ),
)
@group(
    "Run",
    click.option(
        "--out",
        metavar="FOLDER",
        help="Folder of the run, with a folder for each seed (default: runs/TASK-ENGINE-ALGO).",
    ),
    click.option(
        "--resume",
        is_flag=True,
        help="Go on from the last checkpoint in the folder, with the options of its run; only those that "
        "change, such as --steps, are given.",
    ),
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
        "--target-return",
        type=float,
        metavar="RETURN",
        help="Mean return of an evaluation at which training ends early (default: none).",
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
        help="Threads of environments with contacts in kernels, of mini-batches of PPO with more than 4096 "
        "samples, and of PyTorch, which is no faster with more for small networks.",
    ),
    click.option("--tensorboard", is_flag=True, help="Write curves for TensorBoard into the folder."),
)
@group(
    "Output",
    json_option,
    click.option("--plot", "plot_path", metavar="FILE", help="File for a plot of the learning curves."),
    quiet_option,
)
@runs("dynx.cli.learning.train:train")
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
      dynx train --task my_module:mine/Lift-v0
      dynx train CartPole --engine compiled --seed 0,1,2 --plot curve.png
      dynx train Stand --engine mujoco --out stand
      dynx train LunarLander-v3 --out lander
      dynx train --resume --out stand
      dynx train CartPole --engine compiled --randomize mass_scale=[0.5,2]
      dynx train Pendulum --algo sac --steps 20000 --set learning_rate=0.001
    """


@click.command(cls=GroupedCommand)
@click.argument("policy", metavar="FILE")
@group(
    "Episodes",
    engine_option(
        "engines",
        "Engines on which the policy is judged (default: that of its training).",
        type=name_list,
        metavar="A,B,C",
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
    "Files of stable-baselines3",
    click.option(
        "--unpickle",
        is_flag=True,
        help="Read FILE as stable-baselines3 saved it, for the task of --task. This runs the code that is in "
        "the file: use it for files that you trust.",
    ),
    click.option(
        "--algo",
        "algorithm",
        metavar="NAME",
        help="Its algorithm: ppo, a2c, dqn, sac or td3 (default: the one whose hyperparameters it has).",
    ),
    click.option(
        "--statistics",
        metavar="PICKLE",
        help="Statistics of VecNormalize by which observations were scaled; with --unpickle, which runs the "
        "code in this file, too.",
    ),
)
@group(
    "Output",
    click.option(
        "--view",
        is_flag=True,
        help="Page in the browser with the episodes, their numbers and controls; on one engine or two.",
    ),
    click.option(
        "--export",
        "export_path",
        metavar="FILE",
        help="Film of an episode, as .gif, .webp or .mp4 (extra film).",
    ),
    json_option,
    quiet_option,
)
@runs("dynx.cli.learning.play:play")
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
      dynx play stand/final.zip --engine mujoco,pybullet --episodes 100
      dynx play lander/final.zip --view
      dynx play stand/final.zip --view --engine mujoco,pybullet
      dynx play ppo.zip --unpickle --task CartPole-v1 --statistics stats.pkl
      dynx play lander/final.zip --export lander.mp4
    """
