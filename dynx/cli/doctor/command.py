"""``dynx doctor``: why do engines differ on these files, and how are they mended?"""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

import click

from dynx.cli.shell.options import choice_pair, name_list, run_options

if TYPE_CHECKING:
    from dynx.model.model import Base


@click.command(short_help="Why do engines differ on a file, and how is it mended?")
@click.argument("robots", nargs=-1, required=True, metavar="ROBOT...")
@click.option(
    "--base",
    type=click.Choice(["fixed", "floating", "both"]),
    default="fixed",
    show_default=True,
    help="Whether the root link is bolted to the world or free.",
)
@click.option(
    "--engines", type=name_list, metavar="A,B,C", help="The engines to ask (default: all installed)."
)
@click.option("--samples", type=click.IntRange(min=1), help="Random states per robot (default: 5).")
@click.option("--seed", type=click.IntRange(min=0), default=0, show_default=True, help="Of the states.")
@click.option(
    "--tolerance",
    type=click.FloatRange(min=0.0),
    default=1e-12,
    show_default=True,
    help="Relative error above which engines differ; 1e-6 for those who do not mind rounding.",
)
@click.option(
    "--choose",
    type=choice_pair,
    multiple=True,
    metavar="RULE=CHOICE",
    help="How to mend what can be read in two ways, as in DX103=keep (see `dynx explain`).",
)
@click.option("--fix", "fix", metavar="OUT", help="Write the mended URDF; for several robots a directory.")
@click.option("--in-place", is_flag=True, help="Mend the files where they are.")
@click.option("--json", "json_path", metavar="FILE", help="Write the reports as JSON; - is standard output.")
@click.option("--html", metavar="FILE", help="Write a page for people: one file that needs no other.")
@click.option("--junit", metavar="FILE", help="Write JUnit XML.")
@click.option("--sarif", metavar="FILE", help="Write SARIF 2.1.0.")
@click.option(
    "--baseline", "baseline_path", metavar="FILE", help="Fail only on differences not in this file."
)
@click.option("--write-baseline", metavar="FILE", help="Write a file in which all that differs is known.")
@click.option(
    "--counterexamples",
    metavar="DIR",
    default=".",
    show_default=True,
    help="Where the smallest robot goes that shows a difference nothing explains.",
)
@run_options
def doctor(
    robots: tuple[str, ...],
    base: Literal["fixed", "floating", "both"],
    engines: tuple[str, ...] | None,
    samples: int | None,
    seed: int,
    tolerance: float,
    choose: tuple[tuple[str, str], ...],
    fix: str | None,
    in_place: bool,
    json_path: str | None,
    html: str | None,
    junit: str | None,
    sarif: str | None,
    baseline_path: str | None,
    write_baseline: str | None,
    counterexamples: str,
    jobs: int | None,
    timeout: float,
    quiet: bool,
) -> int:
    """Let every engine load the file itself; say where they differ and why, prove it, and mend it.

    ROBOT is a name (see `dynx robots`), a URDF file, a directory (every .urdf below it), or `all`:
    every robot of example-robot-data. One robot gives the full report, several give a line each.

    Each cause is proved: it is taken out of the file alone, and the engines are measured again. Only
    with --in-place is the file written that was read.

    Exit code 0 if no engine differs (or only in what the baseline knows, or was just told), 1 if some
    do, 2 if some robot could not be used (the others are done all the same). Ctrl-C ends the run with
    what is done so far, and 130.

    \b
    Examples:
      dynx doctor ur5
      dynx doctor my.urdf --fix mended.urdf
      dynx doctor robots/ --base both --html report.html --jobs 4
      dynx doctor robots/ --tolerance 1e-6 --baseline known.json --sarif dynx.sarif
    """
    from dynx.cli.doctor.conclusion import Conclusion
    from dynx.cli.doctor.mending import planned_targets
    from dynx.cli.doctor.outputs import Outputs
    from dynx.cli.doctor.task import DoctorTask, check_engines, doctor_run, refused
    from dynx.cli.shell.run import carry_out
    from dynx.doctor.formats.baseline import load_baseline
    from dynx.model.expansion import expand
    from dynx.rules.choices import checked_choices

    outputs = Outputs(json_path, html, junit, sarif, write_baseline)
    outputs.check()
    choices = tuple(checked_choices(choose).items())
    check_engines(engines)
    baseline = None if baseline_path is None else load_baseline(baseline_path)
    inputs = expand(robots)
    bases: tuple[Base, ...] = ("fixed", "floating") if base == "both" else (base,)
    targets = planned_targets(inputs, fix, in_place=in_place, bases=len(bases))
    outputs.keep_apart((each.robot for each in inputs), () if in_place else targets, baseline_path)
    run = doctor_run(
        [
            DoctorTask(each.robot, one, engines, samples, seed, tolerance, choices)
            for each in inputs
            for one in bases
        ]
    )
    for index, task in enumerate(run.tasks):
        refusal = inputs[index // len(bases)].refusal
        if refusal is not None:
            run.record(index, refused(task, refusal))
    conclusion = Conclusion(run, outputs, baseline, targets, in_place, counterexamples, engines)
    return carry_out(run, jobs, timeout, quiet, lambda: conclusion.reach(quiet=quiet))
