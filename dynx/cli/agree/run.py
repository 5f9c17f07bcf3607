"""Run of ``dynx agree``: each robot is compared in a worker process, then come files and tables."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import click

from dynx.agreement.agreement import AgreementTask, measure, refused
from dynx.agreement.report import AgreementReport, results_document, summarized
from dynx.backends.registry import backend_class
from dynx.cli.agree.tables import label, show_many, show_one, show_summary, verdict
from dynx.cli.shell.exits import BAD_INPUT, DONE, NEGATIVE_RESULT, complain, failure_of
from dynx.cli.shell.inputs import Locks, pose_of
from dynx.cli.shell.lazy import import_object
from dynx.cli.shell.output_file import check_json, require_apart
from dynx.cli.shell.run import TaskRun, carry_out
from dynx.cli.shell.terminal import console, write_json
from dynx.errors import DynxError
from dynx.model.expansion import expand, refusals
from dynx.model.tree import Base

AgreementRun = TaskRun[AgreementTask, AgreementReport]


def agree(
    robots: tuple[str, ...],
    backends: tuple[str, ...] | None,
    as_loaded: bool,
    base: Base,
    base_pose: list[float] | None,
    lock: Locks,
    samples: int | None,
    seed: int,
    jobs: int | None,
    timeout: float,
    json_path: str | None,
    json_samples: bool,
    quiet: bool,
) -> int:
    """Compare the engines on each robot; return the exit code."""
    if as_loaded:
        if lock or base_pose is not None:
            option = "--lock" if lock else "--base-pose"
            raise click.UsageError(f"{option} changes the robot, and --as-loaded compares files as they are")
        # Importing the doctor here would take a third of the time that other comparisons need to start.
        compare: Callable[..., int] = import_object("dynx.cli.doctor.as_loaded:compare")
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
    check_json(json_path)
    for name in backends or ():  # Checked once, so that an error is not reported for every robot.
        backend_class(name)
    found = expand(robots)
    inputs = found.robots
    if json_path is not None:
        require_apart([json_path], (each.robot for each in inputs), "a robot that is read")
    pose = None if base_pose is None else pose_of(base_pose, "--base-pose")
    tasks = [AgreementTask(each.robot, base, lock, backends, samples, seed, pose) for each in inputs]
    run = agreement_run(tasks, refusals=refusals(inputs), left_out=found.left_out)
    return carry_out(run, jobs, timeout, quiet, lambda: _report(run, json_path, json_samples, quiet))


def agreement_run(
    tasks: Sequence[AgreementTask],
    target: Callable[[AgreementTask], AgreementReport] = measure,
    refusals: dict[int, DynxError] | None = None,
    left_out: Sequence[str] = (),
) -> AgreementRun:
    """Prepare the run of ``dynx agree``."""
    return TaskRun(tasks, target, refused, _problem, _verdict, "comparing", refusals, left_out)


def _verdict(report: AgreementReport) -> str:
    return _problem(report) or "agree"


def _problem(report: AgreementReport) -> str | None:
    if report.error is not None:
        return "refused"
    return None if report.agree else "differ"


def _report(run: AgreementRun, json_path: str | None, json_samples: bool, quiet: bool) -> int:
    """Write the document, the tables and the errors; return the exit code."""
    document = results_document(run.results, run.not_done, run.left_out)
    entries: list[dict[str, Any]] = document["results"]
    # The document is written first, so that it is not lost if a pipe closes while the table is written.
    error = failure_of(write_json, document if json_samples else summarized(document), json_path)
    if not quiet:
        out = console(err=json_path == "-")
        if len(run.tasks) == 1:
            for entry in entries:
                show_one(out, entry)
        else:
            show_many(out, entries)
            show_summary(out, document["summary"], run.seconds)
    for entry in entries:
        if verdict(entry) == "refused":
            complain(_refusal(entry))
    if error is not None:
        complain(str(error))
    if error is not None or document["summary"]["refused"]:
        return BAD_INPUT
    return NEGATIVE_RESULT if document["summary"]["differ"] else DONE


def _refusal(entry: dict[str, Any]) -> str:
    """Write the reason why a robot was refused, after its name where the message does not contain that."""
    message: str = entry["error"]["message"]
    return message if entry["robot"] in message else f"{label(entry)}: {message}"
