"""Declaration of ``dynx agree``."""

from __future__ import annotations

import click

from dynx.cli.shell.lazy import runs
from dynx.cli.shell.options import json_option, model_options, name_list, run_options


@click.command
@click.argument("robots", nargs=-1, required=True, metavar="ROBOT...")
@click.option(
    "--backends",
    type=name_list,
    metavar="A,B,C",
    help="Backends to compare; with --as-loaded, engines (default: all that are installed).",
)
@click.option(
    "--as-loaded",
    is_flag=True,
    help="Compare the engines as each loads the file itself.",
)
@model_options
@click.option(
    "--samples",
    type=click.IntRange(min=1),
    help="Number of random configurations per robot (default: 16; with --as-loaded 5).",
)
@click.option(
    "--seed", type=click.IntRange(min=0), default=0, show_default=True, help="Seed of the configurations."
)
@json_option
@click.option(
    "--json-samples",
    is_flag=True,
    help="Every pair of engines with its worst sample in the JSON, instead of the largest error of each "
    "quantity and what differs.",
)
@run_options
@runs("dynx.cli.agree.run:agree")
def agree() -> None:
    """Compare the results of all engines for every quantity, in pairs and with a 50-digit referee.

    ROBOT is a name (see `dynx robots`), a URDF file, a directory (every .urdf below it), or `all`:
    every robot of example-robot-data. For one robot the full table is printed, for several a line each.

    With --as-loaded each engine loads the file itself by the call that its documentation recommends,
    and that call is printed; `dynx doctor` explains the differences. The JSON document is then that of
    `dynx doctor`, without findings.

    Exit code 0 if all engines agree, 1 if some differ, 2 if some robot cannot be used (the others are
    compared nevertheless). Ctrl-C ends the run with the results so far and exit code 130. A robot that
    crashes an engine or takes too long is reported as refused.

    \b
    Examples:
      dynx agree ur5
      dynx agree ur5 panda --base floating --samples 100
      dynx agree all --backends pinocchio,pybullet,reference --json all.json
      dynx agree path/to/urdfs --lock gripper_joint=0.02
      dynx agree my.urdf --as-loaded
    """
