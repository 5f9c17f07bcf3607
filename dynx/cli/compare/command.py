"""Declaration of ``dynx compare``."""

from __future__ import annotations

import click

from dynx.cli.shell.lazy import runs
from dynx.cli.shell.options import FiniteRange, GroupedCommand, group, json_option, quiet_option


@click.command(cls=GroupedCommand)
@click.argument("first", metavar="A")
@click.argument("second", metavar="B")
@group(
    "Comparison",
    click.option(
        "--tolerance",
        type=FiniteRange(min=0.0),
        help="Distance up to which the rollouts are alike [rad or m] (default: 1e-9).",
    ),
    click.option(
        "--list-only", is_flag=True, help="Differences of the scenarios only, without reruns and effects."
    ),
    click.option(
        "--robot",
        metavar="ROBOT",
        help="Robot of a .csv file (default: that of the other rollout).",
    ),
)
@group("Output", json_option, quiet_option)
@runs("dynx.cli.compare.run:compare_files")
def compare() -> None:
    """Find out how far apart two rollouts of a robot are, and why.

    A and B are files of rollouts: .npz (dynx sim --save), .mcap of dynx, or .csv, which may be a log of your
    own robot: a column t [s], and q:JOINT for each joint, with v:JOINT and tau:JOINT where they are known.

    The report gives the times at which the rollouts part, and every difference of their scenarios: settings,
    gains, links and joints of the robot. Each is taken over from B into A alone and simulated again (the
    effect alone), and so are all but this one (the distance that this one leaves). With all of them A must
    be B, which proves that nothing else is a cause.

    Exit code 0 if the rollouts are alike, 1 if they part, 2 for files that cannot be compared. Ctrl-C ends
    the run with exit code 130.

    \b
    Examples:
      dynx sim so101 --to elbow_flex=0.4 --save a.npz
      dynx sim so101 --to elbow_flex=0.4 --payload gripper_link:0.1 --save b.npz
      dynx compare a.npz b.npz
      dynx compare log.csv a.npz --tolerance 0.01
    """
