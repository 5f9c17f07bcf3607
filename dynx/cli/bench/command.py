"""Declaration of ``dynx bench``."""

from __future__ import annotations

import click

from dynx.cli.shell.lazy import runs
from dynx.cli.shell.options import frame_option, json_option, model_options, name_list, one_of


@click.command
@click.argument("robot")
@click.option(
    "--quantity",
    "quantities",
    type=one_of(source="dynx.backends.quantities:QUANTITIES"),
    multiple=True,
    metavar="NAME",
    help="Quantity to time, such as inverse-dynamics or mass-matrix; may be given several times "
    "(default: poses, Jacobian, inverse and forward dynamics, mass matrix; a wrong name prints a list).",
)
@click.option(
    "--batch",
    "batches",
    type=click.IntRange(min=1),
    multiple=True,
    metavar="N",
    help="Number of samples in one call; may be given several times (default: 1, 8 and 65536).",
)
@click.option(
    "--threads",
    type=click.IntRange(min=1),
    multiple=True,
    metavar="N",
    help="Number of threads of implementations that can use several; may be given several times "
    "(default: 1, and one per processor).",
)
@click.option(
    "--backends", type=name_list, metavar="A,B,C", help="Backends to time (default: all installed)."
)
@frame_option
@model_options
@click.option(
    "--seed", type=click.IntRange(min=0), default=0, show_default=True, help="Seed of the random samples."
)
@click.option("--quick", is_flag=True, help="Run with 5 repetitions instead of 20.")
@json_option
@runs("dynx.cli.bench.run:bench")
def bench() -> None:
    """Time all backends, and other libraries for comparison, on this machine and this robot.

    Each implementation is checked before it is timed; one with a wrong result is reported and not
    timed. All are then called in turn, so that other load on the machine affects them alike. The table
    shows the median time per sample, the interquartile range, the speed relative to each other library,
    and for compiled kernels the share of the machine's memory bandwidth and arithmetic peak.

    Exit code 0 if every result was right, 1 if one was wrong, 2 if the robot cannot be used. Ctrl-C
    ends the run with the measurements so far and exit code 130.

    \b
    Examples:
      dynx bench ur5
      dynx bench panda --quantity inverse-dynamics --batch 1000000 --threads 1
      dynx bench path/to/my.urdf --base floating --quick --json
    """
