"""``dynx agree``: do the engines give the same answers on these robots?"""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from dynx.cli.shell.exits import ANSWER_IS_NO, BAD_INPUT, DONE, complain
from dynx.cli.shell.options import model_options, name_list, run_options
from dynx.cli.shell.output_file import check_writable, require_apart
from dynx.files.documents import json_text
from dynx.files.writing import write_text

if TYPE_CHECKING:
    from dynx.cli.agree.task import AgreementTask, Entry
    from dynx.cli.shell.run import Run
    from dynx.model.model import Base


@click.command(short_help="Do the engines give the same answers on a robot?")
@click.argument("robots", nargs=-1, required=True, metavar="ROBOT...")
@click.option(
    "--backends",
    type=name_list,
    metavar="A,B,C",
    help="The engines to compare (default: all that are installed).",
)
@click.option(
    "--as-loaded",
    is_flag=True,
    help="Let each engine load the file itself, as its users do, and compare that.",
)
@model_options
@click.option("--samples", type=click.IntRange(min=1), help="Random configurations per robot (default: 16).")
@click.option("--seed", type=click.IntRange(min=0), default=0, show_default=True, help="Of the samples.")
@click.option(
    "--json", "json_path", metavar="FILE", help="Also write the results as JSON; - is standard output."
)
@run_options
def agree(
    robots: tuple[str, ...],
    backends: tuple[str, ...] | None,
    as_loaded: bool,
    base: Base,
    lock: tuple[tuple[str, float], ...],
    samples: int | None,
    seed: int,
    jobs: int | None,
    timeout: float,
    json_path: str | None,
    quiet: bool,
) -> int:
    """Compare all engines on every quantity, pair by pair and against a 50-digit referee.

    ROBOT is a name (see `dynx robots`), a URDF file, a directory (every .urdf below it), or `all`:
    every robot of example-robot-data. One robot gives the full table, several give a line each.

    With --as-loaded each engine reads the file itself by the call that its documentation gives, which
    is printed, and --backends names engines; `dynx doctor` says why they differ. The JSON document is
    then that of `dynx doctor`, with no findings.

    Exit code 0 if all agree, 1 if some differ, 2 if some could not be used (the others are done all
    the same). Ctrl-C ends the run with what is done so far, and 130. A robot that crashes an engine
    or takes too long is reported as refused.

    \b
    Examples:
      dynx agree ur5
      dynx agree ur5 panda --base floating --samples 100
      dynx agree all --backends pinocchio,pybullet,reference --json all.json
      dynx agree path/to/urdfs --lock gripper_joint=0.02
      dynx agree my.urdf --as-loaded
    """
    if as_loaded:
        from dynx.cli.doctor.as_loaded import compare

        if lock:
            raise click.UsageError("--lock changes the robot, and --as-loaded compares files as they are")
        return compare(
            robots,
            base,
            backends,
            samples,
            seed,
            jobs=jobs,
            timeout=timeout,
            json_path=json_path,
            quiet=quiet,
        )
    from dynx.cli.agree.run import agreement_run
    from dynx.cli.agree.task import AgreementTask, refused
    from dynx.cli.shell.run import carry_out
    from dynx.model.expansion import expand

    if json_path is not None and json_path != "-":
        check_writable(json_path)
    if backends is not None:
        _check_backends(backends)
    inputs = expand(robots)
    if json_path is not None:
        require_apart([json_path], (each.robot for each in inputs), "a robot that is read")
    run = agreement_run([AgreementTask(each.robot, base, lock, backends, samples, seed) for each in inputs])
    for index, each in enumerate(inputs):
        if each.refusal is not None:
            run.record(index, refused(run.tasks[index], each.refusal))
    return carry_out(run, jobs, timeout, quiet, lambda: _report(run, json_path, quiet))


def _report(run: Run[AgreementTask, Entry], json_path: str | None, quiet: bool) -> int:
    """Write the document, the tables and the errors; the exit code."""
    from dynx.cli.agree.tables import show_many, show_one, show_summary
    from dynx.cli.agree.task import counts, document
    from dynx.cli.shell.terminal import console, echo_json

    entries = run.results
    # First the document: a pipe that closes while the table is written must not lose it.
    if json_path == "-":
        echo_json(document(entries, run.not_done))
    elif json_path is not None:
        write_text(json_path, json_text(document(entries, run.not_done)) + "\n")
    if not quiet:
        out = console(err=json_path == "-")
        if len(run.tasks) == 1:
            for entry in entries:
                show_one(out, entry)
        else:
            show_many(out, entries)
            show_summary(out, entries, run.seconds, len(run.not_done))
    for entry in entries:
        if entry["error"] is not None:
            complain(_refusal(entry))
    count = counts(entries)
    if count["refused"]:
        return BAD_INPUT
    return ANSWER_IS_NO if count["differ"] else DONE


def _refusal(entry: Entry) -> str:
    """Why a robot was refused; most messages name its file already."""
    from dynx.cli.agree.task import label

    message: str = entry["error"]["message"]
    return message if entry["robot"] in message else f"{label(entry)}: {message}"


def _check_backends(names: tuple[str, ...]) -> None:
    """Raise for a backend that is unknown or not installed: once, not for every robot."""
    from dynx.backends.registry import backend_class

    for name in names:
        backend_class(name)
