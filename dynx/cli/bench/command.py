"""``dynx bench``: how fast are the engines on this machine and this robot?"""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from dynx.cli.shell.options import frame_option, json_flag, model_options, name_list

if TYPE_CHECKING:
    from dynx.model.model import Base

QUANTITIES = ("forward_kinematics", "jacobian", "inverse_dynamics", "forward_dynamics", "mass_matrix")
"""A test holds them to those of `dynx.bench`, which is slow to import."""


@click.command(short_help="How fast are the engines on this machine and robot?")
@click.argument("robot")
@click.option(
    "--quantity",
    "quantities",
    type=click.Choice(QUANTITIES),
    multiple=True,
    help="What to time; may be given several times (default: all).",
)
@click.option(
    "--batch",
    "batches",
    type=click.IntRange(min=1),
    multiple=True,
    metavar="N",
    help="Samples in one call; may be given several times (default: 1, 8 and 65536).",
)
@click.option(
    "--threads",
    type=click.IntRange(min=1),
    multiple=True,
    metavar="N",
    help="Threads of what has threads; may be given several times (default: 1, and one per processor).",
)
@click.option(
    "--backends", type=name_list, metavar="A,B,C", help="The engines to time (default: all installed)."
)
@frame_option
@model_options
@click.option("--seed", type=click.IntRange(min=0), default=0, show_default=True, help="Of the samples.")
@click.option("--quick", is_flag=True, help="5 repetitions instead of 20.")
@json_flag
def bench(
    robot: str,
    quantities: tuple[str, ...],
    batches: tuple[int, ...],
    threads: tuple[int, ...],
    backends: tuple[str, ...] | None,
    frame: str | None,
    base: Base,
    lock: tuple[tuple[str, float], ...],
    seed: int,
    quick: bool,
    as_json: bool,
) -> int:
    """Time all engines, and the peers beside them, on this machine and this robot.

    Every way to do a work is checked first; one that answers wrongly is reported and not timed. Then
    all are called in turn, so that whatever else the machine does falls on all alike. Shown are the
    median time of one sample, the distance of the quartiles, how many times faster than each peer,
    and for compiled kernels how near they come to the machine's own limits.

    Exit code 0 if every answer was right, 1 if one was wrong, 2 if the robot cannot be used. Ctrl-C
    ends the run with what is measured so far, and 130.

    \b
    Examples:
      dynx bench ur5
      dynx bench panda --quantity inverse_dynamics --batch 1000000 --threads 1
      dynx bench path/to/my.urdf --base floating --quick --json
    """
    from dynx.backends.registry import backend_class
    from dynx.bench import Plan, Session, works
    from dynx.bench.session import BATCHES, QUICK_REPETITIONS, REPETITIONS, WORTH_THREADS
    from dynx.cli.bench.run import run_bench
    from dynx.cli.shell.configuration_input import chosen_frame
    from dynx.cli.shell.run import processors
    from dynx.model.loading import load

    for name in backends or ():
        backend_class(name)
    model = load(robot, base=base, lock=dict(lock))
    plan = Plan(
        model,
        chosen_frame(model, frame),
        works(
            quantities or QUANTITIES,
            batches or BATCHES,
            threads or (1, processors()),
            1 if threads else WORTH_THREADS,
        ),
        backends,
        QUICK_REPETITIONS if quick else REPETITIONS,
        seed,
    )
    with Session(plan) as session:
        return run_bench(session, as_json=as_json)
