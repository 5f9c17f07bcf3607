"""Declaration of ``dynx contacts``."""

from __future__ import annotations

from fractions import Fraction

import click

from dynx.cli.shell.lazy import runs
from dynx.cli.shell.options import (
    GroupedCommand,
    engines_option,
    finite_number,
    group,
    json_option,
    name_list,
    quiet_option,
    settings_option,
)
from dynx.errors import shown


def steps(text: str) -> tuple[float, ...]:
    """Read steps [s] separated by commas, each a number or a fraction such as 1/240."""
    found = []
    for word in text.replace(",", " ").split():
        try:
            number = float(Fraction(word)) if "/" in word else finite_number(word)
        except (ValueError, ZeroDivisionError):
            raise click.BadParameter(f"{shown(word)} is not a number [s], such as 0.002 or 1/480") from None
        if not number > 0.0:
            raise click.BadParameter(f"{shown(word)} is not positive")
        found.append(number)
    if not found:
        raise click.BadParameter("wanted steps [s] separated by commas, such as 1/240,1/480")
    return tuple(found)


@click.command(cls=GroupedCommand)
@group(
    "Measurement",
    engines_option("Engines to measure"),
    click.option(
        "--case",
        "cases",
        type=name_list,
        metavar="A,B,C",
        help="Cases to run; all of their figures are printed (default: all cases, and of each case the worst "
        "figure of every engine).",
    ),
    click.option(
        "--dt",
        "steps",
        type=steps,
        metavar="A,B,C",
        help="Steps of 1e-6 to 0.1 s, numbers or fractions such as 1/240 (default: 0.004,0.002,0.001). With "
        "a single step no error can fall.",
    ),
    settings_option("Setting of an engine (docs/world.md), or substeps"),
    click.option(
        "--jobs",
        type=click.IntRange(min=1),
        help="Number of runs at a time, each in its own process (default: one per processor).",
    ),
)
@group(
    "Output",
    click.option(
        "--list", "only_list", is_flag=True, help="List of the cases with their laws, without a run."
    ),
    json_option,
    click.option(
        "--html", "html_path", metavar="FILE", help="File for the results as one HTML page with plots."
    ),
    quiet_option,
)
@runs("dynx.cli.contacts.run:contacts")
def contacts() -> None:
    """Measure the errors of engines where bodies touch, against closed forms, and find their causes.

    Each case is a scene whose motion or forces are known in closed form. Every engine runs it at several
    steps, and each figure gets a verdict: its error is within the tolerance; it falls with the step, at the
    order printed; a rerun with another setting of the engine removes it or makes it fall; the engine cannot
    avoid it, because it lacks the coefficient; or it is unexplained. The table has the relative errors at the
    largest and at the smallest step.

    Exit code 0 if every error is explained, 1 if one is not, if an engine failed or if nothing was measured,
    2 for input that cannot be used. Ctrl-C ends the run with the results so far and exit code 130.

    \b
    Examples:
      dynx contacts
      dynx contacts --engine mujoco --case slope --set impratio=1000
      dynx contacts --dt 1/240,1/480,1/960 --html page.html --json all.json
      dynx contacts --list
    """
