"""Declarations of ``dynx agree``, ``doctor``, ``same`` and ``bench``: engines and descriptions compared."""

from __future__ import annotations

from collections.abc import Callable

import click

from dynx.cli.shell.lazy import runs
from dynx.cli.shell.options import (
    F,
    FiniteRange,
    choice_pair,
    engine_option,
    frame_option,
    joined,
    json_option,
    model_options,
    name_list,
    one_of,
    report_options,
    run_options,
    silent_option,
)


@click.command
@click.argument("robots", nargs=-1, required=True, metavar="ROBOT...")
@engine_option(
    "backends",
    "Engines to compare (default: all that are installed).",
    type=name_list,
    metavar="A,B,C",
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
@runs("dynx.cli.agree:agree")
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
      dynx agree all --engine pinocchio,pybullet,reference --json all.json
      dynx agree path/to/urdfs --lock gripper_joint=0.02
      dynx agree my.urdf --as-loaded
    """


def _rules_option(option: str, subject: str) -> Callable[[F], F]:
    return click.option(
        option,
        type=name_list,
        multiple=True,
        callback=joined,
        metavar="RULE,...",
        help=f"{subject}, by number or name (see `dynx explain`); may be given several times.",
    )


@click.command
@click.argument("robots", nargs=-1, required=True, metavar="ROBOT...")
@click.option(
    "--base",
    type=click.Choice(["fixed", "floating", "both"]),
    help="Mount of the root link: fixed to the world, floating (free to move), or each in turn with `both`; "
    "by default that of an MJCF or SDF file, else fixed.",
)
@engine_option(
    "engines",
    "Engines and loading variants to examine (default: all installed engines; beside them, not counted, "
    "pybullet:plain).",
    type=name_list,
    metavar="A,B,C",
)
@click.option("--samples", type=click.IntRange(min=1), help="Number of random states per robot (default: 5).")
@click.option(
    "--seed", type=click.IntRange(min=0), default=0, show_default=True, help="Seed of the random states."
)
@click.option(
    "--tolerance",
    type=FiniteRange(min=0.0),
    help="Relative error above which engines differ, 1e-12 by default; 1e-6 ignores rounding. With --fix "
    "also the largest effect that the mended file may keep, 1e-9 by default.",
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
    help="File for the mended URDF; for several robots, or with / at its end, a directory, which is made. A "
    "file of that name is replaced, unless it is one of the robots that are read.",
)
@click.option(
    "--level",
    type=click.Choice(["safe", "rounding", "physics"]),
    default="physics",
    show_default=True,
    help="Largest change of the mended URDF: `safe` changes nothing that a reader notices, `rounding` the "
    "equations of motion by rounding only, `physics` whatever the causes require.",
)
@_rules_option("--ignore", "Rules whose findings are counted and make no check fail")
@_rules_option("--only", "Rules whose findings alone make a check fail; all others are counted")
@click.option(
    "--in-place", is_flag=True, help="Overwrite the files that were read with the mended descriptions."
)
@json_option
@report_options
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

    ROBOT is a name (see `dynx robots`), a URDF, MJCF or SDF file, a directory (every .urdf below it), or
    `all`: every robot of example-robot-data. For one robot the full report is printed, for several a line
    each.

    Each cause is proved by removing it alone from the file and measuring the engines again. The file
    that was read is changed only with --in-place. Other files named as outputs are replaced where they exist.

    Differences that no rule explains fail always, whatever --ignore and --only name; --fix mends the
    causes of all rules.

    Exit code 0 if no engine differs (or only as the baseline, --ignore or --only allow, or a baseline was
    written), 1 if some differ on the file as it was read, mended or not, 2 if some robot cannot be used
    (the others are examined nevertheless). Ctrl-C ends the run with the results so far and exit code 130.

    \b
    Examples:
      dynx doctor ur5
      dynx doctor my.urdf --fix mended.urdf
      dynx doctor my.xml --engine mujoco,pinocchio
      dynx doctor robots/ --base both --html report.html --jobs 4
      dynx doctor my.urdf --ignore DX301,inertia-not-diagonal
      dynx doctor robots/ --tolerance 1e-6 --baseline known.json --sarif out.sarif
    """


@click.command
@click.argument("first", metavar="A")
@click.argument("second", metavar="B")
@click.option(
    "--base",
    type=click.Choice(["fixed", "floating"]),
    help="Mount of the root links; by default that of an MJCF or SDF file, of A or B, else fixed.",
)
@click.option(
    "--tolerance",
    type=FiniteRange(min=0.0, max=1.0, max_open=True),
    help="Largest difference of two equal robots, relative to reach, 1 rad or inertia (default: 1e-9).",
)
@click.option(
    "--fix",
    "fix",
    metavar="OUT",
    help="File for B with the elements that differ replaced by those of A, in the format of B: .urdf, .sdf, "
    "or .xml or .mjcf for MJCF. A file of that name is replaced, unless it is A, B or included by them.",
)
@json_option
@report_options
@silent_option
@runs("dynx.cli.same:same")
def same() -> None:
    """Decide whether A and B describe the same robot in every state; name and mend what differs.

    A and B are names (see `dynx robots`), URDF, xacro, MJCF or SDF files. Links are merged across fixed
    joints; frames of links, signs of axes and inertia that no state shows make no difference. Where the
    robots differ, the fewest elements of B are listed that make them the same when replaced by those of A.
    Other differences do not change the verdict: limits, joint dynamics, shapes, frames and names, and for two
    MJCF files contact filters, actuators, sensors, tendons, equality constraints, gravity compensation and
    keyframes, which URDF and SDF leave open.

    Exit code 0 if it is the same robot (or differs only as the baseline allows, or a baseline was written),
    1 if not, mended or not, 2 if A or B cannot be used, or B is to be mended and cannot be.

    \b
    Examples:
      dynx same robot.urdf robot.xml
      dynx same old.urdf new.urdf --tolerance 1e-6 --fix mended.urdf
      dynx same g1 g1_with_hands --json
      dynx same robot.urdf robot.xml --html report.html --baseline known.json
    """


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
@engine_option(
    "backends", "Engines to time (default: all that are installed).", type=name_list, metavar="A,B,C"
)
@frame_option
@model_options
@click.option(
    "--seed", type=click.IntRange(min=0), default=0, show_default=True, help="Seed of the random samples."
)
@click.option("--quick", is_flag=True, help="Run with 5 repetitions instead of 20.")
@json_option
@silent_option
@runs("dynx.cli.bench:bench")
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
