"""Declaration of ``dynx doctor``."""

from __future__ import annotations

import click

from dynx.cli.shell.lazy import runs
from dynx.cli.shell.options import FiniteRange, choice_pair, json_option, name_list, run_options


@click.command
@click.argument("robots", nargs=-1, required=True, metavar="ROBOT...")
@click.option(
    "--base",
    type=click.Choice(["fixed", "floating", "both"]),
    default="fixed",
    show_default=True,
    help="Mount of the root link: fixed to the world, floating (free to move), or each in turn with `both`.",
)
@click.option(
    "--engines",
    type=name_list,
    metavar="A,B,C",
    help="Engines and loading variants to examine (default: all installed engines; beside them, not counted, "
    "pybullet:plain).",
)
@click.option("--samples", type=click.IntRange(min=1), help="Number of random states per robot (default: 5).")
@click.option(
    "--seed", type=click.IntRange(min=0), default=0, show_default=True, help="Seed of the random states."
)
@click.option(
    "--tolerance",
    type=FiniteRange(min=0.0),
    default=1e-12,
    show_default=True,
    help="Relative error above which engines differ; 1e-6 ignores rounding.",
)
@click.option(
    "--choose",
    type=choice_pair,
    multiple=True,
    metavar="RULE=CHOICE",
    help="Choice for a rule that can mend a file in two ways, such as DX103=keep (see `dynx explain`); "
    "may be given several times.",
)
@click.option(
    "--fix",
    "fix",
    metavar="OUT",
    help="File for the mended URDF; for several robots a directory. A file of that name is replaced, unless "
    "it is one of the robots that are read.",
)
@click.option(
    "--level",
    type=click.Choice(["safe", "rounding", "physics"]),
    default="physics",
    show_default=True,
    help="Largest change of the mended URDF: `safe` changes nothing that a reader notices, `rounding` the "
    "equations of motion by rounding only, `physics` whatever the causes require.",
)
@click.option(
    "--in-place", is_flag=True, help="Overwrite the files that were read with the mended descriptions."
)
@json_option
@click.option("--html", metavar="FILE", help="File for the reports as one self-contained HTML page.")
@click.option("--junit", metavar="FILE", help="File for the reports as JUnit XML.")
@click.option("--sarif", metavar="FILE", help="File for the reports as SARIF 2.1.0.")
@click.option(
    "--github",
    is_flag=True,
    help="Findings as annotations of GitHub Actions on standard output, without those in the baseline.",
)
@click.option(
    "--baseline",
    "baseline_path",
    metavar="FILE",
    help="File of known differences, as --write-baseline writes it: only other differences fail.",
)
@click.option("--write-baseline", metavar="FILE", help="File for all present differences, as a baseline.")
@click.option(
    "--counterexamples",
    metavar="DIR",
    default=".",
    show_default=True,
    help="Directory for the smallest robot that shows a difference no rule explains.",
)
@run_options
@runs("dynx.cli.doctor.run:doctor")
def doctor() -> None:
    """Find out why engines differ on a file: load it with each, prove every cause, and mend the file.

    ROBOT is a name (see `dynx robots`), a URDF file, a directory (every .urdf below it), or `all`:
    every robot of example-robot-data. For one robot the full report is printed, for several a line each.

    Each cause is proved by removing it alone from the file and measuring the engines again. The file
    that was read is changed only with --in-place. Other files named as outputs are replaced where they exist.

    Exit code 0 if no engine differs (or only as the baseline allows, or a baseline was written), 1 if
    some differ, 2 if some robot cannot be used (the others are examined nevertheless). Ctrl-C ends the
    run with the results so far and exit code 130.

    \b
    Examples:
      dynx doctor ur5
      dynx doctor my.urdf --fix mended.urdf
      dynx doctor robots/ --base both --html report.html --jobs 4
      dynx doctor robots/ --tolerance 1e-6 --baseline known.json --sarif out.sarif
    """
